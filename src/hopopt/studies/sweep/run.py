"""A design study run: every point solved and verified, from its neighbours, side by side, and kept as it finishes.

The definition alone decides the order: seeds, solved from the problem's starts, then each point from those next to it
that come before. So the results depend neither on the number of processes nor on interruptions.
Further passes solve points again that are not verified, lie below what their neighbours suggest, or are next to
another kind of optimum. What a pass gives depends on the passes before it alone; this process alone writes.
"""

import os
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hopopt.errors import ProblemFileError, ResultError, UsageError
from hopopt.files import remove_abandoned
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.ocp.objectives.registry import find
from hopopt.studies.faults import kept
from hopopt.studies.sweep.definition import DRIVE, Definition
from hopopt.studies.sweep.order import doubtful, sources, to_search
from hopopt.studies.sweep.point import Neighbour, solve_again, solve_point
from hopopt.studies.sweep.point_file import ENDED, IMPOSSIBLE, NOT_VERIFIED, Point
from hopopt.studies.sweep.store import (
    check_same,
    dataset,
    load_begin,
    load_points,
    open_folder,
    read_definition,
    save_point,
    save_tables,
)
from hopopt.studies.sweep.workers.crew import Workers
from hopopt.studies.sweep.workers.processes import Clock, Progress, workers

PASSES = 8  # after the first, at most


@dataclass(frozen=True)
class Study:
    """A study: every point that is finished.

    definition: the problem, the objective, and what is varied
    points: in the study's order
    folder: where it lies
    seconds: of this run [s]
    """

    definition: Definition
    points: tuple[Point, ...]
    folder: Path
    seconds: float

    def __repr__(self) -> str:
        entries, verified = (axis.entry for axis in self.definition.axes), sum(p.verified for p in self.points)
        best = "" if self.best is None else f", best at {self.definition.words(self.best.values)}"
        over = f"over {', '.join(entries)}"
        return f"<Study of {self.definition.design.name} {over}: {verified} of {len(self.points)} verified{best}>"

    @property
    def best(self) -> Point | None:
        """The verified point with the best objective."""
        signed_value = find(self.definition.objective).signed_value
        return max(
            (p for p in self.points if p.verified), key=lambda p: signed_value(p.objective_value or 0.0), default=None
        )

    @property
    def at_the_edge(self) -> str:
        """Which entries of the best point are at the edge of what was tried; empty if none is."""
        tried, best = self.definition.points.T, self.best
        ends = [
            f"{entry} at the {'least' if x == values.min() else 'most'}"
            for (entry, x), values in zip(best.values.items() if best else (), tried if best else (), strict=True)
            if not DRIVE.fullmatch(entry) and x in (values.min(), values.max()) and values.min() < values.max()
        ]
        return f"{' and '.join(ends)} that was tried: better may lie beyond" if ends else ""

    @property
    def corrected(self) -> int:
        """How many points a later pass improved."""
        return sum(p.corrected for p in self.points)

    @property
    def exit_code(self) -> int:
        """0 every point decided and one verified, 1 none verified, 3 points that are solved but not verified, or that a fault
        of hopopt ended."""
        if any(p.outcome in (NOT_VERIFIED, ENDED) for p in self.points):
            return 3
        return 0 if any(p.verified for p in self.points) else 1

    @property
    def dataset(self) -> Any:
        """The points as an xarray.Dataset, with a dimension for each varied entry if they are a grid."""
        return dataset(self.definition, self.points)

    def as_dict(self) -> dict[str, Any]:
        """What ``--json`` prints."""
        return {
            "definition": self.definition.as_dict(),
            "points": [p.as_dict() | {"values": self.definition.stated(p.values)} for p in self.points],
            "outcomes": dict(Counter(p.outcome for p in self.points)),
            "failures": [{"index": p.index, "outcome": p.outcome, "sentence": p.sentence} for p in self.failures],
            "best": self.best.index if self.best else None,
            "corrected": self.corrected,
            "seconds": self.seconds,
            "exit_code": self.exit_code,
            "result_dir": str(self.folder),
        }

    @property
    def failures(self) -> list[Point]:
        """The points without a verified hop."""
        return [p for p in self.points if not p.verified]


def is_study(folder: Path) -> bool:
    """Whether a folder is that of a design study."""
    return (folder / "sweep.json").is_file()


def study_in(folder: Path) -> Study:
    """The study in a folder with all points that are finished; ResultError if none is, or one cannot be trusted."""
    definition, latest = read_definition(folder), dict[int, Point]()
    for _, points in sorted(load_points(folder, definition).items()):
        latest |= points
    if not latest:
        verify, state = (" --verify-best 5", "verified") if definition.preliminary else ("", "finished")
        raise ResultError(f"{folder}: no point of this study is {state}: hopopt sweep --resume {folder}{verify}")
    return Study(definition, tuple(latest[k] for k in sorted(latest)), folder, sum(p.seconds for p in latest.values()))


def run(
    definition: Definition,
    *,
    processes: int | None = None,
    scheduler: str | None = None,
    results: Path = Path("results"),
    resume: Path | None = None,
    progress: Progress | None = None,
    opened: Callable[[Path], None] = lambda folder: None,
    until: Deadline = NEVER,
) -> Study:
    """The study of a definition, begun or resumed; ``opened`` is told the folder before the work.

    until: when no point may be begun any more; the points that are finished by then are the study, which can be resumed
    """
    began = time.perf_counter()
    impossible = _impossible(definition)
    if resume is None:
        folder = open_folder(definition, results)
    else:
        check_same(resume, definition)
        folder = resume
    opened(folder)
    for place in (folder, folder / "points"):
        remove_abandoned(place)
    passes = load_points(folder, definition)
    first = passes.setdefault(0, {})
    for k in impossible.keys() - first.keys():
        save_point(folder, impossible[k], {})
    first |= {k: p for k, p in impossible.items() if k not in first}
    with kept(folder, f"what is finished is kept: hopopt sweep --resume {folder}"):
        with workers(processes or os.cpu_count() or 1, scheduler) as crew:
            show = Clock(progress or (lambda text: None), len(definition.points) - len(first))
            _first_pass(definition, folder, first, crew, show, until)
            finished = _further_passes(definition, folder, passes, crew, show, until)
        points = tuple(finished[k] for k in sorted(finished))
        study = Study(definition, points, folder, time.perf_counter() - began)
        if not until.passed:
            save_tables(folder, definition, points, study.as_dict())
        return study


def _impossible(definition: Definition) -> dict[int, Point]:
    """The points that are no problem at all, each with the reason; UsageError if they all are."""
    found: dict[int, Point] = {}
    for k in range(len(definition.points)):
        try:
            definition.design_at(k)
        except ProblemFileError as error:
            found[k] = Point(k, definition.values(k), IMPOSSIBLE, error.problems[0].removeprefix("override "))
    if len(found) == len(definition.points):
        raise UsageError(f"no point of the study is a possible problem: {found[0].sentence}")
    return found


# ---- the first pass -----------------------------------------------------------------------------------------


def _first_pass(
    definition: Definition, folder: Path, finished: dict[int, Point], crew: Workers, show: Clock, until: Deadline
) -> None:
    """Every point that is not finished, each as soon as the point it begins from is."""
    possible = [k for k in range(len(definition.points)) if k not in finished or finished[k].outcome != IMPOSSIBLE]
    order, before = sources(definition, possible)

    def origins(k: int) -> list[int]:
        """The points before it that have a solution, or else the nearest ancestor that has one."""
        solved = [g for g in before.get(k, ()) if finished[g].solved]
        while not solved and k in before:
            k = before[k][0]
            solved = [k] if finished[k].solved else []
        return solved

    waiting = [k for k in order if k not in finished]
    while (waiting and not until.passed) or crew.busy:
        ready = [] if until.passed else [k for k in waiting if all(g in finished for g in before.get(k, ()))]
        for k in ready[: crew.free]:
            waiting.remove(k)
            search = definition.starts is not None or k not in before
            crew.submit(solve_point, definition, k, _begins(folder, finished, origins(k)), search)
        for point, begin in crew.done():
            save_point(folder, point, begin)
            finished[point.index] = point
            show.finished(len(finished), len(definition.points), point)


def _begins(folder: Path, finished: Mapping[int, Point], indices: Sequence[int]) -> list[Neighbour]:
    return [Neighbour(k, finished[k].solved_in, load_begin(folder, finished[k])) for k in indices]


# ---- the further passes -------------------------------------------------------------------------------------


def _further_passes(
    definition: Definition,
    folder: Path,
    passes: dict[int, dict[int, Point]],
    crew: Workers,
    show: Clock,
    until: Deadline,
) -> dict[int, Point]:
    """Every point as it is after all passes: each solves again what the points after the last one give reason to."""
    finished = dict(passes[0])
    for number in range(1, PASSES + 1):
        if until.passed:
            break
        search = to_search(definition, finished, number, last=number == PASSES)
        jobs, done = {k: [] for k in search} | _reasons(definition, folder, finished), passes.get(number, {})
        waiting = [k for k in jobs if k not in done]
        if waiting:
            how = f"{len({*waiting} & {*search}) or 'none'} by a search as of a single solve"
            show.say(f"pass {number + 1}: {len(waiting)} point{'s' if len(waiting) > 1 else ''} again, {how}")
        while (waiting and not until.passed) or crew.busy:
            free = 0 if until.passed else crew.free
            for k in [waiting.pop(0) for _ in range(min(free, len(waiting)))]:
                old = finished[k]
                own = load_begin(folder, old) if old.solved else {}
                begins = _begins(folder, finished, jobs[k])
                crew.submit(solve_again, definition, old, own, begins, number, k in search)
            for point, begin in crew.done():
                save_point(folder, point, begin)
                done[point.index] = point
        if not jobs:
            break
        finished |= done
    return finished


def _reasons(definition: Definition, folder: Path, finished: Mapping[int, Point]) -> dict[int, list[int]]:
    shapes = {k: load_begin(folder, p)["shape"] for k, p in finished.items() if p.verified}
    return doubtful(definition, finished, shapes, find(definition.objective).sign)
