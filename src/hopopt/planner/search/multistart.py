"""Every starting point solved on the first mesh, side by side, and what they led to."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, TypeVar

import numpy as np

from hopopt.amounts import check
from hopopt.errors import NotSolvedError
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.mesh import uniform
from hopopt.nlp.schemes import scheme
from hopopt.nlp.solver.ipopt import CARRIED, GENTLE_OPTIONS, Bounds, NlpSolution, NlpSolver
from hopopt.nlp.solver.known_optima import Known, KnownOptima
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.guesses.feasibility import drives_too_weak
from hopopt.ocp.guesses.initial_guess import StartGuess, make_guess, starts_of
from hopopt.ocp.hop import Hop
from hopopt.ocp.phases import ON_GROUND, STANCE
from hopopt.optimality.directions.infeasibility import conflict
from hopopt.optimality.violations import violations
from hopopt.planner.answer.limit_names import conflict_words
from hopopt.planner.search.beside import Beside
from hopopt.planner.stopwatch import Countdown
from hopopt.problem.checking.hints import hints

Progress = Callable[[str], None]
SAME_OPTIMUM = 2e-3  # relative: coarse objectives closer than this are the same local optimum (switches are smeared)
KNOWN_HOP_ITERATIONS = 200  # iterations of a start where another is known to lead to a hop
CLOSE_OBJECTIVE = 2e-2  # relative: optima this close to the best on the first mesh are refined too
STOPPED_NEAR_KNOWN = "stopped near a hop that is known"
CANNOT_HOLD = "limits cannot hold together near its guess"


class _Ended(Protocol):
    @property
    def success(self) -> bool: ...
    @property
    def objective(self) -> float: ...


Ended = TypeVar("Ended", bound=_Ended)


@dataclass(frozen=True)
class StartOutcome:
    """How one start ended on the first mesh: in words and figures, and the NLP's vectors (as in ``NlpSolution``);
    ``objective``: the program's, in which the tie-break weighs ``tie_break`` [its unit]."""

    name: str
    status: str
    success: bool
    objective: float
    iterations: int
    seconds: float
    vectors: dict[str, np.ndarray] = field(repr=False)
    sign: float = 1.0  # of the objective in its signed value
    near: str | None = None  # the start whose hop it was stopped near: objective and vectors are that hop's
    tie_break: float = 0.0  # what of the objective is that [its unit]

    @property
    def signed_value(self) -> float:
        """More is better."""
        return self.sign * self.objective

    @property
    def value(self) -> float:
        """The objective without its tie-break [its unit]."""
        return self.objective + self.sign * self.tie_break


def first_transcription(hop: Hop) -> Transcription:
    """The program that every start is solved on, built once for a hop's problem and these meshes."""
    s = hop.design.solver
    counts = {p.name: s.stance_intervals if p.name in ON_GROUND else s.flight_intervals for p in hop.problem.phases}
    mesh, method = {name: uniform(count) for name, count in counts.items()}, scheme(s.scheme, s.degree)
    key = f"first mesh of {method.name}, {counts}"  # a text: a problem with another objective takes none of it over
    return hop.problem.once(key, lambda: Transcription(hop.problem, method, mesh))


def first_solver(hop: Hop, known: bool = False, watch: KnownOptima | None = None, until: Deadline = NEVER) -> NlpSolver:
    """That program, ready to be solved from any start; not for long if a hop is ``known`` already, and no further than to
    one of those that ``watch`` knows."""
    return NlpSolver(first_transcription(hop), first_options(hop, known), watch, until)


def known_optima(hop: Hop, outcomes: Sequence[StartOutcome] = ()) -> KnownOptima:
    """A watch for hops of the first mesh that are known: the stances of these outcomes, and of all that it is told."""
    watch = watch_on(first_transcription(hop))
    for outcome in outcomes:
        remember(watch, outcome)
    return watch


def watch_on(t: Transcription, kind: type[KnownOptima] = KnownOptima) -> KnownOptima:
    """A watch of a kind for hops of a program, by their stances; none is known yet."""
    where, every = t.variables[STANCE], np.arange(len(t.scale))
    return kind(len(t.scale), t.lbg, t.ubg, np.concatenate([every[where.x], every[where.durations]]))


def remember(watch: KnownOptima, outcome: StartOutcome) -> None:
    """One more hop that is known, if the outcome is one and it is new."""
    if outcome.success and all(outcome.vectors is not k.origin.vectors for k in watch.known):
        watch.known.append(Known(outcome.vectors["z"], -outcome.signed_value, outcome))


def first_options(hop: Hop, known: bool) -> dict[str, Any]:
    """Ipopt's options for a start; not for long if a hop is ``known`` already."""
    most = hop.design.solver.max_iterations
    return GENTLE_OPTIONS | {"ipopt.max_iter": min(most, KNOWN_HOP_ITERATIONS)} if known else {"ipopt.max_iter": most}


def run_starts(
    hop: Hop, count: int, beside: Beside, say: Progress, besides: Sequence[StartOutcome] = (), until: Deadline = NEVER,
    then: Callable[[StartOutcome], object] = lambda first: None,
) -> list[StartOutcome]:  # fmt: skip
    """Solve every start on the first mesh, or as many as there is time for, each in the process that is free.

    In the order of the starts, then those ``besides``: if any of these leads to a hop, no start need be followed for long.
    ``then``: called when the first of several has ended, and others are worth it.
    """
    return [*_run_all(hop, count, beside, say, any(o.success for o in besides), until, then), *besides]


def _run_all(
    hop: Hop, count: int, beside: Beside, say: Progress, known: bool, until: Deadline,
    then: Callable[[StartOutcome], object],
) -> list[StartOutcome]:  # fmt: skip
    check("starts", count)
    weak = bool(drives_too_weak(hop.design, hop.robot))
    if weak and (ended := _beyond_limits(hop, until)):
        return [ended]
    say(f"solving from {count} starting point{'s' if count > 1 else ''}")
    count_down = Countdown(say, "starting points", count)
    first = _one_start(hop, 0, known, None, until)
    assert first is not None  # the first is tried whatever the time
    count_down.more()
    if until.passed or (not first.success and weak):  # seldom does another start help such a leg
        return [first]
    then(first)
    # each knows the first alone, so that what they lead to does not depend on who solves them, or when
    tasks = [beside.task(_one_start, k, known, first, until) for k in range(1, count)]
    for task in reversed(tasks):  # from the other end
        if task.done_here():
            count_down.more()
    ended = [task.result() for task in tasks]
    return [first, *(outcome for outcome in ended if outcome is not None)]


def _one_start(hop: Hop, k: int, known: bool, first: StartOutcome | None, until: Deadline) -> StartOutcome | None:
    """A start by its number, stopped where it comes near the hop of the ``first``; None if there is no time for it."""
    if first is not None and until.passed:
        return None
    solver = hop.problem.once(f"starts, {known}", lambda: first_solver(hop, known, known_optima(hop)))
    watch = solver.known
    watch.known.clear()
    if first is not None:
        remember(watch, first)
    return run_start(hop, solver.on(solver.transcription, until), starts_of(hop, k + 1)[k], known)


def _beyond_limits(hop: Hop, until: Deadline) -> StartOutcome | None:
    """How the first start ends if limits cannot hold together near its guess: where they give least. Ipopt takes hundreds
    of slow steps of restoration to end there."""
    began, start = time.perf_counter(), starts_of(hop, 1)[0]
    glance = NlpSolver(first_transcription(hop), {"ipopt.max_iter": 0})
    found = conflict(glance(make_guess(hop, start)), until)
    if found is None or not any(part.gives for part in found.parts):
        return None
    ended = outcome_of(start.name, glance.from_vector(found.z), time.perf_counter() - began)
    return replace(ended, status=CANNOT_HOLD)


def run_chunk(
    hop: Hop, chunk: Sequence[int], solver: NlpSolver | None = None, known: bool = False
) -> list[StartOutcome]:
    """Some of the starts, by number, on the first mesh: the first, and more while there is time; ``solver``: its program,
    with its deadline, if it is built already."""
    solver = solver or first_solver(hop, known)
    starts, outcomes = starts_of(hop, max(chunk) + 1), list[StartOutcome]()
    for k in chunk:
        if outcomes and solver.until.passed:
            break
        outcomes.append(run_start(hop, solver, starts[k], known))
    return outcomes


def run_start(hop: Hop, solver: NlpSolver, start: StartGuess, known: bool) -> StartOutcome:
    """One start on the first mesh; ``known``: another is known to lead to a hop."""
    began = time.perf_counter()
    guess = make_guess(hop, start)
    s = solver(guess)
    if not (s.success or solver.stopped or solver.until.passed or violations(s)):
        # a hop, but no optimum: the adaptive barrier can lose its way to one
        monotone = first_options(hop, known) | {"ipopt.mu_strategy": "monotone"}
        s = NlpSolver(s.transcription, monotone, until=solver.until)(guess)
    return noted(solver, outcome_of(start.name, s, time.perf_counter() - began))


def noted(solver: NlpSolver, outcome: StartOutcome) -> StartOutcome:
    """The outcome of the solver's last solve or, if it was stopped on its way to a known hop, that hop."""
    if solver.known is None or (met := solver.known.met) is None:
        return outcome
    mine = {"name": outcome.name, "iterations": outcome.iterations, "seconds": outcome.seconds}
    return replace(met, **mine, status=STOPPED_NEAR_KNOWN, near=met.near or met.name)


def outcome_of(name: str, s: NlpSolution, seconds: float) -> StartOutcome:
    """How a solve on the first mesh ended; ``name`` says from where it began."""
    vectors = {name: getattr(s, name) for name in ("z", "p", "g", "lam_g", "lam_x")}
    ended = name, s.status, s.success, s.objective, s.iterations, seconds, vectors
    return StartOutcome(*ended, s.transcription.problem.objective.sign, tie_break=s.tie_break)


def solved_from(hop: Hop, outcome: StartOutcome, until: Deadline = NEVER) -> StartOutcome:
    """A problem of the same form, solved on its first mesh from the hop that a start led to and its multipliers: from
    the point alone the barrier may lead to another optimum."""
    began, t = time.perf_counter(), first_transcription(hop)
    begin = outcome.vectors["lam_g"], outcome.vectors["lam_x"]
    solver = NlpSolver(t, {**CARRIED, "ipopt.max_iter": hop.design.solver.max_iterations}, until=until)
    s = solver.from_vector(outcome.vectors["z"], begin)
    if not s.success and not until.passed:
        s = first_solver(hop, until=until).from_vector(outcome.vectors["z"])
    return outcome_of(outcome.name, s, time.perf_counter() - began)


def solution_of(outcome: StartOutcome, t: Transcription) -> NlpSolution:
    """The outcome as a solution of the first mesh's program."""
    phases, values = t.unpack(outcome.vectors["z"], outcome.vectors["p"])
    bounds = Bounds(*t.bounds(t.guess_from(phases)), t.lbg, t.ubg)
    return NlpSolution(
        t, phases, values, outcome.objective, outcome.status, outcome.success, outcome.iterations,
        **outcome.vectors, bounds=bounds,
    )  # fmt: skip


def distinct(outcomes: Sequence[StartOutcome]) -> list[StartOutcome]:
    """The best representative of each local optimum that was found, best first."""
    return [group[0] for group in grouped(sorted(outcomes, key=lambda o: -o.signed_value))]


def grouped(ranked: Sequence[Ended], apart: float | None = None) -> list[list[Ended]]:
    """The successful ones of ``ranked``, best first, gathered by the local optimum that they ended in: objectives closer
    than ``apart`` [its unit], or SAME_OPTIMUM of themselves, are one."""
    groups: list[list[Ended]] = []
    for outcome in (o for o in ranked if o.success):
        group = next((g for g in groups if same(g[0].objective, outcome.objective, apart)), None)
        if group is None:
            groups.append(group := [])
        group.append(outcome)
    return groups


def contenders(outcomes: Sequence[StartOutcome]) -> list[StartOutcome]:
    """The distinct optima that may prove the best once refined."""
    found = distinct(outcomes)
    return [o for o in found if abs(o.objective - found[0].objective) <= CLOSE_OBJECTIVE * abs(found[0].objective)]


def same(a: float, b: float, apart: float | None = None) -> bool:
    """Whether two coarse objectives belong to the same local optimum: closer than ``apart``, or SAME_OPTIMUM of themselves."""
    return abs(a - b) <= (SAME_OPTIMUM * max(abs(a), abs(b), 1e-3) if apart is None else apart)


def not_solved(
    hop: Hop, outcomes: Sequence[StartOutcome], thorough: bool = False, until: Deadline = NEVER
) -> NotSolvedError:
    """What went wrong, from the start that came closest to meeting the constraints; ``thorough``: which of them cannot
    hold together too, which takes seconds. Where the time was up, that is the reason."""
    weak = drives_too_weak(hop.design, hop.robot)
    if until.passed:
        late = f"{hop.design.name}: the time limit was reached before there was an answer: try a larger one."
        return NotSolvedError(late, weak)
    t = first_transcription(hop)
    closest = min((solution_of(o, t) for o in outcomes), key=infeasibility)
    statuses = ", ".join(f"{o.name}: {o.status.replace('_', ' ').lower()}" for o in outcomes)
    worst = violations(closest)
    reason = "no start led to a feasible hop" if worst else "no start converged, though one met every constraint"
    message = f"{hop.design.name}: {reason} ({statuses})."
    in_the_way = conflict_words(hop.design, conflict(closest, until)) if thorough and worst else []
    found = [*weak, *hints(hop.design), *in_the_way]
    if worst:
        return NotSolvedError(message, [*found, "Worst constraints of the closest start:", *worst])
    return NotSolvedError(f"{message} Try a larger solver.max_iterations or more starts.", found)


def infeasibility(s: NlpSolution) -> float:
    """By how much a point violates its constraints in all, scaled."""
    return float(np.maximum(0.0, np.maximum(s.bounds.low_g - s.g, s.g - s.bounds.high_g)).sum())
