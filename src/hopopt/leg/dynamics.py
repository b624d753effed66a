"""The leg's equations of motion in CasADi, stance and flight, both in minimal coordinates.

The body only translates, so one known point gives its position from the joint angles: in stance the foot,
pinned at the origin; in flight the centre of mass, which falls freely. No algebraic constraint, no drift, and
no momentum for an optimiser to gain from integration error. Joint torques follow by inverse dynamics; the
contact force is what its base rows ask for.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca

from hopopt.leg.rigid_body import com_position, frames, point_position, rnea
from hopopt.leg.robot import BASE, Robot, link_bodies, link_points

PLANE = [0, 2]  # x and z of a world vector


@dataclass(frozen=True)
class Motion:
    """The whole leg at one instant: q, v, a (BASE + n), joint torques tau (n) [N m], contact force f (2) [N]."""

    q: ca.SX
    v: ca.SX
    a: ca.SX
    tau: ca.SX
    f: ca.SX


class LegDynamics:
    """Symbolic dynamics of a leg; ``p`` maps design-parameter paths to numbers or SX symbols."""

    def __init__(self, robot: Robot, p: Mapping[str, Any]):
        self.robot, self.n = robot, len(robot.joints)
        self.bodies, self.link_points = link_bodies(robot.leg, p), link_points(robot.leg, p)
        self.gravity = ca.DM(robot.model.gravity.linear[PLANE])

    def points(self, q: ca.SX) -> dict[str, ca.SX]:
        """World (x, z) [m] of each joint, of the foot and of the centre of mass ("com")."""
        poses = frames(self.robot.model, self.bodies, q)
        points = {name: point_position(poses, at)[PLANE] for name, at in self.link_points.items()}
        return {**points, "com": com_position(poses, self.bodies)[PLANE]}

    def inverse_dynamics(self, q: ca.SX, v: ca.SX, a: ca.SX) -> ca.SX:
        """Generalised forces M a + nle, shape (BASE + n,)."""
        return rnea(self.robot.model, self.bodies, q, v, a)

    def stance_pose(self, q_j: ca.SX, v_j: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """q and v (BASE + n) with the foot pinned at the origin, and the foot Jacobian (BASE x n)."""
        foot = self.points(ca.vertcat(ca.SX.zeros(BASE), q_j))["foot"]
        jacobian = ca.jacobian(foot, q_j)
        return ca.vertcat(-foot, q_j), ca.vertcat(-jacobian @ v_j, v_j), jacobian

    def stance(self, q_j: ca.SX, v_j: ca.SX, a_j: ca.SX) -> Motion:
        """Stance with the foot pinned at the origin; joint angles, speeds and accelerations are symbols (n)."""
        q, v, jacobian = self.stance_pose(q_j, v_j)
        base_a = -jacobian @ a_j + ca.jtimes(v[:BASE], q_j, v_j)
        a = ca.vertcat(base_a, a_j)
        forces = self.inverse_dynamics(q, v, a)
        f = forces[:BASE]
        return Motion(q, v, a, forces[BASE:] - jacobian.T @ f, f)

    def flight_pose(self, com: ca.SX, com_v: ca.SX, q_j: ca.SX, v_j: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """q and v (BASE + n) with the centre of mass at com [m], com_v [m/s], and its joint Jacobian (BASE x n)."""
        offset = self.points(ca.vertcat(ca.SX.zeros(BASE), q_j))["com"]
        jacobian = ca.jacobian(offset, q_j)
        return ca.vertcat(com - offset, q_j), ca.vertcat(com_v - jacobian @ v_j, v_j), jacobian

    def flight(self, com: ca.SX, com_v: ca.SX, q_j: ca.SX, v_j: ca.SX, a_j: ca.SX) -> Motion:
        """Flight: the centre of mass falls freely, the guides carry no force along x and z; symbols as stance."""
        q, v, jacobian = self.flight_pose(com, com_v, q_j, v_j)
        base_a = self.gravity - jacobian @ a_j + ca.jtimes(v[:BASE], q_j, v_j)
        a = ca.vertcat(base_a, a_j)
        return Motion(q, v, a, self.inverse_dynamics(q, v, a)[BASE:], ca.SX.zeros(BASE))
