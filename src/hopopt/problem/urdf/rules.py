"""What a leg out of a URDF may lack: limits of its joints and drives that are none, links without a length."""

from collections.abc import Mapping, Sequence
from itertools import zip_longest
from typing import Any

import numpy as np

from hopopt.design.drives.motor import LINEAR
from hopopt.design.geometry.link_joint import SLIDING, TURNING
from hopopt.leg.files.urdf import UrdfLeg
from hopopt.problem.checking.entries import bounds_of, entry_at
from hopopt.problem.checking.faults import Report
from hopopt.problem.render import shown_path

WHOLE_TURN = 6.27  # rad; nearly: files round it
VERTICAL = 0.99  # of an axis of length 1, its part along z
STRONGEST, FASTEST = 1000.0, 100.0  # N m, rad/s of a joint: more than any has; files say so where there is no limit
PUSHING = 1e5  # N of a linear motor, likewise; speeds above FASTEST [m/s] are none either


def urdf_rules(found: UrdfLeg, leg: Mapping[str, Any], tables: Mapping[str, Any], report: Report) -> None:
    """Report what the URDF lacks and the problem's ``leg`` does not state.

    found: the leg of the URDF. leg: what the problem itself states. tables: what is made of the URDF.
    """
    _upright(found, report)
    _continuous(found, leg, report)
    _placeholders(found, tables, report)
    _without_length(found, leg, tables["links"], report)


def _upright(found: UrdfLeg, report: Report) -> None:
    """Report a leg all of whose joints turn about the vertical: in its file another axis than z is up."""
    if all(abs(item.axis[2]) > VERTICAL and not item.slides for item in found.links):
        turning = f"turn about the vertical of {report.urdf}, and so lift nothing: a robot stands with z up"
        turn = 'rpy = "1.5707963 0 0" if y is up'
        report.add("leg.joints", f"{turning}; turn it by a fixed joint between a new root link and its body ({turn})")
        report.unreadable = True


def _without_length(found: UrdfLeg, leg: Mapping[str, Any], names: Sequence[str], report: Report) -> None:
    """Report joints, or a joint and the foot, that lie in one point."""
    least, _ = bounds_of(entry_at(("leg", "link", "", "length")) or {})
    for item, name, after in zip_longest(found.links, names, [item.joint for item in found.links[1:]]):
        own, length = leg.get(name), float(np.linalg.norm(item.vector))
        if length >= least or (isinstance(own, Mapping) and "length" in own):
            continue
        apart, needed = f"{length:.3g} m", f"and a link needs {least:g} m"
        if after is None:
            words = f"lies {apart} from joint {shown_path(item.joint)}, {needed}: give leg.foot_point, in the frame of that link [m]"
            report.add("leg.foot_frame", words)
        else:
            words = f"has {shown_path(item.joint)} and {shown_path(after)} {apart} apart, {needed}: leave one out, which locks it"
            report.add("leg.joints", words)
        report.unreadable = True  # what follows from it would only confuse


def _continuous(found: UrdfLeg, leg: Mapping[str, Any], report: Report) -> None:
    """Report joints that turn without end, unless the problem file gives limits."""
    for item in found.links:
        own = leg.get(item.joint)
        stated = own if isinstance(own, Mapping) else {}
        missing = [f"leg.{item.joint}.{side}" for side in ("lower", "upper") if side not in stated]
        if item.continuous and missing and item.follows is None:
            words = f"is of type continuous in {report.urdf}, and a leg's joint has limits: give {' and '.join(missing)} [rad]"
            report.add(f"leg.{item.joint}", words)
            report.unreadable = True  # what is missing then would only be said again


def _placeholders(found: UrdfLeg, tables: Mapping[str, Any], report: Report) -> None:
    """Report limits of the URDF that are none, where the problem file puts nothing in their place."""

    def ours(path: str) -> bool:
        return report.origins.get(path) == report.urdf

    limits, drives = list[str](), list[str]()
    for item in (each for each in found.links if each.follows is None):
        units = SLIDING if item.slides else TURNING
        for side, value in (("lower", item.lower), ("upper", item.upper)):
            if ours(path := f"leg.{item.joint}.{side}") and abs(value) >= WHOLE_TURN:
                limits.append(f"{path} ({value:g} {units.q})")
        names = LINEAR if item.slides else {}
        for entry, value, unit, most in (
            (names.get("max_torque", "max_torque"), item.effort, units.tau, PUSHING if item.slides else STRONGEST),
            (names.get("max_speed", "max_speed"), item.velocity, units.v, FASTEST),
        ):
            path = f"leg.{item.joint}.motor.{entry}"
            if entry in tables.get(item.joint, {}).get("motor", {}) and ours(path) and value >= most:
                drives.append(f"{path} ({value:g} {unit})")
    if limits or drives:
        once = ", those of motors once for all joints in [leg.motor]" if len(drives) > 1 else ""
        listed = ", ".join((*limits, *drives))
        report.fault(
            f"{report.urdf}: placeholders, which limit nothing: {listed}; write them in the problem file{once}", "leg"
        )
        report.unreadable = True  # what follows from it would only confuse
