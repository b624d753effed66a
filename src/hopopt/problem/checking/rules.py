"""Rules between the entries of a problem: names, orders, counts, and whether the start is a possible pose."""

import re
from collections.abc import Iterator, Mapping
from typing import Any, TypeGuard

import numpy as np

from hopopt.design import Design, HopSettings, Leg, StartPose
from hopopt.design.fields import RESERVED, RESERVED_JOINTS, TRUNK
from hopopt.design.geometry.link_joint import follower
from hopopt.leg.inertia import obeys_triangle, principal_moments
from hopopt.leg.kinematics import (
    TwoJoints,
    joint_positions,
    loop_axes,
    reach,
    start_fault,
    two_joints,
    unlike_two_joints,
    within_limits,
)
from hopopt.problem.checking.faults import Report
from hopopt.problem.checking.wording import did_you_mean, is_number, lookalike
from hopopt.problem.render import shown

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,31}")
LEAST_LENGTH = 1e-9  # below which a vector has no direction
ROUNDING = 1e-9  # m or rad: a pose given in decimals is not refused for its last digit


def entry_rules(data: Mapping[str, Any], report: Report) -> None:
    """Report what is wrong between entries of the file, of whatever the file has so far."""
    leg, hop = _table(data, "leg"), _table(data, "hop")
    refused = {path for path, _ in report.faults}  # of these enough is said
    joints, links = _texts(leg.get("joints")), _texts(leg.get("links"))
    found = [*_name_faults("leg.joints", joints, RESERVED_JOINTS), *_name_faults("leg.links", links, RESERVED)]
    found += _chain_faults(joints, links, following := [name for name in links if _table(_table(leg, name), "follows")])
    for name in joints:
        found += _joint_faults(f"leg.{name}", _table(leg, name))
    for name in links:
        found += _link_faults(f"leg.{name}", _table(leg, name))
    for name in following:
        found += _follower_faults(name, _table(_table(leg, name), "follows"), joints, leg)
    found += _far_masses({f"leg.{name}": _table(leg, name) for name in links})
    found += _parameter_faults(_table(data, "parameters"))
    if is_number(legs := _table(leg, "body").get("legs")) and legs % 1:
        found.append(("leg.body.legs", f"= {shown(legs)} is not allowed: a whole number of legs is needed"))
    trunk = [TRUNK] if _table(_table(leg, "body"), "shapes") else []
    shaped = [name for name in links[:-1] if {"shapes", "radius"} & _table(leg, name).keys()]
    for path, words in (*found, *_hop_faults(hop, [*joints, *map(follower, following)], [*trunk, *shaped])):
        if path not in refused:
            report.add(path, words)


def _table(data: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    found = data.get(key)
    return found if isinstance(found, dict) else {}


def _texts(value: Any) -> list[str]:
    return [item for item in value if isinstance(item, str)] if isinstance(value, tuple) else []


def _name_faults(path: str, names: list[str], reserved: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    for name in dict.fromkeys(names):
        if names.count(name) > 1:
            yield path, f"has {shown(name)} {names.count(name)} times: give each a name of its own"
        if name in reserved:
            yield path, f"has {shown(name)}, which is reserved: choose a name other than {', '.join(reserved)}"
        elif not NAME.fullmatch(name):
            yield path, f"has {shown(name)}: a name is a letter, then at most 31 letters, digits, _ or -"


def _chain_faults(joints: list[str], links: list[str], following: list[str]) -> Iterator[tuple[str, str]]:
    if joints and links and len(joints) != len(links) - len(following):
        but = f" but {', '.join(following)}" if following else ""
        yield "leg.links", f"names {len(links)}{but} where leg.joints names {len(joints)}: each joint carries one link"
    for name in sorted(set(joints) & set(links)):
        yield "leg.links", f"has {shown(name)}, which is a joint too: their tables would both be [leg.{name}]"


def _parameter_faults(table: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for name in table:
        path, own = f"parameters.{name}", _table(table, name)
        if not NAME.fullmatch(name):
            yield path, "is no name of a number: a letter, then at most 31 letters, digits, _ or -"
        value, low, high = (own.get(key) for key in ("value", "lower", "upper"))
        for bound, sign, words in ((low, 1, "below"), (high, -1, "above")):
            if is_number(value) and is_number(bound) and sign * (value - bound) < 0:
                side = "lower" if sign > 0 else "upper"
                yield f"{path}.value", f"= {shown(value)} is {words} {path}.{side} = {shown(bound)}: change one of them"


def _joint_faults(path: str, joint: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    yield from _vector_faults(path, joint, "axis")
    lower, upper = joint.get("lower"), joint.get("upper")
    if is_number(lower) and is_number(upper) and not lower < upper:
        unit = "m" if joint.get("type") == "prismatic" else "rad"
        above = f"{path}.upper = {shown(upper)} {unit}"
        yield f"{path}.lower", f"= {shown(lower)} {unit} is not below {above}: exchange or widen them"


def _follower_faults(
    link: str, follows: Mapping[str, Any], joints: list[str], leg: Mapping[str, Any]
) -> Iterator[tuple[str, str]]:
    path, joint = f"leg.{link}.follows", follows.get("joint")
    yield from _vector_faults(path, follows, "axis")
    if isinstance(joint, str) and joints and joint not in joints:
        yield (
            f"{path}.joint",
            f"= {shown(joint)} is no joint of the leg{did_you_mean(joint, joints)}: allowed are {', '.join(joints)}",
        )
    if isinstance(joint, str) and _table(leg, joint).get("type") == "prismatic":
        yield (
            f"{path}.joint",
            f"= {shown(joint)} slides, and what follows a joint turns as it turns: name one that turns",
        )
    if follows.get("ratio") == 0:
        yield f"{path}.ratio", "= 0 moves nothing: leave leg.links without this link, or give another ratio"
    if follower(link) in joints:
        yield (
            "leg.joints",
            f"has {shown(follower(link))}, as the joint of the link {link} is called: choose another name",
        )


def _vector_faults(path: str, table: Mapping[str, Any], entry: str) -> Iterator[tuple[str, str]]:
    vector = table.get(entry)
    if isinstance(vector, tuple) and all(map(is_number, vector)) and not any(abs(x) > LEAST_LENGTH for x in vector):
        yield f"{path}.{entry}", f"= {shown(vector)} has no direction: one of its numbers has to be other than 0"


def _solid_faults(path: str, link: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """A link's own tensor and centre of mass: given once, of a body that can exist."""
    for one, other in (("com", "com_position"), ("inertia", "inertia_tensor")):
        if link.get(one) is not None and link.get(other) is not None:
            yield f"{path}.{other}", f"says again what {path}.{one} says: remove one of them"
    moments = link.get("inertia_tensor")
    if _numbers(moments, 6):
        low, middle, high = principal_moments(moments)
        if low < 0 or not obeys_triangle(low, middle, high):
            words = f"has the principal moments {low:.3g}, {middle:.3g} and {high:.3g}, which no body has"
            remedy = "none is negative, each at most the sum of the others"
            yield f"{path}.inertia_tensor", f"= {shown(moments)} kg m^2 {words}: {remedy}"


def _far_masses(links: Mapping[str, Mapping[str, Any]]) -> Iterator[tuple[str, str]]:
    """Centres of mass further from their joint than the whole leg is long: a slip of the unit or a point."""
    lengths = [link.get("length") for link in links.values()]
    known = [length for length in lengths if is_number(length)]
    for path, link in links.items():
        place = link.get("com_position")
        if len(known) == len(lengths) and _numbers(place, 3) and np.linalg.norm(place) > sum(known):
            words = f"is further from the joint than the whole leg is long ({sum(known):.3g} m)"
            yield f"{path}.com_position", f"= {shown(place)} m {words}"


def _numbers(value: Any, count: int) -> TypeGuard[tuple[float, ...]]:
    return isinstance(value, tuple) and len(value) == count and all(is_number(x) and abs(x) < 1e6 for x in value)


def _link_faults(path: str, link: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    yield from _vector_faults(path, link, "direction")
    yield from _solid_faults(path, link)
    com, length = link.get("com"), link.get("length")
    if is_number(com) and is_number(length) and com > length:
        most = f"{path}.length = {shown(length)} m"
        yield f"{path}.com", f"= {shown(com)} m is beyond the end of the link: a number from 0 to {most} is needed"


def _hop_faults(hop: Mapping[str, Any], joints: list[str], shaped: list[str]) -> Iterator[tuple[str, str]]:
    """Ranges that begin above their end; a mean speed, which only a periodic hop has; limits of a touchdown, which only hops
    that land have; names that no joint has."""
    for name in ("stance_duration", "flight_duration", "landing_duration"):
        value = hop.get(name)
        if _numbers(value, 2) and value[0] > value[1]:
            yield f"hop.{name}", f"= {shown(value)} s begins above its end: write [shortest, longest]"
    kind = hop.get("kind", "single")
    if kind != "periodic" and (value := hop.get("speed")):
        yield "hop.speed", f'= {shown(value)} is for periodic hops: set hop.kind = "periodic", or remove it'
    if kind == "single":
        for name in ("touchdown_impulse", "touchdown_loss", "touchdown_speed", "touchdown_gear_torque"):
            if value := hop.get(name):
                words = 'hops that land: set hop.kind = "landing" or "periodic", or remove it'
                yield f"hop.{name}", f"= {shown(value)} is for {words}"

    names, known = _texts(hop.get("above_ground")), [*joints, *shaped, "foot"]
    for name in dict.fromkeys(names):
        if joints and name not in known:
            yield "hop.above_ground", f"has {shown(name)}{did_you_mean(name, known)}: it takes {', '.join(known)}"
        if names.count(name) > 1:
            yield "hop.above_ground", f"has {shown(name)} {names.count(name)} times: once is enough"


# ---- the start ------------------------------------------------------------------------------------------------


def stated_once(start: StartPose, report: Report) -> None:
    """Report a start that says nothing about the pose, or says it twice."""
    given = [name for name in ("hip_height", "joint_angles") if getattr(start, name) is not None]
    if not given:
        report.add("start", "says nothing about the pose: give hip_height (legs of two joints) or joint_angles")
    if len(given) == 2:
        report.add("start", "has both hip_height and joint_angles: each says where the leg starts, remove one")


def start_rules(leg: Leg, start: StartPose, hop: HopSettings | None, report: Report) -> None:
    """Report why the leg cannot start as the file says; without ``hop`` heights above ground are not checked."""
    if len(leg.joints) <= len(loop_axes(leg)):
        held = " and ".join("xyz"[axis] for axis in loop_axes(leg))
        words = f"= {shown(leg.joints)} cannot move while the foot stands: the body cannot follow it along {held}"
        return report.add(
            "leg.joints", f"{words}; a leg needs more joints than that, or both guides and axes across x-z"
        )
    faults = _angle_faults(leg, start.joint_angles) if start.joint_angles is not None else _height_faults(leg, start)
    found = list(faults)
    for path, words in found or (_ground_faults(leg, start, hop) if hop else ()):
        report.add(path, words)


def _angle_faults(leg: Leg, angles: tuple[float, ...]) -> Iterator[tuple[str, str]]:
    path = "start.joint_angles"
    if len(angles) != len(leg.joints):
        words = f"has the wrong number of angles ({len(angles)}): one is needed for each of {', '.join(leg.joints)}"
        yield path, f"= {shown(angles)} {words}"
        return
    for k, (name, angle) in enumerate(zip(leg.joints, angles, strict=True)):
        low, high, unit = leg.joint[name].lower, leg.joint[name].upper, leg.units(name).q
        if not low <= angle <= high:
            needed = f"a number from leg.{name}.lower = {low:g} to leg.{name}.upper = {high:g} {unit} is needed"
            words = f"is outside the limits of {name}: {needed}{lookalike(angle, unit, (low, high))}"
            yield f"{path}[{k}]", f"= {angle} {unit} {words}"


def _height_faults(leg: Leg, start: StartPose) -> Iterator[tuple[str, str]]:
    height, foot = start.hip_height, start.foot_x
    assert height is not None
    if not two_joints(leg):
        words = f"does not give the pose of a leg {unlike_two_joints(leg)}: give start.joint_angles instead"
        yield "start.hip_height", f"= {height} m {words}"
        return
    solutions = TwoJoints.of(leg).angles(np.array([foot, -height]))
    if not any(within_limits(leg, q) for q in solutions):
        why = start_fault(Design.model_construct(leg=leg, start=start), solutions)
        words = f"with start.foot_x = {foot} m is not possible: {why}; {_possible(leg, foot)}"
        yield "start.hip_height", f"= {height} m {words}"


def _possible(leg: Leg, foot: float) -> str:
    """Which hip heights there are for this foot position, to the millimetre."""
    heights, geometry = np.arange(0.0, reach(leg), 1e-3), TwoJoints.of(leg)
    fit = [h for h in heights if any(within_limits(leg, q) for q in geometry.angles(np.array([foot, -h])))]
    if not fit:
        return f"no height is possible with this foot_x{'' if foot else ' and these joint limits'}"
    return f"with this foot_x choose it from {min(fit):.3f} to {max(fit):.3f} m"


def _ground_faults(leg: Leg, start: StartPose, hop: HopSettings) -> Iterator[tuple[str, str]]:
    """Joints below the ground at the start that the hop wants above it."""
    entry, pose = "joint_angles", start.joint_angles
    if pose is None:
        solutions = TwoJoints.of(leg).angles(np.array([start.foot_x, -(start.hip_height or 0.0)]))
        entry, pose = "hip_height", next(tuple(q) for q in solutions if within_limits(leg, q))
    positions = joint_positions(leg, pose)[:, 2]
    path, value = f"start.{entry}", getattr(start, entry)
    for name, height in zip(leg.joints, positions - positions[-1], strict=False):
        if name in (hop.above_ground or leg.joints) and height < -ROUNDING:
            below = f"puts {name} {-height:.3f} m below the ground"
            yield path, f"= {shown(value)} {below}: choose another pose, or leave {name} out of hop.above_ground"
