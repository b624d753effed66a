"""A hop that ends as it began: stance, flight, descent, and an impact that leaves the state in which stance begins.

The impact (ocp/hops/touchdown_impact.py) is the transition from the descent to the stance of the next hop. docs/periodic.md has
the equations.
"""

import casadi as ca
import numpy as np

from hopopt.ocp.free_parameters import FreeParameters
from hopopt.ocp.guesses.guess import Guess
from hopopt.ocp.guesses.motion import MovingLeg
from hopopt.ocp.hops.sequence import PhaseSequence
from hopopt.ocp.hops.touchdown_impact import impact_limits, landing
from hopopt.ocp.phases import DESCENT, FLIGHT, STANCE, descent, flight, stance
from hopopt.ocp.problem import BoundaryConstraint, Ends, linkage
from hopopt.ocp.transitions import handed_over, lift_off, touchdown

STEP_CONSTRAINT = "step"  # the constraint of how far ahead the foot lands


def hop_after_hop(leg: MovingLeg, free_parameters: FreeParameters) -> PhaseSequence:
    """Stance, flight and descent; the next stance begins with the pose of touchdown and the speeds after the impact."""
    on_the_ground, _, from_above = touchdown(leg, DESCENT)
    return PhaseSequence(
        (stance(leg), flight(leg), descent(leg)),
        (
            *lift_off(leg, STANCE, FLIGHT), handed_over(leg, FLIGHT, DESCENT),
            on_the_ground, step(leg, DESCENT), from_above, *landing(leg, DESCENT, STANCE), *impact_limits(leg, DESCENT),
        ),
    )  # fmt: skip


def step(leg: MovingLeg, before: str) -> BoundaryConstraint:
    """The foot lands as far ahead of where it stood as the mean speed takes the body in one period."""

    def miss(e: Ends) -> ca.SX:
        ahead = leg.design.hop.speed * sum(e.duration.values(), ca.SX(0))
        return leg.flight_points(e.final[before])["foot"][0] - ahead

    return linkage(STEP_CONSTRAINT, miss, unit="m")


def there_and_back(leg: MovingLeg, push: Guess) -> Guess:
    """A push backwards, then forwards, no longer than stance may last: the leg gives way, and pushes off."""
    n, s, longest = leg.n, push.fraction / 2, leg.design.hop.stance_duration[1]
    duration = min(2 * push.duration, longest)
    faster = 2 * push.duration / duration
    q, v = push.x[:, :n], push.x[:, n:] * faster
    x = np.vstack([np.hstack([q, -v])[::-1], np.hstack([q, v])[1:]])
    u = np.vstack([push.u[::-1], push.u[1:]]) * faster**2
    return Guess(duration, np.concatenate([0.5 - s[::-1], 0.5 + s[1:]]), x, u)
