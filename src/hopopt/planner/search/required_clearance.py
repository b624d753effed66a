"""The highest hop, from which the most economical hop of a given clearance is looked for; or there is none that high.

Close to the highest clearance, and beyond it, other starts drive the solver away from every hop, for minutes each; the
highest hop on the same mesh takes a second, and what stands in a clearance's way is told best from there.
"""

import time

import casadi as ca

from hopopt.errors import NotSolvedError
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.solver.ipopt import NlpSolution, NlpSolver
from hopopt.ocp.guesses.initial_guess import motion_guess
from hopopt.ocp.hop import Hop
from hopopt.ocp.objectives.objective import REQUIRED, HopObjective, lowest_point, required_clearance
from hopopt.optimality.directions.infeasibility import Conflict, conflict
from hopopt.planner.answer.limit_names import conflict_words
from hopopt.planner.search.first_mesh import search_first_mesh
from hopopt.planner.search.multistart import (
    Progress,
    StartOutcome,
    contenders,
    first_solver,
    first_transcription,
    outcome_of,
    run_chunk,
    solution_of,
)
from hopopt.problem.checking.hints import hints

MAXIMUM_CLEARANCE = "the highest hop"  # its name as a start
ANY = HopObjective(
    "any hop", "a hop as high as asked", "", lambda hop, e: ca.SX(0), "", "required clearance", maximize=False,
    parameters=lambda hop: (required_clearance(hop),), boundary=lambda hop: lowest_point(hop, REQUIRED),
)  # fmt: skip
FINER_MESH_GAIN = 0.01  # relative: what a finer mesh may add to the highest hop


def from_highest(
    hop: Hop, starts: int, say: Progress, thorough: bool = True, until: Deadline = NEVER
) -> list[StartOutcome]:
    """If the objective asks for a clearance, what the highest hop as one more start leads to on the first mesh.

    NotSolvedError if the highest from so many starts does not reach it; ``thorough``: with the limits that cannot hold
    together, unless a hop that high turns up there.
    """
    asked = hop.design.hop.clearance
    if hop.objective.ends != "required clearance" or asked is None:
        return []
    say(f"looking whether a clearance of {asked:g} m is in reach")
    maximum = maximum_clearance_hop(hop, starts, until)
    if maximum is None:
        return []
    if reaches(hop, maximum):
        return [begun_from(hop, maximum, until)]
    if until.passed:  # more starts may reach it
        return []
    found = _in_the_way(hop, maximum, until) if thorough else None
    if found is not None and not found.parts:
        return []
    more = "a larger solver.stance_intervals or " if asked < (1 + FINER_MESH_GAIN) * clearance(maximum) else ""
    raise NotSolvedError(
        f"{hop.design.name}: no hop was found that reaches the clearance of {asked:g} m that hop.clearance asks for: the "
        f"highest, on the first mesh from {starts} start{'s' if starts > 1 else ''}, has {clearance(maximum):.6g} m. "
        f"Ask for less, or try {more}more starts.",
        [*hints(hop.design), *conflict_words(hop.design, found)],
    )


def maximum_clearance_hop(hop: Hop, starts: int, until: Deadline = NEVER) -> NlpSolution | None:
    """On the first mesh: the first hop that reaches the clearance asked for or, if none does, the highest."""
    high = Hop(hop.design, "clearance", hop.free_parameters, hop.constraints)
    solver, t, maximum = first_solver(high, until=until), first_transcription(high), None
    for k in range(starts):
        if k and until.passed:
            break
        (outcome,) = run_chunk(high, [k], solver)
        if outcome.success:
            found = solution_of(outcome, t)
            if maximum is None or clearance(found) > clearance(maximum):
                maximum = found
            if reaches(hop, maximum):
                return maximum
    more = starts > 1 and not until.passed
    outcomes = search_first_mesh(high, starts, 1, lambda text: None, until=until).outcomes if more else ()
    found = [maximum, *(solution_of(o, t) for o in contenders(outcomes)[:1])]
    return max((s for s in found if s is not None), key=clearance, default=None)


def clearance(maximum: NlpSolution) -> float:
    """Of the highest hop [m]; its program's objective is less by the tie-break."""
    return float(maximum.parameters["clearance"][0])


def reaches(hop: Hop, maximum: NlpSolution) -> bool:
    """Whether the highest hop is as high as asked."""
    return clearance(maximum) >= (hop.design.hop.clearance or 0.0)


def begun_from(hop: Hop, maximum: NlpSolution, until: Deadline) -> StartOutcome:
    """The objective's own program solved from the highest hop's motion."""
    began, t = time.perf_counter(), first_transcription(hop)
    free = t.free_from(maximum.parameters)
    solver = NlpSolver(t, {"ipopt.max_iter": hop.design.solver.max_iterations}, until=until)
    s = solver(motion_guess(hop, maximum.phases), free)
    return outcome_of(MAXIMUM_CLEARANCE, s, time.perf_counter() - began)


def _in_the_way(hop: Hop, maximum: NlpSolution, until: Deadline) -> Conflict | None:
    """Which limits cannot hold together with the clearance asked for, seen from the highest hop."""
    if hop.free_parameters:
        return None
    t = first_transcription(Hop(hop.design, ANY, constraints=hop.constraints))
    return conflict(NlpSolver(t, {"ipopt.max_iter": 0})(t.guess_from(maximum.phases)), until)
