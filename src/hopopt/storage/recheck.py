"""Verification of a stored result, from its files alone."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from hopopt.errors import ResultError
from hopopt.nlp.interval_errors import interval_errors
from hopopt.nlp.ipopt import NlpSolution
from hopopt.ocp.custom import FIGURE, as_objective, custom
from hopopt.ocp.objective import HopObjective
from hopopt.optimality.certificate import Certificate, certify
from hopopt.optimality.error_estimate import objective_error
from hopopt.planner.certify import agreement
from hopopt.planner.custom_check import custom_checks, stated_value
from hopopt.planner.refine_and_verify import numerical_checks
from hopopt.planner.solution import Solution
from hopopt.planner.solution_program import has_multipliers, own_functions, stored_nlp
from hopopt.planner.stated_error import simulated
from hopopt.storage.folder import fitting
from hopopt.verify.check import KKT, Check
from hopopt.verify.plan import verify_plan

CONFIRMED = 1e-4  # relative: the fixed design may be worse than the co-design by this
AGREE = 1e-9  # stored tables against the stored trajectories, relative
SAME = 1e-7  # the error of the objective against the stated one, relative to the objective


def recheck(solution: Solution) -> list[Check]:
    """All checks of a stored solution: the plan's table, the NLP's conditions, and that the two belong together.

    Raises ResultError if the files do not hold what they must.
    """
    with fitting(solution.result_dir):
        return _recheck(solution)


def recertified(solution: Solution) -> Certificate | None:
    """The certificate of a stored solution, recomputed from its trajectories and multipliers; None if it was stored
    without multipliers.

    The plan's table must be of those trajectories; costates that the file holds are compared with those of its
    multipliers. Raises ResultError as ``recheck``.
    """
    if not has_multipliers(solution):
        return None
    try:
        certificate = certify(replace(stored_nlp(solution), phases=solution.phases))
        checks = [*certificate.checks, replace(_agreement(solution), name="stored torques and motion")]
        if solution.multipliers:
            checks.append(agreement(certificate, solution.multipliers))
        return replace(certificate, checks=tuple(checks))
    except (KeyError, ValueError, IndexError, TypeError, RuntimeError) as error:
        raise ResultError(
            f"{solution.result_dir}: its multipliers do not fit the plan ({type(error).__name__}: {str(error)[:200]}): "
            "solve it again"
        ) from error


def reverified(solution: Solution) -> Solution:
    """A stored solution that is ``verified`` only if its summary says so and every check passes again."""
    with fitting(solution.result_dir):
        verified = solution.verified and all(check.passed for check in recheck(solution))
    return replace(solution, summary={**solution.summary, "verified": verified})


def _recheck(solution: Solution) -> list[Check]:
    goal, constraints = own_functions(solution)
    names = {"clearance_m", *({goal.figure} - {FIGURE})}
    claims = {name: float(solution.summary[name]) for name in names}
    plan = verify_plan(solution.design, solution.tables, claims, goal.ends)
    plan += custom_checks(solution.robot, solution.tables, goal, constraints, stated_value(solution.summary))
    if not has_multipliers(solution):
        missing = Check("first-order conditions", float("inf"), KKT, "scaled", "the file holds no multipliers")
        return [missing, _agreement(solution), *plan]
    nlp = stored_nlp(solution)
    change = next(c for c in solution.summary["verification"] if c["name"] == "change of the objective")["residual"]
    errors, error = {name: interval_errors(nlp, name) for name in solution.phases}, objective_error(nlp)
    checks = numerical_checks(solution.design, nlp, errors, float("inf") if change is None else change, error)
    checks += [_agreement(solution), _same_program(solution, nlp), _same_limits(nlp)]
    more, told = simulated(solution, goal, error)
    return [*checks, *_same_error(solution, nlp, told), *plan, *more, *co_design_checks(goal, solution.summary)]


def co_design_checks(goal: HopObjective, summary: Mapping[str, Any]) -> Iterator[Check]:
    """That the fixed design confirms the co-design that it comes from, if it does."""
    if "codesign" in summary:
        value = summary["objective_value"]
        worse = goal.sign * (summary["codesign"]["objective_value"] - value) / max(abs(value), 1e-9)
        where = "the fixed design against the co-design"
        yield Check("co-design confirmed", max(worse, 0.0), CONFIRMED, "relative", where)


def with_functions(solution: Solution, objective: Any = None, constraints: Sequence[Any] = ()) -> Solution:
    """A stored solution with the functions of the user's own that it was found with, or their names."""
    own = tuple(custom(c) for c in constraints)
    found = replace(solution, own=(as_objective(objective) if objective else None, own))
    found.__dict__["tables"] = solution.tables  # those that the file holds, which are what is to be checked
    return found


def _same_limits(nlp: NlpSolution) -> Check:
    """The stored bounds are the problem's or tighter, those of equations equal."""
    t, b = nlp.transcription, nlp.bounds
    low_z, high_z = t.bounds(t.guess_from(nlp.phases))
    with np.errstate(invalid="ignore"):
        looser = [low_z - b.low_z, b.high_z - high_z, t.lbg - b.low_g, b.high_g - t.ubg]
    worst = float(np.nan_to_num(np.concatenate(looser), nan=0.0, posinf=np.inf).max())  # inf - inf: no limit in either
    return Check("limits are the problem's or tighter", max(worst, 0.0), AGREE, "scaled")


def _same_program(solution: Solution, nlp: NlpSolution) -> Check:
    """The stored NLP vectors against problem.toml's parameters, the stored trajectories and the stated objective."""
    wrong: list[Any] = [nlp.p - nlp.transcription.parameter_values()]
    for name, trajectory in solution.phases.items():
        other = nlp.phases[name]
        wrong += [getattr(trajectory, s) - getattr(other, s) for s in ("edges", "x_start")]
        wrong.append((trajectory.u - other.u) / np.maximum(1.0, np.abs(other.u).max(axis=(0, 1))))
    t = nlp.transcription
    cost = ca.Function("f", [t.nlp["x"], t.nlp["p"]], [t.nlp["f"]])(nlp.z, nlp.p)
    goal = t.problem.objective
    wrong.append((float(cost) - goal.cost(nlp.objective)) / goal.scale)
    return Check("the program is the problem's", float(np.max([np.abs(w).max() for w in wrong])), AGREE, "SI")


def _same_error(solution: Solution, nlp: NlpSolution, told: Mapping[str, Any]) -> Iterator[Check]:
    """The error of the objective, computed again, is no larger than the one that stands beside the answer."""
    if "objective_error" in solution.summary:  # results of earlier versions state none
        stated = solution.summary["objective_error"]["too_high_by"]
        more = (told["too_high_by"] - (np.inf if stated is None else stated)) / nlp.magnitude
        yield Check("error of the objective as stated", max(more, 0.0), SAME, "relative")


def _agreement(solution: Solution) -> Check:
    """The stored tables against the motion that the stored collocation data describe."""
    wrong = 0.0
    for name, table in solution.tables.items():
        fresh = solution.fresh_table(name)
        for part in ("t", "q", "v", "a", "tau", "f"):
            stored, computed = getattr(table, part), getattr(fresh, part)
            wrong = max(wrong, float(np.abs(stored - computed).max() / max(1.0, np.abs(computed).max())))
    return Check("tables agree with the collocation data", wrong, AGREE, "relative")
