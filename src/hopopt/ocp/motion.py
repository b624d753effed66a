"""The leg at an instant: what it is, and how it moves in stance and in flight, as expressions of an instant's symbols.

Joint torques follow from inverse dynamics, so the equations of motion hold by construction.
"""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from hopopt.design import Design
from hopopt.leg.dynamics import LegDynamics, Motion
from hopopt.leg.kinematics import contact_axes, dependent_joints, loop_axes, reach, start_place
from hopopt.leg.robot import BASE, build_robot
from hopopt.leg.scales import force_range, weight
from hopopt.ocp.problem import Instant

STANCE, FLIGHT = "stance", "flight"  # what the leg does


class MovingLeg:
    """A problem's leg, and its motion at an instant.

    robot: the leg as Pinocchio's model and its parameters.
    n: how many joints it has; reach [m], weight [N] and force_range [N] are its scales.
    contact_axes: along how many axes the ground holds the foot.
    loops: axes along which stance closes a loop; dependent, free: joints that follow there, and the others.
    falling: components of (x, z) along which no guide holds the body.
    rules: what holds in its phases (ocp/rules.py).
    """

    rules: Sequence[Callable[["MovingLeg", str], Any]] = ()

    def __init__(self, design: Design):
        self.design, self.leg = design, design.leg
        self.robot = build_robot(design.leg)
        self.n = len(self.leg.joints)
        self.force_range, self.weight = force_range(self.robot.model), weight(self.robot.model)
        self.reach = reach(self.leg)
        self.contact_axes = len(contact_axes(self.leg))
        self.loops, self.dependent = loop_axes(self.leg), dependent_joints(design)
        self.free = [k for k in range(self.n) if k not in self.dependent]
        self.falling = [BASE - 1] if "x" not in self.leg.guides else list(range(BASE))

    @cached_property
    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper joint angles [rad], (n,) each."""
        joints = [self.leg.joint[j] for j in self.leg.joints]
        return np.array([j.lower for j in joints]), np.array([j.upper for j in joints])

    @property
    def point_names(self) -> tuple[str, ...]:
        """Joints and foot."""
        return tuple(self.robot.points)

    def dynamics(self, s: Instant) -> LegDynamics:
        """The leg with the instant's parameters."""
        return s.once("dynamics", lambda: LegDynamics(self.robot, s.p))

    def motion_in(self, kind: str) -> Callable[[Instant], Motion]:
        """The whole leg at an instant of a phase of that kind, "stance" or "flight"."""
        return {STANCE: self.stance_motion, FLIGHT: self.flight_motion}[kind]

    # ---- stance ----------------------------------------------------------------------------------------

    def stance_motion(self, s: Instant) -> Motion:
        """The whole leg in stance."""
        force = s.loop_force if self.loops else None
        return s.once("motion", lambda: self.dynamics(s).stance(s.q, s.v, self.joint_acceleration(s), force))

    def stance_pose(self, s: Instant) -> tuple[ca.SX, ca.SX]:
        """q and v (2 + n) of body and joints in stance."""
        return self.dynamics(s).stance_pose(s.q, s.v)[:2]

    def joint_acceleration(self, s: Instant) -> ca.SX:
        """Of all joints in stance (n) [rad/s^2]: the controls, and what a closed loop makes the others do."""
        return s.once("joint_a", lambda: self.dynamics(s).closed(s.q, s.v, s.a, self.dependent))

    # ---- flight ----------------------------------------------------------------------------------------

    def flight_motion(self, s: Instant) -> Motion:
        """The whole leg in flight."""
        return s.once("motion", lambda: self.dynamics(s).flight(*self.com_and_speed(s), s.q, s.v, s.a))

    def flight_pose(self, s: Instant) -> tuple[ca.SX, ca.SX]:
        """q and v (2 + n) of body and joints in flight."""
        return s.once("pose", lambda: self.dynamics(s).flight_pose(*self.com_and_speed(s), s.q, s.v)[:2])

    def flight_points(self, s: Instant) -> dict[str, ca.SX]:
        """World (x, z) [m] of the leg's points in flight."""
        return s.once("points", lambda: self.dynamics(s).points(self.flight_pose(s)[0]))

    def com_and_speed(self, s: Instant) -> tuple[ca.SX, ca.SX]:
        """Place and speed of the centre of mass in flight, (x, z); on a slider the body's x is that of the start."""
        if len(self.falling) == BASE:
            return s.com, s.com_v
        return ca.vertcat(float(start_place(self.design)[0]), s.com), ca.vertcat(0, s.com_v)
