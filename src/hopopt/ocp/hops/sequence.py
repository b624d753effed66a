"""The order in which a hop's phases run, and what each hands over to the next.

A kind of hop is a function of the leg and of its free parameters that lists both:

    PhaseSequence((stance(leg, q0, v0), flight(leg)), lift_off(leg, STANCE, FLIGHT))
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hopopt.ocp.free_parameters import FreeParameters
from hopopt.ocp.guesses.motion import MovingLeg
from hopopt.ocp.phases import FLIGHT, STANCE, LegPhase, flight, stance
from hopopt.ocp.problem import BoundaryConstraint
from hopopt.ocp.transitions import lift_off


@dataclass(frozen=True)
class PhaseSequence:
    """The phases of a hop in the order in which they run.

    phases: each with its own name.
    transitions: the constraints of all transitions between them.
    """

    phases: tuple[LegPhase, ...]
    transitions: tuple[BoundaryConstraint, ...]


Sequence = Callable[[MovingLeg, FreeParameters], PhaseSequence]


def from_rest(leg: MovingLeg, free_parameters: FreeParameters) -> PhaseSequence:
    """A push from the start pose at rest, and flight up to the apex."""
    return PhaseSequence(
        (stance(leg, free_parameters.start(leg), np.zeros(leg.n)), flight(leg)), lift_off(leg, STANCE, FLIGHT)
    )
