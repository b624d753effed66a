"""Robust plans in their folders, and read as what they were."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hopopt.comparison.compare import planned_trace
from hopopt.comparison.robust.robust import RobustHop
from hopopt.comparison.robust.robust_search import PlanTrial
from hopopt.comparison.robust.robustness import Reached
from hopopt.control.reference import PlanReference
from hopopt.storage.motions import read_motions, write_motions
from hopopt.storage.runs import read_data, required_hop, save_runs, stored_hop
from hopopt.verify.table import NORMALISED_TIMES

KIND, PLAN = "robust", "plan"


def save_robust(
    found: RobustHop, results: Path, data: Mapping[str, Any] | None = None, figures: Callable[[Path], Any] | None = None
) -> Path:
    """Write a robust plan into a new folder below ``results``, the folder; ResultError if it cannot be written.

    data: what its JSON file holds, if more than ``as_dict()``; figures: draws into a folder
    """
    best, outcomes = found.best, {name: list(r.outcomes) for name, r in found.reached.items()}
    more = {"outcomes": outcomes, "score_m": best.score, "feedback_matrix": _matrix(best.reference.feedback)}
    hops = {"bound": found.bound, "ideal_bound": None if found.ideal_bound is found.bound else found.ideal_bound}
    traces, whole = {PLAN: planned_trace(best.plan)}, {**(data or found.as_dict()), **more}
    folder = save_runs(KIND, best.design, whole, traces, results, figures, hops)
    write_motions(folder, {PLAN: best.plan})
    return folder


def _matrix(feedback: np.ndarray | None) -> list[list[float]] | None:
    return None if feedback is None else feedback.tolist()


def read_robust(folder: Path) -> RobustHop:
    """The robust plan in a folder; ResultError if files are missing or broken."""
    design, data = read_data(folder, KIND)
    plan = read_motions(folder, design)[PLAN]
    reference = PlanReference.from_tables(NORMALISED_TIMES, plan.tables, float(data["plan_m"]))
    if data["feedback_matrix"] is not None:
        reference = replace(reference, feedback=np.array(data["feedback_matrix"]))
    lowest = data["lowest_by_way_m"]
    best = PlanTrial(
        data["way"], design, plan, reference, data["plan_verified"], lowest[data["way"]] or 0.0, data["score_m"],
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
