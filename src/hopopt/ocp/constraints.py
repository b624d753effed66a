"""One function for each physical rule, stated at one instant."""

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

from hopopt.design import Leg, physical_parameters
from hopopt.drivetrain.limits import BACKWARD, FORWARD
from hopopt.drivetrain.region import operating_region
from hopopt.leg.dynamics import LegDynamics, Motion
from hopopt.leg.limit_id import Kind, LimitId
from hopopt.leg.robot import BASE
from hopopt.leg.scales import DESCENT_RANGE
from hopopt.ocp.problem import INF, Instant, PathConstraint

MotionAt = Callable[[Instant], Motion]
DynamicsAt = Callable[[Instant], LegDynamics]
LEFT, RIGHT = "left", "right"
GROUND_FORCE = LimitId(Kind.GROUND_FORCE, key="contact.least_force", unit="N")
FRICTION = LimitId(Kind.FRICTION, key="contact.friction", unit="N")
HEIGHT = LimitId(Kind.HEIGHT, key="hop.least_height", unit="m")
NO_DESCENT = LimitId(Kind.DESCENT, key="hop.counter_movement", unit="m/s")


def operating_region_constraint(
    leg: Leg, joint: str, motion: MotionAt, asked: Callable[[Instant], ca.SX]
) -> PathConstraint:
    """-1 <= a tau + b w <= 1 for every pair of half-planes of the joint's operating region (paper, eq. 13); tau is what
    the motor is ``asked`` for [N m]."""
    k = leg.joints.index(joint)

    def value(s: Instant) -> ca.SX:
        return ca.vertcat(*operating_region(leg, joint, s.p).use(motion(s).v[BASE + k], asked(s))[::2])

    planes = operating_region(leg, joint, physical_parameters(leg)).planes  # each followed by its mirror image
    labels = tuple(h.line for h in planes[::2])
    return PathConstraint(LimitId(Kind.REGION, joint), value, -1.0, 1.0, scale=2.0, labels=labels)


def unilateral_contact(motion: MotionAt, size: float, least: float) -> PathConstraint:
    """The ground only pushes: f_z >= least [N]; ``size`` [N] is the range by which excess is measured."""
    return PathConstraint(GROUND_FORCE, lambda s: motion(s).f[-1], lower=least, scale=size, unit=GROUND_FORCE.unit)


def friction_cone(motion: MotionAt, friction: float, size: float, axes: int = 2) -> PathConstraint:
    """|f_x| <= mu f_z [N], as two half-planes; ``size`` [N] as for ``unilateral_contact``.

    Where the foot is held sideways too, a pyramid within the cone: |f_x|, |f_y| <= mu f_z / sqrt(2).
    """
    labels = (FORWARD, BACKWARD) if axes == 2 else (FORWARD, BACKWARD, LEFT, RIGHT)

    def value(s: Instant) -> ca.SX:
        f = motion(s).f
        most = f[-1] * friction * steepness(axes)
        return ca.vertcat(*[most + sign * f[k] for k in range(axes - 1) for sign in (-1, 1)])

    return PathConstraint(FRICTION, value, lower=0.0, scale=size, unit=FRICTION.unit, labels=labels)


def steepness(axes: int) -> float:
    """What each side of the friction cone (2 axes held), or of the pyramid within it (3), has of the friction coefficient."""
    return 1.0 if axes == 2 else 1 / np.sqrt(2)


def above_ground(
    names: Sequence[str], motion: MotionAt, dynamics: DynamicsAt, size: float, least: float
) -> PathConstraint:
    """Heights of the named points >= least [m], of the foot >= 0."""

    def value(s: Instant) -> ca.SX:
        points = dynamics(s).points(motion(s).q)
        return ca.vertcat(*[points[name][1] for name in names])

    lower = [0.0 if name == "foot" else least for name in names]
    return PathConstraint(HEIGHT, value, lower=lower, scale=size, unit=HEIGHT.unit, labels=tuple(names))


def no_counter_movement(motion: MotionAt) -> PathConstraint:
    """The body never descends in stance: z' >= 0 [m/s]."""
    return PathConstraint(NO_DESCENT, lambda s: motion(s).v[1], 0.0, INF, DESCENT_RANGE, unit=NO_DESCENT.unit)
