"""Workers that solve a study's points side by side, whatever they run on."""

from collections.abc import Callable
from typing import Any

from hopopt.studies.sweep.point_file import Point

Kept = tuple[Point, Any]  # a point, and what a neighbour begins from
Job = Callable[..., Kept]
GO_ON = "what is finished is kept, --resume goes on, with fewer --processes if memory is short"


class Workers:
    """A number of processes, or this one if there is no executor; ``wait`` waits for one of several futures."""

    def __init__(self, count: int, executor: Any, wait: Callable[[set[Any]], tuple[set[Any], set[Any]]]):
        self.count, self.executor, self.wait, self.running = count, executor, wait, set[Any]()
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
            self.running.add(self.executor(job, *arguments))

    def done(self) -> list[Kept]:
        """What has finished since, at least one."""
        if self.running:
            ended, self.running = self.wait(self.running)
            self.results += [future.result() for future in ended]
        results, self.results = self.results, []
        return results
