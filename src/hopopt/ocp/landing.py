"""The softest landing: a third phase, from the apex to the foot's touchdown, and the energy lost there.

The impact is plastic: the foot stays where it lands (Featherstone, Rigid Body Dynamics Algorithms, 11.6). With the
foot's speed u = J v before it and the mass that the foot shows, (J M^-1 J')^-1, the kinetic energy
u' (J M^-1 J')^-1 u / 2 is lost: smooth, and least at rest.

A foot can meet the ground at rest while the leg folds and the body goes on falling. So the body is no lower at touchdown
than at lift-off: it comes no faster than it went, and has as much way left to stop as the push took.
"""

from dataclasses import replace

import casadi as ca
import numpy as np

from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.kinematics import PLANE
from hopopt.leg.robot import BASE
from hopopt.ocp.guess import Guess
from hopopt.ocp.hop_view import HopView
from hopopt.ocp.objective import HopObjective, demand, lowest_point, no_demand
from hopopt.ocp.problem import INF, BoundaryConstraint, Ends, Phase, linkage

APEX, DESCENT = "flight", "descent"  # the phase that ends at the apex, and the one that ends at touchdown
GRAZE = 1e-5  # share of the reach by which the foot may be below the ground before it has landed
GENTLE = 2e4  # times the usual tie-break: most legs can land at 0 J, and gentle torques decide between such hops


def descent(hop: HopView) -> Phase:
    """Flight again, but downwards; the last instant, where the foot is on the ground, would hold that limit twice."""
    up = hop.flight()
    states = tuple(replace(s, initial=None) for s in up.states)
    path = []
    for c in up.path:
        low = np.array(c.lower, dtype=float)
        if c.name == "height above ground":
            low[[label == "foot" for label in c.labels]] -= GRAZE * hop.reach
        path.append(replace(c, lower=low))
    return replace(up, name=DESCENT, states=states, path=tuple(path), duration=hop.design.hop.descent_duration)


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


def energy_lost(dynamics: LegDynamics, q: ca.SX, v: ca.SX) -> ca.SX:
    """Kinetic energy [J] that a plastic impact of the foot takes, at q and v (BASE + n) before it."""
    a = ca.SX.sym("a", v.numel())
    M = ca.jacobian(dynamics.inverse_dynamics(q, ca.SX.zeros(v.numel()), a), a)
    J, u = foot_before(dynamics, q, v)
    impulse = ca.solve(J @ ca.solve(M, J.T), u)
    return 0.5 * ca.dot(u, impulse)


def _landing(hop: HopView, e: Ends) -> tuple[LegDynamics, ca.SX, ca.SX]:
    """The leg, q and v just before touchdown."""
    s = e.final[DESCENT]
    dynamics = hop.dynamics(s)
    return s.once("pose", lambda: (dynamics, *dynamics.flight_pose(*hop.com_and_speed(s), s.q, s.v)[:2]))


def _boundary(hop: HopView) -> tuple[BoundaryConstraint, ...]:
    """The apex, where the descent begins as flight ends; the touchdown, the foot below the hip and not moving up, the
    body no lower than at lift-off."""

    def handed_over(e: Ends) -> ca.SX:
        a, b = e.final[APEX], e.initial[DESCENT]
        return ca.vertcat(b.com - a.com, b.com_v - a.com_v, b.q - a.q, b.v - a.v)

    def at_apex(e: Ends) -> ca.SX:
        return e.final[APEX].com_v[-1]

    def foot(e: Ends) -> ca.SX:
        dynamics, q, _ = _landing(hop, e)
        points = dynamics.points(q)
        return ca.vertcat(points["foot"][1], points["foot"][0] - points[hop.leg.joints[0]][0])

    def above_lift_off(e: Ends) -> ca.SX:
        s = e.final["stance"]
        return _landing(hop, e)[1][1] - hop.dynamics(s).stance_pose(s.q, s.v)[0][1]

    def sinking(e: Ends) -> ca.SX:
        return foot_before(*_landing(hop, e))[1][hop.contact_axes - 1]

    window = hop.design.hop.foot_window
    scale = [float(x) for s in hop.flight().states for x in s.column("scale")]
    return (
        linkage("apex handed over", handed_over, scale),
        linkage("apex", at_apex, 3.0, unit="m/s"),
        linkage("touchdown", lambda e: foot(e)[0], unit="m"),
        BoundaryConstraint("landing foot window", lambda e: foot(e)[1], -window, window, unit="m"),
        BoundaryConstraint("body at touchdown", above_lift_off, 0.0, INF, unit="m"),
        BoundaryConstraint("touchdown from above", sinking, -INF, 0.0, unit="m/s"),
    )


def landing_guess(hop: HopView, flight: Guess) -> Guess:
    """The joints' flight backwards, which ends with the foot at rest as flight begins, along the fall from its end."""
    m, t = len(hop.falling), flight.fraction * flight.duration
    fall = np.array(hop.robot.model.gravity.linear)[[0, 2]][hop.falling]
    place, speed = flight.x[-1, :m], flight.x[-1, m : 2 * m]
    q, v = np.split(flight.x[::-1, 2 * m :], 2, axis=1)
    com = place + t[:, None] * speed + 0.5 * t[:, None] ** 2 * fall
    x = np.hstack([com, speed + t[:, None] * fall, q, -v])
    return Guess(flight.duration, flight.fraction, x, flight.u[::-1])


IMPACT = HopObjective(
    "impact", "kinetic energy lost when the foot lands, after the descent from the apex", "J",
    lambda hop, e: energy_lost(*_landing(hop, e)), "impact_J", "demand", maximize=False,
    scale=lambda hop: hop.weight * hop.reach, parameters=lambda hop: (demand(hop),),
    boundary=lambda hop: (*lowest_point(hop, "hop.clearance"), *_boundary(hop)),
    fault=no_demand, tie_break=GENTLE, phases=lambda hop: (descent(hop),),
)  # fmt: skip
