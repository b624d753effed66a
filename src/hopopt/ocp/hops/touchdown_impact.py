"""The impact at touchdown, from which the leg goes on in stance: what it leaves, and the limits that protect a robot.

It is plastic: M (v+ - v-) = J' I and J v+ = 0, with the rotors' reflected inertia in M. It is the transition from the
descent to a stance; the costates jump by its multipliers. docs/periodic.md has the equations.
"""

from collections.abc import Callable, Iterator
from typing import Any

import casadi as ca

from hopopt.leg.limit_id import Kind, LimitId
from hopopt.leg.robot import BASE, armatures
from hopopt.ocp.guesses.motion import MovingLeg
from hopopt.ocp.phases import joint_scales
from hopopt.ocp.problem import INF, BoundaryConstraint, Ends, Instant, linkage
from hopopt.ocp.rules import LEFT, RIGHT
from hopopt.ocp.transitions import foot_before, impact_at

IMPACT_PUSH = LimitId(Kind.IMPACT_PUSH, unit="N s")
IMPACT_FRICTION = LimitId(Kind.IMPACT_FRICTION, key="contact.friction", unit="N s")
IMPULSE = LimitId(Kind.IMPULSE, key="hop.touchdown_impulse", unit="N s")
IMPACT_LOSS = LimitId(Kind.IMPACT_LOSS, key="hop.touchdown_loss", unit="J")
FOOT_SPEED = LimitId(Kind.FOOT_SPEED, key="hop.touchdown_speed", unit="m/s")
GEAR_IMPACT = LimitId(Kind.GEAR_IMPACT, key="hop.touchdown_gear_torque", unit="N m")
IMPACT_TIME = 0.1  # [s] on the paper's leg: the weight's impulse in that time is the scale of an impact's impulse


def landing(leg: MovingLeg, before: str, after: str) -> tuple[BoundaryConstraint, ...]:
    """Stance begins with the pose of touchdown, and the joint speeds that the impact leaves."""
    return (impact_leads_to("landing", leg, before, lambda e: e.initial[after]),)


def impact_leads_to(name: str, leg: MovingLeg, before: str, begin: Callable[[Ends], Any]) -> BoundaryConstraint:
    """The joints after the impact have the angles q [rad] and speeds v [rad/s] with which a stance is to ``begin``."""

    def miss(e: Ends) -> ca.SX:
        f, s = e.final[before], begin(e)
        return ca.vertcat(s.q - f.q, s.v - impact_at(leg, f)[0][BASE:])

    labels = tuple(f"{what} {joint}" for what in "qv" for joint in leg.leg.joints)
    return linkage(name, miss, joint_scales(leg), labels=labels)


def impact_limits(leg: MovingLeg, before: str) -> Iterator[BoundaryConstraint]:
    """The ground pushes, within its friction; and the limits that the problem file sets."""
    hop, friction, push = leg.design.hop, leg.design.contact.friction, leg.weight * IMPACT_TIME * leg.scale.time

    def of(what: Callable[[Instant], ca.SX]) -> Callable[[Ends], ca.SX]:
        return lambda e: what(e.final[before])

    def impulse(s: Instant) -> ca.SX:
        return impact_at(leg, s)[1]

    def foot_speed(s: Instant) -> ca.SX:
        return foot_before(leg.dynamics(s), *leg.flight_pose(s))[1]

    yield BoundaryConstraint(IMPACT_PUSH, of(lambda s: impulse(s)[-1]), 0.0, INF, push, "N s")
    if friction is not None:
        both = of(lambda s: ca.vertcat(*[friction * impulse(s)[-1] - way * impulse(s)[0] for way in (1, -1)]))
        yield BoundaryConstraint(IMPACT_FRICTION, both, 0.0, INF, push, "N s", labels=(LEFT, RIGHT))
    for limit, most, value in (
        (IMPULSE, hop.touchdown_impulse, lambda s, most: _size(impulse(s), most)),
        (IMPACT_LOSS, hop.touchdown_loss, lambda s, most: impact_at(leg, s)[2]),
        (FOOT_SPEED, hop.touchdown_speed, lambda s, most: _size(foot_speed(s), most)),
    ):
        if most is not None:
            at_touchdown = of(lambda s, value=value, most=most: value(s, most))
            yield BoundaryConstraint(limit, at_touchdown, -INF, most, most, limit.unit)
    if (most := hop.touchdown_gear_torque) is not None:
        value = of(lambda s: gear_impulse(leg, s) / hop.touchdown_time)
        yield BoundaryConstraint(GEAR_IMPACT, value, -most, most, most, "N m", labels=leg.leg.joints)


def _size(vector: ca.SX, most: float) -> ca.SX:
    """The magnitude of a vector to first order about ``most``, smooth at zero, where a root is not."""
    return (ca.sumsqr(vector) / most + most) / 2


def gear_impulse(leg: MovingLeg, s: Instant) -> ca.SX:
    """What each gear passes on to stop or start its rotor in the impact, joint side [N m s], (n,)."""
    dynamics = leg.dynamics(s)
    rotors = ca.vertcat(*armatures(dynamics.bodies)[BASE:])
    q, v = leg.flight_pose(s)
    after = impact_at(leg, s)[0]
    still = ca.SX.zeros(BASE + leg.n)
    return rotors * dynamics.motion(q, still, after - v, still[BASE:], still[BASE:]).drives.rate
