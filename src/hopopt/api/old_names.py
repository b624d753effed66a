"""Verbs under the names that they had before; each warns with the name of today."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from typing_extensions import deprecated

from hopopt.api.asked import Constraint, Objective, Problem, Progress
from hopopt.api.results import Front
from hopopt.api.solution import Solution
from hopopt.api.studies import pareto
from hopopt.api.verbs import solve


@deprecated("hopopt.front is now hopopt.pareto, as the command is called")
def front(
    design: Problem,
    against: str = "energy",
    *,
    points: int = 8,
    lowest: float | None = None,
    starts: int | None = None,
    processes: int | None = None,
    results: str | Path | None = None,
    progress: Progress = None,
) -> Front:
    """The old name of ``pareto``."""
    return pareto(
        design, against, points=points, lowest=lowest, starts=starts, processes=processes, results=results,
        progress=progress,
    )  # fmt: skip


@deprecated("hopopt.codesign is now hopopt.solve(problem, free=...), as the command's --free")
def codesign(
    design: Problem,
    free: Mapping[str, tuple[float, float]],
    objective: Objective = "clearance",
    *,
    couple: Sequence[str] = (),
    constraints: Sequence[Constraint] = (),
    starts: int | None = None,
    processes: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Solution:
    """The old name of ``solve`` with ``free``."""
    return solve(
        design, objective, free=free, couple=couple, constraints=constraints, starts=starts, processes=processes,
        time_limit=time_limit, progress=progress,
    )  # fmt: skip
