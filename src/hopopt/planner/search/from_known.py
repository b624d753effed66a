"""A problem solved from a hop that is known: of the same leg with other numbers or limits."""

import time
from collections.abc import Callable
from typing import Any

from hopopt.errors import UsageError
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.solver.ipopt import NlpSolution, NlpSolver
from hopopt.nlp.trajectory import FromTrajectory
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.hop import Hop
from hopopt.planner.refine_and_verify import refined_and_verified
from hopopt.planner.search.multistart import StartOutcome, first_transcription, not_solved, outcome_of
from hopopt.planner.solution import Solution, stored_nlp
from hopopt.planner.stopwatch import Stopwatch

Known = Solution | NlpSolution  # a hop to begin from
GUESS = "the guess"  # what a start from a hop that was given is called


def guess_of(t: Transcription, known: Known) -> tuple[dict[str, FromTrajectory], dict[str, Any]]:
    """A hop as a guess for a program: its phases, and the parameters that are free; UsageError if it does not fit."""
    motion = stored_nlp(known) if isinstance(known, Solution) else known
    if lacking := [name for name in t.layouts if name not in motion.phases]:
        have = ", ".join(motion.phases)
        raise UsageError(
            f"the guess has no {' and no '.join(lacking)}: it is a hop of {have}; give one of the same kind"
        )
    for name, layout in t.layouts.items():
        trajectory, phase = motion.phases[name], layout.phase
        given = trajectory.x_start.shape[-1], trajectory.u.shape[-1]
        needed = sum(s.size for s in phase.states), sum(c.size for c in phase.controls)
        if given != needed:
            words = f"{given[0]} states and {given[1]} controls in {name}, and this program {needed[0]} and {needed[1]}"
            raise UsageError(
                f"the guess has {words}: give a hop of a leg with as many joints, for an objective of the kind"
            )
    return t.guess_from({name: motion.phases[name] for name in t.layouts}), t.free_from(motion.parameters)


def from_motion(hop: Hop, motion: Known, name: str = "a known hop", until: Deadline = NEVER) -> StartOutcome:
    """The problem solved from a motion of the same leg with other numbers, or with numbers fixed that are free here."""
    began, t = time.perf_counter(), first_transcription(hop)
    solver = NlpSolver(t, {"ipopt.max_iter": hop.design.solver.max_iterations}, until=until)
    return outcome_of(name, solver(*guess_of(t, motion)), time.perf_counter() - began)


def solved_from_known(
    hop: Hop, known: Solution, say: Callable[[str], None] = lambda text: None, until: Deadline = NEVER
) -> Solution:
    """The verified answer of a problem that the hop of another leads to. Raises NotSolvedError if it leads to none."""
    outcome = from_motion(hop, known, f"the hop of {known.clearance:.4f} m", until)
    if not outcome.success:
        raise not_solved(hop, [outcome], until=until)
    return refined_and_verified(hop, outcome, [outcome], say, Stopwatch(), until=until)
