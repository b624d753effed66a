"""From one start's optimum on the first mesh to a verified answer: refined, checked, summed up."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from hopopt.design import Design
from hopopt.nlp.interval_errors import IntervalErrors
from hopopt.nlp.ipopt import NlpSolution
from hopopt.nlp.kkt_residuals import residuals
from hopopt.nlp.mesh_refinement import MET, Aims, MeshStep, Refinement
from hopopt.nlp.tightened_refinement import refinement_of
from hopopt.nlp.tightening_cost import price
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.hop import Hop
from hopopt.ocp.objective import HEIGHTS
from hopopt.ocp.tie_break import EFFORT
from hopopt.optimality.error_estimate import ObjectiveError, objective_error
from hopopt.optimality.free_switches import Resolved
from hopopt.planner.certify import attached
from hopopt.planner.custom_check import custom_checks, stated_value
from hopopt.planner.multistart import Progress, StartOutcome, first_transcription, solution_of
from hopopt.planner.solution import Solution
from hopopt.planner.stated_error import relaxed, simulated
from hopopt.planner.stopwatch import Stopwatch
from hopopt.planner.summary import summarize
from hopopt.planner.tighter_tolerances import finer
from hopopt.verify.check import KKT, LIMIT, Check
from hopopt.verify.plan import verify_plan

Refined = Refinement | Resolved
MARGIN = 0.5  # refinement aims at this share of the excess that verification allows


def finish(
    hop: Hop,
    outcome: StartOutcome,
    outcomes: Sequence[StartOutcome],
    say: Progress,
    clock: Stopwatch,
    first: Transcription | None = None,
    restarts: bool = True,
) -> Solution:
    """Refine one start's optimum, verify it and sum it up, with smaller tolerances if those of the problem are met and it
    is not verified; ``first`` is the first mesh's program if there is one."""
    refinement = refine_outcome(hop, outcome, say, first, restarts)
    clock.mark("refinement")
    say("verifying")
    found = summed_up(hop, refinement, outcomes, outcome, clock)
    if (closer := with_smaller_tolerances(hop, refinement, found.verified)) is None:
        return found
    say("not verified: refining again, with smaller tolerances")
    again = finish(closer, outcome, outcomes, say, clock, first, restarts)
    return again if again.verified else found


def with_smaller_tolerances(hop: Hop, refinement: Refinement, verified: bool) -> Hop | None:
    """The question once more with smaller tolerances (planner/tighter_tolerances.py), if it is worth it: the hop met all aims of its refinement
    and is not verified; else None."""
    smaller = finer(hop.design)
    return None if verified or refinement.ended != MET or smaller == hop.design else hop.with_solver_of(smaller)


def summed_up(
    hop: Hop, refinement: Refined, outcomes: Sequence[StartOutcome], outcome: StartOutcome, clock: Stopwatch
) -> Solution:
    """What came of refining a start's optimum: verified, certified, with every figure that is printed of it."""
    goal, solution = hop.objective, refinement.solution
    stated = stated_figure(hop, solution)
    own = (goal if goal.custom else None, hop.constraints)
    plan, error = Solution(hop.design, goal.name, solution.phases, stated, own=own), objective_error(solution)
    checks = numerical_checks(hop.design, solution, refinement.errors, refinement.change, error)
    checks += verify_plan(hop.design, plan.tables, plan.claims(), goal.ends)
    checks += custom_checks(plan.robot, plan.tables, goal, hop.constraints, stated_value(stated))
    more, told = simulated(plan, goal, error)
    told |= relaxed(solution)
    checks, plan = checks + more, plan.noted(summary={**stated, "objective_error": told})
    clock.mark("verification")
    found = summarize(hop, plan, solution, checks, outcomes, outcome, refinement, clock)
    certified = attached(found, solution)
    clock.mark("certificate")
    return certified


def stated_figure(hop: Hop, solution: NlpSolution) -> dict[str, float]:
    """Name and value [its unit] of what was optimised, without the tie-break, where no table of the plan tells it."""
    goal, t = hop.objective, solution.transcription
    if goal.figure in HEIGHTS:
        return {}
    names = [name for phase in t.problem.phases for name in phase.integrands]
    z, p = t.program.symbols()
    integrals = ca.Function("integrals", [z, p], [t.program.integral(z, p)])
    effort = np.array(integrals(solution.z, solution.p)).ravel()[[name == EFFORT for name in names]].sum()
    return {goal.figure: solution.objective + goal.sign * hop.tie_break * float(effort)}


def refine_outcome(
    hop: Hop, outcome: StartOutcome, say: Progress, first: Transcription | None = None, restarts: bool = True
) -> Refinement:
    """A start's optimum, refined as the problem's solver settings ask for."""
    aims = aims_of(hop) if restarts else replace(aims_of(hop), restarts=0)
    solution = solution_of(outcome, first or first_transcription(hop))
    refinement = refinement_of(solution, aims, lambda step: say(progress_line(hop, step)))
    refinement.run()
    return refinement


def aims_of(hop: Hop) -> Aims:
    """What refinement is to reach."""
    s = hop.design.solver
    meshes = s.max_refinements if s.refine else 0
    return Aims(s.tolerance, s.objective_tolerance, MARGIN * LIMIT, s.price_tolerance, meshes, s.max_iterations)


def progress_line(hop: Hop, s: MeshStep) -> str:
    """One solve of a refinement, for whoever waits; what counts first, for narrow screens cut the rest."""
    sizes = " + ".join(str(n) for n in s.intervals.values())
    held = f", limits held between the nodes in {s.held} intervals" if s.held else ""
    held += f", limits drawn in {s.drawn_in} time{'s' if s.drawn_in > 1 else ''}" if s.drawn_in else ""
    return (
        f"{hop.objective.name} {s.objective:.5f} {hop.objective.unit} on {sizes} intervals, local error "
        f"{s.local_error:.0e}, limits exceeded by {s.excess:.0e}{held}"
    )


def numerical_checks(
    design: Design,
    solution: NlpSolution,
    errors: Mapping[str, IntervalErrors],
    change: float,
    error: ObjectiveError | None = None,
) -> list[Check]:
    """First-order conditions recomputed, error of every interval, settled objective, price of the limits, and the error
    of the objective, unless ``error`` is it already."""
    r, s = residuals(solution), design.solver
    local = max(float(e.local.max()) for e in errors.values())
    return [
        Check("stationarity", r.stationarity, KKT, "scaled"),
        Check("constraints", r.feasibility, KKT, "scaled"),
        Check("complementarity", r.complementarity, KKT, "scaled"),
        Check("local error of the intervals", local, s.tolerance, "scaled"),
        Check("change of the objective", change, s.objective_tolerance, "relative"),
        Check("price of drawing in the limits", price(solution), s.price_tolerance, "relative"),
        (error or objective_error(solution)).check(),
    ]
