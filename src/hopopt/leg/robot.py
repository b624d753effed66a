"""The machine: the only ``pin.Model`` in hopopt, made from the link table.

``link_bodies`` says once, for numbers and for CasADi symbols alike, where each body sits and what it weighs;
the Pinocchio model is built from it with numbers, the planner's recursion (rigid_body) with symbols.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from hopopt.leg.design import Leg, physical_parameters

BASE = 2  # degrees of freedom of the guides: x and z
FORWARD = np.array([0.0, -1.0, 0.0])  # axis about which a positive angle swings a hanging link forward (+x)


@dataclass(frozen=True)
class MovingBody:
    """What moves with one joint: floats, or CasADi symbols in the planner (SI).

    placement: its joint in the parent joint's frame [m]; com: centre of mass in its own frame [m];
    inertia: moment of inertia about the com and the y axis [kg m^2]; armature: reflected rotor inertia [kg m^2].
    """

    placement: tuple[Any, Any, Any]
    mass: Any
    com: tuple[Any, Any, Any]
    inertia: Any
    armature: Any


@dataclass(frozen=True)
class Robot:
    """A leg as Pinocchio sees it, q = (x, z, joint angles).

    points: name -> (joint index, offset [m] in that joint's frame) of each joint and of the foot.
    """

    leg: Leg
    model: pin.Model
    points: dict[str, tuple[int, tuple[Any, Any, Any]]]
    parameters: dict[str, float]

    @property
    def joints(self) -> tuple[str, ...]:
        return self.leg.joints


def link_bodies(leg: Leg, p: Mapping[str, Any]) -> list[MovingBody]:
    """One body for each joint (guides x and z, then the chain) from parameter values or symbols ``p``."""
    nothing = MovingBody((0.0, 0.0, 0.0), 0.0, (0.0, 0.0, 0.0), 0.0, 0.0)
    base = MovingBody((0.0, 0.0, 0.0), p["leg.body.mass"], (0.0, 0.0, 0.0), 0.0, 0.0)
    bodies, above = [nothing, base], 0.0
    for joint, link in zip(leg.joints, leg.links, strict=True):
        length, mass = p[f"leg.{link}.length"], p[f"leg.{link}.mass"]
        com = p.get(f"leg.{link}.com", 0.5 * length)
        inertia = p.get(f"leg.{link}.inertia", mass * length**2 / 12)
        ratio, rotor = p[leg.drive(joint, "gear", "ratio")[0]], p[leg.drive(joint, "motor", "rotor_inertia")[0]]
        rotor = rotor + p.get(leg.drive(joint, "gear", "inertia")[0], 0.0)
        bodies.append(MovingBody((0.0, 0.0, -above), mass, (0.0, 0.0, -com), inertia, rotor * ratio**2))
        above = length
    return bodies


def link_points(leg: Leg, p: Mapping[str, Any]) -> dict[str, tuple[int, tuple[Any, Any, Any]]]:
    """Where each joint and the foot sit: name -> (Pinocchio joint index, offset in its frame [m])."""
    points = {name: (BASE + 1 + k, (0.0, 0.0, 0.0)) for k, name in enumerate(leg.joints)}
    return {**points, "foot": (BASE + len(leg.joints), (0.0, 0.0, -p[f"leg.{leg.links[-1]}.length"]))}


def build_robot(leg: Leg, parameters: Mapping[str, float] | None = None) -> Robot:
    """The Pinocchio model of the leg; ``parameters`` overrides design parameters by path (SI)."""
    p = {**physical_parameters(leg), **(parameters or {})}
    model, bodies = pin.Model(), link_bodies(leg, p)
    kinds = [pin.JointModelPX(), pin.JointModelPZ()] + [pin.JointModelRevoluteUnaligned(FORWARD)] * len(leg.joints)
    for name, kind, body in zip(("x", "z", *leg.joints), kinds, bodies, strict=True):
        placement = pin.SE3(np.eye(3), np.array(body.placement))
        index = model.addJoint(model.njoints - 1, kind, placement, name)
        inertia = pin.Inertia(body.mass, np.array(body.com), np.diag([body.inertia, body.inertia, 0.0]))
        model.appendBodyToJoint(index, inertia, pin.SE3.Identity())
    model.armature = np.array([float(body.armature) for body in bodies])
    points = link_points(leg, p)
    for name, (index, offset) in points.items():
        frame = pin.Frame(f"point_{name}", index, pin.SE3(np.eye(3), np.array(offset)), pin.FrameType.OP_FRAME)
        model.addFrame(frame)
    return Robot(leg, model, points, p)
