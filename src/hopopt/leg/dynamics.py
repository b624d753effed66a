"""The leg's equations of motion in CasADi, stance and flight, both in minimal coordinates.

With the body's place and the joint angles q, their speeds v and accelerations a, and the foot's Jacobian J(q),

    M(q) a + h(q, v) = (0, tau) + J(q)' f         rows of the body, on which no joint acts, then of the joints
    J(q) a + (dJ/dt) v = 0                        in stance, where the foot is pinned; in flight f = 0

M, h: mass matrix, and Coriolis, centrifugal, gravity and rotor forces, less what springs beside the drives give; tau: torques
that the drives give the joints; f: contact force. The body
only translates, so J is the unit matrix in its columns: the second equation gives its acceleration from the joints',
and the first equation's body rows are f. What is left gives tau. In flight the body rows say that the centre of mass
falls freely. So one known point gives the body's place from the joint angles: in stance the foot, pinned at the
origin; in flight the centre of mass. No algebraic constraint, no drift, and no momentum for an optimiser to gain from
integration error. Rotors turn as the joints turn the drives (drivetrain/transmission.py), and h bears what that asks.

Where the guides do not follow the foot (x on a vertical slider, y where the leg leaves the plane), the pinned foot
closes a loop: as many joints depend on the others, and as many components of the contact force are free, because
the joints can press against the guides. There the foot is held by accelerations alone, which lets it drift by the
error of integration: verification says by how much.

Cranks and rods of five-bars (leg/closed_chains.py) weigh as parts of the body. With r the place of one's centre of mass from the
body and phi its angle, both of q, what it asks as it moves relative to the body is added: m r'' of the body's rows, and of the
joints' (dr/dq)' m (r'' + a - g) + (d phi/dq)' I phi''.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca

from hopopt.drivetrain.linkages.five_bar import forward
from hopopt.drivetrain.springs import Springs
from hopopt.drivetrain.transmission import turned
from hopopt.leg.closed_chains import SideBody, crank_points, side_bodies
from hopopt.leg.kinematics import PLANE, contact_axes, loop_axes
from hopopt.leg.rigid_body import Frames, com_position, frames, point_position, rnea
from hopopt.leg.robot import BASE, Robot, armatures, link_bodies, link_points

PLANE_ROWS = list(PLANE)


@dataclass(frozen=True)
class DriveMotion:
    """The drives behind their gears at one instant: speeds w (n) [rad/s], the rate (n) [rad/s^2] at which what spins in front of them
    speeds up, over their ratios, and torques tau (n) [N m]."""

    w: ca.SX
    rate: ca.SX
    tau: ca.SX


@dataclass(frozen=True)
class LegMotion:
    """The whole leg at one instant: q, v, a (BASE + n), joint torques tau (n) [N m], contact force f [N]: x and z, or
    x, y and z where the leg leaves the plane; and its drives."""

    q: ca.SX
    v: ca.SX
    a: ca.SX
    tau: ca.SX
    f: ca.SX
    drives: DriveMotion


class LegDynamics:
    """Symbolic dynamics of a leg; ``p`` maps design-parameter paths to numbers or SX symbols."""

    def __init__(self, robot: Robot, p: Mapping[str, Any]):
        self.robot, self.n, self.p = robot, len(robot.joints), p
        self.bodies, self.link_points = link_bodies(robot.leg, p), link_points(robot.leg, p)
        self.springs = Springs.of(robot.leg, p)
        self.contact, self.loops = contact_axes(robot.leg), loop_axes(robot.leg)
        self.slider = "x" not in robot.leg.guides
        fall = robot.model.gravity.linear[PLANE_ROWS]
        self.fall = ca.DM(
            [0.0, fall[1]] if self.slider else fall
        )  # of the centre of mass in flight, where no guide holds it

    def points(self, q: ca.SX) -> dict[str, ca.SX]:
        """World (x, z) [m] of each joint, of the foot and of the centre of mass ("com")."""
        poses = frames(self.robot.model, self.bodies, q)
        places = self.link_points | crank_points(self.robot.leg, self.p, q[BASE:])
        points = {name: point_position(poses, at)[PLANE_ROWS] for name, at in places.items()}
        com = com_position(poses, self.bodies)[PLANE_ROWS]
        total = sum(body.mass for body in self.bodies)
        for body in side_bodies(self.robot.leg, self.p, q[BASE:]):
            com += body.mass * self._from_body(body, poses) / total
        return {**points, "com": com}

    def places(self, q: ca.SX, points: Sequence[tuple[int, Sequence[float]]]) -> list[ca.SX]:
        """World (x, z) [m] of points: the number of the link's joint, -1 of the body, and the place x, z [m] from there."""
        poses = frames(self.robot.model, self.bodies, q)
        return [point_position(poses, (BASE + 1 + joint, (x, 0.0, z)))[PLANE_ROWS] for joint, (x, z) in points]

    def _from_body(self, part: SideBody, poses: Frames) -> ca.SX:
        """Where the centre of mass of a five-bar's link is from the body (x, z) [m], as part of which it weighs in ``bodies``."""
        return (point_position(poses, (part.carrier, part.centre)) - poses.o[BASE])[PLANE_ROWS]

    def _side_forces(self, q: ca.SX, v: ca.SX, a: ca.SX) -> ca.SX:
        """What cranks and rods ask of all coordinates (BASE + n) as they move relative to the body; arguments as of
        ``inverse_dynamics``."""
        q_j, v_j, a_j = q[BASE:], v[BASE:], a[BASE:]
        poses, found = (
            frames(self.robot.model, self.bodies, ca.vertcat(ca.SX.zeros(BASE), q_j)),
            ca.SX.zeros(BASE + self.n),
        )
        rises = a[:BASE] - ca.DM(self.robot.model.gravity.linear[PLANE_ROWS])
        for part in side_bodies(self.robot.leg, self.p, q_j):
            (x, z), joints = (b - a for a, b in zip(part.start, part.end, strict=True)), range(part.carrier - BASE)
            turn = ca.atan2(z, x) + sum(forward(self.robot.leg, k) * q_j[k] for k in joints)
            jacobian = ca.jacobian(ca.vertcat(self._from_body(part, poses), turn), q_j)
            rate = jacobian @ a_j + ca.jtimes(jacobian @ v_j, q_j, v_j)
            push = part.mass * rate[:BASE]
            whole = ca.vertcat(push + part.mass * rises, part.inertia * rate[BASE])
            found += ca.vertcat(push, jacobian.T @ whole)
        return found

    def foot(self, q_j: ca.SX) -> ca.SX:
        """Place of the foot from the body, (x, y, z) [m]."""
        poses = frames(self.robot.model, self.bodies, ca.vertcat(ca.SX.zeros(BASE), q_j))
        return point_position(poses, self.link_points["foot"])

    def inverse_dynamics(self, q: ca.SX, v: ca.SX, a: ca.SX) -> ca.SX:
        """Generalised forces M a + nle less what springs give, shape (BASE + n,); the joints' part of q are symbols."""
        joints = ca.SX.zeros(self.n)
        if self.robot.leg.direct:
            forces = rnea(self.robot.model, self.bodies, q, v, a)
        else:
            bare = [replace(body, armature=0.0) for body in self.bodies]
            rotors = ca.vertcat(*armatures(self.bodies)[BASE:])
            drives = turned(self.robot.leg, self.p, q[BASE:], v[BASE:], a[BASE:])
            forces = rnea(self.robot.model, bare, q, v, a)
            joints += drives.spin.T @ (rotors * drives.rate)
            if self.robot.leg.five_bars:
                forces += self._side_forces(q, v, a)
        if self.springs:
            joints -= ca.vertcat(*self.springs.torques(ca.vertsplit(q[BASE:])))
        elif self.robot.leg.direct:
            return forces
        return forces + ca.vertcat(ca.SX.zeros(BASE), joints)

    def motion(self, q: ca.SX, v: ca.SX, a: ca.SX, tau: ca.SX, f: ca.SX) -> LegMotion:
        """The whole leg with its drives; arguments as its fields."""
        if self.robot.leg.direct:
            return LegMotion(q, v, a, tau, f, DriveMotion(v[BASE:], a[BASE:], tau))
        drives = turned(self.robot.leg, self.p, q[BASE:], v[BASE:], a[BASE:])
        return LegMotion(q, v, a, tau, f, DriveMotion(drives.w, drives.rate, ca.solve(drives.jacobian.T, tau)))

    def stance_pose(self, q_j: ca.SX, v_j: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """q and v (BASE + n) with the foot pinned at the origin, and the foot Jacobian (BASE x n)."""
        foot = self.foot(q_j)[PLANE_ROWS]
        jacobian = ca.jacobian(foot, q_j)
        return ca.vertcat(-foot, q_j), ca.vertcat(-jacobian @ v_j, v_j), jacobian

    def stance(self, q_j: ca.SX, v_j: ca.SX, a_j: ca.SX, loop_force: ca.SX | None = None) -> LegMotion:
        """Both equations with the foot pinned at the origin: f from the body rows, tau from the joint rows.

        q_j, v_j, a_j: symbols of joint angles, speeds and accelerations (n), on a closed loop such as ``closed`` gives
        loop_force: contact force along the loop's axes [N], where the guides carry what the body rows ask for besides
        """
        q, v, jacobian = self.stance_pose(q_j, v_j)
        base_a = -jacobian @ a_j + ca.jtimes(v[:BASE], q_j, v_j)
        a = ca.vertcat(base_a, a_j)
        forces = self.inverse_dynamics(q, v, a)
        f = dict(zip(PLANE, (forces[0], forces[1]), strict=True))
        f |= {axis: loop_force[k] for k, axis in enumerate(self.loops) if loop_force is not None}
        force = ca.vertcat(*[f[axis] for axis in self.contact])
        whole = ca.jacobian(self.foot(q_j)[list(self.contact)], q_j)
        return self.motion(q, v, a, forces[BASE:] - whole.T @ force, force)

    def closed(self, q_j: ca.SX, v_j: ca.SX, free: ca.SX, dependent: Sequence[int]) -> ca.SX:
        """Joint accelerations (n) under which the foot stays where it is along the loop's axes; ``free`` are those of
        the joints that are not ``dependent``."""
        if not self.loops:
            return free
        foot = self.foot(q_j)[list(self.loops)]
        jacobian = ca.jacobian(foot, q_j)
        drift = ca.jtimes(jacobian @ v_j, q_j, v_j)
        others = [k for k in range(self.n) if k not in dependent]
        following = ca.solve(jacobian[:, list(dependent)], -(drift + jacobian[:, others] @ free))
        places = dict(zip(others, ca.vertsplit(free), strict=True)) if others else {}
        places |= dict(zip(dependent, ca.vertsplit(following), strict=True))
        return ca.vertcat(*[places[k] for k in range(self.n)])

    def flight_pose(self, com: ca.SX, com_v: ca.SX, q_j: ca.SX, v_j: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """q and v (BASE + n) with the centre of mass at com [m], com_v [m/s], and its joint Jacobian (BASE x n).

        On a vertical slider the first component of com is where the body stands, and of com_v is zero.
        """
        offset = self.points(ca.vertcat(ca.SX.zeros(BASE), q_j))["com"]
        if self.slider:
            offset = ca.vertcat(0, offset[1])
        jacobian = ca.jacobian(offset, q_j)
        return ca.vertcat(com - offset, q_j), ca.vertcat(com_v - jacobian @ v_j, v_j), jacobian

    def flight(self, com: ca.SX, com_v: ca.SX, q_j: ca.SX, v_j: ca.SX, a_j: ca.SX) -> LegMotion:
        """The first equation with f = 0: the centre of mass falls freely where the guides carry no force; symbols as in
        stance."""
        q, v, jacobian = self.flight_pose(com, com_v, q_j, v_j)
        base_a = self.fall - jacobian @ a_j + ca.jtimes(v[:BASE], q_j, v_j)
        a = ca.vertcat(base_a, a_j)
        return self.motion(q, v, a, self.inverse_dynamics(q, v, a)[BASE:], ca.SX.zeros(len(self.contact)))
