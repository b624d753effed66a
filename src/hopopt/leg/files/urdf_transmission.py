"""Transmissions of a URDF, as ROS defines them: how far an actuator turns for each joint of a leg.

With reductions n_a of actuators and n_j of joints, by the documentation of ros_control's transmission_interface:
simple a = n_a n_j q; four-bar linkage a_1 = n_a1 n_j1 q_1, a_2 = n_a2 (q_1 + n_j2 q_2); differential
a_1 = n_a1 (n_j1 q_1 + n_j2 q_2), a_2 = n_a2 (n_j1 q_1 - n_j2 q_2).
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from hopopt.leg.files.urdf_xml import UrdfError, decimals, quoted

LARGEST = 1e6  # of a reduction
REDUCTION = "mechanicalReduction"


@dataclass(frozen=True)
class Gearing:
    """A joint's actuator: its turns for one of the joint, ``ratio``, and over that its turns for one of other joints."""

    ratio: float = 1.0
    coupling: Mapping[str, float] = field(default_factory=dict)


DIRECT = Gearing()


def gearings(root: ET.Element, joints: Sequence[str]) -> dict[str, Gearing]:
    """Of the ``joints`` of a leg that have a transmission; UrdfError for one that cannot be read."""
    found = dict[str, Gearing]()
    for element in root.findall("transmission"):
        moved = [name for name in _names(element) if name in joints]
        if not moved:
            continue
        where = f"transmission {quoted(element.get('name', ''))} of {quoted(moved[0])}"
        for name, gearing in _read(element, where, joints):
            if name in found:
                raise UrdfError(f"{where} is another one of joint {quoted(name)}: give leg.{name}.gear.ratio")
            found[name] = gearing
    return found


def _names(element: ET.Element) -> list[str]:
    return [joint.get("name", "") for joint in element.findall("joint")]


def _read(element: ET.Element, where: str, joints: Sequence[str]) -> Iterator[tuple[str, Gearing]]:
    kind = (element.findtext("type") or element.get("type", "")).strip().rpartition("/")[2]
    names = _by_role(element, "joint")
    of_joints = [_reduction(joint, where) for joint in names]
    of_actuators = [_reduction(actuator, where) for actuator in _by_role(element, "actuator")]
    named = [joint.get("name", "") for joint in names]
    if kind == "SimpleTransmission" and len(named) == 1 and len(of_actuators) <= 1:
        yield named[0], Gearing(abs(_reduction(element, where) * of_joints[0] * (of_actuators or [1.0])[0]))
        return
    known = kind in ("DifferentialTransmission", "FourBarLinkageTransmission")
    if not known or len(named) != 2 or len(of_actuators) != 2:
        raise UrdfError(
            f"{where} is of type {quoted(kind)} or has other ends than hopopt reads: give leg.{named[0]}.gear.ratio"
        )
    if apart := [name for name in named if name not in joints]:
        raise UrdfError(
            f"{where} moves {quoted(apart[0])} too, which the leg locks: give the gear.ratio of the other one"
        )
    (first, second), (j1, j2), (a1, a2) = named, of_joints, of_actuators
    if kind == "DifferentialTransmission":
        yield first, Gearing(abs(a1 * j1), {second: j2 / j1})
        yield second, Gearing(abs(a2 * j2), {first: -j1 / j2})
    else:
        yield first, Gearing(abs(a1 * j1))
        yield second, Gearing(abs(a2 * j2), {first: 1 / j2})


def _by_role(element: ET.Element, tag: str) -> list[ET.Element]:
    """Joints or actuators by their roles, joint1 before joint2; in the file's order without roles."""
    return sorted(element.findall(tag), key=lambda end: (end.findtext("role") or "").strip())


def _reduction(element: ET.Element, where: str) -> float:
    """The reduction that an element states, 1 without."""
    text = element.findtext(REDUCTION)
    if text is None:
        return 1.0
    (value,) = decimals(text, 1, f"{where} has the {REDUCTION} {quoted(text.strip())}", LARGEST)
    if not value:
        raise UrdfError(f"{where} has the {REDUCTION} 0: a number other than 0 is needed")
    return value
