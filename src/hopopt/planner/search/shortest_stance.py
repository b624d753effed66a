"""Of hops that are equal in value, the one with the shortest stance.

Where a jump may wait on the ground, a longer stance gives nothing, and the solver ends at whichever it meets. The shortest is
looked for on the first mesh, with the stance bounded ever tighter; the hop is then refined and verified within the limits that
were asked for.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import inf, sqrt

from hopopt.nlp.deadline import Deadline
from hopopt.nlp.refinement.mesh_refinement import BEHIND
from hopopt.nlp.solver.ipopt import Bounds
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.hop import Hop
from hopopt.ocp.phases import STANCE
from hopopt.planner.answer.program_figures import by_longest
from hopopt.planner.attempts import AS_GOOD
from hopopt.planner.refine_and_verify import refine_outcome, refined_and_verified
from hopopt.planner.search.multistart import Progress, StartOutcome, first_solver, outcome_of, same, solution_of
from hopopt.planner.solution import Solution
from hopopt.planner.stopwatch import Stopwatch

TRIALS = 8  # stances that are tried
SHORTER = 0.98  # of a stance: what is nearer to it is not looked for


def with_shortest_stance(
    hop: Hop, best: Solution, outcomes: Sequence[StartOutcome], say: Progress, clock: Stopwatch, until: Deadline
) -> Solution:
    """The best hop or, if a shorter stance loses no more than its stated error, that with the shortest."""
    s = best.summary
    allowed = s.objective_error.either_way
    waits = s.leans_on.stance_at_its_limit == "longest" and s.gains.get("longest stance", 0.0) <= allowed < inf
    if not (best.verified and waits) or hop.free_parameters or until.passed:
        return best
    say("a longer stance gives nothing: looking for the shortest that is as good")
    chosen = next(o for o in outcomes if o.name == s.starts.chosen)
    found = _shortest(hop, chosen, allowed, until)
    if found is None:
        return best
    settled = hop.design.solver.objective_tolerance * abs(s.objective_value)
    least = s.objective_value - hop.objective.signed_value(settled)  # it need be no better
    refinement = refine_outcome(hop, found, say, restarts=False, until=until, known=least)
    if refinement.ended == BEHIND:
        return best
    again = refined_and_verified(
        hop, found, outcomes, say, clock, restarts=False, until=until, attempts=AS_GOOD, refinement=refinement
    )
    lost = hop.objective.signed_value(s.objective_value) - hop.objective.signed_value(again.summary.objective_value)
    as_sure = again.verified and (again.summary.certified or not s.certified)
    if not as_sure or lost > allowed or again.lift_off > SHORTER * best.lift_off:
        return best
    return again


def _shortest(hop: Hop, chosen: StartOutcome, allowed: float, until: Deadline) -> StartOutcome | None:
    """On the first mesh, from the hop that a start led to, the shortest stance of which 1 % is worth no more than ``allowed``
    [the objective's unit]; None if that is no shorter."""
    solver = first_solver(hop, until=until)
    t, signed_value = solver.transcription, hop.objective.signed_value
    longest = found = solution_of(chosen, t)
    low, trial, bracketed = hop.design.hop.stance_duration[0], found.phases[STANCE].duration / 2, False
    for _ in range(TRIALS):
        if until.passed or not low < trial < SHORTER * found.phases[STANCE].duration:
            break
        tried = solver(found.phases, found.parameters, bounds=_with_stance(t, trial))
        slope = by_longest(tried, STANCE)
        if tried.success and 0.01 * trial * slope <= allowed and same(tried.objective, longest.objective):
            found, trial = tried, sqrt(low * trial) if bracketed else trial / 2
            continue
        low, bracketed = trial, True
        trial = sqrt(low * found.phases[STANCE].duration)
        lost = signed_value(longest.objective) - signed_value(tried.objective)
        if tried.success and lost > 0 and slope > 0:  # as below the top of a parabola
            trial = min(trial, low + 2 * lost / slope)
    return (
        None
        if found is longest
        else replace(outcome_of(chosen.name, found, chosen.seconds), iterations=chosen.iterations)
    )


def _with_stance(t: Transcription, longest: float) -> Bounds:
    """The program's own bounds with another longest stance [s]."""
    (low, high), where = t.bounds({}), t.variables[STANCE].durations
    high[where] = longest / t.scale[where]
    return Bounds(low, high, t.lbg, t.ubg)
