"""The error that is stated beside an answer: the estimate of its trajectories, and the hop simulated in one piece."""

from typing import Any

from hopopt.nlp.ipopt import NlpSolution
from hopopt.nlp.tightening_cost import price
from hopopt.ocp.objective import HopObjective
from hopopt.optimality.certificate import Certificate
from hopopt.optimality.error_estimate import ObjectiveError
from hopopt.planner.solution import Solution
from hopopt.verify.check import Check
from hopopt.verify.whole_hop import left_out, not_simulated, worth


def relaxed(solution: NlpSolution) -> dict[str, Any]:
    """For the summary: what the limits cost that hold between the nodes too (``gains``, objective's unit), by the
    multipliers: so much better might a hop be whose torques follow their limits inside an interval as well."""
    return {"relaxed": {"gains": price(solution) * solution.magnitude}}


def simulated(plan: Solution, goal: HopObjective, error: ObjectiveError) -> tuple[list[Check], dict[str, Any]]:
    """Checks of the simulated hop, and for the summary (objective's unit): ``too_high_by``, the larger one of the
    ``estimate`` and of what the ``simulated`` hop is short by, if it followed the plan; ``relative``, the same relative
    to the objective."""
    told = {"too_high_by": error.too_high_by, "relative": error.relative, "estimate": error.as_dict()}
    if note := not_simulated(plan.design):
        return left_out(note), {**told, "simulated": {"note": note}}
    claim = (goal.figure, {**plan.claims(), **plan.summary}[goal.figure], goal.sign)
    found = worth(plan.design, plan.tables, goal.figure, goal.ends)
    largest = max(error.too_high_by, found.short(*claim)) if found.followed else error.too_high_by
    told |= {"too_high_by": largest, "relative": largest / error.size}
    return found.checks(*claim, error.size), {**told, "simulated": found.as_dict(*claim)}


def could_be_beaten_by(summary: dict[str, Any], certificate: Certificate) -> float | None:
    """By how much, to first order, neighbouring hops may be better [objective's unit], the tie-break counted in: what the
    certificate leaves open, and the stated error; None for a hop that is not certified."""
    if not certificate.passed:
        return None
    still_open = sum(c.residual for c in certificate.checks if c.unit == "of the objective")
    return summary["objective_error"]["too_high_by"] + still_open * abs(summary["objective_value"])
