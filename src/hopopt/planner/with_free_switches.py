"""The best hop of a leg once more with its drives' switches at free times: taken if it is verified and the same optimum."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from hopopt.nlp.deadline import Deadline
from hopopt.nlp.refinement.mesh_refinement import relative
from hopopt.ocp.hop import Hop
from hopopt.optimality.minimum_principle.free_switches import resolve
from hopopt.planner.refine_and_verify import aims_of, judged, progress_line, summed_up
from hopopt.planner.search.multistart import Progress, StartOutcome
from hopopt.planner.solution import Solution, stored_nlp
from hopopt.planner.stopwatch import Stopwatch


def with_free_switches(
    hop: Hop, best: Solution, outcomes: Sequence[StartOutcome], say: Progress, clock: Stopwatch, until: Deadline
) -> Solution:
    """The best hop solved again with its drives' switches at free times, if that is verified and agrees with it."""
    say("solving again with free switching times")
    settled = best.summary.mesh[-1]
    found = resolve(stored_nlp(best), settled, aims_of(hop, until), lambda step: say(progress_line(hop, step)))
    clock.mark("structure")
    if isinstance(found, str):
        return _with_structure(best, solved_again=False, note=found)
    outcome = next(o for o in outcomes if o.name == best.summary.starts.chosen)
    again = summed_up(judged(hop, found, clock), outcomes, outcome, clock)
    difference = relative(again.summary.objective_value, best.summary.objective_value)
    wrong = [*again.summary.failed_checks, *([] if again.summary.certified else ["the certificate"])]
    wrong += [f"another optimum, {difference:.0e} away"] if difference > hop.design.solver.objective_tolerance else []
    note = f"with free switching times it failed: {', '.join(wrong)}" if wrong else ""
    return _with_structure(
        best if wrong else again,
        solved_again=not wrong,
        note=note,
        switches_s=dict(found.switches),
        jumps_s=dict(found.jumps),
        difference=difference,
    )


def _with_structure(solution: Solution, **more: Any) -> Solution:
    return solution.with_summary(structure=replace(solution.summary.structure, **more))
