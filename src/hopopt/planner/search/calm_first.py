"""Objectives whose optima are flat: solved with a larger tie-break first, then with their own.

With the larger one torques do not chatter, and meshes settle in seconds. On a mesh that was refined for one of them, what
different starts led to can be compared. On the first mesh its error is many times the differences.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import inf

from hopopt.nlp.refinement.mesh_refinement import Refinement
from hopopt.nlp.refinement.mesh_step import Report
from hopopt.nlp.refinement.next_mesh import Aims
from hopopt.nlp.solver.ipopt import GENTLE_OPTIONS, NlpSolution, NlpSolver
from hopopt.nlp.solver.known_optima import Known, KnownOptima
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.hop import Hop
from hopopt.planner.search.multistart import SAME_OPTIMUM, watch_on

CALM = 10.0  # times the tie-break
COMPARED = 100.0  # times the local error that is allowed at last, where hops are compared on one mesh
ROUGH = 10.0  # times the error that is allowed at last, where they are compared on two and the own program begins
UNTIGHTENED = 1.0  # share of its range by which a limit may be passed there: nothing is stated of it


def calmest(
    hop: Hop, begun: Sequence[NlpSolution], aims: Aims, report: Report = lambda step: None
) -> tuple[int, NlpSolution] | None:
    """Of solutions on the first mesh the number of that which leads to the best hop with the larger tie-break, and that
    hop; None if none is solved.

    All are compared on the mesh that the best so far has led to; none is followed to a hop that is known.
    """
    best: tuple[int, NlpSolution] | None = None
    rough = replace(aims, local_error=ROUGH * aims.local_error, change=ROUGH * aims.change, excess=UNTIGHTENED)
    compared = replace(rough, local_error=COMPARED * aims.local_error, change=inf, tightening_cost=inf)
    for k, start in enumerate(begun):
        if aims.until.passed and k:
            break
        beside = None if best is None else best[1]
        found = _solved_with_larger(hop, start, aims, beside)
        if found is not None and (beside is None or _better(found, beside)):
            found = Refinement(found, compared, report).run().solution
            best = (k, found) if beside is None or _better(found, beside) else best
    return None if best is None else (best[0], Refinement(best[1], rough, report).run().solution)


def uncalmed(hop: Hop, found: NlpSolution, aims: Aims) -> NlpSolution | None:
    """The hop's own program solved from one with the larger tie-break, on its mesh; None if it is not solved."""
    t = found.transcription
    return _solved(Transcription(hop.problem, t.scheme, t.mesh), found, aims)


def _solved_with_larger(hop: Hop, start: NlpSolution, aims: Aims, beside: NlpSolution | None) -> NlpSolution | None:
    """The program with the larger tie-break from a solution on the first mesh; on the mesh ``beside`` which it is compared,
    unless it leads there too."""
    if beside is None:
        t = start.transcription
        return _solved(Transcription(hop.tied(CALM), t.scheme, t.mesh), start, aims)
    t = beside.transcription
    watch = watch_on(t)
    watch.known.append(Known(beside.z, t.problem.objective.cost(beside.objective)))
    return _solved(t, start, aims, watch)


def _better(a: NlpSolution, b: NlpSolution) -> bool:
    """Whether a is better than b by more than hops of one optimum differ on two meshes."""
    signed_value = a.transcription.problem.objective.signed_value
    return bool(signed_value(a.objective - b.objective) > SAME_OPTIMUM * b.magnitude)


def _solved(t: Transcription, begun: NlpSolution, aims: Aims, known: KnownOptima | None = None) -> NlpSolution | None:
    """A program that differs in mesh and tie-break from that of a solution, from there; None if it is not solved, or leads
    to an optimum that is ``known``."""
    solver = NlpSolver(t, GENTLE_OPTIONS | {"ipopt.max_iter": aims.iterations}, known, aims.until)
    found = solver(t.guess_from(begun.phases), t.free_from(begun.parameters))
    return found if found.success and not solver.stopped else None
