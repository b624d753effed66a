"""One point of a study: solved from a neighbour's solution or from the problem's starts, refined, verified.

Every point is solved on the problem's first mesh, from a neighbour's optimum and multipliers there; points that differ
in numbers of the leg and its start alone share one compiled program of it. Refinement and
checks are those of a single solve.
"""

import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from hopopt.errors import NotSolvedError, SolverError, one_line
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.guesses.feasibility import cannot_begin
from hopopt.ocp.hop import Hop
from hopopt.planner.answer.motion_figures import parts
from hopopt.planner.answer.program_figures import limit_gains
from hopopt.planner.attempts import POINT, Attempt, tried_again
from hopopt.planner.refine_and_verify import Answer, refine_and_verify
from hopopt.planner.search.first_mesh import search_first_mesh
from hopopt.planner.search.multistart import (
    CLOSE_OBJECTIVE,
    StartOutcome,
    contenders,
    first_transcription,
    not_solved,
    solved_from,
)
from hopopt.planner.search.required_clearance import from_highest
from hopopt.planner.solve import TIME_LIMIT
from hopopt.record import as_data
from hopopt.studies.faults import Fault, guarded
from hopopt.studies.sweep.definition import Definition
from hopopt.studies.sweep.first_program import (
    Begin,
    Neighbour,
    begin_of,
    compiling_shared,
    first_program,
    from_neighbour,
    kinds,
    stored_outcome,
    with_others,
)
from hopopt.studies.sweep.order import unlike
from hopopt.studies.sweep.point_file import ENDED, NOT_SOLVED, NOT_VERIFIED, VERIFIED, Point

BETTER = 1e-5  # relative: less is noise of the tolerances
CORRECTED = 1e-4  # relative: more than the same optimum on other meshes can differ
FIRST_MESH_ERROR = 3e-3  # relative: what the first mesh may be wrong by between two different optima
REFINEMENT_STOPPED = "refinement stopped: no start's or neighbour's optimum could be refined"

Kept = tuple[Point, Begin]
CARRIED_KINDS = 2  # of optima beside the best that a point hands on to its neighbours, at most
Found = tuple["Neighbour | None", StartOutcome, Begin, Transcription]  # on the first mesh
_one_at_a_time = threading.Lock()  # a worker of a scheduler may have several threads, a compiled program may not


def solve_point(definition: Definition, k: int, sources: Sequence[Neighbour], search: bool = True) -> Kept:
    """Solve point k from the sources; if ``search``, or none of them leads to a verified hop, as a single solve does too."""
    began = time.perf_counter()
    if definition.full and definition.full[k]:  # of another program than the map's hop
        sources = ()
    found = guarded(_solved, definition, k, sources, search)
    if isinstance(found, Fault):
        found = Point(k, definition.values(k), ENDED, found.sentence, traceback=found.traceback), {}
    point, begin = found
    tried = tuple(sorted((s.index, s.solved_in) for s in sources))
    return replace(point, tried=tried, seconds=time.perf_counter() - began), begin


def _solved(definition: Definition, k: int, sources: Sequence[Neighbour], search: bool) -> Kept:
    point, begin = Point(k, definition.values(k), NOT_SOLVED, searched=search), dict[str, np.ndarray]()
    found = list[Found]()
    with _one_at_a_time, compiling_shared(definition):
        until = NEVER.within(TIME_LIMIT)
        try:
            hop = Hop(definition.full_design_at(k), definition.objective)
            if faults := cannot_begin(hop.design, hop.robot):
                raise NotSolvedError(f"{definition.design.name}: the leg cannot hop from its start.", faults)
            found = _on_the_first_mesh(definition, hop, point.values, sources, until)
            if not search:
                point, begin = _best(hop, found, (point, begin), until)
            if not point.verified:
                point, refined = replace(point, searched=True), [] if search else [each[2] for each in found]
                found += _searched(definition, hop, bool(found), until)
                left = [each for each in found if all(each[2] is not begin for begin in refined)]
                point, begin = _best(hop, left, (point, begin), until)
        except NotSolvedError as error:  # one point does not end a study
            if not point.solved:
                point = replace(point, sentence=one_line(error))
    point = point if point.solved or point.sentence else replace(point, sentence=REFINEMENT_STOPPED)
    return point, _handed_on(begin, found)


def _best(hop: Hop, found: Sequence[Found], kept: Kept, until: Deadline) -> Kept:
    """The best point that its optima on the first mesh lead to, or the one that is kept."""
    point, begin = kept
    for source, answer, its in _answers(hop, found, until):
        if not point.solved or _preferred(hop, answer, point):
            point, begin = _described(point, answer, source), its
    return point, begin


def _handed_on(begin: Begin, found: Sequence[Found]) -> Begin:
    """What neighbours begin from: the best, and other kinds of optima that are nearly as good on the first mesh."""
    if not begin:
        return begin
    carried, best = [begin], float(begin["objective"])
    for other in (each[2] for each in sorted(found, key=lambda each: -each[1].signed_value)):
        close = abs(float(other["objective"]) - best) <= CLOSE_OBJECTIVE * abs(best)
        if close and len(carried) <= CARRIED_KINDS and all(unlike(other["shape"], b["shape"]) for b in carried):
            carried.append(other)
    return with_others(begin, carried[1:])


def solve_again(
    definition: Definition, old: Point, own: Begin, sources: Sequence[Neighbour], after_pass: int, search: bool = False
) -> Kept:
    """Solve a finished point from other neighbours and, if ``search``, as a single solve does; the better, and what was
    tried."""
    began = time.perf_counter()
    found = guarded(_solved_again, definition, old, own, sources, after_pass, search)
    if isinstance(found, Fault):
        found = replace(old, sentence=found.sentence, traceback=found.traceback), {}
    best, begin = found
    seconds = old.seconds + time.perf_counter() - began
    tried = tuple(sorted({*old.tried, *((s.index, s.solved_in) for s in sources)}))
    return replace(best, tried=tried, seconds=seconds, after_pass=after_pass), begin


def _solved_again(
    definition: Definition, old: Point, own: Begin, sources: Sequence[Neighbour], after_pass: int, search: bool
) -> Kept:
    best, begin = (old := replace(old, traceback="", searched=old.searched or search)), dict[str, np.ndarray]()
    with _one_at_a_time, compiling_shared(definition):
        until = NEVER.within(TIME_LIMIT)
        hop = Hop(definition.design_at(old.index), definition.objective)
        known = kinds(own)[0] if old.verified else None
        on_the_first_mesh = _on_the_first_mesh(definition, hop, old.values, sources, until)
        with suppress(NotSolvedError):
            on_the_first_mesh += _searched(definition, hop, False, until) if search else []
        for source, found, its in _other_answers(hop, on_the_first_mesh, known, until):
            if _better(hop, found.objective_value, best):
                best = replace(_described(old, found, source), solved_in=after_pass)
                begin = _handed_on(its, on_the_first_mesh)
    improved = best is not old and _better(hop, best.objective_value or 0.0, old, CORRECTED)
    by_search = improved and best.begun_from is None
    return replace(best, corrected=old.corrected or improved, found_by_search=old.found_by_search or by_search), begin


def again(definition: Definition, point: Point, begin: Begin) -> Point:
    """A point as it comes out when its optimum on the first mesh, ``begin``, is refined and verified once more."""
    with _one_at_a_time, compiling_shared(definition):
        until = NEVER.within(TIME_LIMIT)
        hop = Hop(definition.full_design_at(point.index), definition.objective)
        own = point.begun_from is None  # from starts, on a program of its own
        t = first_transcription(hop) if own else first_program(definition, hop, point.values, until)[0]
        found = _refined(hop, stored_outcome(hop, t, begin), t, until)
    return replace(_described(point, found, None), begun_from=point.begun_from)


def _better(hop: Hop, value: float, than: Point, by: float = BETTER) -> bool:
    """Whether a verified value beats a point's: by this share, or because that is not verified."""
    if not than.verified or than.objective_value is None:
        return True
    return hop.objective.signed_value(value - than.objective_value) > by * abs(than.objective_value)


def _described(point: Point, found: Answer, source: Neighbour | None) -> Point:
    heights: dict[str, Any] = {"clearance_m": None, "unverified_clearance_m": None, "parts": None, "limit": ""}
    if found.verified:
        gains = limit_gains(found.refined.solution, found.hop.design)
        heights["limit"] = next(iter(gains), "")
        heights |= {"clearance_m": found.claims["clearance_m"], "parts": as_data(parts(found.plan))}
    else:
        heights["unverified_clearance_m"] = found.claims["clearance_m"]
    return replace(
        point, outcome=VERIFIED if found.verified else NOT_VERIFIED, objective_value=found.objective_value,
        sentence="" if found.verified else f"failed: {', '.join(found.verdict.failed_checks)}",
        begun_from=source and source.index, certified=found.verdict.certified, error=_error(found), **heights,
    )  # fmt: skip


def _error(found: Answer) -> float | None:
    return found.verdict.error.too_high_by if found.verdict.error else None


def _answers(hop: Hop, found: Sequence[Found], until: Deadline) -> Iterator[tuple[Neighbour | None, Answer, Begin]]:
    """The refined and verified best of what was found on the first mesh, and what is close to it but unlike."""
    verified, refined = False, list[Begin]()
    for source, outcome, begin, t in sorted(found, key=lambda each: -each[1].signed_value):
        if refined and until.passed:
            return
        if not refined or not verified or _another(hop, begin, refined):
            try:
                got = _refined(hop, outcome, t, until)
            except SolverError:
                continue
            verified |= got.verified
            refined.append(begin)
            yield source, got, begin


def _searched(definition: Definition, hop: Hop, known: bool, until: Deadline) -> list[Found]:
    """The distinct hops that the search of a single solve finds; NotSolvedError if it finds none and none is ``known``."""
    t, count = first_transcription(hop), definition.starts or hop.design.solver.starts
    try:
        besides = from_highest(hop, count, _silent, thorough=False, until=until)
        outcomes = search_first_mesh(hop, count, 1, _silent, besides, until).outcomes
        if not known and not any(o.success for o in outcomes):
            raise not_solved(hop, outcomes, until=until)
    except NotSolvedError:
        if not known:
            raise
        return []
    return [(None, o, begin_of(o, t), t) for o in contenders(outcomes)]


def _other_answers(
    hop: Hop, found: Sequence[Found], own: Begin | None, until: Deadline
) -> Iterator[tuple[Neighbour | None, Answer, Begin]]:
    """What is verified of the optima found that may be better than the ``own``, and than each other: the best on the
    first mesh first, and none that is like one before."""
    verified: list[Begin] = []
    for source, outcome, begin, t in sorted(found, key=lambda each: -each[1].signed_value):
        known = [*verified[:1], *([] if own is None else [own])]
        again = any(not unlike(begin["shape"], other["shape"]) for other in verified)
        if again or until.passed or not all(_promising(hop, begin, other) for other in known):
            continue
        try:
            got = _refined(hop, outcome, t, until)
        except SolverError:
            continue
        if got.verified:
            verified.append(begin)
            yield source, got, begin


def _on_the_first_mesh(
    definition: Definition, hop: Hop, values: Mapping[str, float], sources: Sequence[Neighbour], until: Deadline
) -> list[Found]:
    """What the sources lead to on the first mesh: the best optimum of each, and their other kinds that were not tried yet."""
    found, begun = list[Found](), list[Begin]()
    kept = [kinds(source.begin) for source in sources]
    others = [(source, begin) for source, its in zip(sources, kept, strict=True) for begin in its[1:]]
    first = [(source, its[0]) for source, its in zip(sources, kept, strict=True)]
    for place, (source, from_here) in enumerate([*first, *others]):
        if found and until.passed:
            break
        if place >= len(first) and not all(unlike(from_here["shape"], other["shape"]) for other in begun):
            continue
        begun.append(from_here)
        try:
            t, solver = first_program(definition, hop, values, until)
            outcome = from_neighbour(hop, t, solver, replace(source, begin=from_here))
        except SolverError:
            continue
        if outcome.success:
            found.append((source, outcome, begin_of(outcome, t), t))
    return found


def _another(hop: Hop, begin: Begin, refined: Sequence[Begin]) -> bool:
    """Whether an optimum on the first mesh is close to the best and unlike all that were refined."""
    return _promising(hop, begin, refined[0]) and all(unlike(begin["shape"], other["shape"]) for other in refined)


def _preferred(hop: Hop, found: Answer, than: Point) -> bool:
    return found.verified and (not than.verified or _better(hop, found.objective_value, than))


def _promising(hop: Hop, begin: Begin, own: Begin) -> bool:
    """Whether an optimum on the first mesh may be better than the own one: it is, or it is close and another."""
    value = float(own["objective"])
    gain = hop.objective.signed_value(float(begin["objective"]) - value) / max(abs(value), 1e-9)
    return gain > CORRECTED or (gain > -FIRST_MESH_ERROR and unlike(begin["shape"], own["shape"]))


def _refined(hop: Hop, outcome: StartOutcome, t: Transcription, until: Deadline) -> Answer:
    """An optimum of the first mesh refined and verified, as a single solve is, with the attempts after it
    (planner/attempts.py)."""
    found = refine_and_verify(hop, outcome, _silent, t, restarts=False, until=until)

    def again(attempt: Attempt, other: Hop) -> Answer | None:
        if (begin := outcome if other is hop else solved_from(other, outcome, until)).success:
            first = t if other is hop else None
            return refine_and_verify(other, begin, _silent, first, attempt.restarts, until=until)
        return None

    return tried_again(hop, found, POINT, again, lambda answer: answer.trial, _silent, until)[1]


def _silent(text: str) -> None:
    """Progress is the study's, not a point's."""
