"""The machine: the only ``pin.Model`` in hopopt, made from the link table.

``link_bodies`` says once, for numbers and for CasADi symbols alike, where each body sits and what it weighs;
the Pinocchio model is built from it with numbers, the planner's recursion (rigid_body) with symbols.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin

from hopopt.design import Leg, physical_parameters, unit
from hopopt.design.geometry.link_joint import LinkJoint
from hopopt.drivetrain.dynamics import added_states
from hopopt.drivetrain.motor import reflected_inertia
from hopopt.drivetrain.springs import Springs
from hopopt.drivetrain.transmission import Turning
from hopopt.leg.closed_chains import ClosedChains, arm_points, crank_point, side_mass
from hopopt.leg.geometry.solids import counted_points
from hopopt.leg.inertia import PAIRS, tensor

BASE = 2  # coordinates of the body: x and z; on a vertical slider x keeps its value
GUIDES = LinkJoint("x", (1.0, 0.0, 0.0), True, 0), LinkJoint("z", (0.0, 0.0, 1.0), True, 1)


@dataclass(frozen=True)
class MovingBody:
    """What moves with one joint: floats, or CasADi symbols in the planner (SI).

    placement: its joint in the parent joint's frame [m], whose axes are parallel when all angles are zero; com:
    centre of mass in its own frame [m]; inertia: moments xx, yy, zz and products xy, xz, yz about the com
    [kg m^2]; armature: rotor inertia reflected through the joint's gear [kg m^2], none behind a series spring or of a joint
    that follows; joint: how it moves, by which of the coordinates (x, z, joint angles).
    """

    placement: tuple[Any, ...]
    mass: Any
    com: tuple[Any, ...]
    inertia: tuple[Any, ...]
    armature: Any
    joint: LinkJoint


@dataclass(frozen=True)
class Robot:
    """A leg as Pinocchio sees it, q = (x, z, joint angles).

    points: name -> (joint index, offset [m] in that joint's frame) of each joint and of the foot; of a leg with shapes also of
    the trunk's lowest point and of corners about the links.
    """

    leg: Leg
    model: pin.Model
    points: dict[str, tuple[int, tuple[Any, ...]]]
    parameters: dict[str, float]

    @property
    def joints(self) -> tuple[str, ...]:
        return self.leg.joints

    @cached_property
    def springs(self) -> Springs:
        """Those beside the drives, which Pinocchio's model does not know."""
        return Springs.of(self.leg, self.parameters)

    def spring_forces(self, q: np.ndarray) -> np.ndarray:
        """What the springs give every coordinate (BASE + n) [N, N m] at q (BASE + n)."""
        return np.concatenate([np.zeros(BASE), np.array(self.springs.torques(list(q[BASE:])))])

    def forces_at_rest(self, q: np.ndarray) -> np.ndarray:
        """Generalised forces (BASE + n) [N, N m] that hold the leg still at q (BASE + n), against gravity and its springs."""
        if self.chains:
            still = np.zeros(len(q))
            return self.chains.inverse_dynamics(q, still, still) - self.spring_forces(q)
        return pin.computeGeneralizedGravity(self.model, self.model.createData(), q) - self.spring_forces(q)

    @cached_property
    def chains(self) -> ClosedChains | None:
        """The leg with cranks and rods of five-bars, which ``model`` has as parts of the body; None where there are none."""
        return ClosedChains(self.model, self.leg, self.parameters) if self.leg.five_bars else None

    @property
    def point_names(self) -> tuple[str, ...]:
        """Of all points that may be lowest: ``points``, and where cranks of five-bars end."""
        return *self.points, *map(crank_point, self.leg.five_bars)

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        """(BASE + n square) [kg, kg m, kg m^2] at q (BASE + n), with the rotors' inertia."""
        if self.chains:
            M = self.chains.mass_matrix(q)
        else:
            upper = pin.crba(self.model, self.model.createData(), q)
            M = np.triu(upper) + np.triu(upper, 1).T
        if self.turning:
            M[BASE:, BASE:] += self.turning.inertia(q[BASE:])
        return M

    @cached_property
    def rotors(self) -> np.ndarray:
        """Reflected inertias of what spins in front of the gears as the joints turn (n) [kg m^2], none behind series springs: in
        ``model`` where drives turn as joints do."""
        return np.array([float(each) for each in armatures(link_bodies(self.leg, self.parameters))[BASE:]])

    @cached_property
    def turning(self) -> Turning | None:
        """How the joints turn the drives; None where they turn together."""
        return None if self.leg.direct else Turning(self.leg, self.parameters, self.rotors)

    def drive_speeds(self, q: np.ndarray, v: np.ndarray, x: np.ndarray | None = None) -> np.ndarray:
        """Speeds of the drives behind their gears (..., n) [rad/s] at q, v (..., BASE + n) of the leg and, if they have any,
        states x (..., m) of their own."""
        speeds = self.turning.speeds(q[..., BASE:], v[..., BASE:]) if self.turning else v[..., BASE:]
        return speeds if x is None else added_states(self.leg, self.parameters).speeds(x, speeds)

    def rotor_speeds(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Speeds (..., n) [rad/s] of what spins in front of the gears, over their ratios, at q, v (..., BASE + n) of the leg."""
        return self.turning.spins(q[..., BASE:], v[..., BASE:]) if self.turning else v[..., BASE:]

    def joint_torques(self, q: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Torques at the joints (..., n) [N m] of torques tau (..., n) of the drives behind their gears, at q (..., BASE + n)."""
        return self.turning.joint_torques(q[..., BASE:], tau) if self.turning else tau

    def drive_torques(self, q: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Torques of the drives behind their gears (..., n) [N m] of joint torques tau (..., n) at q (..., BASE + n)."""
        return self.turning.drive_torques(q[..., BASE:], tau) if self.turning else tau


def link_bodies(leg: Leg, p: Mapping[str, Any]) -> list[MovingBody]:
    """One body for each joint (guides x and z, then the chain) from parameter values or symbols ``p``."""
    origin, still = (0.0, 0.0, 0.0), (0.0,) * 6
    masses = 0.0, p["leg.body.mass"] + side_mass(leg, p)
    bodies = [MovingBody(origin, m, origin, still, 0.0, at) for m, at in zip(masses, GUIDES, strict=True)]
    above: tuple[Any, ...] = origin
    for at, link in zip(leg.link_joints, leg.links, strict=True):
        length, mass = p[f"leg.{link}.length"], p[f"leg.{link}.mass"]
        com = leg.link[link].com_position or _along(leg, link, p.get(f"leg.{link}.com", 0.5 * length))
        across = p.get(f"leg.{link}.inertia", mass * length**2 / 12)
        inertia = leg.link[link].inertia_tensor or _rod(leg, link, across)
        rotor = 0.0 if at.follows or at.name in leg.elastic else reflected_inertia(leg, at.name, p)
        bodies.append(MovingBody(above, mass, com, inertia, rotor, replace(at, coordinate=BASE + at.coordinate)))
        above = _along(leg, link, length)
    return bodies


def armatures(bodies: Sequence[MovingBody]) -> list[Any]:
    """What rotors add to the inertia of each coordinate, (BASE + n)."""
    return [body.armature for body in bodies if not body.joint.follows]


def _along(leg: Leg, link: str, distance: Any) -> tuple[Any, ...]:
    """The point of a link at a distance [m] from its joint."""
    return tuple(distance * d if d else 0.0 for d in unit(leg.link[link].direction))


def _rod(leg: Leg, link: str, across: Any) -> tuple[Any, ...]:
    """Inertia of a thin rod along the link: ``across`` (1 - d d') [kg m^2]."""
    d = unit(leg.link[link].direction)
    matrix = np.eye(3) - np.outer(d, d)
    return tuple(across * matrix[i, j] if matrix[i, j] else 0.0 for i, j in PAIRS)


def link_points(leg: Leg, p: Mapping[str, Any]) -> dict[str, tuple[int, tuple[Any, ...]]]:
    """Where each joint and the foot sit, and what else may be lowest: name -> (Pinocchio joint index, offset in its frame [m])."""
    points: dict[str, tuple[int, tuple[Any, ...]]] = {
        name: (BASE + 1 + k, (0.0, 0.0, 0.0)) for k, name in enumerate(leg.pivots)
    }
    last = leg.links[-1]
    if leg.link_joints[0].slides:
        points = {"body": (BASE, (0.0, 0.0, 0.0))} | points
    points["foot"] = (BASE + len(leg.links), _along(leg, last, p[f"leg.{last}.length"]))
    points |= arm_points(leg, p)
    return points | {name: (BASE + 1 + joint, place) for name, joint, place in counted_points(leg)}


def build_robot(leg: Leg, parameters: Mapping[str, float] | None = None) -> Robot:
    """The Pinocchio model of the leg where it stands; ``parameters`` overrides design parameters by path (SI)."""
    p = {**physical_parameters(leg), **(parameters or {})}
    model, bodies = pin.Model(), link_bodies(leg, p)
    model.gravity.linear = np.array(leg.fall)
    for body in bodies:
        placement = pin.SE3(np.eye(3), np.array(body.placement))
        index = model.addJoint(model.njoints - 1, _joint_model(body.joint), placement, body.joint.name)
        inertia = pin.Inertia(body.mass, np.array(body.com), np.array(tensor(body.inertia), dtype=float))
        model.appendBodyToJoint(index, inertia, pin.SE3.Identity())
    if leg.direct:
        model.armature = np.array([float(each) for each in armatures(bodies)])
    points = link_points(leg, p)
    for name, (index, offset) in points.items():
        frame = pin.Frame(f"point_{name}", index, pin.SE3(np.eye(3), np.array(offset)), pin.FrameType.OP_FRAME)
        model.addFrame(frame)
    return Robot(leg, model, points, p)


def _joint_model(joint: LinkJoint) -> Any:
    """A joint as Pinocchio has it."""
    if joint.slides:
        own = {at: kind for at, kind in zip(GUIDES, (pin.JointModelPX, pin.JointModelPZ), strict=True)}.get(joint)
        return own() if own is not None else pin.JointModelPrismaticUnaligned(np.array(joint.axis))
    own = pin.JointModelRevoluteUnaligned(np.array(joint.axis))
    if not joint.follows:
        return own
    own.setIndexes(0, joint.coordinate, joint.coordinate)  # of the joint that it follows
    return pin.JointModelMimic(pin.JointModel(own), joint.ratio, joint.offset)
