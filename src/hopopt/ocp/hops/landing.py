"""The softest landing: a third phase, from the apex to the foot's touchdown, and the energy lost there.

The impact is plastic: the foot stays where it lands (Featherstone, Rigid Body Dynamics Algorithms, 11.7). Before it
the foot's speed is u = J v, and the mass that the foot shows is L = (J M^-1 J')^-1. The kinetic energy u' L u / 2 is
lost: smooth, and least at rest.

A foot can meet the ground at rest while the leg folds and the body goes on falling. So the body is no lower at touchdown
than at lift-off: it comes no faster than it went, and has as much way left to stop as the push took.
"""

import casadi as ca
import numpy as np

from hopopt.ocp.free_parameters import FreeParameters
from hopopt.ocp.guesses.guess import Guess
from hopopt.ocp.guesses.motion import MovingLeg
from hopopt.ocp.hops.sequence import PhaseSequence, from_rest
from hopopt.ocp.objectives.objective import AT_CLEARANCE, HopObjective
from hopopt.ocp.phases import DESCENT, FLIGHT, STANCE, descent
from hopopt.ocp.problem import INF, BoundaryConstraint, Ends
from hopopt.ocp.transitions import apex, impact_at, touchdown

TIE_BREAK_FACTOR = (
    5.5e3  # times the usual tie-break, in the leg's own time: most legs can land at 0 J, and gentle torques decide
)


def to_touchdown(leg: MovingLeg, free_parameters: FreeParameters) -> PhaseSequence:
    """A hop from rest, and the descent from its apex to touchdown."""
    up = from_rest(leg, free_parameters)
    on_the_ground, window, from_above = touchdown(leg, DESCENT)
    return PhaseSequence(
        (*up.phases, descent(leg)),
        (*up.transitions, *apex(leg, FLIGHT, DESCENT), on_the_ground, window, body_above_lift_off(leg), from_above),
    )


def body_above_lift_off(leg: MovingLeg) -> BoundaryConstraint:
    """The body is no lower at touchdown than at lift-off."""

    def above(e: Ends) -> ca.SX:
        return leg.flight_pose(e.final[DESCENT])[0][1] - leg.stance_pose(e.final[STANCE])[0][1]

    return BoundaryConstraint("body at touchdown", above, 0.0, INF, unit="m")


def energy_lost(leg: MovingLeg, e: Ends) -> ca.SX:
    """Kinetic energy [J] that the impact takes."""
    return impact_at(leg, e.final[DESCENT])[2]


def landing_guess(leg: MovingLeg, flight: Guess) -> Guess:
    """The joints' flight backwards, which ends with the foot at rest as flight begins, along the fall from its end."""
    m, t = len(leg.falling), flight.fraction * flight.duration
    fall = np.array(leg.robot.model.gravity.linear)[[0, 2]][leg.falling]
    place, speed = flight.x[-1, :m], flight.x[-1, m : 2 * m]
    q, v = np.split(flight.x[::-1, 2 * m :], 2, axis=1)
    com = place + t[:, None] * speed + 0.5 * t[:, None] ** 2 * fall
    x = np.hstack([com, speed + t[:, None] * fall, q, -v])
    return Guess(flight.duration, flight.fraction, x, flight.u[::-1])


IMPACT = HopObjective(
    "impact", "kinetic energy lost when the foot lands, after the descent from the apex", "J",
    energy_lost, "impact_J", maximize=False, scale=lambda leg: leg.weight * leg.reach,
    tie_break=lambda leg: TIE_BREAK_FACTOR / leg.time_scale, sequence=to_touchdown, **AT_CLEARANCE,
)  # fmt: skip
