"""The leg keeps its distance from the body and from itself, by a smooth function of its angles (leg/geometry/smooth.py)."""

import casadi as ca
import numpy as np

from hopopt.leg.geometry.smooth import clearances, margin_of
from hopopt.leg.kinematics import start_angles
from hopopt.leg.limit_id import Kind, LimitId
from hopopt.ocp.guesses.motion import MovingLeg
from hopopt.ocp.problem import Instant, PathConstraint

COLLISION = LimitId(Kind.COLLISION, key="hop.collision_margin", unit="m")
FROM_START = 1e-6  # of the leg's reach: what the start pose has left


def collision(leg: MovingLeg, kind: str) -> tuple[PathConstraint, ...]:
    """Every link at least hop.collision_margin from what it moves against [m], and as much further as the smooth distance may
    err; where the hop starts nearer, no nearer than there."""
    found = clearances(leg.design)
    if found is None or not found.links:
        return ()
    joints = {name: k + 1 for k, name in enumerate(leg.leg.links)}
    start, margin = start_angles(leg.design), margin_of(leg.design)

    def value(s: Instant) -> ca.SX:
        return ca.vertcat(*[link.function(s.q[: joints[link.link]]) for link in found.links])

    least = [
        min(
            found.levelled(margin + link.error),
            float(np.array(link.function(start[: joints[link.link]])).item()) - FROM_START * found.reach,
        )
        for link in found.links
    ]
    labels = tuple(link.link for link in found.links)
    return (PathConstraint(COLLISION, value, least, scale=leg.reach, unit="m", labels=labels, smooth=False),)
