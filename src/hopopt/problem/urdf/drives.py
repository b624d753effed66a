"""Motors, gears and transmissions of a leg out of a robot's file, where the problem states none."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hopopt.design.drives.motor import LINEAR
from hopopt.drivetrain.motor import IMPLIES
from hopopt.problem.checking.faults import Report
from hopopt.problem.checking.wording import is_number
from hopopt.problem.render import shown_path

TURNS = {
    *LINEAR,
    "catalogue",
    "current_cap",
    *(entry for entries in IMPLIES.values() for entry in entries),
}  # of a rotary motor


def drives_of(found: Any, leg: Mapping[str, Any], report: Report) -> dict[str, Any]:
    """Motors from effort and velocity, taken for torque at standstill and speed at no torque: the conservative
    reading, for the region then lies inside both limits. What [leg.motor] states holds for all joints, and a datasheet
    implies its own; the rest comes from the URDF, joint by joint. Joints without are reported."""
    drives: dict[str, dict[str, Any]] = {}
    common: dict[str, Any] = {}
    for_all, implied = _motor(leg), set[str]()
    coupled = _at_coupled_drives([each for each in found.links if each.follows is None], leg)
    for item in (each for each in found.links if each.follows is None):
        own = leg.get(item.joint)
        stated, given = _ratio(own, leg), _motor(own)
        if item.slides and not _spindle(given, own):
            drives[item.joint] = _linear(item, given, _ratio(own) or 1.0, report)
            continue
        turning = _turning(item, own) if stated is None else {}
        ratio = item.gearing.ratio if stated is None else stated
        known = for_all.keys() | (here := _implied(for_all | given, leg))
        implied |= here
        torque, speed = coupled.get(item.joint, (item.effort / ratio, item.velocity * ratio))
        values = {"max_torque": torque, "max_speed": speed}
        usable = {k: v for k, v in values.items() if math.isfinite(v) and k not in known}
        rotor = item.drive.armature / ratio**2
        more = {"rotor_inertia": rotor} if rotor and "rotor_inertia" not in for_all else {}
        losses = {"friction": item.drive.friction, "damping": item.drive.damping}
        lossy = {name: value for name, value in losses.items() if value and name not in _stated(leg, "gear")}
        turning["gear"] = turning.get("gear", {}) | lossy
        drives[item.joint] = {k: v for k, v in ({"motor": usable | more} | turning).items() if v}
        common = {k: v for k, v in (given | usable).items() if k in values and k not in known} | common
        if missing := [entry for entry in values if entry not in usable.keys() | given.keys() | known]:
            _report_missing(item.joint, missing, report)
    return {"motor": {} if implied else common} | drives


def _spindle(given: Mapping[str, Any], own: Any) -> bool:
    """Whether a prismatic joint has a motor that turns: by its own motor's entries, or else by its own gear's ratio [rad/m]."""
    if given.keys() & {*LINEAR.values()}:
        return False
    return bool(given.keys() & TURNS) or _ratio(own) is not None


def _at_coupled_drives(items: Sequence[Any], leg: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """Torque and speed of each drive that a transmission of the file couples to other joints, by its joint: the largest at which
    no joint passes its effort or velocity whatever the drives do, if all that move a joint have equal shares of it."""
    names, turns = [item.joint for item in items], np.zeros((len(items), len(items)))
    for k, item in enumerate(items):
        stated = _ratio(own := leg.get(item.joint), leg)
        turning, turns[k, k] = _turning(item, own) if stated is None else {}, 1.0
        for other, by in turning.get("transmission", {}).get("coupling", {}).items():
            if other in names:
                turns[k, names.index(other)] = by["ratio"]
        turns[k] *= item.gearing.ratio if stated is None else stated
    torques = _equal_shares([item.effort for item in items], turns)
    speeds = _equal_shares([item.velocity for item in items], np.linalg.inv(turns).T)
    coupled = np.count_nonzero(turns, axis=0) + np.count_nonzero(turns, axis=1) > 2
    return {name: (torques[k], speeds[k]) for k, name in enumerate(names) if coupled[k]}


def _equal_shares(most: Sequence[float], by: np.ndarray) -> list[float]:
    """What each drive (row of ``by``) may give so that no joint (column) has more than its ``most``; nan where one is not known."""
    shares = np.array(most) / np.count_nonzero(by, axis=0)
    return [float(np.min(shares[row != 0] / np.abs(row[row != 0]))) for row in by]


def _linear(item: Any, given: Mapping[str, Any], ratio: float, report: Report) -> dict[str, Any]:
    """Tables of a prismatic joint with a linear motor: effort [N] is the force that it gives behind its gear at standstill, velocity
    its speed at no force."""
    values = {"max_force": item.effort / ratio, "max_velocity": item.velocity * ratio}
    usable = {name: value for name, value in values.items() if math.isfinite(value) and name not in given}
    if missing := [name for name in values if name not in usable.keys() | given.keys()]:
        _report_missing(item.joint, missing, report, alone=True)
    more = {"rotor_mass": item.drive.armature / ratio**2} if item.drive.armature else {}
    losses = {"friction": item.drive.friction, "damping": item.drive.damping}
    lossy = {name: value for name, value in losses.items() if value}
    return {"motor": usable | more} | ({"gear": lossy} if lossy else {})


def _implied(motor: Mapping[str, Any], leg: Mapping[str, Any]) -> set[str]:
    """Which of max_torque and max_speed the datasheet of a motor implies, where it is not stated."""
    known = motor.keys() | ({"voltage"} if "supply" in leg else set())
    return {name for name, entries in IMPLIES.items() if name not in motor and known >= set(entries)}


MEANT = {
    "max_torque": "effort",
    "max_speed": "velocity",
    "max_force": "effort",
    "max_velocity": "velocity",
}  # entries of a motor: what a URDF has for them


def _report_missing(joint: str, entries: list[str], report: Report, alone: bool = False) -> None:
    """Report what neither the problem nor the URDF states of a joint's motor; ``alone``: where no common motor can."""
    entry = f".{entries[0]}" if len(entries) == 1 else ""
    says = " and ".join(MEANT[entry] for entry in entries)
    common = "" if alone else f", or {f'leg.motor{entry}' if entry else '[leg.motor]'} for all joints"
    report.add(
        f"leg.{joint}.motor{entry}",
        f"is missing, and {shown_path(str(report.urdf))} states no usable {says} of {shown_path(joint)}: add it{common}",
    )
    report.unreadable = True  # what is missing then would only be said again


def _motor(holder: Any) -> dict[str, Any]:
    """What a table states of its motor."""
    return _stated(holder, "motor")


def _stated(holder: Any, part: str) -> dict[str, Any]:
    """What a table states of its motor or gear."""
    found = holder.get(part) if isinstance(holder, Mapping) else None
    return dict(found) if isinstance(found, Mapping) else {}


def _turning(item: Any, own: Any) -> dict[str, Any]:
    """Gear and transmission of a joint by the file's <transmission>, where the problem states neither."""
    gear = {"ratio": item.gearing.ratio} if item.gearing.ratio != 1 else {}
    coupling = {other: {"ratio": ratio} for other, ratio in item.gearing.coupling.items()}
    if isinstance(own, Mapping) and "transmission" in own:
        coupling = {}
    return {"gear": gear} | ({"transmission": {"coupling": coupling}} if coupling else {})


def _ratio(*holders: Any) -> float | None:
    """The first gear ratio that one of these tables has in its gear; None if none has."""
    gears = [holder.get("gear") for holder in holders if isinstance(holder, Mapping)]
    ratios: list[Any] = [gear.get("ratio") for gear in gears if isinstance(gear, Mapping)]
    return next((ratio for ratio in ratios if moderate(ratio) and ratio > 0), None)


def moderate(value: Any) -> bool:
    """Whether a value is a number that an angle or a ratio may be."""
    return is_number(value) and abs(value) <= 1e3
