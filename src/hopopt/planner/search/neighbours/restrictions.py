"""Restricted problems as starts: the optimum of a problem with a soft touchdown or a shorter stance, released to what was asked.

A restriction's optimum is a hop of the problem that was asked, so what it is released to can only be better. Of hops that
land, the best often lies near a restricted one: without a limit the impact is a brake, and the solver ends where that
brakes best. All limits of the touchdown are tight at once, since one alone often leads where none does.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.solver.ipopt import NlpSolution, NlpSolver
from hopopt.ocp.guesses.initial_guess import make_guess, starts_of
from hopopt.ocp.hop import Hop
from hopopt.ocp.phases import STANCE
from hopopt.planner.search.multistart import (
    StartOutcome,
    first_solver,
    known_optima,
    noted,
    outcome_of,
)
from hopopt.planner.search.neighbours.relaxations import asked_from, own_bounds

SOFT = {  # entries of a soft touchdown, on the paper's leg: value and unit; benchmarks/landed_limits.py chose them
    "touchdown_loss": (1.0, "J"), "touchdown_impulse": (2.0, "N s"), "touchdown_speed": (1.0, "m/s"),
    "touchdown_gear_torque": (20.0, "N m"),
}  # fmt: skip
OBJECTIVES = ("clearance", "apex")  # that restrictions suit


@dataclass(frozen=True)
class Restriction:
    """A problem with a soft touchdown and, if so, a shorter stance.

    name: in words
    stance: share of the longest stance that is left
    """

    name: str
    stance: float


RESTRICTIONS = (
    Restriction("soft touchdown", 1.0),
    Restriction("soft touchdown in a shorter stance", 0.8),
)


def restricting(hop: Hop) -> tuple[Restriction, ...]:
    """The restrictions that suit a problem."""
    return RESTRICTIONS if hop.design.hop.lands and hop.objective.name in OBJECTIVES else ()


def restricted_starts(
    hop: Hop, restriction: Restriction, known: Sequence[StartOutcome] = (), until: Deadline = NEVER
) -> list[StartOutcome]:
    """What a restricted problem, solved from the first start, leads to once it is released, on the first mesh; nothing if it
    is not solved, or there is no time for it.

    known: hops to which it need not be followed again
    """
    if until.passed:
        return []
    began = time.perf_counter()
    found = _restricted(hop.problem.once("soft touchdown", lambda: softened(hop)), restriction, until)
    if not found.success:
        return []
    asked = asked_from(hop, known_optima(hop, known), until)
    released = _released(asked, found)
    return [noted(asked, outcome_of(restriction.name, released, time.perf_counter() - began))]


def softened(hop: Hop) -> Hop:
    """The same question with every limit of the touchdown at that of a soft one, or tighter if the problem asks for that."""
    asked = hop.design.hop
    soft = {entry: value * hop.scale.unit(unit) for entry, (value, unit) in SOFT.items()}
    limits = {entry: min(value, getattr(asked, entry) or np.inf) for entry, value in soft.items()}
    design = hop.design.model_copy(update={"hop": asked.model_copy(update=limits)})
    return Hop(design, hop.asked, hop.free_parameters, hop.constraints)


def _restricted(soft: Hop, restriction: Restriction, until: Deadline) -> NlpSolution:
    """The restricted problem solved from the first start."""
    solver, (first,) = first_solver(soft, True, until=until), starts_of(soft, 1)
    t = solver.transcription
    bounds, durations = own_bounds(t), t.variables[STANCE].durations
    bounds.high_z[durations] = np.maximum(restriction.stance * bounds.high_z[durations], bounds.low_z[durations])
    return solver(make_guess(soft, first), bounds=bounds)


def _released(asked: NlpSolver, found: NlpSolution) -> NlpSolution:
    """What was asked, solved from the restricted optimum and those of its multipliers that both problems have."""
    names = {r.name for r in asked.transcription.rows}
    both = [np.full(r.stop - r.start, r.name in names) for r in found.transcription.rows]
    return asked.from_vector(found.z, (found.lam_g[np.concatenate(both)], found.lam_x))
