"""Restricted problems as starts: the optimum of a problem with a soft touchdown or a shorter stance, released to what was asked.

A restriction's optimum is a hop of the problem that was asked, so what it is released to can only be better. Of hops that
land, the best often lies near a restricted one: without a limit the impact is a brake, and the solver ends where that
brakes best. All limits of the touchdown are tight at once, since one alone often leads where none does. Some families lie
near no restriction, nor near a relaxation, but near both at once: a leg that lies down to push, and lands softly.
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
    first_transcription,
    known_optima,
    noted,
    outcome_of,
)
from hopopt.planner.search.neighbours.relaxations import NO_FRICTION_LIMIT, Relaxation, asked_from, own_bounds

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
    tight: entries of SOFT that are as in a soft touchdown; the others are as asked
    begun_with: the wider bounds within which the restricted problem is solved at first
    """

    name: str
    stance: float = 1.0
    tight: tuple[str, ...] = tuple(SOFT)
    begun_with: Relaxation | None = None


RESTRICTIONS = (
    Restriction("soft touchdown"),
    Restriction("soft touchdown in a shorter stance", stance=0.8),
    Restriction(
        "little loss at touchdown, at first without friction limit",
        tight=("touchdown_loss",),
        begun_with=NO_FRICTION_LIMIT,
    ),
)


def restricting(hop: Hop) -> tuple[Restriction, ...]:
    """The restrictions that suit a problem."""
    if not hop.design.hop.lands or hop.objective.name not in OBJECTIVES:
        return ()
    t = first_transcription(hop)
    return tuple(r for r in RESTRICTIONS if r.begun_with is None or r.begun_with.suits(t))


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
    found = _restricted(hop, restriction, until)
    if not found.success or until.passed:
        return []
    asked = asked_from(hop, known_optima(hop, known), until)
    released = _released(asked, found)
    return [noted(asked, outcome_of(restriction.name, released, time.perf_counter() - began))]


def softened(hop: Hop, tight: Sequence[str] = tuple(SOFT)) -> Hop:
    """The same question with these limits of the touchdown at that of a soft one, or tighter if the problem asks for that."""
    asked = hop.design.hop
    soft = {entry: SOFT[entry][0] * hop.scale.unit(SOFT[entry][1]) for entry in tight}
    limits = {entry: min(value, getattr(asked, entry) or np.inf) for entry, value in soft.items()}
    design = hop.design.model_copy(update={"hop": asked.model_copy(update=limits)})
    return Hop(design, hop.asked, hop.free_parameters, hop.constraints)


def _restricted(hop: Hop, restriction: Restriction, until: Deadline) -> NlpSolution:
    """The restricted problem solved from the first start, or from the optimum of the relaxed one that it begins with."""
    tight, relaxed = restriction.tight, restriction.begun_with
    soft = hop.problem.once(f"soft touchdown, {tight}", lambda: softened(hop, tight))
    solver, (first,) = first_solver(soft, True, until=until), starts_of(soft, 1)
    t = solver.transcription
    guess, bounds, wide = make_guess(soft, first), own_bounds(t), own_bounds(t)
    durations = t.variables[STANCE].durations
    for b in (bounds, wide):
        b.high_z[durations] = np.maximum(restriction.stance * b.high_z[durations], b.low_z[durations])
    if relaxed is None:
        return solver(guess, bounds=bounds)
    relaxed.widen(t, wide)
    found = solver(guess, bounds=wide)
    return asked_from(soft, None, until).again(found, bounds) if found.success else found


def _released(asked: NlpSolver, found: NlpSolution) -> NlpSolution:
    """What was asked, solved from the restricted optimum and those of its multipliers that both problems have."""
    names = {r.name for r in asked.transcription.rows}
    both = [np.full(r.stop - r.start, r.name in names) for r in found.transcription.rows]
    return asked.from_vector(found.z, (found.lam_g[np.concatenate(both)], found.lam_x))
