"""A map: every point of a study solved on the first mesh alone, warm from its neighbour, and some of them verified.

The first point gets the search of a single solve; the families of hops that it finds are carried through the map, piece by
piece, and each is followed where it could be the best. Points that failed or lie below the trend are solved again
from all around them. What is given depends on the definition alone, not on the number of processes or on interruptions.
"""

import os
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hopopt.amounts import check
from hopopt.errors import ResultError, UsageError
from hopopt.files import remove_abandoned
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.ocp.objectives.registry import find
from hopopt.planner.stopwatch import Countdown
from hopopt.studies.faults import kept
from hopopt.studies.maps.doubt import doubtful
from hopopt.studies.maps.found import Map, Verified
from hopopt.studies.maps.part_file import FOLDER, read_part, save_part
from hopopt.studies.maps.piece import AGAIN, FINER, FIRST, PIECE, Part, solve_finer, solve_piece, solve_points_again
from hopopt.studies.maps.pieces import pieces
from hopopt.studies.maps.search import first_search
from hopopt.studies.maps.warm import MapPoint
from hopopt.studies.sweep.definition import Definition
from hopopt.studies.sweep.first_program import Neighbour
from hopopt.studies.sweep.point import solve_point
from hopopt.studies.sweep.point_file import Point
from hopopt.studies.sweep.store import (
    check_same,
    load_points,
    open_folder,
    read_definition,
    save_point,
    save_tables,
)
from hopopt.studies.sweep.workers.crew import Workers
from hopopt.studies.sweep.workers.processes import Progress, workers

CHECKED = 5  # points drawn and verified, to see how far the first mesh is off
GROUP, FEW = 8, 2  # points that are solved again together, and on a finer mesh
PASSES = 4  # in which points are solved again, at most


def run_map(
    definition: Definition,
    *,
    verify_best: int = 0,
    checked: int = CHECKED,
    doubts: Callable[[Mapping[int, MapPoint]], Collection[int]] = lambda points: (),
    finer: Callable[[Mapping[int, MapPoint]], Sequence[int]] = lambda points: (),
    to_verify: Callable[[Mapping[int, MapPoint], Mapping[int, np.ndarray]], Sequence[int]] | None = None,
    so_far: Callable[[Mapping[int, MapPoint]], str] = lambda points: "",
    processes: int | None = None,
    scheduler: str | None = None,
    results: Path = Path("results"),
    resume: Path | None = None,
    progress: Progress | None = None,
    opened: Callable[[Path], None] = lambda folder: None,
    until: Deadline = NEVER,
) -> Map:
    """The map of a definition, begun or resumed; ``opened`` is told the folder before the work.

    verify_best: how many of the best points are solved and verified in full; checked: how many points drawn at random;
    doubts: which points besides are solved again from those around them; finer: which have their value of a finer mesh
    then; to_verify: which are verified besides, once all are solved; so_far: words on the points that are solved, for the line of progress; until: when nothing more may be begun: the map is then what is finished, and can be resumed
    """
    began, say = time.perf_counter(), progress or (lambda text: None)
    check_verify_best(verify_best, definition.preliminary)
    folder = _folder(definition, results, resume)
    opened(folder)
    for place in (folder, folder / "points", folder / FOLDER):
        remove_abandoned(place)
    with kept(folder, f"what is finished is kept: hopopt sweep --resume {folder}"):
        with workers(count := processes or os.cpu_count() or 1, scheduler) as crew:
            work = _Work(definition, folder, crew, say, until, so_far)
            first = read_part(folder, FIRST, 0, definition) or _saved(folder, first_search(definition, count, say))
            parts = work.pieces(first)
            if not until.passed:
                parts += work.again(parts, doubts(_latest(parts)))
                parts += work.finer(parts, finer(_latest(parts)))
            points, solved_now, mapping = _latest(parts), work.solved, time.perf_counter() - began
            drawn, best = _drawn(definition, points, checked), _best(definition, points, verify_best)
            besides = to_verify(points, _hops(parts)) if to_verify else ()
            verified = work.verified(points, _hops(parts), list(dict.fromkeys([*drawn, *best, *besides])))
            if until.passed:
                return map_in(folder)
        sampled, leading = (tuple(Verified(points[k], verified[k]) for k in chosen) for chosen in (drawn, best))
        preliminary = tuple(points[k] for k in range(len(points)))
        shown = tuple(verified.get(k, p) for k, p in enumerate(preliminary))
        found = Map(
            definition, shown, folder, time.perf_counter() - began, preliminary, first.words, sampled, leading, mapping,
            solved_now,
        )  # fmt: skip
        save_tables(folder, definition, found.points, found.as_dict())
        return found


def map_in(folder: Path) -> Map:
    """The map in a folder with all that is finished; ResultError if it is none, or cannot be trusted."""
    definition = read_definition(folder)
    first = read_part(folder, FIRST, 0, definition)
    if first is None:
        raise ResultError(f"{folder}: no point of this map is finished: hopopt sweep --resume {folder}")
    begin = next(iter(first.exits), 0)  # a list has none
    parts = [p for piece in pieces(definition, begin) if (p := read_part(folder, PIECE, piece.number, definition))]
    for kind in (*(f"{AGAIN}-{number}" for number in range(1, PASSES + 1)), FINER):
        parts += [p for n in range(len(definition.points)) if (p := read_part(folder, kind, n, definition))]
    points, verified = _latest(parts), load_points(folder, definition).get(0, {})
    drawn = _drawn(definition, points, CHECKED)
    best = [k for k in _best(definition, points, len(points)) if k in verified and k not in drawn]
    sampled, leading = (
        tuple(Verified(points[k], verified[k]) for k in chosen if k in verified) for chosen in (drawn, best)
    )
    preliminary = tuple(points[k] for k in sorted(points))
    shown = tuple(verified.get(p.index, p) for p in preliminary)
    return Map(definition, shown, folder, sum(p.seconds for p in shown), preliminary, first.words, sampled, leading)


def check_verify_best(count: int, preliminary: bool) -> None:
    """UsageError for a number of best points to be verified that cannot be, or where all points are."""
    check("verify-best", count, 0)
    if count and not preliminary:
        raise UsageError("--verify-best goes with --preliminary: without that every point is verified")


def _folder(definition: Definition, results: Path, resume: Path | None) -> Path:
    if resume is not None:
        check_same(resume, definition)
    folder = resume or open_folder(definition, results)
    (folder / FOLDER).mkdir(exist_ok=True)
    return folder


def _saved(folder: Path, part: Part) -> Part:
    save_part(folder, part)
    return part


@dataclass
class _Work:
    """What the workers do for a map, each thing as it was kept if it is finished already.

    solved: points that were solved now
    """

    definition: Definition
    folder: Path
    crew: Workers
    say: Progress
    until: Deadline = NEVER
    so_far: Callable[[Mapping[int, MapPoint]], str] = lambda points: ""
    solved: int = 0

    def pieces(self, first: Part) -> list[Part]:
        """Every piece, each as soon as the one that it begins from is there."""
        begin, families = next(iter(first.exits.items()), (0, {}))
        whole = pieces(self.definition, begin)
        home = {k: piece.number for piece in whole for k in piece.points}
        done = {p.number: part for p in whole if (part := read_part(self.folder, PIECE, p.number, self.definition))}
        count_down = Countdown(self.say, "designs", sum(len(p.points) for p in whole if p.number not in done))
        waiting = [p for p in whole if p.number not in done]
        while waiting or self.crew.busy:
            if self.until.passed:
                waiting.clear()
            ready = [p for p in waiting if p.entrance is None or home[p.entrance] in done]
            for piece in ready[: self.crew.free]:
                waiting.remove(piece)
                if piece.entrance is None:
                    known, before = families, None
                else:
                    known, before = _begun(done[home[piece.entrance]], piece.entrance)
                self.crew.submit(solve_piece, self.definition, piece, known, before)
            for part in self.crew.done():
                save_part(self.folder, part)
                done[part.number] = part
                self.solved += len(part.points)
                count_down.more(len(part.points), self.so_far(_latest(list(done.values()))))
        return [done[p.number] for p in whole if p.number in done]

    def again(self, parts: Sequence[Part], besides: Collection[int]) -> list[Part]:
        """Points that are to be doubted solved again from those around them, until that improves none."""
        found = list[Part]()
        for number in range(1, PASSES + 1):
            if self.until.passed:
                break
            points = _latest([*parts, *found])
            first = number == 1
            jobs = doubtful(self.definition, points, first and not self.definition.listed, besides if first else ())
            hops = _hops([*parts, *found])
            given = [(points[k], [(points[g].family, hops[g]) for g in around]) for k, around in jobs.items()]
            words = "designs once more, from those around them"
            done = self._in_groups(f"{AGAIN}-{number}", words, GROUP, solve_points_again, given)
            found += done
            if not any(part.x for part in done):
                break
        return found

    def finer(self, parts: Sequence[Part], chosen: Sequence[int]) -> list[Part]:
        """Points with their values on a finer mesh."""
        points, hops = _latest(parts), _hops(parts)
        given = [(points[k], hops[k]) for k in chosen]
        return self._in_groups(FINER, "designs on a finer mesh", FEW, solve_finer, given)

    def _in_groups(
        self, kind: str, words: str, size: int, job: Callable[..., Part], given: Sequence[Any]
    ) -> list[Part]:
        """A job done for all that is given, so many at a time."""
        groups = [given[at : at + size] for at in range(0, len(given), size)]
        done = {n: part for n in range(len(groups)) if (part := read_part(self.folder, kind, n, self.definition))}
        waiting = [n for n in range(len(groups)) if n not in done]
        count_down = Countdown(self.say, words, sum(len(groups[n]) for n in waiting))
        while waiting or self.crew.busy:
            if self.until.passed:
                waiting.clear()
            for n in waiting[: self.crew.free]:
                waiting.remove(n)
                self.crew.submit(job, self.definition, kind, n, groups[n])
            for part in self.crew.done():
                save_part(self.folder, part)
                done[part.number] = part
                count_down.more(len(groups[part.number]))
        return [done[n] for n in sorted(done)]

    def verified(
        self, points: Mapping[int, MapPoint], hops: Mapping[int, np.ndarray], chosen: Sequence[int]
    ) -> dict[int, Point]:
        """The chosen points solved and verified in full, from their hops on the first mesh and by a search of their own."""
        done = load_points(self.folder, self.definition).get(0, {})
        waiting = [k for k in chosen if k not in done]
        if waiting:
            self.say(f"designs to be verified: {len(waiting)}, one after the other on each core")
        count_down = Countdown(self.say, "designs to be verified", len(waiting))
        while waiting or self.crew.busy:
            if self.until.passed:
                waiting.clear()
            for k in waiting[: self.crew.free]:
                waiting.remove(k)
                self.crew.submit(solve_point, self.definition, k, [_neighbour(points[k], hops[k])])
            for point, begin in self.crew.done():
                save_point(self.folder, point, begin)
                done[point.index] = point
                count_down.more()
        return done


def _begun(part: Part, entrance: int) -> tuple[Mapping, int | None]:
    """The families at a point of a finished piece, and the best of them."""
    point = next(p for p in part.points if p.index == entrance)
    return part.exits.get(entrance, {}), point.family if point.solved else None


def _neighbour(point: MapPoint, x: np.ndarray) -> Neighbour:
    """A point's hop of the first mesh, without multipliers, for itself to begin from."""
    return Neighbour(point.index, 0, {"x": x.astype(float)})


def _latest(parts: Sequence[Part]) -> dict[int, MapPoint]:
    return {p.index: p for part in parts for p in part.points}


def _hops(parts: Sequence[Part]) -> dict[int, np.ndarray]:
    return {k: x for part in parts for k, x in part.x.items()}


def _drawn(definition: Definition, points: Mapping[int, MapPoint], count: int) -> list[int]:
    """So many of the points that have a hop, drawn with the study's seed."""
    solved = sorted(k for k, p in points.items() if p.solved)
    drawn = np.random.default_rng(definition.seed).permutation(len(solved))[:count]
    return sorted(solved[n] for n in drawn)


def _best(definition: Definition, points: Mapping[int, MapPoint], count: int) -> list[int]:
    """The best points, the best first."""
    signed_value = find(definition.objective).signed_value
    solved = [p for p in points.values() if p.solved]
    return [p.index for p in sorted(solved, key=lambda p: -signed_value(p.objective_value or 0.0))[:count]]
