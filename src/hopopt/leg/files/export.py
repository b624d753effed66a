"""The leg as files for other programs: URDF (ROS, Pinocchio, Drake, ...) and MJCF (MuJoCo).

Both are written from the link table the Pinocchio model is made of, every number to its last digit. The body slides
along x and z and the joints turn about y, so of an inertia only the moment about y enters the motion. Readers demand
a physical body all the same: positive moments, none larger than the sum of the others. What the leg does not say is
filled in so, and named as such in the file.
"""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from importlib.metadata import version
from itertools import pairwise
from typing import Any

import numpy as np

from hopopt.design.geometry.link_joint import LinkJoint
from hopopt.drivetrain.dynamics import refuse_series_springs
from hopopt.drivetrain.gear import gears_of
from hopopt.drivetrain.heat import REFERENCE, TwoBodies
from hopopt.drivetrain.motor import voltage_line
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.errors import UsageError
from hopopt.leg.derived import effort_limit, velocity_limit
from hopopt.leg.inertia import PAIRS, tensor
from hopopt.leg.kinematics import planar
from hopopt.leg.robot import BASE, GUIDES, MovingBody, Robot, link_bodies
from hopopt.leg.scales import Scale

TRAVEL = 1000.0  # m and m/s: a URDF guide must have limits; these are as good as none
SLENDER = 1e-3  # moment about a link's own axis as a share of the one across it; a rod has none
BALL = 0.1  # m: radius of the ball whose moments the body is given; it does not turn
FOOT_RADIUS = 1e-6  # m: of the contact point, too small to roll anywhere
DRAWN = 0.015  # [m] on the paper's leg: radius of what is drawn for a link
AS_BUILT, SLACK = -1.0, 1e3  # rad: a rest length that means another to MuJoCo; one that no spring reaches
MADE = "Made by hopopt {version}. SI units, z up."
IN_PLANE = (
    "It moves in the x-z plane only: of the inertias the moments about y are the leg's; those about x and z, and all of "
    "the body's, do not enter the motion and are placeholders (of a thin rod, of a ball of {ball} m)."
)
IN_SPACE = (
    "The body does not turn, and its inertia is a placeholder (of a ball of {ball} m). A link that is a thin rod is given "
    "some thickness, a thousandth of its moment."
)
TAKES_TORQUE = "A motor takes its joint's torque; its limit is the one at standstill."
TAKES_VOLTAGE = "A motor takes the voltage at its terminals."
LOSES_NOTHING = " Gears lose nothing here: MuJoCo's motors have no efficiency, and no table of it."
DRIVE, ROTOR = "{} drive", "{} rotor"  # names of the tendons that are a joint's drive, and its rotor on a link
SPRINGS = "The leg has springs beside its drives, which URDF does not know."
ON_SLIDER = "The body moves on a vertical slider: its guide along x is fixed."


# ---- URDF -------------------------------------------------------------------------------------------------


def to_urdf(robot: Robot) -> str:
    """The leg as URDF, its foot a link of its own, with a transmission for each gear.

    URDF has no place for rotor inertias: comments list them.
    """
    if not robot.leg.direct:
        raise UsageError(
            "a URDF knows drives that turn as their joints do: leave out the joints' transmissions, or write MJCF"
        )
    bodies, root = _bodies(robot), ET.Element("robot", name="leg")
    *links, world, guide, body, foot = _unique([*robot.leg.links, "world", "guide", "body", "foot"])
    names = [world, guide, body, *links, foot]
    for name, content in zip(names, [None, None, *bodies[1:], None], strict=True):
        _urdf_link(root, name, content)
    *joints, foot_joint = _unique([*(body.joint.name for body in bodies), "foot_joint"])
    limits = [_travel()] * BASE + [_limits(robot, body.joint) for body in bodies[BASE:]]
    for name, ends, content, limit in zip(joints, pairwise(names[:-1]), bodies, limits, strict=True):
        at = content.joint
        if at in GUIDES and at.name not in robot.leg.guides:
            _urdf_joint(root, name, "fixed", ends, content.placement)
            continue
        joint = _urdf_joint(root, name, "prismatic" if at.slides else "revolute", ends, content.placement)
        ET.SubElement(joint, "axis", xyz=_text(at.axis))
        ET.SubElement(joint, "limit", limit)
        if at.follows:
            ratio = {"multiplier": repr(at.ratio), "offset": repr(at.offset)}
            ET.SubElement(joint, "mimic", {"joint": robot.joints[at.coordinate - BASE]} | ratio)
    _urdf_joint(root, foot_joint, "fixed", (names[-2], foot), robot.points["foot"][1])
    for name, rotor in zip(robot.joints, robot.rotors.tolist(), strict=True):
        _transmission(root, robot, name, rotor)
    rotors = ", ".join(f"{j} {rotor!r}" for j, rotor in zip(robot.joints, robot.rotors.tolist(), strict=True))
    springs = f" {SPRINGS}" if robot.springs else ""
    return _document(
        robot, root, f"URDF has no rotor inertia. Add to the diagonal of the mass matrix [kg m^2]: {rotors}.{springs}"
    )


def _urdf_link(root: ET.Element, name: str, body: MovingBody | None) -> None:
    link = ET.SubElement(root, "link", name=name)
    if body is not None:
        inertial = ET.SubElement(link, "inertial")
        ET.SubElement(inertial, "origin", xyz=_text(body.com), rpy="0 0 0")
        ET.SubElement(inertial, "mass", value=_text([body.mass]))
        names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        ET.SubElement(inertial, "inertia", dict(zip(names, map(repr, _inertia(body)), strict=True)))


def _urdf_joint(root: ET.Element, name: str, kind: str, ends: tuple[str, str], at: Sequence[Any]) -> ET.Element:
    joint = ET.SubElement(root, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=ends[0])
    ET.SubElement(joint, "child", link=ends[1])
    ET.SubElement(joint, "origin", xyz=_text(at), rpy="0 0 0")
    return joint


def _transmission(root: ET.Element, robot: Robot, joint: str, armature: float) -> None:
    """The gear of a joint as ROS reads it; of the rotor inertia a comment, on the motor's side [kg m^2]."""
    ratio = float(robot.parameters[robot.leg.drive(joint, "gear", "ratio")[0]])
    made = ET.SubElement(root, "transmission", name=f"{joint}_transmission")
    ET.SubElement(made, "type").text = "transmission_interface/SimpleTransmission"
    end = ET.SubElement(made, "joint", name=joint)
    ET.SubElement(end, "hardwareInterface").text = "hardware_interface/EffortJointInterface"
    motor = ET.SubElement(made, "actuator", name=f"{joint}_motor")
    ET.SubElement(motor, "mechanicalReduction").text = repr(ratio)
    motor.append(ET.Comment(f" rotor inertia in front of the gear: {armature / ratio**2!r} kg m^2 "))


def _travel() -> dict[str, str]:
    """Limits of a guide: free, and without a motor."""
    return {"lower": repr(-TRAVEL), "upper": repr(TRAVEL), "effort": "0", "velocity": repr(TRAVEL)}


def _limits(robot: Robot, at: LinkJoint) -> dict[str, str]:
    """Of a joint; one that follows has those of the joint that it follows, and no motor."""
    name = robot.joints[at.coordinate - BASE]
    joint, region = robot.leg.joint[name], operating_region(robot.leg, name, robot.parameters)
    lower, upper = sorted((at.place(joint.lower), at.place(joint.upper)))
    values = (lower, upper, 0.0 if at.follows else effort_limit(region), abs(at.ratio) * velocity_limit(region))
    return dict(zip(("lower", "upper", "effort", "velocity"), map(repr, values), strict=True))


# ---- MJCF -------------------------------------------------------------------------------------------------


def to_mjcf(robot: Robot, dc_motors: bool = False, heat: bool = True, pose: np.ndarray | None = None) -> str:
    """The leg as MJCF above a floor that the foot, a site and a contact point, can touch.

    dc_motors: its motors are MuJoCo's DC motors, which take a voltage [V], in place of motors that take a torque. They have
    back-EMF, a winding's resistance and a torque cap; what gears lose and how far a supply sags they do not know. UsageError
    where the problem does not say at which voltage. heat: with the temperatures of their windings, by which their resistance
    grows, so that a voltage gives less torque. pose (n) [rad]: where ratios that change with the angle are taken, without which
    they are refused.

    The equality constraint "stance", inactive at first, pins the foot to the origin: the ideal ground. A motor takes its
    joint's torque [N m] and knows its limit at standstill; the rest of the operating region is left to the controller.
    A drive that does not turn as its joint does is a tendon on all joints with the rotor's inertia, which its motor pulls.
    Joint limits are stops. A spring is a tendon, whose corner MuJoCo does not round; UsageError for one with a table. (MuJoCo itself takes a centre of mass within 1e-6 m of its joint to be at the joint.)
    """
    if robot.leg.follows:
        raise UsageError(
            "MJCF and MuJoCo take legs all of whose joints have drives: leave out follows of links, or write URDF"
        )
    if dc_motors and robot.leg.sliding:
        raise UsageError("DC motors in MJCF turn: leave out --dc-motors, or prismatic joints")
    turns = _ratios(robot, pose, dc_motors)
    bodies, root = _bodies(robot), ET.Element("mujoco", model="leg")
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    ET.SubElement(root, "option", gravity=_text(robot.model.gravity.linear))
    world = ET.SubElement(root, "worldbody")
    ET.SubElement(world, "geom", name="floor", type="plane", size="0 0 1", pos=_text((0, 0, -FOOT_RADIUS)))
    ET.SubElement(world, "site", name="foothold")
    body = ET.SubElement(world, "body", name="body")
    for guide in (at for at in GUIDES if at.name in robot.leg.guides):
        ET.SubElement(body, "joint", name=guide.name, type="slide", axis=_text(guide.axis))
    _mjcf_inertial(body, bodies[1])
    _, _, *links = _unique(["world", "body", *robot.leg.links])  # MuJoCo's own, and the leg's
    foot, radius = robot.points["foot"][1], repr(DRAWN * Scale.of(robot.leg).length)
    ends = [b.placement for b in bodies[BASE + 1 :]] + [foot]
    for link, name, content, end in zip(links, robot.joints, bodies[BASE:], ends, strict=True):
        body = ET.SubElement(body, "body", name=link, pos=_text(content.placement))
        _mjcf_joint(body, robot, name, content)
        _mjcf_inertial(body, content)
        line = _text((0, 0, 0, *end))
        ET.SubElement(body, "geom", type="capsule", fromto=line, size=radius, contype="0", conaffinity="0")
    ET.SubElement(body, "site", name="foot", pos=_text(foot))
    ET.SubElement(body, "geom", name="foot", type="sphere", size=repr(FOOT_RADIUS), pos=_text(foot))
    equality = ET.SubElement(root, "equality")
    ET.SubElement(equality, "connect", name="stance", site1="foot", site2="foothold", active="false")
    tendons = ET.SubElement(root, "tendon") if robot.springs or turns is not None else root
    _mjcf_springs(tendons, robot)
    if turns is not None:
        _mjcf_drives(tendons, robot, turns)
    actuators = ET.SubElement(root, "actuator")
    for name in robot.joints:
        if dc_motors:
            ET.SubElement(actuators, "dcmotor", _dc_motor(robot, name, heat))
            continue
        effort = effort_limit(operating_region(robot.leg, name, robot.parameters))
        pulls = {"joint": name} if turns is None else {"tendon": DRIVE.format(name)}
        ET.SubElement(actuators, "motor", {"name": name, "ctrlrange": _text((-effort, effort)), **pulls})
    losses = "" if gears_of(robot.leg, robot.parameters).ideal else LOSES_NOTHING
    return _document(robot, root, (TAKES_VOLTAGE if dc_motors else TAKES_TORQUE) + losses)


def _dc_motor(robot: Robot, joint: str, heat: bool) -> dict[str, str]:
    """A joint's motor as MuJoCo's: voltage [V], stall torque and no-load speed in front of its gear, and its torque cap."""
    line = voltage_line(robot.leg, joint, robot.parameters)
    if line.voltage is None:
        raise UsageError(
            f"leg.{joint}.motor: a DC motor needs the voltage at which its torque-speed line holds: give leg.motor.voltage or supply.voltage"
        )
    numbers = {
        "name": joint, "joint": joint, "gear": _text([line.ratio]), "ctrlrange": _text((-line.voltage, line.voltage)),
        "nominal": _text((line.voltage, line.max_torque, line.max_speed)),
    }  # fmt: skip
    if line.torque_cap is not None:
        numbers["saturation"] = _text((line.torque_cap, 0.0, 0.0))
    bodies = TwoBodies.of(robot.leg, joint, robot.parameters, REFERENCE) if heat else None
    if bodies is not None:  # MuJoCo's housing stays as it is
        of_winding = bodies.winding_to_housing, 0.0, bodies.winding_time_constant
        numbers["thermal"] = _text((*of_winding, bodies.copper, REFERENCE, REFERENCE))
    return numbers


def _mjcf_joint(body: ET.Element, robot: Robot, name: str, content: MovingBody) -> None:
    limits, axis = robot.leg.joint[name], content.joint.axis
    kind = "slide" if content.joint.slides else "hinge"
    joint = {"name": name, "type": kind, "axis": _text(axis), "range": _text((limits.lower, limits.upper))}
    ET.SubElement(body, "joint", joint, armature=_text([content.armature if robot.leg.direct else 0.0]))


def _ratios(robot: Robot, pose: np.ndarray | None, dc_motors: bool) -> np.ndarray | None:
    """d theta / d q (n, n) of the drives at a pose; None where they turn as their joints do. UsageError as of ``to_mjcf``."""
    if robot.turning is None:
        return None
    leg = robot.leg
    laws = [f"leg.{j}.transmission.{t.law}" for j in leg.joints if (t := leg.joint[j].transmission) and t.law]
    if laws and pose is None:
        raise UsageError(f"{laws[0]}: MJCF has no ratio that changes with the angle: leave the law out")
    if dc_motors:
        raise UsageError("DC motors in MJCF turn as their joints do: leave out transmissions, or --dc-motors")
    return robot.turning.jacobian(np.zeros(len(leg.joints)) if pose is None else pose)


def _mjcf_drives(tendons: ET.Element, robot: Robot, turns: np.ndarray) -> None:
    """Drives as tendons on joints, whose length is the drive's angle behind its gear; with the rotor's inertia, or a tendon for that
    where it rides on a link: its length is the rotor's own angle over the gear's ratio."""
    assert robot.turning is not None
    for k, (joint, rotor) in enumerate(zip(robot.joints, robot.rotors.tolist(), strict=True)):
        rides = joint in robot.leg.riding
        found = [(DRIVE, turns[k], 0.0 if rides else rotor)]
        for name, row, inertia in [*found, (ROTOR, turns[k] + robot.turning.housings[k], rotor)][: 1 + rides]:
            fixed = ET.SubElement(tendons, "fixed", name=name.format(joint), armature=_text([inertia]))
            for other, ratio in zip(robot.joints, row.tolist(), strict=True):
                ET.SubElement(fixed, "joint", joint=other, coef=_text([ratio]))


def _mjcf_springs(tendons: ET.Element, robot: Robot) -> None:
    """Springs as tendons on joints, whose length is the spring's angle; it is slack between two lengths."""
    for name, law in robot.springs.laws.items():
        spring, p = (robot.leg.spring or {})[name], robot.parameters
        if spring.table is not None:
            raise UsageError(f"leg.spring.{name}.table: MuJoCo's springs have no table: give stiffness and rest_angle")
        rest = p[f"leg.spring.{name}.rest_angle"]
        rest = np.nextafter(rest, 0) if rest == AS_BUILT else rest
        ends = {"everywhere": (rest, rest), "above": (-SLACK, rest), "below": (rest, SLACK)}[spring.acts]
        stiffness = _text([p[f"leg.spring.{name}.stiffness"]])
        fixed = ET.SubElement(tendons, "fixed", name=name, stiffness=stiffness, springlength=_text(ends))
        for joint, coefficient in zip(robot.joints, law.coefficients, strict=True):
            if coefficient:
                ET.SubElement(fixed, "joint", joint=joint, coef=_text([coefficient]))


def _mjcf_inertial(body: ET.Element, content: MovingBody) -> None:
    inertia = _inertia(content)
    moments = {"fullinertia": _text(inertia)} if any(inertia[3:]) else {"diaginertia": _text(inertia[:3])}
    ET.SubElement(body, "inertial", {"pos": _text(content.com), "mass": _text([content.mass]), **moments})


# ---- both -------------------------------------------------------------------------------------------------


def _bodies(robot: Robot) -> list[MovingBody]:
    refuse_series_springs(robot.leg, "a URDF or MJCF")
    for joint in robot.leg.five_bars:
        raise UsageError(f"a URDF or MJCF knows no closed chains: leave out leg.{joint}.transmission.five_bar")
    return link_bodies(robot.leg, robot.parameters)


def _inertia(body: MovingBody) -> list[float]:
    """Moments xx, yy, zz and products xy, xz, yz [kg m^2], made those of a physical body: a rod has some thickness,
    the body that does not turn is a ball."""
    matrix = np.array(tensor(body.inertia), dtype=float)
    if not matrix.any():
        matrix = np.eye(3) * 0.4 * float(body.mass) * BALL**2
    moments, axes = np.linalg.eigh(matrix)
    if moments[0] < SLENDER * moments[2]:
        matrix += (SLENDER * moments[2] - moments[0]) * np.outer(axes[:, 0], axes[:, 0])
    return [float(matrix[i, j]) for i, j in PAIRS]


def _unique(names: Iterable[str]) -> list[str]:
    """The names in order, with underscores added to those that were there before."""
    taken: list[str] = []
    for name in names:
        while name in taken:
            name += "_"
        taken.append(name)
    return taken


def _text(values: Iterable[Any]) -> str:
    """Numbers as XML, to the last digit."""
    return " ".join(repr(float(x) + 0.0) for x in values)


def _document(robot: Robot, root: ET.Element, remark: str) -> str:
    ET.indent(root)
    notes = [MADE, IN_PLANE if planar(robot.leg) else IN_SPACE, *([] if "x" in robot.leg.guides else [ON_SLIDER])]
    note = f"{' '.join(notes).format(version=version('hopopt'), ball=BALL)} {remark}"
    comment = re.sub("-(?=-)", "- ", note)  # two hyphens would end the comment
    return f'<?xml version="1.0"?>\n<!-- {comment} -->\n{ET.tostring(root, encoding="unicode")}\n'
