"""The leg keeps its distance from the body and from itself, by a smooth function of its angles (leg/geometry/smooth.py)."""

from collections.abc import Callable

import casadi as ca
import numpy as np

from hopopt.design import Design
from hopopt.errors import UsageError
from hopopt.leg.geometry.distance import distances_of
from hopopt.leg.geometry.smooth import clearances, least
from hopopt.leg.kinematics import start_angles
from hopopt.leg.limit_id import Kind, LimitId
from hopopt.ocp.guesses.motion import FLIGHT, MovingLeg
from hopopt.ocp.problem import Instant, PathConstraint

COLLISION = LimitId(Kind.COLLISION, key="hop.collision_margin", unit="m")


def collision(leg: MovingLeg, kind: str) -> tuple[PathConstraint, ...]:
    """Every link at least hop.collision_margin from what it moves against [m], and as much further as the smooth distance may
    err; where the hop starts nearer, no nearer than there. UsageError where solids enter each other at the start."""
    found = clearances(leg.design)
    if found is None or not found.links:
        return ()
    start = start_angles(leg.design)
    if any(link.at(start) < -link.error for link in found.links):
        raise UsageError(f"{leg.design.name}: {_overlap(leg.design, start)}")

    def value(s: Instant) -> ca.SX:
        return ca.vertcat(*[link.function(s.q[link.angles]) for link in found.links])

    labels = tuple(link.link for link in found.links)
    return (
        PathConstraint(
            COLLISION, value, least(leg.design, found), scale=leg.reach, unit="m", labels=labels, smooth=False
        ),
    )


def _overlap(design: Design, start: np.ndarray) -> str:
    """Which solids enter each other at angles (n) [rad] of the start, and what to do."""
    solids = distances_of(design)
    distances = solids.all(start[None])[0]
    names, depth = solids.names(solids.pairs[int(distances.argmin())]), -float(distances.min())
    return (
        f"{names[0]} is {depth:.3g} m inside {names[1]} where the hop starts: start otherwise, move or shrink the shapes, or set "
        "hop.may_collide = true"
    )


def slack(leg: MovingLeg, q: ca.SX) -> ca.SX:
    """By how much each link is clear at joint angles q (n) [rad], beyond what a plan keeps [m]; no rows where nothing can be met."""
    rows = [c.value(Instant(q=q)) - ca.DM(c.lower) for c in collision(leg, FLIGHT)]
    return ca.vertcat(*rows) if rows else ca.SX.zeros(0)


def slack_of(leg: MovingLeg) -> Callable[[np.ndarray], np.ndarray] | None:
    """The least of these (k,) [m] of poses (k, n) [rad]; None where nothing can be met."""
    q = ca.SX.sym("q", leg.n)
    rows = slack(leg, q)
    if not rows.numel():
        return None
    function = ca.Function("slack", [q], [ca.mmin(rows)])
    return lambda poses: np.array(function(np.atleast_2d(poses).T)).ravel()
