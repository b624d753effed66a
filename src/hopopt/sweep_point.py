"""One point of a study: solved from a neighbour's solution or from the problem's starts, refined, verified, kept.

Every point is solved on the problem's first mesh and refined as a single solve is. Points that differ in numbers
of the leg and its start alone share one compiled first program; from a neighbour, its optimum and its multipliers
are where Ipopt begins. (Beginning on the neighbour's refined mesh was slower: it is fine where the neighbour
switches, and grows with every neighbour.)
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hopopt.errors import NotSolvedError
from hopopt.leg.design import physical_parameters
from hopopt.multistart import StartOutcome, contenders, first_transcription, not_solved, outcome_of, run_starts
from hopopt.nlp.ipopt import WARM, NlpSolver
from hopopt.nlp.reuse import with_numbers_of
from hopopt.nlp.transcribe import Transcription
from hopopt.ocp.hop import Hop
from hopopt.planner import Stopwatch, finish
from hopopt.solution import Solution
from hopopt.study import Definition
from hopopt.sweep_store import NOT_SOLVED, NOT_VERIFIED, VERIFIED, Point, load_begin, save_point

PATIENCE = 60  # iterations from a neighbour's multipliers
BETTER = 1e-6  # relative: less is noise
CORRECTED = 1e-4  # relative: more than the same optimum on other meshes can differ

Found = tuple[Solution, dict[str, np.ndarray]] | None
_compiled: dict[
    str, tuple[Transcription, NlpSolver]
] = {}  # this process's programs of the first mesh; only the last is kept


def solve_point(definition: Definition, folder: Path, k: int, neighbours: Sequence[int]) -> Point:
    """Solve point k from the neighbours in turn until one leads to a verified hop, then from the starts; keep it."""
    began = time.perf_counter()
    point, hop = Point(k, definition.values(k), NOT_SOLVED), Hop(definition.design_at(k), definition.objective)
    begin: dict[str, np.ndarray] = {}
    try:
        if faults := hop.static_faults():
            raise NotSolvedError(f"{definition.design.name}: the leg cannot stand at its start.", faults)
        for source in (*neighbours, None):
            found = _attempt(definition, folder, hop, point.values, source)
            if found and (not point.solved or found[0].summary["verified"]):
                point, begin = _described(point, found[0], source), found[1]
            if point.verified:
                break
    except (NotSolvedError, ArithmeticError, RuntimeError, ValueError) as error:  # one point does not end a study
        if not point.solved:
            what = "" if isinstance(error, NotSolvedError) else f"stopped by a {type(error).__name__}: "
            point = replace(point, sentence=what + " ".join(str(error).split()))
    point = replace(point, seconds=time.perf_counter() - began)
    save_point(folder, point, begin)
    return point


def solve_again(definition: Definition, folder: Path, old: Point, neighbours: Sequence[int]) -> Point:
    """Solve a finished point from other neighbours; keep the better, and that it was tried."""
    began = time.perf_counter()
    best, begin = old, dict[str, np.ndarray]()
    hop = Hop(definition.design_at(old.index), definition.objective)
    least = -np.inf
    if old.verified:  # the same optimum, or a worse one, is told on the first mesh: no need to refine it
        value = float(load_begin(folder, old.index)["objective"])
        least = value + CORRECTED * abs(value)
    for source in neighbours:
        found = _attempt(definition, folder, hop, old.values, source, least)
        if found and found[0].summary["verified"] and _better(found[0].summary["objective_value"], best):
            best, begin = _described(old, found[0], source), found[1]
    seconds = old.seconds + time.perf_counter() - began
    best = replace(
        best, tried=tuple(sorted({*old.tried, *neighbours})), seconds=seconds,
        corrected=old.corrected or (best is not old and _better(best.objective_value or 0.0, old, CORRECTED)),
    )  # fmt: skip
    save_point(folder, best, begin)
    return best


def _better(value: float, than: Point, by: float = BETTER) -> bool:
    """Whether a verified value beats a point's: by this share, or because that is not verified."""
    if not than.verified or than.objective_value is None:
        return True
    return value > than.objective_value + by * abs(than.objective_value)


def _described(point: Point, solution: Solution, source: int | None) -> Point:
    s = solution.summary
    heights: dict[str, Any] = {"clearance_m": None, "unverified_clearance_m": None, "parts": None}
    if s["verified"]:
        heights |= {"clearance_m": s["clearance_m"], "parts": s["parts"]}
    else:
        heights["unverified_clearance_m"] = s["clearance_m"]
    return replace(
        point, outcome=VERIFIED if s["verified"] else NOT_VERIFIED, objective_value=s["objective_value"],
        sentence="" if s["verified"] else f"failed: {', '.join(s['failed_checks'])}", begun_from=source, **heights,
    )  # fmt: skip


def _attempt(
    definition: Definition,
    folder: Path,
    hop: Hop,
    values: Mapping[str, float],
    source: int | None,
    least: float = -np.inf,
) -> Found:
    """A refined and verified solution from one neighbour, or from the starts; None if that neighbour leads nowhere,
    or to an objective on the first mesh below ``least``."""
    if source is None:
        return _from_starts(hop, definition.starts or hop.design.solver.starts)
    clock = Stopwatch()
    t, solver = _first_program(definition, hop, values)
    outcome = _from_neighbour(hop, t, solver, source, load_begin(folder, source))
    clock.mark("starts")
    if not outcome.success or outcome.objective < least:
        return None
    return finish(hop, outcome, [outcome], _silent, clock, t), _begin(outcome, t)


def _from_starts(hop: Hop, count: int) -> Found:
    clock, t = Stopwatch(), first_transcription(hop)
    outcomes = run_starts(hop, count, 1, _silent)
    clock.mark("starts")
    finished = [(finish(hop, o, outcomes, _silent, clock, t), _begin(o, t)) for o in contenders(outcomes)]
    if not finished:
        raise not_solved(hop, outcomes)
    return max(finished, key=lambda pair: (pair[0].verified, pair[0].summary["objective_value"]))


def _begin(outcome: StartOutcome, t: Transcription) -> dict[str, np.ndarray]:
    """What a neighbour begins from: variables (SI), multipliers and objective on the first mesh."""
    return {
        "x": outcome.vectors["z"] * t.scale,
        "lam_g": outcome.vectors["lam_g"],
        "lam_x": outcome.vectors["lam_x"],
        "objective": np.array(outcome.objective),
    }


def _from_neighbour(
    hop: Hop, t: Transcription, solver: NlpSolver, source: int, begin: Mapping[str, np.ndarray]
) -> StartOutcome:
    """The first mesh's program from a neighbour's optimum: with its multipliers, else without."""
    began, name = time.perf_counter(), f"point {source}"
    if len(begin["x"]) != len(t.scale) or len(begin["lam_g"]) != len(t.lbg):  # another mesh or other constraints
        return StartOutcome(name, "does not fit", False, 0.0, 0, 0.0, {})
    z = begin["x"] / t.scale
    s = solver.from_vector(z, (begin["lam_g"], begin["lam_x"]))
    if not s.success:
        s = NlpSolver(t, {"ipopt.max_iter": hop.design.solver.max_iterations}).from_vector(z)
    return outcome_of(name, s, time.perf_counter() - began)


def _first_program(definition: Definition, hop: Hop, values: Mapping[str, float]) -> tuple[Transcription, NlpSolver]:
    """The first mesh's program of a point, compiled once for all points that differ in numbers of leg and start."""
    numbers = physical_parameters(hop.leg)
    form = {entry: x for entry, x in values.items() if entry not in numbers and not entry.startswith("start.")}
    key = repr((definition.as_dict(), form))
    if key not in _compiled:
        _compiled.clear()
        t = first_transcription(hop)
        _compiled[key] = t, NlpSolver(t, WARM | {"ipopt.max_iter": PATIENCE})
        return _compiled[key]
    t, solver = _compiled[key]
    t = with_numbers_of(t, hop.problem)
    return t, solver.on(t)


def _silent(text: str) -> None:
    """Progress is the study's, not a point's."""
