"""From a problem to a verified answer: several starts, refinement, verification."""

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hopopt.errors import NotSolvedError
from hopopt.leg.design import Design
from hopopt.nlp.accuracy import IntervalErrors, interval_errors
from hopopt.nlp.diagnose import violations
from hopopt.nlp.ipopt import NlpSolution, NlpSolver
from hopopt.nlp.kkt import residuals
from hopopt.nlp.mesh import PhaseMesh, uniform
from hopopt.nlp.refine import refine, refine_everywhere
from hopopt.nlp.schemes import Scheme, scheme
from hopopt.nlp.transcribe import Transcription
from hopopt.ocp.hop import FLIGHT, STANCE, Hop
from hopopt.ocp.starts import make_guess, starts
from hopopt.solution import Solution
from hopopt.summary import summarize
from hopopt.verify import KKT, LIMIT, Check, verify_plan

Progress = Callable[[str], None]
SAME = 2e-3  # relative: coarse objectives closer than this are the same local optimum (switches are smeared)
CLOSE = 2e-2  # relative: optima this close to the best on the first mesh are refined too
MARGIN = 0.5  # refinement aims at this share of the excess that verification allows


@dataclass(frozen=True)
class StartOutcome:
    """How one start ended on the first mesh."""

    name: str
    status: str
    success: bool
    objective: float
    iterations: int
    seconds: float
    z: np.ndarray = field(repr=False)


@dataclass(frozen=True)
class MeshStep:
    """One solve of the refinement: intervals and ramps by phase, objective, largest errors, effort."""

    intervals: dict[str, int]
    ramps: int
    objective: float
    local_error: float
    excess: float
    iterations: int
    solve_seconds: float
    seconds: float


def first_mesh(design: Design) -> dict[str, PhaseMesh]:
    """The mesh every start is solved on."""
    return {STANCE: uniform(design.solver.stance_intervals), FLIGHT: uniform(design.solver.flight_intervals)}


def solver_scheme(design: Design) -> Scheme:
    """The collocation scheme the problem asks for."""
    return scheme(design.solver.scheme, design.solver.degree)


def solve(
    design: Design,
    objective: str = "clearance",
    *,
    starts: int | None = None,
    processes: int | None = None,
    progress: Progress | None = None,
) -> Solution:
    """The best hop of a leg: solved from several starts, refined, verified.

    starts overrides the problem's number; processes (default: the cores) solve them side by side; progress is
    called with a line of text now and then. Raises NotSolvedError, with the worst constraints, if no start
    leads to a solution. A solution that fails verification is returned with ``verified`` False.
    """
    say, clock = progress or (lambda text: None), Stopwatch()
    hop = Hop(design, objective)
    faults = hop.static_faults()
    if faults:
        raise NotSolvedError(f"{design.name}: the leg cannot stand at its start.", faults)
    clock.mark("model")
    count = starts or design.solver.starts
    outcomes = run_starts(hop, count, processes or os.cpu_count() or 1, say)
    clock.mark("starts")
    finished: list[Solution] = []
    for candidate in contenders(outcomes):
        solution = _finish(hop, candidate, outcomes, say, clock)
        if solution is not None:
            finished.append(solution)
    if not finished:
        raise not_solved(hop, outcomes)
    return max(finished, key=lambda s: (s.verified, s.summary["objective_value"]))


class Stopwatch:
    """Wall time by stage [s]."""

    def __init__(self) -> None:
        self.begin = self.last = time.perf_counter()
        self.stages: dict[str, float] = {}

    def mark(self, stage: str) -> None:
        """Add the time since the last mark to ``stage``."""
        now = time.perf_counter()
        self.stages[stage] = self.stages.get(stage, 0.0) + now - self.last
        self.last = now


# ---- starts --------------------------------------------------------------------------------------------------


def run_starts(hop: Hop, count: int, processes: int, say: Progress) -> list[StartOutcome]:
    """Solve every start on the first mesh, in chunks side by side; in the order of the starts."""
    say(f"solving from {count} starting point{'s' if count > 1 else ''}")
    processes = min(processes, count)
    chunks = [list(range(k, count, processes)) for k in range(processes)]
    if processes == 1:
        parts = [_run_chunk(hop, chunks[0])]
    else:
        from joblib import Parallel, delayed

        data = hop.design.model_dump(exclude_none=True)
        jobs = (delayed(_chunk_in_worker)(data, hop.objective.name, chunk) for chunk in chunks)
        parts: list[list[StartOutcome]] = Parallel(n_jobs=processes, backend="loky")(jobs)  # type: ignore[assignment]
    by_index = {
        k: outcome for chunk, part in zip(chunks, parts, strict=True) for k, outcome in zip(chunk, part, strict=True)
    }
    return [by_index[k] for k in range(count)]


def _chunk_in_worker(data: dict[str, Any], objective: str, chunk: Sequence[int]) -> list[StartOutcome]:
    return _run_chunk(Hop(Design.model_validate(data), objective), chunk)


def _run_chunk(hop: Hop, chunk: Sequence[int]) -> list[StartOutcome]:
    transcription = Transcription(hop.problem, solver_scheme(hop.design), first_mesh(hop.design))
    solver = NlpSolver(transcription, {"ipopt.max_iter": hop.design.solver.max_iterations})
    chosen = starts(max(chunk) + 1, hop.design.solver.seed)
    return [_run_start(hop, solver, chosen[k]) for k in chunk]


def _run_start(hop: Hop, solver: NlpSolver, start: Any) -> StartOutcome:
    began = time.perf_counter()
    s = solver(make_guess(hop, start))
    seconds = time.perf_counter() - began
    return StartOutcome(start.name, s.status, s.success, s.objective, s.iterations, seconds, s.z)


def distinct(outcomes: Sequence[StartOutcome]) -> list[StartOutcome]:
    """The best representative of each local optimum that was found, best first."""
    found: list[StartOutcome] = []
    for outcome in sorted((o for o in outcomes if o.success), key=lambda o: -o.objective):
        if not any(same(outcome.objective, other.objective) for other in found):
            found.append(outcome)
    return found


def contenders(outcomes: Sequence[StartOutcome]) -> list[StartOutcome]:
    """The distinct optima that may prove the best once refined."""
    found = distinct(outcomes)
    return [o for o in found if o.objective >= found[0].objective - CLOSE * abs(found[0].objective)]


def same(a: float, b: float) -> bool:
    """Whether two coarse objectives belong to the same local optimum."""
    return abs(a - b) <= SAME * max(abs(a), abs(b), 1e-3)


def not_solved(hop: Hop, outcomes: Sequence[StartOutcome]) -> NotSolvedError:
    """What went wrong, from the start that came closest to meeting the constraints."""
    transcription = Transcription(hop.problem, solver_scheme(hop.design), first_mesh(hop.design))
    closest = min((_evaluate(transcription, o) for o in outcomes), key=_infeasibility)
    statuses = ", ".join(f"{o.name}: {o.status.replace('_', ' ').lower()}" for o in outcomes)
    worst = violations(closest)
    reason = "no start led to a feasible hop" if worst else "no start converged, though one met every constraint"
    advice = "Worst constraints:" if worst else "Try a larger solver.max_iterations or more starts."
    return NotSolvedError(f"{hop.design.name}: {reason} ({statuses}). {advice}", worst)


def _infeasibility(s: NlpSolution) -> float:
    t = s.transcription
    return float(np.maximum(0.0, np.maximum(t.lbg - s.g, s.g - t.ubg)).sum())


def _evaluate(transcription: Transcription, outcome: StartOutcome) -> NlpSolution:
    """An outcome's iterate with its constraint values."""
    import casadi as ca

    nlp, p = transcription.nlp, transcription.parameter_values()
    g = np.array(ca.Function("g", [nlp["x"], nlp["p"]], [nlp["g"]])(outcome.z, p)).ravel()
    phases, values = transcription.unpack(outcome.z, p)
    none = np.zeros(0)
    return NlpSolution(
        transcription,
        phases,
        values,
        outcome.objective,
        outcome.status,
        outcome.success,
        0,
        outcome.z,
        p,
        g,
        none,
        none,
    )


# ---- refinement ----------------------------------------------------------------------------------------------


def _finish(
    hop: Hop, outcome: StartOutcome, outcomes: Sequence[StartOutcome], say: Progress, clock: Stopwatch
) -> Solution | None:
    """Refine one start's optimum, verify it and sum it up; None if its first mesh cannot be solved again."""
    solution, history = refine_solution(hop, outcome, say)
    clock.mark("refinement")
    if solution is None:
        return None
    say("verifying")
    plan = Solution(hop.design, hop.objective.name, solution.phases, {})
    tables = plan.tables
    claims = plan.claims()
    checks = [*numerical_checks(hop.design, solution, history), *verify_plan(hop.design, tables, claims)]
    clock.mark("verification")
    return summarize(hop, plan, solution, checks, outcomes, outcome, history, clock)


def refine_solution(hop: Hop, outcome: StartOutcome, say: Progress) -> tuple[NlpSolution | None, list[MeshStep]]:
    """Solve on finer and finer meshes until every interval is accurate and the objective has settled."""
    settings, order = hop.design.solver, solver_scheme(hop.design)
    mesh, guess, parameters = first_mesh(hop.design), None, None
    solution, history = None, []
    for _ in range(settings.max_refinements + 1):
        began = time.perf_counter()
        transcription = Transcription(hop.problem, order, mesh)
        if guess is None:
            phases, values = transcription.unpack(outcome.z, transcription.parameter_values())
            guess, parameters = transcription.guess_from(phases), _free(transcription, values)
        attempt, solve_seconds = _solve_mesh(transcription, guess, parameters, settings.max_iterations)
        if not attempt.success:
            break
        solution = attempt
        errors = {name: interval_errors(solution, name) for name in mesh}
        history.append(_step(solution, errors, solve_seconds, time.perf_counter() - began))
        say(_progress_line(hop, history))
        if not settings.refine or _accurate(hop.design, history):
            break
        mesh = _next_mesh(solution, errors, hop.design)
        guess, parameters = transcription.guess_from(solution.phases), _free(transcription, solution.parameters)
    return solution, history


def _solve_mesh(
    transcription: Transcription, guess: Mapping[str, Any], parameters: Mapping[str, Any] | None, iterations: int
) -> tuple[NlpSolution, float]:
    """One solve, and a second with another barrier strategy if the first fails; and the time in Ipopt [s]."""
    options, seconds = {"ipopt.max_iter": iterations}, 0.0
    for strategy in ("adaptive", "monotone"):
        solver = NlpSolver(transcription, {**options, "ipopt.mu_strategy": strategy})
        began = time.perf_counter()
        attempt = solver(guess, parameters)
        seconds += time.perf_counter() - began
        if attempt.success:
            break
    return attempt, seconds


def _free(transcription: Transcription, values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {q.name: values[q.name] for q in transcription.free}


def _step(
    solution: NlpSolution, errors: Mapping[str, IntervalErrors], solve_seconds: float, seconds: float
) -> MeshStep:
    mesh = solution.transcription.mesh
    return MeshStep(
        {name: m.intervals for name, m in mesh.items()},
        sum(len(m.ramps) for m in mesh.values()),
        solution.objective,
        max(float(e.local.max()) for e in errors.values()),
        max(float(e.excess.max()) for e in errors.values()),
        solution.iterations,
        solve_seconds,
        seconds,
    )


def _accurate(design: Design, history: Sequence[MeshStep]) -> bool:
    last = history[-1]
    return last.local_error <= design.solver.tolerance and last.excess <= 0.95 * LIMIT and settled(design, history)


def settled(design: Design, history: Sequence[MeshStep]) -> bool:
    """Whether the objective changed by less than the objective tolerance in the last refinement."""
    return relative_change(history) <= design.solver.objective_tolerance


def relative_change(history: Sequence[MeshStep]) -> float:
    """Relative change of the objective in the last refinement; infinite after one mesh."""
    if len(history) < 2:
        return float("inf")
    return abs(history[-1].objective - history[-2].objective) / max(abs(history[-1].objective), 1e-9)


def _next_mesh(solution: NlpSolution, errors: Mapping[str, IntervalErrors], design: Design) -> dict[str, PhaseMesh]:
    step = refine(solution, errors, design.solver.tolerance, MARGIN * LIMIT)
    return step.mesh if step.cut + step.ramps else refine_everywhere(solution)


def _progress_line(hop: Hop, history: Sequence[MeshStep]) -> str:
    s = history[-1]
    sizes = " + ".join(str(n) for n in s.intervals.values())
    return (
        f"mesh {len(history)}: {sizes} intervals, {hop.objective.name} {s.objective:.5f} {hop.objective.unit}, "
        f"local error {s.local_error:.0e}, limits exceeded by {s.excess:.0e}"
    )


def numerical_checks(design: Design, solution: NlpSolution, history: Sequence[MeshStep]) -> list[Check]:
    """First-order conditions recomputed, error of every interval, settled objective."""
    return [
        *kkt_checks(solution),
        Check("local error of the intervals", history[-1].local_error, design.solver.tolerance, "scaled"),
        Check("change of the objective", relative_change(history), design.solver.objective_tolerance, "relative"),
    ]


def kkt_checks(solution: NlpSolution) -> list[Check]:
    """First-order conditions of the nonlinear program, recomputed."""
    r = residuals(solution)
    return [
        Check("stationarity", r.stationarity, KKT, "scaled"),
        Check("constraints", r.feasibility, KKT, "scaled"),
        Check("complementarity", r.complementarity, KKT, "scaled"),
    ]
