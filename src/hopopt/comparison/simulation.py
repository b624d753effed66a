"""A plan as controllers follow it in a simulation from rest."""

from hopopt.control.reference import PlanReference
from hopopt.design import Design
from hopopt.errors import UsageError
from hopopt.planner.reserve import reference_of
from hopopt.planner.solution import Solution


def followed(design: Design, plan: Solution) -> PlanReference:
    """A plan as strategies follow it from rest; UsageError for one of other joints, or one that begins as it lands."""
    where = f"the plan {plan.result_dir or plan.design.name}"
    if plan.design.leg.joints != design.leg.joints:
        raise UsageError(f"{where}: it moves other joints than those of {design.name}")
    if plan.design.hop.periodic:
        raise UsageError(f"{where}: a periodic hop begins as it lands, and a simulation at rest: give a single hop")
    return reference_of(plan)
