"""Whether a plan may be called verified: one function decides, for a solve, a study's point, a co-design, a stored result.

The checks: the program's first-order conditions and errors, the plan's own table checked by code that the planner did not
use, and the whole hop simulated in one piece. The certificate of first-order optimality is part of the verdict.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from hopopt.design import Design
from hopopt.design.parameters import own_numbers
from hopopt.nlp.refinement.interval_errors import IntervalErrors
from hopopt.nlp.refinement.tightening_cost import tightening_cost
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.nlp.solver.kkt_residuals import residuals
from hopopt.ocp.custom import CUSTOM_FIGURE, Custom
from hopopt.ocp.objectives.objective import HopObjective
from hopopt.optimality.certificate import certify
from hopopt.optimality.error_estimate import ObjectiveError, objective_error
from hopopt.planner.checks.custom_check import custom_checks
from hopopt.planner.checks.program_limits import program_limits
from hopopt.planner.checks.verdict import Relaxed, StatedError, Verdict, multipliers_of
from hopopt.planner.motion import Motion
from hopopt.planner.stopwatch import Stopwatch
from hopopt.verify.check import KKT, Check
from hopopt.verify.plan import verify_plan
from hopopt.verify.whole_hop import Simulated, left_out, not_simulated, sharper_gears_clearance, whole_hop_rollout


def judge(
    plan: Motion,
    solution: NlpSolution,
    goal: HopObjective,
    constraints: Sequence[Custom],
    claims: Mapping[str, float],
    errors: Mapping[str, IntervalErrors],
    change: float,
    clock: Stopwatch | None = None,
) -> Verdict:
    """The verdict on a plan; ``with_sharper_gears`` adds what an answer tells beside it.

    plan: its motion and tables
    solution: of the nonlinear program that it comes from, with multipliers
    goal, constraints: the objective, and the user's own constraints
    claims: what is to be stated of the plan, by name [the name's unit]
    errors: local errors of every interval, by phase
    change: of the objective with the last mesh, relative
    clock: told how long verification and certificate took
    """
    clock, estimate = clock or Stopwatch(), objective_error(solution)
    checks = numerical_checks(plan.design, solution, errors, change, estimate)
    checks += plan_checks(plan, goal, constraints, claims)
    checks += program_limits(solution, errors, {check.name for check in checks})
    rollout, error = stated_error(plan, solution, goal, estimate, claims)
    clock.mark("verification")
    certificate = certify(solution)
    error = error.beside(certificate, solution)
    clock.mark("certificate")
    return Verdict((*checks, *rollout), error, certificate.checks, multipliers_of(certificate))


def with_sharper_gears(plan: Motion, verdict: Verdict) -> Verdict:
    """The verdict with what sharper gears make of the plan's hop, where it was simulated: it decides nothing, so that only the
    answer needs it."""
    error = verdict.error
    if error is None or error.simulated.clearance_m is None:
        return verdict
    simulated = replace(error.simulated, sharper_gears_m=sharper_gears_clearance(plan.design, plan.tables))
    return replace(verdict, error=replace(error, simulated=simulated))


def plan_checks(
    plan: Motion, goal: HopObjective, constraints: Sequence[Custom], claims: Mapping[str, float]
) -> list[Check]:
    """The checks of a plan's table by code that the planner did not use; arguments as those of ``judge``."""
    own = custom_checks(plan.robot, plan.tables, goal, constraints, claims.get(CUSTOM_FIGURE), own_numbers(plan.design))
    return [*verify_plan(plan.design, plan.tables, claims, goal.ends), *own]


def numerical_checks(
    design: Design,
    solution: NlpSolution,
    errors: Mapping[str, IntervalErrors],
    change: float,
    error: ObjectiveError | None = None,
) -> list[Check]:
    """First-order conditions recomputed, error of every interval, settled objective, tightening cost, and the error
    of the objective, unless ``error`` is it already."""
    r, s = residuals(solution), design.solver
    return [
        Check("stationarity", r.stationarity, KKT, "scaled"),
        Check("constraints", r.feasibility, KKT, "scaled"),
        Check("complementarity", r.complementarity, KKT, "scaled"),
        local_error(design, errors),
        Check("change of the objective", change, s.objective_tolerance, "relative"),
        Check("tightening cost", tightening_cost(solution), s.price_tolerance, "relative"),
        (error or objective_error(solution)).check(),
    ]


def local_error(design: Design, errors: Mapping[str, IntervalErrors]) -> Check:
    """The check of the largest local error of all intervals; ``errors``: of every interval, by phase."""
    local = max(float(e.local.max()) for e in errors.values())
    return Check("local error of the intervals", local, design.solver.tolerance, "scaled")


def simulated_in_one_piece(
    plan: Motion, goal: HopObjective, size: float, claims: Mapping[str, float]
) -> tuple[list[Check], Simulated]:
    """Checks of the hop simulated in one piece, and what is stated of that.

    size: of the objective [its unit]; claims: what is stated, by name
    """
    if note := not_simulated(plan.design):
        return left_out(note), Simulated(note=note)
    claim = (goal.figure, claims[goal.figure], goal.sign)
    found = whole_hop_rollout(plan.design, plan.tables, goal.figure, goal.ends)
    return found.checks(*claim, size), found.beside(*claim)


def stated_error(
    plan: Motion, solution: NlpSolution, goal: HopObjective, estimate: ObjectiveError, claims: Mapping[str, float]
) -> tuple[list[Check], StatedError]:
    """Checks of the hop simulated in one piece, and the stated error; ``claims``: what is stated, by name."""
    checks, simulated = simulated_in_one_piece(plan, goal, estimate.size, claims)
    short = simulated.short_by or 0.0 if simulated.followed else 0.0
    largest, relaxed = max(estimate.too_high_by, short), Relaxed(tightening_cost(solution) * solution.magnitude)
    return checks, StatedError(largest, largest / estimate.size, estimate, simulated, relaxed, could_be_beaten_by=None)
