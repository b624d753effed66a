"""What a process does of a map: a piece of it, point after point; or points again, from others next to them."""

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

import numpy as np

from hopopt.nlp.deadline import NEVER
from hopopt.studies.faults import Fault, guarded
from hopopt.studies.maps.cold import finer_value
from hopopt.studies.maps.pieces import Piece
from hopopt.studies.maps.warm import LONGEST, Families, MapPoint, solved_at, solved_from_points
from hopopt.studies.sweep.definition import Definition
from hopopt.studies.sweep.first_program import compiling_shared
from hopopt.studies.sweep.point_file import ENDED

FIRST, PIECE, AGAIN = "first", "piece", "again"  # the search at the first point, a piece, points solved again
FINER = "finer"  # points solved on a finer mesh
SAME_HOP = 0.02  # share of the objective by which a finer mesh may differ and be of the same hop

_one_at_a_time = threading.Lock()  # a worker of a scheduler may have several threads, a compiled program may not


@dataclass(frozen=True)
class Part:
    """Points of a map that were solved together, and what others begin from.

    kind: FIRST, PIECE, FINER or, with its number, AGAIN
    number: of the piece or, of points that were solved again, of the group
    points: how each ended
    x: by point, variables [SI] of its hop, in single precision: they are many
    exits: by point from which other pieces begin, its families
    words: what the hops of the families do, of the search that found them
    """

    kind: str
    number: int
    points: tuple[MapPoint, ...]
    x: Mapping[int, np.ndarray]
    exits: Mapping[int, Families] = field(default_factory=dict)
    words: tuple[str, ...] = ()

    @property
    def ended(self) -> bool:
        """Whether a fault of hopopt ended one of its points, so that all are to be solved another time."""
        return any(p.outcome == ENDED for p in self.points)


def solve_piece(definition: Definition, piece: Piece, families: Families, before: int | None) -> Part:
    """Every point of a piece, the first from these families, of which ``before`` was the best."""
    carried, best = dict[int, Families](), dict[int, int | None]()
    points, x = list[MapPoint](), dict[int, np.ndarray]()
    with _one_at_a_time, compiling_shared(definition):
        for k in piece.points:
            begin = piece.begins.get(k)
            known = carried.get(begin, families) if begin is not None else families
            last = best.get(begin, before) if begin is not None else before
            point, carried[k] = _timed(definition, k, solved_at, definition, k, known, last, otherwise=known)
            best[k] = point.family if point.solved else last
            points.append(point)
            if point.solved:
                x[k] = carried[k][point.family].x.astype(np.float32)
    return Part(PIECE, piece.number, tuple(points), x, {k: carried[k] for k in piece.exits})


def solve_points_again(
    definition: Definition, kind: str, number: int, jobs: Sequence[tuple[MapPoint, Sequence[tuple[int, np.ndarray]]]]
) -> Part:
    """Points again, each from the variables of other points, by their families."""
    points, x = list[MapPoint](), dict[int, np.ndarray]()
    with _one_at_a_time, compiling_shared(definition):
        for old, begins in jobs:
            point, better = _timed(
                definition, old.index, solved_from_points, definition, old, begins, otherwise=np.zeros(0)
            )
            points.append(point if point.outcome != ENDED else old)
            if len(better):
                x[old.index] = better.astype(np.float32)
    return Part(kind, number, tuple(points), x)


def solve_finer(definition: Definition, kind: str, number: int, jobs: Sequence[tuple[MapPoint, np.ndarray]]) -> Part:
    """Points with their values on a finer mesh, each from its variables on the first; those of another hop as they were."""
    points, until = list[MapPoint](), NEVER.within(LONGEST)
    with _one_at_a_time, compiling_shared(definition):
        for old, x in jobs:
            found = guarded(finer_value, definition, old, x.astype(float), until)
            most = SAME_HOP * abs(old.objective_value or 0.0)
            same = isinstance(found, float) and abs(found - (old.objective_value or 0.0)) <= most
            points.append(replace(old, objective_value=found, unverified_clearance_m=found) if same else old)
    return Part(kind, number, tuple(points), {})


def _timed(
    definition: Definition, k: int, job: Callable[..., Any], *given: Any, otherwise: Any
) -> tuple[MapPoint, Any]:
    """What a job gives of a point, with its time; of one that a fault of hopopt ended the fault, and ``otherwise``."""
    began, found = perf_counter(), guarded(job, *given)
    if isinstance(found, Fault):
        found = MapPoint(k, definition.values(k), ENDED, found.sentence, traceback=found.traceback), otherwise
    point, more = found
    return replace(point, seconds=perf_counter() - began), more
