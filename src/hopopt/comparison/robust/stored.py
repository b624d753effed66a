"""Robust plans in their folders, and read as what they were."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hopopt.comparison.compare import planned_trace
from hopopt.comparison.robust.robust import RobustHop
from hopopt.comparison.robust.robust_search import TRACKER, PlanTrial
from hopopt.comparison.robust.robustness import Reached
from hopopt.control.closed_loop import simulate
from hopopt.control.strategies import find
from hopopt.storage.motions import PLAN, ROBUST, read_robust_plan, write_motions
from hopopt.storage.runs import required_hop, save_runs, stored_hop


def save_robust(
    found: RobustHop, results: Path, data: Mapping[str, Any] | None = None, figures: Callable[[Path], Any] | None = None
) -> Path:
    """Write a robust plan, and its hop on the believed leg, into a new folder below ``results``, the folder; ResultError if it
    cannot be written.

    data: what its JSON file holds, if more than ``as_dict()``; figures: draws into a folder
    """
    best, outcomes = found.best, {name: list(r.outcomes) for name, r in found.reached.items()}
    more = {"outcomes": outcomes, "score_m": best.score, "feedback_matrix": _matrix(best.reference.feedback)}
    hops = {"bound": found.bound, "ideal_bound": None if found.ideal_bound is found.bound else found.ideal_bound}
    tracked = simulate(best.design, find(TRACKER), plan=best.reference).trace
    traces, whole = {PLAN: planned_trace(best.plan), TRACKER: tracked}, {**(data or found.as_dict()), **more}
    folder = save_runs(ROBUST, best.design, whole, traces, results, figures, hops)
    write_motions(folder, {PLAN: best.plan})
    return folder


def _matrix(feedback: np.ndarray | None) -> list[list[float]] | None:
    return None if feedback is None else feedback.tolist()


def read_robust(folder: Path) -> RobustHop:
    """The robust plan in a folder; ResultError if files are missing or broken."""
    plan, data = read_robust_plan(folder)
    lowest = data["lowest_by_way_m"]
    best = PlanTrial(
        data["way"], plan.motion.design, plan.motion, plan.reference, data["plan_verified"], lowest[data["way"]] or 0.0, data["score_m"],
        data["against"] or "",
    )  # fmt: skip
    bound = required_hop(folder, "bound")
    reached = {
        name: Reached(np.array(heights), tuple(data["outcomes"][name]))
        for name, heights in data["clearances_m"].items()
    }
    pd = {name: r for name, r in reached.items() if name != data["tracker"]}
    return RobustHop(
        best, lowest, bound, stored_hop(folder, "ideal_bound") or bound, reached[data["tracker"]], pd, data["pd_best"],
        data["share"], data["confidence"], data["evaluations"],
    )  # fmt: skip
