"""Closed chains in the leg's plane: the cranks and rods of five-bars, which weigh and move as the leg's own joints let them.

``side_bodies`` says for numbers and symbols where they are, by the law of cosines. ``ClosedChains`` knows no such law: it is the
leg in Pinocchio with crank and rod as bodies of a tree, which the constraint closes that the rod ends where the arm does,

    c(q, y) = 0,    y' = G v,  G = -(dc/dy)^-1 dc/dq,    M(q) = S' M_tree S,  S = (1, G),    h = S' (h_tree + M_tree S' v).

Coordinates partitioned as in Featherstone, Rigid Body Dynamics Algorithms (2008), section 8.5. In the leg's own model crank and rod
weigh as parts of the body, so that its mass is the whole one.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from hopopt.design import Leg, physical_parameters
from hopopt.design.fields import FORWARD
from hopopt.drivetrain.linkages.five_bar import crank_pivot, heading, side, side_links
from hopopt.errors import UsageError
from hopopt.leg.kinematics import joint_frames

GUIDES = 2  # coordinates of the body, before the joints'
PARTS = ("crank", "rod")
OPEN = "leg.{}.transmission.five_bar cannot close where the leg has moved to, beyond its joints' limits: change its entries"
PLANE = [0, 2]


class OpenChain(UsageError, ArithmeticError):
    """A pose at which a five-bar cannot close."""


@dataclass(frozen=True)
class SideBody:
    """A crank or a rod: floats, or CasADi symbols in the planner (SI).

    carrier: joint of the leg's model, in whose frame it is. start, end: x and z (2) of its ends there; com: distance of its centre
    of mass from the start; inertia: about that
    """

    carrier: int
    start: tuple[Any, Any]
    end: tuple[Any, Any]
    length: Any
    mass: Any
    com: Any
    inertia: Any

    @property
    def centre(self) -> tuple[Any, Any, Any]:
        """Its centre of mass in the carrier's frame (x, y, z) [m]."""
        x, z = (a + (b - a) * self.com / self.length for a, b in zip(self.start, self.end, strict=True))
        return x, 0.0, z


def carrier_of(leg: Leg, joint: str) -> int:
    """The joint of the leg's model that moves the pivot of a five-bar's crank."""
    return GUIDES + leg.joints.index(joint) - 1


def side_bodies(leg: Leg, p: Mapping[str, Any], q: Any) -> Iterator[SideBody]:
    """Crank and rod of every five-bar at joint angles q (n) [rad]."""
    for joint in leg.five_bars:
        links = side_links(leg, joint, p, q)
        ends = (links.pivot, links.crank_end), (links.crank_end, links.arm_end)
        for part, (start, end) in zip(PARTS, ends, strict=True):
            yield SideBody(carrier_of(leg, joint), start, end, *_weighs(p, joint, part))


def _weighs(p: Mapping[str, Any], joint: str, part: str) -> tuple[Any, Any, Any, Any]:
    """Length, mass, centre of mass and inertia of a part [SI]."""
    path = f"leg.{joint}.transmission.five_bar.{part}"
    length, mass = p[path], p[f"{path}_mass"]
    return length, mass, p.get(f"{path}_com", 0.5 * length), p.get(f"{path}_inertia", mass * length**2 / 12)


def side_link_scaled(five_bar: Mapping[str, Any], part: str, mass: float) -> dict[str, float]:
    """Entries of a five-bar that change where its crank or rod weighs so many times as much."""
    return {name: five_bar[name] * mass for name in (f"{part}_mass", f"{part}_inertia") if name in five_bar}


def side_mass(leg: Leg, p: Mapping[str, Any]) -> Any:
    """Of all cranks and rods [kg]."""
    return sum(_weighs(p, joint, part)[1] for joint in leg.five_bars for part in PARTS)


def side_lever(leg: Leg, p: Mapping[str, float]) -> float:
    """What cranks and rods weigh, each times the farthest that its centre of mass can be from the pivot's carrier [kg m]."""
    found = 0.0
    for joint in leg.five_bars:
        away = math.hypot(*(p[f"leg.{joint}.transmission.five_bar.pivot_{axis}"] for axis in "xz"))
        for part in PARTS:
            length, mass, com, _ = _weighs(p, joint, part)
            found += mass * (away + abs(com))
            away += length
    return found


def arm_points(leg: Leg, p: Mapping[str, Any]) -> dict[str, tuple[int, tuple[Any, ...]]]:
    """Where rods end on their links: name -> (joint of the leg's model, offset in its frame [m])."""
    found = dict[str, tuple[int, tuple[Any, ...]]]()
    for joint in leg.five_bars:
        path, k = f"leg.{joint}.transmission.five_bar", leg.joints.index(joint)
        found[arm_point(joint)] = GUIDES + 1 + k, heading(leg, k, p[f"{path}.turned"], p[f"{path}.arm"])
    return found


def arm_point(joint: str) -> str:
    """Name of the point at which the rod of a joint's five-bar ends."""
    return f"{joint}-arm"


def crank_point(joint: str) -> str:
    """Name of the point at which the crank of a joint's five-bar ends."""
    return f"{joint}-crank"


def crank_points(leg: Leg, p: Mapping[str, Any], q: Any) -> dict[str, tuple[int, tuple[Any, ...]]]:
    """Where cranks end at joint angles q (n) [rad], as ``arm_points``."""
    ends = {joint: side_links(leg, joint, p, q).crank_end for joint in leg.five_bars}
    return {crank_point(joint): (carrier_of(leg, joint), (x, 0.0, z)) for joint, (x, z) in ends.items()}


def chain_points(leg: Leg, q: np.ndarray) -> list[tuple[str, int, tuple[float, ...]]]:
    """The points of all five-bars at joint angles q (n) [rad]: name, number of the joint that moves it (-1: the body), and place in
    its frame (3) [m]."""
    p = physical_parameters(leg)
    found = {**arm_points(leg, p), **crank_points(leg, p, q)}
    return [(name, index - GUIDES - 1, place) for name, (index, place) in found.items()]


def chain_lines(leg: Leg, q: np.ndarray) -> list[np.ndarray]:
    """Pivot, crank's end and rod's end of every five-bar at joint angles q (n) [rad], (3, 2) x and z [m] from the body."""
    (places, turns), p, found = joint_frames(leg, q), physical_parameters(leg), []
    places, turns = [np.zeros(3), *places], [np.eye(3), *turns]  # the body's first
    for joint in leg.five_bars:
        links, at = side_links(leg, joint, p, q), carrier_of(leg, joint) - GUIDES
        ends = np.array([(x, 0.0, z) for x, z in (links.pivot, links.crank_end, links.arm_end)], dtype=float)
        found.append((places[at] + ends @ turns[at].T)[:, PLANE])
    return found


@dataclass(frozen=True)
class _Loop:
    """Of one five-bar: joints of the tree, places in their frames [m], lengths [m], and 1 or -1 for the side of the crank."""

    joint: str
    carrier: int
    pivot: np.ndarray
    moved: int
    arm: np.ndarray
    crank: float
    rod: float
    side: int


class ClosedChains:
    """The leg with the cranks and rods of its five-bars as Pinocchio moves it, in the leg's own coordinates (2 + n)."""

    _kept: tuple[bytes, tuple[np.ndarray, np.ndarray, np.ndarray]] | None

    def __init__(self, model: pin.Model, leg: Leg, p: Mapping[str, float]):
        self._made_of, self.own = (model, leg, p), model.nv
        self.model, self.loops = model.copy(), list[_Loop]()
        whole = self.model.inertias[GUIDES]
        self.model.inertias[GUIDES] = pin.Inertia(p["leg.body.mass"], whole.lever, whole.inertia)
        arms = arm_points(leg, p)
        for joint in reversed(leg.five_bars):  # so that every joint's subtree stays in one piece, as Pinocchio wants it
            self._add(leg, joint, p, *arms[arm_point(joint)])
        self.data, self._kept = self.model.createData(), None

    def __reduce__(self) -> tuple[Any, ...]:
        return ClosedChains, self._made_of

    def _add(self, leg: Leg, joint: str, p: Mapping[str, float], moved: int, arm: tuple[Any, ...]) -> None:
        """Crank and rod of one five-bar, along x at zero, and frames at the ends that meet."""
        path = f"leg.{joint}.transmission.five_bar"
        x, z = crank_pivot(leg, joint, p)
        pivot, last = np.array([x, 0.0, z]), carrier_of(leg, joint)
        place = pivot
        for part in PARTS:
            length, mass, com, inertia = _weighs(p, joint, part)
            turn = pin.JointModelRevoluteUnaligned(np.array(FORWARD))
            last = self.model.addJoint(last, turn, pin.SE3(np.eye(3), place), f"{joint} {part}")
            about_y = np.diag([0.0, inertia, 0.0])
            self.model.appendBodyToJoint(
                last, pin.Inertia(mass, np.array([com, 0.0, 0.0]), about_y), pin.SE3.Identity()
            )
            place = np.array([length, 0.0, 0.0])
        offset = np.array(arm, dtype=float)
        for name, index, at in (("rod's end", last, place), ("arm's end", moved, offset)):
            self.model.addFrame(pin.Frame(f"{joint} {name}", index, pin.SE3(np.eye(3), at), pin.FrameType.OP_FRAME))
        lengths = p[f"{path}.crank"], p[f"{path}.rod"]
        self.loops.append(_Loop(joint, carrier_of(leg, joint), pivot, moved, offset, *lengths, side(leg, joint)))

    def whole(self, q: np.ndarray) -> np.ndarray:
        """All angles of the tree at q (2 + n), where its chains close; OpenChain where one cannot."""
        found = np.concatenate([q, np.zeros(self.model.nq - self.own)])
        pin.forwardKinematics(self.model, self.data, found)
        for k, loop in enumerate(self.loops):
            at = self.data.oMi[loop.carrier]
            start, end = at.act(loop.pivot)[PLANE], self.data.oMi[loop.moved].act(loop.arm)[PLANE]
            apart = float(np.hypot(*(end - start)))
            share = (loop.crank**2 + apart**2 - loop.rod**2) / (2 * loop.crank * apart)
            if not abs(share) <= 1:
                raise OpenChain(OPEN.format(loop.joint))
            inner = math.acos(share)
            crank = math.atan2(*(end - start)[::-1]) + loop.side * inner
            tip = start + loop.crank * np.array([math.cos(crank), math.sin(crank)])
            rod = math.atan2(*(end - tip)[::-1])
            carried = math.atan2(at.rotation[2, 0], at.rotation[0, 0])
            found[self.own + 2 * k : self.own + 2 * k + 2] = crank - carried, rod - crank
        return found

    def _moved(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """All angles; S, how all coordinates move with the leg's own (m, 2 + n); and the inverse of dc/dy. Kept of the last pose, as
        it is asked for several times over."""
        if self._kept is None or self._kept[0] != q.tobytes():
            whole = self.whole(q)
            pin.computeJointJacobians(self.model, self.data, whole)
            pin.updateFramePlacements(self.model, self.data)
            rows = np.vstack([self._end(loop, "rod") - self._end(loop, "arm") for loop in self.loops])
            closing = np.linalg.inv(rows[:, self.own :])
            S = np.vstack([np.eye(self.own), -closing @ rows[:, : self.own]])
            self._kept = q.tobytes(), (whole, S, closing)
        return self._kept[1]

    def _end(self, loop: _Loop, part: str) -> np.ndarray:
        frame = self.model.getFrameId(f"{loop.joint} {part}'s end")
        return pin.getFrameJacobian(self.model, self.data, frame, pin.LOCAL_WORLD_ALIGNED)[PLANE]

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        """(2 + n square), without rotors."""
        whole, S, _ = self._moved(q)
        M = pin.crba(self.model, self.data, whole)
        return S.T @ (np.triu(M) + np.triu(M, 1).T) @ S

    def inverse_dynamics(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Generalised forces (2 + n) [N, N m] under which the leg moves so, without rotors and springs."""
        whole, S, closing = self._moved(q)
        pin.forwardKinematics(self.model, self.data, whole, S @ v, np.zeros(self.model.nv))
        late = np.concatenate([self._drift(loop, "rod") - self._drift(loop, "arm") for loop in self.loops])
        rates = S @ a - np.concatenate([np.zeros(self.own), closing @ late])
        return S.T @ pin.rnea(self.model, self.data, whole, S @ v, rates)

    def _drift(self, loop: _Loop, part: str) -> np.ndarray:
        frame = self.model.getFrameId(f"{loop.joint} {part}'s end")
        found = pin.getFrameClassicalAcceleration(self.model, self.data, frame, pin.LOCAL_WORLD_ALIGNED)
        return found.linear[PLANE]

    def crank_ends(self, q: np.ndarray) -> dict[str, np.ndarray]:
        """World x, z [m] of the points of ``crank_points``."""
        pin.forwardKinematics(self.model, self.data, self.whole(q))
        joints = {loop.joint: self.model.getJointId(f"{loop.joint} rod") for loop in self.loops}
        return {crank_point(joint): self.data.oMi[index].translation[PLANE].copy() for joint, index in joints.items()}

    def placements(self, q: np.ndarray) -> dict[tuple[str, str], pin.SE3]:
        """Frames of cranks and rods at q (2 + n), by (joint, part): each lies along x of its own, from where it turns."""
        pin.forwardKinematics(self.model, self.data, self.whole(q))
        parts = [(loop.joint, part) for loop in self.loops for part in PARTS]
        return {part: self.data.oMi[self.model.getJointId(" ".join(part))].copy() for part in parts}

    def com(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """World x, z of the centre of mass and of its velocity [m, m/s]."""
        whole, S, _ = self._moved(q)
        pin.centerOfMass(self.model, self.data, whole, S @ v)
        return self.data.com[0][PLANE].copy(), self.data.vcom[0][PLANE].copy()

    def energies(self, q: np.ndarray, v: np.ndarray) -> tuple[float, float]:
        """Kinetic, without rotors, and potential energy [J]."""
        whole, S, _ = self._moved(q)
        kinetic = pin.computeKineticEnergy(self.model, self.data, whole, S @ v)
        return float(kinetic), float(pin.computePotentialEnergy(self.model, self.data, whole))
