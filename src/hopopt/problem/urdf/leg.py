"""``leg.urdf`` or ``leg.mjcf`` in a problem: the leg's tables filled from a robot's file, what the problem states on top.

The file is read once, where the problem is; everything behind sees numbers only, and so does a stored result.
"""

import math
import os
import re
from collections.abc import Iterator, Mapping
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

import numpy as np

from hopopt.files import read_regular
from hopopt.leg.files.urdf import read_leg
from hopopt.leg.files.urdf_xml import MAX_BYTES, UrdfError, quoted
from hopopt.problem.checking.faults import Report
from hopopt.problem.checking.wording import is_number
from hopopt.problem.reading import beside
from hopopt.problem.render import shown, shown_path
from hopopt.problem.shapes.collision import GEOMETRY, with_shapes
from hopopt.problem.urdf.drives import drives_of, moderate
from hopopt.problem.urdf.rules import urdf_rules

KINDS = ("urdf", "mjcf")  # entries that name a robot's file
ENTRIES = (*KINDS, "foot_frame", "foot_point", "locked", GEOMETRY)  # of [leg], besides what a leg without a URDF has
FEET = {"urdf": "the link of the URDF", "mjcf": "the body or the site of the MJCF"}
FURTHEST_POINT = 3.0  # m, as a link's length
ROBOTS = "example-robot-data"  # package of public robots; a path that begins with its name lies in it
ROBOTS_FOLDER = "cmeel.prefix/share/example-robot-data/robots"


def located(layer: Mapping[str, Any], folder: Path, label: str, report: Report) -> dict[str, Any]:
    """The layer of a problem file in ``folder`` with leg.urdf or leg.mjcf as a path from where we are; faults are reported."""
    leg = layer.get("leg")
    kind = next((kind for kind in KINDS if kind in leg), "") if isinstance(leg, Mapping) else ""
    name = leg.get(kind) if isinstance(leg, Mapping) else None
    if not isinstance(leg, Mapping) or not isinstance(name, str):
        return dict(layer)
    where = f"{label}: leg.{kind} = {shown(name)}"
    inside = name.removeprefix(f"{ROBOTS}/")
    robots = None if inside == name else _robots()
    if inside != name and robots is None:
        report.unusable(f'{where} is in the package {ROBOTS}, which is not installed: pip install "hopopt[robots]"')
        return dict(layer)

    def absent(path: Path) -> str:
        return f"there is no such file in {_folder(path, robots)}{_beside(path)}"

    found = beside(inside, robots or folder, where, kind.upper(), absent, report)
    if found is None:
        return dict(layer)
    report.homes[str(found)] = robots or folder
    return {**layer, "leg": {**leg, kind: str(found)}}


def _robots() -> Path | None:
    """Folder of the package of public robots, if it is installed."""
    try:
        folder = Path(str(distribution(ROBOTS).locate_file(ROBOTS_FOLDER)))
    except PackageNotFoundError:
        return None
    return folder if folder.is_dir() else None


def _folder(path: Path, robots: Path | None) -> str:
    """The folder that was searched: a path counts from the problem file, or from the package of public robots."""
    if robots is not None:
        return f"{shown_path(str(path.parent))}, where the package {ROBOTS} has its robots"
    return f"{shown_path(str(path.parent))}, for a path counts from the folder of the problem file"


def _beside(path: Path) -> str:
    names = (
        sorted(p.name for p in path.parent.glob(f"*{path.suffix or '.urdf'}"))[:12]
        if os.path.isdir(path.parent)
        else []
    )
    return f"; there is {', '.join(map(shown_path, names))}" if names else ""


def with_leg(data: dict[str, Any], report: Report) -> dict[str, Any]:
    """The problem with the leg of its URDF or MJCF, if it names one; faults are reported."""
    leg = data.get("leg")
    if not isinstance(leg, dict):
        return data
    given = {name: leg[name] for name in ENTRIES if name in leg}
    rest = {name: value for name, value in leg.items() if name not in ENTRIES}
    kind = next((kind for kind in KINDS if kind in given), None)
    if kind is None:
        for name in given:
            report.add(
                f"leg.{name}",
                f"has a meaning only beside {'leg.urdf' if name == GEOMETRY else 'leg.urdf or leg.mjcf'}: give it too, or take this out",
            )
        return {**data, "leg": rest}
    if not _usable(kind, given, rest, report):
        return {**data, "leg": rest}
    path = Path(given[kind])
    try:
        raw, point = read_regular(path, MAX_BYTES + 1), given.get("foot_point", (0.0, 0.0, 0.0))
        found = read_leg(raw, rest["joints"], given["foot_frame"], given.get("locked", {}), point, kind)
        report.urdf = path.name
        within = report.homes.get(str(path), path.parent)
        tables = with_shapes(_tables(found, rest, report), raw, path.parent, rest["joints"], given, within)
    except OSError as error:
        report.unusable(f"{shown_path(path.name)} cannot be read: {error.strerror}")
    except UrdfError as error:
        report.unusable(f"{shown_path(path.name)} {error}")
    else:
        report.origins = dict.fromkeys(_entries(tables, "leg"), path.name) | report.origins
        urdf_rules(found, rest, tables, report)
        return {**data, "leg": _merged(tables, rest)}
    return {**data, "leg": rest}


def _entries(tables: Mapping[str, Any], path: str) -> Iterator[str]:
    """Paths of all entries of nested tables."""
    for name, value in tables.items():
        if isinstance(value, Mapping):
            yield from _entries(value, f"{path}.{name}")
        else:
            yield f"{path}.{name}"


def _usable(kind: str, given: Mapping[str, Any], leg: Mapping[str, Any], report: Report) -> bool:
    """Whether the entries say what to read; if not, that is reported."""
    joints, foot, locked = leg.get("joints"), given.get("foot_frame"), given.get("locked", {})
    if set(KINDS) <= given.keys():
        report.add("leg.mjcf", "stands beside leg.urdf: a leg is read from one of them, remove the other")
    elif not isinstance(given[kind], str):
        report.add(
            f"leg.{kind}", f"= {shown(given[kind])} is not allowed: the path of a {kind.upper()} in quotes is needed"
        )
    elif not isinstance(joints, tuple) or not joints or not all(isinstance(name, str) for name in joints):
        report.add("leg.joints", f"has to name the joints of the {kind.upper()} that move, from the body to the foot")
    elif not isinstance(foot, str):
        report.add("leg.foot_frame", f"has to name {FEET[kind]} whose origin touches the ground")
    elif not _is_point(point := given.get("foot_point", (0.0, 0.0, 0.0))):
        words = f"three numbers from {-FURTHEST_POINT:g} to {FURTHEST_POINT:g} m are needed, in the frame of {foot}"
        report.add("leg.foot_point", f"= {shown(point)} is not allowed: {words}, such as [0.12, 0.0, -0.04]")
    elif kind == "mjcf" and given.get(GEOMETRY):
        report.add(
            f"leg.{GEOMETRY}", "is read from a URDF alone: write the shapes in the problem, as docs/body.md shows"
        )
    elif not isinstance(given.get(GEOMETRY, False), bool):
        report.add(f"leg.{GEOMETRY}", f"= {shown(given[GEOMETRY])} is not allowed: true or false is needed")
    elif not isinstance(locked, Mapping) or not all(map(moderate, locked.values())):
        report.add(
            "leg.locked", "takes names of joints with the angle [rad] they are held at: locked = {hip_yaw = 0.0}"
        )
    else:
        return True
    report.unreadable = True  # what is missing then would only be said again
    return False


def _tables(found: Any, leg: Mapping[str, Any], report: Report) -> dict[str, Any]:
    """Tables of the leg as a problem file has them."""
    links, tables = [], {}
    for item in found.links:
        name = _name(item.link, (*leg["joints"], *links))
        links.append(name)
        if item.follows is None:
            limits = dict(zip(("lower", "upper"), _limits(item, found, leg.get(item.joint)), strict=True))
            tables[item.joint] = {k: v for k, v in limits.items() if math.isfinite(v)} | {"axis": item.axis}
            tables[item.joint] |= {"type": "prismatic"} if item.slides else {}
        length = math.hypot(*item.vector)
        tables[name] = {
            "length": length, "direction": tuple(x / (length or 1.0) for x in item.vector), "mass": item.mass,
            "com_position": item.com, "inertia_tensor": item.inertia,
        }  # fmt: skip
        if (follows := item.follows) is not None:
            tables[name]["follows"] = {
                "joint": follows.joint, "ratio": follows.ratio, "offset": follows.offset, "axis": item.axis,
            }  # fmt: skip
    body = {"links": tuple(links), "body": _body(found, leg, report), "gear": {"ratio": 1.0}}
    return _merged(body | tables, drives_of(found, leg, report))


def _limits(item: Any, found: Any, own: Any) -> tuple[float, float]:
    """Of a joint [rad]: its own, or those of joints that follow it, where these are narrower; nan where the file has none. UrdfError
    where they leave nothing, unless the joint's ``own`` table in the problem has others."""
    lower, upper = item.lower, item.upper
    stated = isinstance(own, Mapping) and {"lower", "upper"} <= own.keys()
    for other in found.links:
        if other.follows is not None and other.follows.joint == item.joint:
            low, high = other.follows.range(other.lower, other.upper)
            before, (lower, upper) = (lower, upper), (np.fmax(lower, low), np.fmin(upper, high))
            if before[0] < before[1] and not lower < upper and not stated:
                raise UrdfError(
                    f"joint {quoted(other.joint)} follows {quoted(item.joint)} ({other.follows.ratio:g} times its angle plus "
                    f"{other.follows.offset:g} rad) and never lies within its own limits, {other.lower:g} to {other.upper:g} rad: "
                    f"change these, its offset, or give leg.{item.joint}.lower and upper, now {before[0]:g} and {before[1]:g} rad"
                )
    return float(lower), float(upper)


def _body(found: Any, leg: Mapping[str, Any], report: Report) -> dict[str, float]:
    """The share of the body that each of the problem's leg.body.legs carries, one unless it says so: an equal part of the
    robot, less one leg."""
    own = leg.get("body")
    stated = own if isinstance(own, Mapping) else {}
    if "mass" in stated:
        return {}
    legs = stated.get("legs", 1.0)
    count = (
        float(legs) if moderate(legs) and legs >= 1 else 1.0
    )  # what else it may be is reported with the other entries
    leg_mass = sum(item.mass for item in found.links)
    share = (found.body_mass + leg_mass) / count - leg_mass
    if share <= 0:
        robot = f"{count:g} legs of {leg_mass:.3g} kg weigh more than the robot of {found.body_mass + leg_mass:.3g} kg"
        report.add("leg.body.legs", f"= {shown(legs)} leaves no body: {robot} in {report.urdf}")
        report.unreadable = True
    return {"mass": share, "legs": count}


def _name(link: str, taken: tuple[str, ...]) -> str:
    """The link's name as a problem file may have it, unlike all others."""
    name = re.sub(r"[^A-Za-z0-9_-]", "_", link)[:32]
    others = (f"{name[:24]}_link{number}" for number in ("", *range(2, len(taken) + 2)))
    return next(candidate for candidate in (name, *others) if candidate not in taken)


def _is_point(value: Any) -> bool:
    """Whether a value is a place in the frame of a link."""
    return (
        isinstance(value, tuple) and len(value) == 3 and all(is_number(x) and abs(x) <= FURTHEST_POINT for x in value)
    )


def _merged(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """``over`` laid over ``base``, table by table; a link's own com or inertia takes the URDF's away."""
    result = dict(base)
    for key, value in over.items():
        old = result.get(key)
        if isinstance(old, Mapping) and isinstance(value, Mapping):
            replaced = {"com": "com_position", "inertia": "inertia_tensor"}
            gone = [there for here, there in replaced.items() if here in value]
            result[key] = _merged({k: v for k, v in old.items() if k not in gone}, value)
        else:
            result[key] = value
    return result
