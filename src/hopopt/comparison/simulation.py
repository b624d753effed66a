"""A leg hopped by a controller in simulation, as Python programs ask for it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hopopt.comparison.compare import reference_of
from hopopt.control.closed_loop import Run, make_plant
from hopopt.control.closed_loop import simulate as simulate_strategy
from hopopt.control.reference import PlanReference
from hopopt.control.strategies import find
from hopopt.design import Design, refuse_landed
from hopopt.errors import UsageError
from hopopt.planner.reserve import plan_to_track
from hopopt.planner.solution import Solution
from hopopt.problem.load import as_design


def simulate(
    problem: Design | str | Path,
    strategy: str = "force",
    *,
    plan: Solution | None = None,
    plant: Design | None = None,
    hops: int = 1,
    options: Mapping[str, Any] | None = None,
) -> Run:
    """Hop the simulated leg with a controller: its ``figures`` and its ``trace`` over time.

    problem: a problem, or its name or file
    strategy: a built-in one, or your own as module:Class (docs/own_controller.md)
    plan: what ``track`` is to follow; without one it solves for its own
    plant: the true leg, if it differs from the one that the strategy believes in
    options: settings of the strategy by name

    Raises UsageError for a leg, strategy or plan that cannot be simulated, NotSolvedError if there is no plan to track.
    """
    design, chosen = as_design(problem), find(strategy)
    refuse_landed(design, "a simulation from rest")
    make_plant(plant or design)  # what cannot be simulated is said before the work
    if plan is None and chosen.needs_plan:
        plan = plan_to_track(design, lambda text: None)
    reference = None if plan is None else followed(design, plan)
    return simulate_strategy(design, chosen, plan=reference, plant=plant, hops=hops, options=options)


def followed(design: Design, plan: Solution) -> PlanReference:
    """A plan as strategies follow it from rest; UsageError for one of other joints, or one that begins as it lands."""
    where = f"the plan {plan.result_dir or plan.design.name}"
    if plan.design.leg.joints != design.leg.joints:
        raise UsageError(f"{where}: it moves other joints than those of {design.name}")
    if plan.design.hop.periodic:
        raise UsageError(f"{where}: a periodic hop begins as it lands, and a simulation at rest: give a single hop")
    return reference_of(plan)
