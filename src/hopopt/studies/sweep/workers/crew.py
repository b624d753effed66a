"""Workers that solve a study's points side by side, whatever they run on."""

from collections.abc import Callable
from typing import Any

from hopopt.extensions import carried

Kept = Any  # what a job gives: a point and what a neighbour begins from, or a part of a map
Job = Callable[..., Kept]
HOW_TO_RESUME = "what is finished is kept, --resume goes on, with fewer --processes if memory is short"


class Workers:
    """A number of processes, or this one if there is no executor; ``collect`` waits for one of several futures and returns
    the results of those that have ended, and the others."""

    def __init__(self, count: int, executor: Any, collect: Callable[[set[Any]], tuple[list[Kept], set[Any]]]):
        self.count, self.executor, self.collect, self.running = count, executor, collect, set[Any]()
        self.results: list[Kept] = []

    @property
    def busy(self) -> bool:
        return bool(self.running or self.results)

    @property
    def free(self) -> int:
        return self.count - len(self.running) - len(self.results)

    def submit(self, job: Job, *arguments: Any) -> None:
        """Begin a job."""
        if self.executor is None:
            self.results.append(job(*arguments))
        else:
            self.running.add(self.executor(carried(job), *arguments))

    def done(self) -> list[Kept]:
        """What has finished since, at least one."""
        if self.running:
            ended, self.running = self.collect(self.running)
            self.results += ended
        results, self.results = self.results, []
        return results
