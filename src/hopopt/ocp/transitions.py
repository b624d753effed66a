"""What one phase hands over to the next: lift-off, the apex, touchdown; to be listed in any order.

Each is a function of the leg and the names of the phases before and after, and gives boundary constraints.
"""

from collections.abc import Callable

import casadi as ca
import numpy as np

from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.kinematics import PLANE
from hopopt.leg.limit_id import Kind, LimitId
from hopopt.leg.robot import BASE
from hopopt.ocp.guesses.motion import MovingLeg
from hopopt.ocp.phases import body_speed, joint_scales, length
from hopopt.ocp.problem import INF, BoundaryConstraint, Ends, Instant, linkage

Transition = Callable[[MovingLeg, str, str], tuple[BoundaryConstraint, ...]]
LANDING_WINDOW = LimitId(Kind.LANDING_WINDOW, key="hop.foot_window", unit="m")


def flight_scales(leg: MovingLeg) -> np.ndarray:
    """Scales of the states of flight: com, com_v, q, v."""
    m = len(leg.falling)
    return np.concatenate([np.repeat([length(leg), body_speed(leg)], m), joint_scales(leg)])


def lift_off(leg: MovingLeg, before: str, after: str) -> tuple[BoundaryConstraint, ...]:
    """Flight begins with what stance ends with: centre of mass and joints, place and speed."""

    def miss(e: Ends) -> ca.SX:
        s, f = e.final[before], e.initial[after]
        com = leg.dynamics(s).points(leg.stance_pose(s)[0])["com"][leg.falling]
        return ca.vertcat(f.com - com, f.com_v - ca.jtimes(com, s.q, s.v), f.q - s.q, f.v - s.v)

    labels = tuple(f"{what} {'xz'[k]}" for what in ("com", "com_v") for k in leg.falling)
    labels += tuple(f"{what} {name}" for what in "qv" for name in leg.leg.joints)
    return linkage("lift-off", miss, flight_scales(leg), labels=labels), *_foot_comes_off(leg, after)


def _foot_comes_off(leg: MovingLeg, phase: str) -> tuple[BoundaryConstraint, ...]:
    """The foot does not begin flight downwards, where no torque can jump: the heights of a phase follow from it, but late."""
    if not leg.no_jumps:
        return ()

    def acceleration(e: Ends) -> ca.SX:
        s, height = e.initial[phase], leg.flight_points(e.initial[phase])["foot"][1]
        speed = ca.jtimes(height, s.com, s.com_v) + ca.jtimes(height, s.q, s.v)
        places = ca.vertcat(s.com, s.q, s.com_v, s.v)
        return ca.jtimes(
            speed, places, ca.vertcat(s.com_v, s.v, leg.dynamics(s).fall[leg.falling], leg.flight_acceleration(s))
        )

    return (BoundaryConstraint("foot comes off", acceleration, 0.0, INF, 10.0 * leg.scale.gravity, "m/s^2"),)


def handed_over(leg: MovingLeg, before: str, after: str) -> BoundaryConstraint:
    """Flight goes on in the next phase as the one before it ends."""

    def miss(e: Ends) -> ca.SX:
        a, b = e.final[before], e.initial[after]
        return ca.vertcat(b.com - a.com, b.com_v - a.com_v, b.q - a.q, b.v - a.v)

    return linkage("apex handed over", miss, flight_scales(leg).tolist())


def apex(leg: MovingLeg, before: str, after: str) -> tuple[BoundaryConstraint, ...]:
    """The descent begins as flight ends, where the centre of mass neither rises nor falls."""
    return (
        handed_over(leg, before, after),
        linkage("apex", lambda e: e.final[before].com_v[-1], body_speed(leg), unit="m/s"),
    )


def touchdown(leg: MovingLeg, before: str) -> tuple[BoundaryConstraint, ...]:
    """A phase ends with the foot on the ground, within its window of the hip's plumb line, and not moving up."""

    def foot(e: Ends) -> ca.SX:
        points = leg.flight_points(e.final[before])
        return ca.vertcat(points["foot"][1], points["foot"][0] - points[leg.leg.joints[0]][0])

    def sinking(e: Ends) -> ca.SX:
        s = e.final[before]
        return foot_before(leg.dynamics(s), *leg.flight_pose(s))[1][leg.contact_axes - 1]

    window = leg.design.hop.foot_window
    return (
        linkage("touchdown", lambda e: foot(e)[0], length(leg), unit="m"),
        BoundaryConstraint(LANDING_WINDOW, lambda e: foot(e)[1], -window, window, length(leg), "m"),
        BoundaryConstraint("touchdown from above", sinking, -INF, 0.0, leg.scale.speed, "m/s"),
    )


def foot_before(dynamics: LegDynamics, q: ca.SX, v: ca.SX) -> tuple[ca.SX, ca.SX]:
    """What an impact stops: rows of the foot's Jacobian (k, BASE + n) along the axes of the contact force, then of a body
    that no guide lets move; and the speeds (k,) [m/s] along them."""
    world, n = ca.SX.zeros(3, BASE), dynamics.n
    for k, axis in enumerate(PLANE):
        world[axis, k] = 1
    joints = ca.SX.sym("joints", n)
    inner = ca.substitute(ca.jacobian(dynamics.foot(joints), joints), joints, q[BASE:])
    rows = ca.horzcat(world, inner)[list(dynamics.contact), :]
    if dynamics.slider:
        rows = ca.vertcat(rows, ca.SX.eye(BASE + n)[0, :])
    return rows, rows @ v


def impact_at(leg: MovingLeg, s: Instant) -> tuple[ca.SX, ca.SX, ca.SX]:
    """The impact of an instant of flight, as ``impact`` gives it."""
    return s.once("impact", lambda: impact(leg.dynamics(s), *leg.flight_pose(s)))


def impact(dynamics: LegDynamics, q: ca.SX, v: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """A plastic impact of the foot at q and v (2 + n) before it: v (2 + n) after it, what the ground (and a guide)
    gives to the leg (k,) [N s], and the kinetic energy lost [J]."""
    a = ca.SX.sym("a", v.numel())
    M = ca.jacobian(dynamics.inverse_dynamics(q, ca.SX.zeros(v.numel()), a), a)
    J, u = foot_before(dynamics, q, v)
    by_force = ca.solve(M, J.T)
    impulse = ca.solve(J @ by_force, u)
    return v - by_force @ impulse, -impulse, 0.5 * ca.dot(u, impulse)
