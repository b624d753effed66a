"""Tracking on legs that differ from the believed one: seeded draws of masses and torque constants."""

from copy import deepcopy
from typing import Any

import numpy as np

from hopopt.control.closed_loop import make_controller, simulate
from hopopt.control.reference import PlanReference
from hopopt.control.strategies import Strategy, find
from hopopt.design import Design
from hopopt.studies.compare import Comparison, reference_of


def mismatched(design: Design, draws: int, seed: int, mass: float, torque: float) -> list[tuple[Design, np.ndarray]]:
    """Seeded draws of a true leg: every mass within +- ``mass`` (share), every motor's torque constant within
    +- ``torque`` (share) of what the controller believes, uniformly; (leg, torque gain (n)) each."""
    rng, found = np.random.default_rng(seed), []
    for _ in range(draws):
        data = design.model_dump(exclude_none=True)
        for name in ("body", *design.leg.links):
            data["leg"][name]["mass"] *= 1 + mass * rng.uniform(-1, 1)
        found.append((Design.model_validate(data), 1 + torque * rng.uniform(-1, 1, len(design.leg.joints))))
    return found


def spread(
    comparison: Comparison, draws: int, seed: int, mass: float, torque: float, processes: int
) -> dict[str, dict[str, Any]]:
    """How the tracked optimum fares on drawn legs, for every tracking strategy compared; failed is below half of
    the plan's clearance."""
    legs, found = mismatched(comparison.solution.design, draws, seed, mass, torque), {}
    for name, run in comparison.runs.items():
        if run.strategy.needs_plan and comparison.plan is not None:
            heights = robustness(comparison, run.strategy, legs, processes)
            levels = {"lowest_m": 0, "p05_m": 5, "median_m": 50, "p95_m": 95, "highest_m": 100}
            found[name] = {
                "draws": draws,
                "mass": mass,
                "torque": torque,
                "seed": seed,
                "failed": int(np.sum(heights < 0.5 * comparison.plan.clearance)),
                **{key: float(np.percentile(heights, level)) for key, level in levels.items()},
                "clearances_m": heights.tolist(),
            }
    return found


def robustness(
    comparison: Comparison, strategy: Strategy, draws: list[tuple[Design, np.ndarray]], processes: int
) -> np.ndarray:
    """Clearances [m] of a strategy on every drawn leg, (draws,), side by side on the cores."""
    from joblib import Parallel, delayed

    design = comparison.solution.design
    reference = None if comparison.plan is None else reference_of(comparison.plan)
    data, chunks = design.model_dump(exclude_none=True), [draws[k::processes] for k in range(processes)]
    jobs = (delayed(_clearances)(data, strategy.name, reference, chunk) for chunk in chunks)
    parts: Any = Parallel(n_jobs=processes, backend="loky")(jobs)
    found = np.empty(len(draws))
    for k, part in enumerate(parts):
        found[k::processes] = part
    return found


def _clearances(
    data: dict[str, Any], name: str, reference: PlanReference | None, draws: list[tuple[Design, np.ndarray]]
) -> list[float]:
    design, strategy = Design.model_validate(data), find(name)
    fresh = make_controller(design, strategy, reference)  # its gains take longer than a hop
    runs = (simulate(design, strategy, plant=leg, torque_gain=gain, controller=deepcopy(fresh)) for leg, gain in draws)
    return [run.figures.clearance for run in runs]
