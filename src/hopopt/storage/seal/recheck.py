"""Verification of a stored result, from its files alone."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hopopt.nlp.refinement.interval_errors import IntervalErrors, interval_errors
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.ocp.custom import as_objective, custom, named_custom
from hopopt.ocp.hop import Hop
from hopopt.ocp.objectives.objective import HopObjective
from hopopt.optimality.second_order import Curvature
from hopopt.planner.answer.extras import CoDesign
from hopopt.planner.answer.notes import second_order
from hopopt.planner.answer.summary import VERSION
from hopopt.planner.checks.judge import judge, plan_checks, with_sharper_gears
from hopopt.planner.checks.verdict import Verdict
from hopopt.planner.solution import Solution, has_multipliers, hop_of, own_functions, stored_nlp
from hopopt.storage.folder import fitting
from hopopt.storage.multipliers import agreement
from hopopt.storage.stated_figures import motion_check, stated_checks
from hopopt.verify.check import KKT, Check

CONFIRMED = 1e-4  # relative: the fixed design may be worse than the co-design by this
TABLES_AGREE = 1e-9  # stored tables against the stored trajectories, relative


def recheck(solution: Solution) -> Verdict:
    """The verdict on a stored solution: that of a fresh one (planner/checks/judge.py), and that its files belong together.

    Raises ResultError if the files do not hold what they must.
    """
    with fitting(solution.result_dir):
        found = _recheck(solution)
    return replace(found, of_file=(_as_written(solution), *found.of_file))


def reverified(solution: Solution) -> Solution:
    """A stored solution that is ``verified`` only if its summary says so and every check passes again."""
    verified = solution.verified and recheck(solution).verified
    return solution.with_summary(verified=verified)


def _recheck(solution: Solution) -> Verdict:
    goal, constraints = own_functions(solution)
    own = (*named_custom(solution.design), *constraints)
    claims = stated_claims(solution, goal)
    co_design = tuple(co_design_checks(goal, solution.summary.objective_value, solution.summary.codesign))
    of_file = [_agreement(solution)]
    if not has_multipliers(solution):
        missing = Check("first-order conditions", float("inf"), KKT, "scaled", "the file holds no multipliers")
        checks = (missing, *plan_checks(solution, goal, own, claims), *co_design)
        return Verdict(checks, of_file=(*of_file, motion_check(solution)))
    hop, nlp, program, errors = stored_program(solution)
    change = solution.summary.check("change of the objective").residual
    found = with_sharper_gears(solution, judge(solution, program, goal, own, claims, errors, change)).with_checks(
        co_design
    )
    of_file += [
        _same_program(solution, nlp),
        _same_limits(nlp),
        *stated_checks(solution, hop, program, errors, found),
    ]
    if solution.multipliers:
        of_file.append(agreement(found.multipliers, solution.multipliers))
    second = second_order(nlp)
    if (stated := solution.summary.second_order) is not None:
        of_file.append(_same_directions(stated, second))
    return replace(found.with_checks((), of_file), second_order=second)


def stated_claims(solution: Solution, goal: HopObjective) -> dict[str, float]:
    """What the summary states of the plan, by name [the name's unit]."""
    names = ("clearance_m", goal.figure)
    return {name: x for name in names if (x := solution.summary.figure(name)) is not None}


def stored_program(solution: Solution) -> tuple[Hop, NlpSolution, NlpSolution, dict[str, IntervalErrors]]:
    """The question of a stored solution, its program with the trajectories of its vectors and with those of the file, and
    the local errors of these."""
    hop = hop_of(solution)
    nlp = stored_nlp(solution, hop.problem)
    program = replace(nlp, phases=solution.phases)
    return hop, nlp, program, {name: interval_errors(program, name) for name in solution.phases}


def co_design_checks(goal: HopObjective, value: float, codesign: CoDesign | None) -> Iterator[Check]:
    """That the fixed design, with its objective's ``value``, confirms the co-design that it comes from, if it does."""
    if codesign is not None:
        worse = goal.sign * (codesign.objective_value - value) / max(abs(value), 1e-9)
        where = "the fixed design against the co-design"
        yield Check("co-design confirmed", max(worse, 0.0), CONFIRMED, "relative", where)


def _as_written(solution: Solution) -> Check:
    """That no file was changed after it was written, and the summary does not contradict itself."""
    doubts = solution.doubts
    return Check("files as they were written", float(len(doubts)), 0.0, "files", "; ".join(doubts))


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
    return Check("limits are the problem's or tighter", max(worst, 0.0), TABLES_AGREE, "scaled")


def _same_program(solution: Solution, nlp: NlpSolution) -> Check:
    """The stored NLP vectors against problem.toml's parameters, the stored trajectories and the stated objective."""
    wrong: list[Any] = [nlp.p - nlp.transcription.parameter_values()]
    for name, trajectory in solution.phases.items():
        other = nlp.phases[name]
        wrong += [getattr(trajectory, s) - getattr(other, s) for s in ("edges", "x_start")]
        wrong.append((trajectory.u - other.u) / np.maximum(1.0, np.abs(other.u).max(axis=(0, 1))))
    value = nlp.value if solution.summary.version == VERSION else nlp.objective  # the tie-break was counted in once
    wrong.append((value - solution.summary.objective_value) / nlp.transcription.problem.objective.scale)
    return Check("the program is the problem's", float(np.max([np.abs(w).max() for w in wrong])), TABLES_AGREE, "SI")


def _same_directions(stated: Curvature, found: Curvature | None) -> Check:
    """The second-order test says of the hop what the summary states: whether it is a saddle. Counts are not compared, for
    eigenvalues at the edge of flat differ with the library of linear algebra."""
    wrong = np.inf if found is None else float((stated.saddle > 0) != (found.saddle > 0))
    return Check("second order as stated", wrong, 0.0, "verdicts that differ")


def _agreement(solution: Solution) -> Check:
    """The stored tables against the motion that the stored collocation data describe."""
    wrong = 0.0
    for name, table in solution.tables.items():
        fresh = solution.fresh_table(name)
        for part in fresh.parts:
            stored, computed = getattr(table, part), getattr(fresh, part)
            if stored is None:
                return Check(
                    "tables agree with the collocation data", np.inf, TABLES_AGREE, "relative", f"{name} has no {part}"
                )
            wrong = max(wrong, float(np.abs(stored - computed).max() / max(1.0, np.abs(computed).max())))
    return Check("tables agree with the collocation data", wrong, TABLES_AGREE, "relative")
