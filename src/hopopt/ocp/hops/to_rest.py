"""A hop that is finished: stance, flight, descent, touchdown, and a landing that ends at rest in the pose of the start.

The landing is a stance: the foot stays where it touched down, the ground pushes, and the drives stop the body. Since it ends
as the hop began, the next hop may follow. docs/landing.md has the equations.
"""

import casadi as ca
import numpy as np

from hopopt.ocp.free_parameters import FreeParameters
from hopopt.ocp.guesses.guess import Guess
from hopopt.ocp.guesses.motion import MovingLeg
from hopopt.ocp.hops.sequence import PhaseSequence, from_rest
from hopopt.ocp.hops.touchdown_impact import impact_limits, landing
from hopopt.ocp.phases import DESCENT, FLIGHT, LANDING, STANCE, descent, joint_scales, landing_stance
from hopopt.ocp.problem import BoundaryConstraint, Ends, linkage
from hopopt.ocp.transitions import handed_over, touchdown


def to_rest(leg: MovingLeg, free_parameters: FreeParameters) -> PhaseSequence:
    """A hop from rest to rest."""
    up = from_rest(leg, free_parameters)
    on_the_ground, _, from_above = touchdown(leg, DESCENT)
    return PhaseSequence(
        (*up.phases, descent(leg), landing_stance(leg)),
        (
            *up.transitions, handed_over(leg, FLIGHT, DESCENT), on_the_ground, from_above,
            *landing(leg, DESCENT, LANDING), *impact_limits(leg, DESCENT), at_rest(leg),
        ),
    )  # fmt: skip


def at_rest(leg: MovingLeg) -> BoundaryConstraint:
    """The landing ends at rest, the joints as at the start."""

    def miss(e: Ends) -> ca.SX:
        end = e.final[LANDING]
        return ca.vertcat(end.q - e.initial[STANCE].q, end.v)

    labels = tuple(f"{what} {name}" for what in "qv" for name in leg.leg.joints)
    return linkage("rest", miss, joint_scales(leg), labels=labels)


def push_backwards(push: Guess) -> Guess:
    """A push in reverse: the leg gives way, and comes to rest where the push began."""
    n = push.x.shape[1] // 2
    x = np.hstack([push.x[::-1, :n], -push.x[::-1, n:]])
    return Guess(push.duration, 1.0 - push.fraction[::-1], x, push.u[::-1])
