"""Results as the commands write them, made without solving: a study with given heights, a robust hop."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import hopopt as ho
from hopopt.comparison.robust.robust import RobustHop
from hopopt.comparison.robust.robust_search import PlanTrial
from hopopt.comparison.robust.robustness import Reached
from hopopt.ocp.objectives.registry import find as objective
from hopopt.planner.reserve import reference_of
from hopopt.storage.folder import new_folder
from hopopt.studies.pareto.front import Front, FrontPoint
from hopopt.studies.sweep.definition import Definition, define
from hopopt.studies.sweep.point_file import IMPOSSIBLE, NOT_SOLVED, NOT_VERIFIED, VERIFIED, Point
from hopopt.studies.sweep.run import Study
from hopopt.studies.sweep.store import open_folder, save_point, save_tables

RNG = np.random.default_rng(3)
ROBUST: dict[str, Any] = {
    "problem": "paper", "clearance_m": 0.61234567, "share": 0.95, "confidence": 0.9, "draws": 60, "rank": 1, "fell": 2,
    "median_m": 0.65, "lowest_m": 0.61, "bound_m": 0.7654321, "ideal_bound_m": 0.8, "plan_m": 0.7, "plan_verified": True,
    "tracker": "track", "reserve": {"torque": 0.05, "speed": 0.03, "ground_force": 12.0, "height": 0.005, "angle": 0.02},
    "way": "program", "lowest_by_way_m": {"reserve": 0.6, "program": 0.62},
    "feedback": {"k_p": [9685.0, 1579.0], "k_d": [387.4, 242.0]}, "evaluations": 3, "pd_best": "force_tuck", "pd": {"force_tuck": 0.51, "position_tuck": 0.5}, "pd_fell": {"force_tuck": 0, "position_tuck": 1},
    "clearances_m": {name: RNG.uniform(0.5, 0.7, 60).tolist() for name in ("track", "force_tuck", "position_tuck")},
    "exit_code": 0, "wall_s": 12.3, "seed": 4, "hopopt": "0.1.0",
}  # fmt: skip


def point(
    definition: Definition, k: int, height: float | None, outcome: str = VERIFIED, limit: str = "knee angle"
) -> Point:
    """A point of a study: verified with a height [m], or without one and of another outcome."""
    if height is None:
        return Point(k, definition.values(k), outcome, f"point {k} has no hop")
    parts = {"com_height_at_lift_off_m": 0.5, "ballistic_rise_m": height - 0.3, "com_height_over_lowest_point_m": -0.2}
    return Point(
        k, definition.values(k), VERIFIED, objective_value=height, clearance_m=height, parts=parts, limit=limit,
        certified=True, error=1e-7, seconds=1.5,
    )  # fmt: skip


def stored_study(
    results: Path, vary: dict[str, Any], heights: list[float | None], objective: str = "clearance", **more: Any
) -> Study:
    """A study with these heights, written as hopopt sweep writes it; its limits take turns."""
    definition = define(ho.load("paper"), vary, objective=objective, **more)
    bad, limits = (NOT_SOLVED, IMPOSSIBLE, NOT_VERIFIED), ("knee angle", "knee operating region")
    points = tuple(point(definition, k, h, bad[k % 3], limits[k % 2]) for k, h in enumerate(heights))
    folder = open_folder(definition, results)
    for p in points:
        save_point(folder, p, {})
    study = Study(definition, points, folder, 3.0)
    save_tables(folder, definition, points, study.as_dict())
    return study


def stored_front(hop: ho.Solution, results: Path) -> Front:
    """A front with the same hop at two points, found in another order than that of its axis."""
    front = Front(hop.design, objective("energy"), new_folder(results / "front"))
    for asked, value in ((hop.clearance, 200.0), (0.2, 50.0)):
        kept = ho.save(hop, front.folder / "points") if front.folder else hop
        place = str(kept.folder)
        front.add(FrontPoint("point", asked, hop.clearance, value, True, "", place, 1.0), kept)
    front.add(FrontPoint("point", 0.5, None, None, False, "not solved: no start led to a hop"), None)
    front.complete = True
    front.write()
    return front


def robust_hop(hop: ho.Solution) -> RobustHop:
    """A robust plan of three drawn legs, whose motion is a hop's."""
    legs = Reached(np.array([0.6, 0.7, 0.75]), ("the foot passed its apex", "landing 1", "fell"))
    reference = replace(reference_of(hop), feedback=np.hstack([np.diag([9.0, 8.0]), np.diag([2.0, 1.0])]))
    best = PlanTrial("program", hop.design, hop, reference, True, 0.6, 0.6)
    lowest = {"reserve": None, "program": 0.6}
    return RobustHop(best, lowest, hop, hop, legs, {"force_tuck": legs}, "force_tuck", 0.5, 0.5, 1)
