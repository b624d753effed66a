"""Whether a leg can hop as high as it is asked to, told before the most economical such hop is looked for.

A clearance out of reach drives the solver away from every hop, for minutes at each start; the highest hop on the same
mesh takes a second, and what stands in its way is told best from there.
"""

import casadi as ca

from hopopt.errors import NotSolvedError
from hopopt.limit_words import conflict_words
from hopopt.multistart import Progress, StartOutcome, first_solver, first_transcription, run_chunk, solution_of
from hopopt.nlp.conflict import conflict
from hopopt.nlp.ipopt import NlpSolver
from hopopt.ocp.goal import DEMAND, HopObjective, demand, lowest_point
from hopopt.ocp.hop import Hop
from hopopt.problem_hints import hints

ANY = HopObjective(
    "any hop", "a hop as high as asked", "", lambda hop, e: ca.SX(0), "", "demand", maximize=False,
    parameters=lambda hop: (demand(hop),), boundary=lambda hop: lowest_point(hop, DEMAND),
)  # fmt: skip

NEARLY = 0.01  # relative: what a finer mesh may add to the highest hop
FINER = " A finer one may reach a little more: try a larger solver.stance_intervals."


def check_in_reach(hop: Hop, starts: int, say: Progress) -> None:
    """NotSolvedError if the objective asks for a clearance and the highest hop from so many starts, on the first mesh,
    does not reach it; with the limits that cannot hold together."""
    asked = hop.design.hop.clearance
    if hop.objective.ends != "demand" or asked is None:
        return
    say(f"looking whether a clearance of {asked:g} m is in reach")
    high = Hop(hop.design, "clearance", hop.freedom, hop.constraints)
    solver, highest = first_solver(high), None
    for k in range(starts):
        (found,) = run_chunk(high, [k], solver)
        if found.success and found.objective >= asked:
            return
        if found.success and (highest is None or found.objective > highest.objective):
            highest = found
    if highest is not None:
        raise NotSolvedError(
            f"{hop.design.name}: no hop reaches the clearance of {asked:g} m that hop.clearance asks for: the highest that "
            f"was found, on the first mesh from {starts} start{'s' if starts > 1 else ''}, has {highest.objective:.3f} m."
            + (FINER if asked < (1 + NEARLY) * highest.objective else ""),
            [*hints(hop.design), *_in_the_way(high, highest)],
        )


def _in_the_way(high: Hop, highest: StartOutcome) -> list[str]:
    """Which limits cannot hold together with the clearance asked for, seen from the highest hop."""
    if high.freedom:
        return []
    phases = solution_of(highest, first_transcription(high)).phases
    t = first_transcription(Hop(high.design, ANY, constraints=high.constraints))
    return conflict_words(high.design, conflict(NlpSolver(t, {"ipopt.max_iter": 0})(t.guess_from(phases))))
