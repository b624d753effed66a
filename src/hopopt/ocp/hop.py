"""The hop as a multi-phase problem: stance in minimal coordinates, then flight up to the apex.

Controls are the joint accelerations; the joint torques follow from inverse dynamics, so the equations of
motion hold by construction and the drives enter as path constraints on the torque they would need.
"""

from collections.abc import Callable
from copy import copy
from dataclasses import replace
from functools import cached_property

import casadi as ca
import numpy as np

from hopopt.design import Design
from hopopt.errors import UsageError
from hopopt.leg.actuator import operating_region
from hopopt.leg.dynamics import LegDynamics, Motion
from hopopt.leg.kinematics import contact_axes, dependent_joints, loop_axes, reach, start_place
from hopopt.leg.robot import BASE, build_robot
from hopopt.leg.scales import force_range, weight
from hopopt.ocp.constraints import (
    MotionAt,
    above_ground,
    friction_cone,
    no_counter_movement,
    operating_region_constraint,
    unilateral_contact,
)
from hopopt.ocp.custom import Custom, checked
from hopopt.ocp.custom import path as custom_path
from hopopt.ocp.free_parameters import Freedom
from hopopt.ocp.objective import HopObjective
from hopopt.ocp.objectives import find
from hopopt.ocp.problem import (
    INF,
    Control,
    Ends,
    Instant,
    Objective,
    PathConstraint,
    Phase,
    Problem,
    State,
    linkage,
)

STANCE, FLIGHT = "stance", "flight"
FIXED = Freedom()
LOOPED = 10.0  # times the tie-break, of a leg that closes a loop in stance: there torques can hold against each other
EFFORT = "effort"  # the integral of the tie-break
SPEED, ACCELERATION = 10.0, 300.0  # scales of joint speed [rad/s] and acceleration [rad/s^2]
BODY_SPEED = 3.0  # scale of the body's speed [m/s]


class Hop:
    """One hop of a leg towards an objective; ``problem`` is what the transcription sees."""

    def __init__(
        self, design: Design, objective: str | HopObjective = "clearance", freedom: Freedom = FIXED,
        constraints: tuple[Custom, ...] = (),
    ):  # fmt: skip
        self.design, self.leg, self.objective = design, design.leg, find(objective)
        self.freedom, self.constraints = freedom, constraints
        self.asked = objective if isinstance(objective, str) else self.objective
        if fault := self.objective.fault(design):
            raise UsageError(f"objective {self.objective.name}: {fault}")
        self.robot = build_robot(design.leg)
        self.n = len(self.leg.joints)
        self.force_range, self.weight = force_range(self.robot.model), weight(self.robot.model)
        self.reach = reach(self.leg)
        self.contact_axes = len(contact_axes(self.leg))
        self.loops, self.dependent = loop_axes(self.leg), dependent_joints(design)
        self.free = [k for k in range(self.n) if k not in self.dependent]
        self.falling = [BASE - 1] if "x" not in self.leg.guides else list(range(BASE))  # where no guide holds the body

        for c in (*constraints, *((self.objective.custom,) if self.objective.custom else ())):
            checked(c, self, c is self.objective.custom)

    def with_solver_of(self, design: Design) -> "Hop":
        """The same question, to be answered with the solver settings of a problem that differs in nothing else."""
        other = copy(self)
        other.design = design
        return other

    # ---- what holds at an instant ----------------------------------------------------------------------

    def dynamics(self, s: Instant) -> LegDynamics:
        """The leg with the instant's parameters."""
        return s.once("dynamics", lambda: LegDynamics(self.robot, s.p))

    def stance_motion(self, s: Instant) -> Motion:
        """The whole leg in stance."""
        force = s.loop_force if self.loops else None
        return s.once("motion", lambda: self.dynamics(s).stance(s.q, s.v, self.joint_acceleration(s), force))

    def joint_acceleration(self, s: Instant) -> ca.SX:
        """Of all joints in stance (n) [rad/s^2]: the controls, and what a closed loop makes the others do."""
        return s.once("joint_a", lambda: self.dynamics(s).closed(s.q, s.v, s.a, self.dependent))

    def flight_motion(self, s: Instant) -> Motion:
        """The whole leg in flight."""
        return s.once("motion", lambda: self.dynamics(s).flight(*self.com_and_speed(s), s.q, s.v, s.a))

    def com_and_speed(self, s: Instant) -> tuple[ca.SX, ca.SX]:
        """Place and speed of the centre of mass in flight, (x, z); on a slider the body's x is that of the start."""
        if len(self.falling) == BASE:
            return s.com, s.com_v
        return ca.vertcat(float(start_place(self.design)[0]), s.com), ca.vertcat(0, s.com_v)

    def points_at_end(self, e: Ends) -> dict[str, ca.SX]:
        """World (x, z) [m] of the leg's points at the end of flight."""
        s = e.final[FLIGHT]
        pose = self.dynamics(s).flight_pose
        return s.once("points", lambda: self.dynamics(s).points(pose(*self.com_and_speed(s), s.q, s.v)[0]))

    @property
    def point_names(self) -> tuple[str, ...]:
        """Joints and foot."""
        return tuple(self.robot.points)

    def effort(self, tau: ca.SX, s: Instant) -> ca.SX:
        """Sum over the joints of (tau / stall torque)^2, for the tie-break."""
        stalls = [
            s.p[self.leg.drive(j, "gear", "ratio")[0]] * s.p[self.leg.drive(j, "motor", "max_torque")[0]]
            for j in self.leg.joints
        ]
        return ca.sumsqr(tau / ca.vertcat(*stalls))

    def own_limits(self, phase: str, motion: MotionAt) -> list[PathConstraint]:
        """What the objective and the user's own constraints add to a phase."""
        own = (custom_path(c, self, phase, motion) for c in self.constraints)
        return [c for group in (self.objective.path(self, phase, motion), *own) for c in group]

    def integrands(self, motion: MotionAt) -> dict[str, Callable[[Instant], ca.SX]]:
        """What is integrated over a phase: the effort of the tie-break, and what the objective asks for."""
        return {EFFORT: lambda s: self.effort(motion(s).tau, s), **self.objective.integrands(self, motion)}

    # ---- the phases ------------------------------------------------------------------------------------

    @cached_property
    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper joint angles [rad], (n,) each."""
        joints = [self.leg.joint[j] for j in self.leg.joints]
        return np.array([j.lower for j in joints]), np.array([j.upper for j in joints])

    def stance(self) -> Phase:
        names, (lower, upper) = self.leg.joints, self.limits
        motion = self.stance_motion
        path = [operating_region_constraint(self.leg, j, motion) for j in names]
        path.append(unilateral_contact(motion, self.force_range, self.design.contact.least_force))
        if self.design.contact.friction is not None:
            path.append(friction_cone(motion, self.design.contact.friction, self.force_range, self.contact_axes))
        clear, least = [name for name in self.design.hop.above_ground if name != "foot"], self.design.hop.least_height
        if clear:
            path.append(above_ground(clear, motion, self.dynamics, self.reach, least))
        if not self.design.hop.counter_movement:
            path.append(no_counter_movement(motion))
        path += self.own_limits(STANCE, motion)
        return Phase(
            STANCE,
            (
                State("q", self.n, lower, upper, 1.0, "rad", names, initial=self.freedom.start(self)),
                State("v", self.n, scale=SPEED, unit="rad/s", labels=names, initial=np.zeros(self.n)),
            ),
            (*self.stance_controls(), *self.objective.controls(self)),
            lambda s: {"q": s.v, "v": self.joint_acceleration(s)},
            self.design.hop.stance_duration,
            tuple(path),
            self.integrands(motion),
        )

    def stance_controls(self) -> tuple[Control, ...]:
        """Accelerations of the joints that no closed loop moves, and the contact force along the loop's axes."""
        labels = tuple(self.leg.joints[k] for k in self.free)
        controls = (Control("a", len(labels), scale=ACCELERATION, unit="rad/s^2", labels=labels),) if labels else ()
        if not self.loops:
            return controls
        size, axes = self.weight, tuple("xyz"[axis] for axis in self.loops)
        return (*controls, Control("loop_force", len(axes), scale=size, unit="N", labels=axes))

    def flight(self) -> Phase:
        motion, (lower, upper) = self.flight_motion, self.limits
        path: list[PathConstraint] = [operating_region_constraint(self.leg, j, motion) for j in self.leg.joints]
        clear, least = self.design.hop.above_ground, self.design.hop.least_height
        path.append(above_ground(clear, motion, self.dynamics, self.reach, least))
        path += self.own_limits(FLIGHT, motion)
        plane, names, m = tuple("xz"[k] for k in self.falling), self.leg.joints, len(self.falling)
        rises = ([-INF, 0.0][-m:], [INF] * m)
        return Phase(
            FLIGHT,
            (
                State("com", m, scale=1.0, unit="m", labels=plane),
                State("com_v", m, scale=BODY_SPEED, unit="m/s", labels=plane, initial=rises),
                State("q", self.n, lower, upper, 1.0, "rad", names),
                State("v", self.n, scale=SPEED, unit="rad/s", labels=names),
            ),
            (
                Control("a", self.n, scale=ACCELERATION, unit="rad/s^2", labels=names),
                *self.objective.controls(self),
            ),
            lambda s: {"com": s.com_v, "com_v": self.dynamics(s).gravity[self.falling], "q": s.v, "v": s.a},
            self.design.hop.flight_duration,
            tuple(path),
            self.integrands(motion),
        )

    def lift_off(self, e: Ends) -> ca.SX:
        """What flight begins with less what stance ends with: centre of mass and joints, place and speed."""
        s, f = e.final[STANCE], e.initial[FLIGHT]
        q = self.dynamics(s).stance_pose(s.q, s.v)[0]
        com = self.dynamics(s).points(q)["com"][self.falling]
        return ca.vertcat(f.com - com, f.com_v - ca.jtimes(com, s.q, s.v), f.q - s.q, f.v - s.v)

    def goal_and_tie_break(self, e: Ends) -> ca.SX:
        """The objective, made a little worse by the effort."""
        effort = sum(integrals[EFFORT] for integrals in e.integral.values())
        return self.objective.value(self, e) - self.objective.sign * self.tie_break * effort

    @property
    def tie_break(self) -> float:
        """Weight of the effort in the objective [objective's unit per second]."""
        looped = LOOPED if self.loops else 1.0
        return looped * self.design.solver.tie_break * self.objective.tie_break * self.objective.scale(self)

    @cached_property
    def problem(self) -> Problem:
        """The multi-phase problem; every physical parameter of the leg is a parameter of it."""
        goal = self.objective
        m = len(self.falling)
        scale = np.r_[np.ones(m), np.full(m, BODY_SPEED), np.ones(self.n), np.full(self.n, SPEED)]
        labels = tuple(f"{what} {'xz'[k]}" for what in ("com", "com_v") for k in self.falling)
        labels += tuple(f"{what} {name}" for what in "qv" for name in self.leg.joints)
        return Problem(
            self.design.name,
            (self.stance(), self.flight(), *goal.phases(self)),
            Objective(goal.name, self.goal_and_tie_break, goal.maximize, goal.unit, goal.scale(self)),
            (*self.freedom.parameters(self.robot.parameters), *goal.parameters(self)),
            (
                linkage("lift-off", self.lift_off, scale, labels=labels),
                *goal.boundary(self),
                *self.freedom.boundary(self),
            ),
        )

    @property
    def untied(self) -> Problem:
        """The problem without the tie-break."""
        return self.problem.towards(replace(self.problem.objective, value=lambda e: self.objective.value(self, e)))

    @property
    def tie_break_bias(self) -> float:
        """What the tie-break can have cost the objective at most [its unit]: weight x longest hop x largest effort.

        A region that no half-plane closes is taken up to twice its stall torque.
        """
        longest = sum(phase.duration[1] for phase in self.problem.phases)
        effort, p = 0.0, self.robot.parameters
        for joint in self.leg.joints:
            stall = p[self.leg.drive(joint, "gear", "ratio")[0]] * p[self.leg.drive(joint, "motor", "max_torque")[0]]
            effort += float(np.max(np.abs(operating_region(self.leg, joint, p).corners()[:, 1]))) ** 2 / stall**2
        return self.tie_break * effort * longest
