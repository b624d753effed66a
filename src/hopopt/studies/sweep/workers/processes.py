"""The processes that solve a study's points, and how long they may still take."""

import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

from hopopt.errors import HopoptError
from hopopt.planner.search.beside import begin_worker, end_at_once
from hopopt.planner.stopwatch import duration
from hopopt.studies.sweep.point_file import Point
from hopopt.studies.sweep.workers.crew import HOW_TO_RESUME, Kept, Workers
from hopopt.studies.sweep.workers.dask_workers import dask_workers

Progress = Callable[[str], None]


class Clock:
    """Says how many points are finished and how long the rest may take."""

    def __init__(self, say: Progress, remaining: int):
        self.say, self.remaining, self.began, self.count = say, remaining, time.perf_counter(), 0

    def finished(self, done: int, total: int, point: Point) -> None:
        """One more point."""
        self.count += 1
        left = (time.perf_counter() - self.began) / self.count * (self.remaining - self.count)
        height = f" {point.clearance_m:.4f} m" if point.clearance_m is not None else ""
        self.say(f"{done} of {total} points, about {duration(left)} left (last: {point.outcome}{height})")


@contextmanager
def workers(count: int, scheduler: str | None = None) -> Iterator[Workers]:
    """So many processes, or those of a Dask scheduler; HopoptError if one dies and its work cannot be done again."""
    if scheduler is not None:
        with dask_workers(count, scheduler) as crew:
            yield crew
        return
    if count == 1:
        yield Workers(1, None, _first_of)
        return
    from joblib.externals.loky import get_reusable_executor

    options: dict[str, Any] = {"reuse": False, "env": {"OMP_NUM_THREADS": "1"}}
    executor = get_reusable_executor(count, initializer=begin_worker, initargs=(os.getpid(),), **options)
    try:
        yield Workers(count, executor.submit, _first_of)
    except BrokenProcessPool as error:
        raise HopoptError(f"a process of the study ended unexpectedly (out of memory?); {HOW_TO_RESUME}") from error
    finally:
        end_at_once(executor)


def _first_of(futures: set[Any]) -> tuple[list[Kept], set[Any]]:
    ended, running = wait(futures, return_when=FIRST_COMPLETED)
    return [future.result() for future in ended], set(running)
