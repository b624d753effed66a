"""The highest hop, from which the most economical hop of a given clearance is looked for; or there is none that high.

Close to the highest clearance, and beyond it, other starts drive the solver away from every hop, for minutes each; the
highest hop on the same mesh takes a second, and what stands in a clearance's way is told best from there.
"""

import time

import casadi as ca

from hopopt.errors import NotSolvedError
from hopopt.nlp.ipopt import NlpSolution, NlpSolver
from hopopt.ocp.hop import Hop
from hopopt.ocp.initial_guess import motion_guess
from hopopt.ocp.objective import DEMAND, HopObjective, demand, lowest_point
from hopopt.optimality.infeasibility import Conflict, conflict
from hopopt.planner.first_mesh import search_first_mesh
from hopopt.planner.limit_names import conflict_words
from hopopt.planner.multistart import (
    Progress,
    StartOutcome,
    contenders,
    first_solver,
    first_transcription,
    outcome_of,
    run_chunk,
    solution_of,
)
from hopopt.problem.hints import hints

HIGHEST = "the highest hop"  # its name as a start
ANY = HopObjective(
    "any hop", "a hop as high as asked", "", lambda hop, e: ca.SX(0), "", "demand", maximize=False,
    parameters=lambda hop: (demand(hop),), boundary=lambda hop: lowest_point(hop, DEMAND),
)  # fmt: skip
NEARLY = 0.01  # relative: what a finer mesh may add to the highest hop


def from_highest(hop: Hop, starts: int, say: Progress, thorough: bool = True) -> list[StartOutcome]:
    """If the objective asks for a clearance, what the highest hop as one more start leads to on the first mesh.

    NotSolvedError if the highest from so many starts does not reach it; ``thorough``: with the limits that cannot hold
    together, unless a hop that high turns up there.
    """
    asked = hop.design.hop.clearance
    if hop.objective.ends != "demand" or asked is None:
        return []
    say(f"looking whether a clearance of {asked:g} m is in reach")
    highest = highest_hop(hop, starts)
    if highest is None:
        return []
    if reaches(hop, highest):
        return [begun_from(hop, highest)]
    found = _in_the_way(hop, highest) if thorough else None
    if found is not None and not found.parts:
        return []
    more = "a larger solver.stance_intervals or " if asked < (1 + NEARLY) * clearance(highest) else ""
    raise NotSolvedError(
        f"{hop.design.name}: no hop was found that reaches the clearance of {asked:g} m that hop.clearance asks for: the "
        f"highest, on the first mesh from {starts} start{'s' if starts > 1 else ''}, has {clearance(highest):.6g} m. "
        f"Ask for less, or try {more}more starts.",
        [*hints(hop.design), *conflict_words(hop.design, found)],
    )


def highest_hop(hop: Hop, starts: int) -> NlpSolution | None:
    """On the first mesh: the first hop that reaches the clearance asked for or, if none does, the highest."""
    high = Hop(hop.design, "clearance", hop.freedom, hop.constraints)
    solver, t, highest = first_solver(high), first_transcription(high), None
    for k in range(starts):
        (outcome,) = run_chunk(high, [k], solver)
        if outcome.success:
            found = solution_of(outcome, t)
            if highest is None or clearance(found) > clearance(highest):
                highest = found
            if reaches(hop, highest):
                return highest
    outcomes = search_first_mesh(high, starts, 1, lambda text: None).outcomes if starts > 1 else ()
    found = [highest, *(solution_of(o, t) for o in contenders(outcomes)[:1])]
    return max((s for s in found if s is not None), key=clearance, default=None)


def clearance(highest: NlpSolution) -> float:
    """Of the highest hop [m]; its program's objective is less by the tie-break."""
    return float(highest.parameters["clearance"][0])


def reaches(hop: Hop, highest: NlpSolution) -> bool:
    """Whether the highest hop is as high as asked."""
    return clearance(highest) >= (hop.design.hop.clearance or 0.0)


def begun_from(hop: Hop, highest: NlpSolution) -> StartOutcome:
    """The objective's own program solved from the highest hop's motion."""
    began, t = time.perf_counter(), first_transcription(hop)
    free = t.free_from(highest.parameters)
    solver = NlpSolver(t, {"ipopt.max_iter": hop.design.solver.max_iterations})
    s = solver(motion_guess(hop, highest.phases), free)
    return outcome_of(HIGHEST, s, time.perf_counter() - began)


def _in_the_way(hop: Hop, highest: NlpSolution) -> Conflict | None:
    """Which limits cannot hold together with the clearance asked for, seen from the highest hop."""
    if hop.freedom:
        return None
    t = first_transcription(Hop(hop.design, ANY, constraints=hop.constraints))
    return conflict(NlpSolver(t, {"ipopt.max_iter": 0})(t.guess_from(highest.phases)))
