"""A problem solved from a hop that is known: of the same leg with other numbers or limits."""

import time
from collections.abc import Callable

from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.solver.ipopt import NlpSolution, NlpSolver
from hopopt.ocp.hop import Hop
from hopopt.planner.refine_and_verify import refined_and_verified
from hopopt.planner.search.multistart import StartOutcome, first_transcription, not_solved, outcome_of
from hopopt.planner.solution import Solution, stored_nlp
from hopopt.planner.stopwatch import Stopwatch


def from_motion(hop: Hop, motion: NlpSolution, name: str = "a known hop", until: Deadline = NEVER) -> StartOutcome:
    """The problem solved from a motion of the same leg with other numbers, or with numbers fixed that are free here."""
    began, t = time.perf_counter(), first_transcription(hop)
    solver = NlpSolver(t, {"ipopt.max_iter": hop.design.solver.max_iterations}, until=until)
    return outcome_of(
        name, solver(t.guess_from(motion.phases), t.free_from(motion.parameters)), time.perf_counter() - began
    )


def solved_from_known(
    hop: Hop, known: Solution, say: Callable[[str], None] = lambda text: None, until: Deadline = NEVER
) -> Solution:
    """The verified answer of a problem that the hop of another leads to. Raises NotSolvedError if it leads to none."""
    outcome = from_motion(hop, stored_nlp(known), f"the hop of {known.clearance:.4f} m", until)
    if not outcome.success:
        raise not_solved(hop, [outcome], until=until)
    return refined_and_verified(hop, outcome, [outcome], say, Stopwatch(), until=until)
