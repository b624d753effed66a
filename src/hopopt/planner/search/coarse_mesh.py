"""Starts solved on a mesh coarser than the first; only the different hops among them are carried to the first mesh."""

import time
from collections.abc import Sequence
from dataclasses import replace

from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.solver.ipopt import CARRIED, NlpSolution, NlpSolver
from hopopt.nlp.solver.known_optima import KnownOptima
from hopopt.nlp.solver.warm_start import carried
from hopopt.ocp.hop import Hop
from hopopt.planner.search.multistart import (
    StartOutcome,
    first_options,
    first_transcription,
    grouped,
    known_optima,
    noted,
    outcome_of,
    remember,
    solution_of,
)

STANCE, FLIGHT = 20, 6  # intervals of a phase on the ground, and in the air
APART = 1e-4  # relative: optima of one coarse program that differ by more are different hops


def on_coarse_mesh(hop: Hop) -> Hop | None:
    """The same hop on a coarser first mesh; None if its own is no finer than that."""
    s = hop.design.solver
    if s.stance_intervals <= STANCE:
        return None
    fewer = {"stance_intervals": STANCE, "flight_intervals": min(FLIGHT, s.flight_intervals)}
    hop.problem  # shared by both
    return hop.with_solver_of(hop.design.model_copy(update={"solver": s.model_copy(update=fewer)}))


def carried_over(
    hop: Hop, coarse: Hop, outcomes: Sequence[StartOutcome], until: Deadline = NEVER
) -> list[StartOutcome]:
    """What outcomes of the coarse mesh lead to on the first, in their order: one solve for each different hop, best first."""
    watch, t = known_optima(hop), first_transcription(coarse)
    solver = NlpSolver(first_transcription(hop), first_options(hop, True) | CARRIED, watch, until)
    found = dict[str, StartOutcome]()
    ranked = sorted((o for o in outcomes if o.success), key=lambda o: -o.merit)
    size = max((abs(o.objective) for o in ranked), default=0.0)
    for group in grouped(ranked, APART * size):
        best = next((o for o in group if o.near is None), group[0])
        led = _carried(solver, best, solution_of(best, t))
        remember(watch, led)
        found |= {o.name: _also(o, led) for o in group}
    return [found.get(o.name) or replace(o, vectors={}) for o in outcomes]


def _carried(solver: NlpSolver, outcome: StartOutcome, s: NlpSolution) -> StartOutcome:
    began, t = time.perf_counter(), solver.transcription
    guess, free = t.guess_from(s.phases), t.free_from(s.parameters)
    led = solver(guess, free, carried(s, t))
    ended = noted(solver, outcome_of(outcome.name, led, time.perf_counter() - began))
    return ended


def _also(outcome: StartOutcome, led: StartOutcome) -> StartOutcome:
    """How a start ended whose hop on the coarse mesh led to this on the first."""
    mine = {"name": outcome.name, "iterations": outcome.iterations, "seconds": outcome.seconds}
    if outcome.name == led.name:
        mine |= {"iterations": outcome.iterations + led.iterations, "seconds": outcome.seconds + led.seconds}
    elif led.success:
        mine |= {"status": outcome.status}
    return replace(led, **mine, near=outcome.near or led.near)
