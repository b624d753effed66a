"""The leg at an instant: what it is, and how it moves in stance and in flight, as expressions of an instant's symbols.

Joint torques follow from inverse dynamics, so the equations of motion hold by construction.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from hopopt.design import Design
from hopopt.design.parameters import numbers_beside_leg
from hopopt.drivetrain.dynamics import added_states
from hopopt.drivetrain.gear import any_lossy
from hopopt.errors import UsageError
from hopopt.leg.dynamics import DriveMotion, LegDynamics, LegMotion
from hopopt.leg.kinematics import contact_axes, dependent_joints, loop_axes, reach, start_place
from hopopt.leg.robot import BASE, build_robot
from hopopt.leg.scales import Scale, force_range, time_scale, weight
from hopopt.ocp.problem import Instant

STANCE, FLIGHT = "stance", "flight"  # what the leg does
MotionAt = Callable[[Instant], LegMotion]  # the whole leg at an instant of a phase


class MovingLeg:
    """A problem's leg, and its motion at an instant.

    robot: the leg as Pinocchio's model and its parameters.
    n: how many joints it has; reach [m], weight [N], force_range [N] and time_scale [s] are its scales.
    scale: its units over those of the paper's leg.
    contact_axes: along how many axes the ground holds the foot.
    loops: axes along which stance closes a loop; dependent: joints that follow there; free: those whose accelerations are
    controls in stance.
    falling: components of (x, z) along which no guide holds the body.
    drive_states: what the drives add, in numbers.
    rules: what holds in its phases (ocp/rules.py).
    """

    rules: Sequence[Callable[["MovingLeg", str], Any]] = ()

    def __init__(self, design: Design):
        self.design, self.leg = design, design.leg
        self.robot = build_robot(design.leg)
        self.n = len(self.leg.joints)
        self.force_range, self.weight = force_range(self.robot.model), weight(self.robot.model)
        self.reach, self.scale = reach(self.leg), Scale.of(self.leg)
        self.time_scale = time_scale(self.robot.model, self.reach)
        self.contact_axes = len(contact_axes(self.leg))
        self.loops, self.dependent = loop_axes(self.leg), dependent_joints(design)
        self.free = [k for k in range(self.n) if k not in self.dependent]
        self.falling = [BASE - 1] if "x" not in self.leg.guides else list(range(BASE))
        self.drive_states = added_states(self.leg, self.robot.parameters)
        if self.drive_states.size:
            self.free = [k for k in self.free if k not in self.drive_states.at]
            if any_lossy(self.leg) and len(self.drive_states.sprung) < len(self.drive_states.of):
                raise UsageError(
                    f"{design.name}: drives with states of their own are planned with gears that lose nothing: leave out "
                    "leg.gear.efficiency, friction and damping"
                )
            if self.loops:
                raise UsageError(
                    f"{design.name}: this leg closes a loop with its guides in stance, where drives cannot have states of their own"
                )
        if design.contact.force_rate is not None and not self.no_jumps:
            raise UsageError(
                f"{design.name}: where a torque jumps the ground force does too, so contact.force_rate needs leg.motor.torque_rate: "
                "give it for every motor, or a series spring at every joint"
            )

    @property
    def no_jumps(self) -> bool:
        """Whether no torque can jump: all are states whose rates are limited, or of springs."""
        return self.drive_states.steady == self.n

    @cached_property
    def numbers(self) -> dict[str, float]:
        """Every number of the problem that is a parameter of its program, by path."""
        return {**self.robot.parameters, **numbers_beside_leg(self.design)}

    @cached_property
    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper joint angles [rad], (n,) each."""
        joints = [self.leg.joint[j] for j in self.leg.joints]
        return np.array([j.lower for j in joints]), np.array([j.upper for j in joints])

    @property
    def point_names(self) -> tuple[str, ...]:
        """Joints and foot, and what else may be lowest."""
        return self.robot.point_names

    def dynamics(self, s: Instant) -> LegDynamics:
        """The leg with the instant's parameters."""
        return s.once("dynamics", lambda: LegDynamics(self.robot, s.p))

    def motion_in(self, kind: str) -> MotionAt:
        """The whole leg at an instant of a phase of that kind, "stance" or "flight"."""
        return {STANCE: self.stance_motion, FLIGHT: self.flight_motion}[kind]

    # ---- stance ----------------------------------------------------------------------------------------

    def stance_motion(self, s: Instant) -> LegMotion:
        """The whole leg in stance."""
        force = s.loop_force if self.loops else None
        dynamics = self.dynamics(s)
        return s.once("motion", lambda: self._driven(s, dynamics.stance(s.q, s.v, self.joint_acceleration(s), force)))

    def _driven(self, s: Instant, m: LegMotion) -> LegMotion:
        """The motion with drives behind series springs as they move themselves; where nothing is commanded, as it is."""
        states = self.drive_states
        if not states.sprung or not hasattr(s, "command"):
            return m
        d, own = m.drives, added_states(self.leg, s.p)
        w, rate, tau = (ca.vertsplit(each) for each in (d.w, d.rate, d.tau))
        rates = own.rates(ca.vertsplit(s.drive), self.commands(s), ca.vertsplit(s.v))
        for k, place in states.sprung.items():
            w[k], rate[k], tau[k] = s.drive[place], rates[place], tau[k] + own.rotors[k] * rates[place]
        return replace(m, drives=DriveMotion(ca.vertcat(*w), ca.vertcat(*rate), ca.vertcat(*tau)))

    def stance_pose(self, s: Instant) -> tuple[ca.SX, ca.SX]:
        """q and v (2 + n) of body and joints in stance."""
        return self.dynamics(s).stance_pose(s.q, s.v)[:2]

    def joint_acceleration(self, s: Instant) -> ca.SX:
        """Of all joints in stance (n) [rad/s^2]: the controls, and what a closed loop makes the others do."""
        if self.drive_states.size:
            return s.once("joint_a", lambda: self._moved(s, lambda a: self.dynamics(s).stance(s.q, s.v, a)))
        return s.once("joint_a", lambda: self.dynamics(s).closed(s.q, s.v, s.a, self.dependent))

    def _moved(self, s: Instant, motion: Callable[[ca.SX], LegMotion]) -> ca.SX:
        """Accelerations (n): the controls, and those of the joints whose drives have states, from the torques that these
        states give. Torques are affine in accelerations, tau = M a + h, so M_dd a_d = tau_d - h_d - M_do a_o."""
        at, a = self.drive_states.at, ca.SX.sym("a", self.n)
        torque, others = motion(a).tau[at], [k for k in range(self.n) if k not in at]
        M, h = ca.jacobian(torque, a), ca.substitute(torque, a, ca.SX.zeros(self.n))
        given = ca.vertcat(*added_states(self.leg, s.p).torques(s.drive, self.asked_torques(s), s.v))
        own = ca.solve(M[:, at], given - h - (M[:, others] @ s.a if others else 0))
        places = dict(zip(at, ca.vertsplit(own), strict=True))
        places |= dict(zip(others, ca.vertsplit(s.a), strict=True)) if others else {}
        return ca.vertcat(*[places[k] for k in range(self.n)])

    def asked_torques(self, s: Instant) -> list[Any]:
        """What motors are asked for [N m] whose drives have states; None for the others."""
        return self.drive_states.asked(ca.vertsplit(s.drive), self.commands(s))

    def commands(self, s: Instant) -> list[Any]:
        """What is controlled of the joints whose drives have states, a torque [N m] or its rate [N m/s]; None for the others."""
        given = (
            ca.vertsplit(s.command) if hasattr(s, "command") else [None] * len(self.drive_states.at)
        )  # ends have none
        own = dict(zip(self.drive_states.at, given, strict=True))
        return [own.get(k) for k in range(self.n)]

    def torque_rate(self, s: Instant, k: int) -> Any:
        """How fast the torque of joint k's motor changes [N m/s] where that is controlled; None where it may jump."""
        return self.commands(s)[k] if k in self.drive_states.limited else None

    # ---- flight ----------------------------------------------------------------------------------------

    def flight_motion(self, s: Instant) -> LegMotion:
        """The whole leg in flight."""
        return s.once("motion", lambda: self._driven(s, self._flying(s, self.flight_acceleration(s))))

    def acceleration(self, s: Instant) -> ca.SX:
        """Of all joints (n) [rad/s^2], at an instant of any phase."""
        return self.flight_acceleration(s) if hasattr(s, "com") else self.joint_acceleration(s)

    def flight_acceleration(self, s: Instant) -> ca.SX:
        """Of all joints in flight (n) [rad/s^2]: the controls, and what drives with states of their own make the others do."""
        if self.drive_states.size:
            return s.once("joint_a", lambda: self._moved(s, lambda a: self._flying(s, a)))
        return s.a

    def _flying(self, s: Instant, a: ca.SX) -> LegMotion:
        return self.dynamics(s).flight(*self.com_and_speed(s), s.q, s.v, a)

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
