"""Comparisons and simulated runs in their folders, and read as what they were; only the controllers are gone."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from hopopt.comparison.compare import OPTIMUM, Comparison
from hopopt.control.closed_loop import Run
from hopopt.control.strategies import Strategy, find
from hopopt.design import Design
from hopopt.storage.runs import StoredRuns, read_runs, required_hop, save_runs, stored_hop

Figures = Callable[[Path], Any]
KIND, RUN = "comparison", "simulation"


def save_comparison(
    found: Comparison, results: Path, data: Mapping[str, Any] | None = None, figures: Figures | None = None
) -> Path:
    """Write a comparison into a new folder below ``results``, the folder.

    data: what its JSON file holds, if more than ``as_dict()``; figures: draws into a folder
    """
    traces = {name: f.trace for name, f in found.figures.items()}
    hops = {"bound": found.solution, "plan": found.plan}
    return save_runs(KIND, found.solution.design, data or found.as_dict(), traces, results, figures, hops)


def read_comparison(folder: Path) -> Comparison:
    """The comparison in a folder; ResultError if files are missing or broken, UsageError without a strategy's module."""
    stored = read_runs(folder, KIND)
    bound = replace(required_hop(folder, "bound"), design=stored.design)
    rows = {name: row for name, row in stored.data["strategies"].items() if name != OPTIMUM}
    runs = {name: stored_run(stored, name, row) for name, row in rows.items()}
    mujoco = {name: row["mujoco_clearance_m"] for name, row in rows.items() if "mujoco_clearance_m" in row}
    return Comparison(bound, stored_hop(folder, "plan"), runs, mujoco, tuple(stored.data["notes"]))


def stored_run(stored: StoredRuns, name: str, row: Mapping[str, Any]) -> Run:
    """A run as it was, and what its row states of the controller."""
    return Run(stored_strategy(name, row), stored.design, stored.traces[name], None, row)


def stored_strategy(name: str, row: Mapping[str, Any]) -> Strategy:
    """A strategy with the settings that it had."""
    return replace(find(name), meaning=str(row["meaning"]), options=dict(row["options"]))


# ---- one run ------------------------------------------------------------------------------------------------------


def run_row(run: Run, hops: int) -> dict[str, Any]:
    """What is stated of one simulated run, for ``--json``."""
    return {
        "problem": run.design.name,
        "strategy": run.strategy.name,
        "meaning": run.strategy.meaning,
        "options": run.options,
        "hops": hops,
        **run.figures.as_dict(),
        "overshoot_m": run.overshoot,
        "limited_by": run.limited_by,
        "feedback_moves": run.moves,
        "lift_offs": run.trace.times_of("lift-off"),
        "touchdowns": run.trace.times_of("touchdown"),
    }


def save_run(
    run: Run, hops: int, results: Path, *, believed: Design | None = None, figures: Figures | None = None
) -> Path:
    """Write a run into a new folder below ``results``, the folder.

    hops: how many were asked for; believed: the problem, if the true leg is another one; figures: draws into a folder
    """
    truth = {} if believed is None else {"plant": run.design.model_dump(mode="json", exclude_none=True)}
    data = run_row(run, hops) | truth
    return save_runs(RUN, believed or run.design, data, {run.strategy.name: run.trace}, results, figures)


def read_run(folder: Path) -> Run:
    """The run in a folder; ResultError if files are missing or broken, UsageError without its strategy's module."""
    stored = read_runs(folder, RUN, names=())
    name = str(stored.data["strategy"])
    run = stored_run(read_runs(folder, RUN, names=(name,)), name, stored.data)
    return replace(run, design=Design.model_validate(stored.data["plant"])) if "plant" in stored.data else run
