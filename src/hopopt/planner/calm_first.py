"""Objectives whose optima are flat: solved with a larger tie-break first, then with their own.

With the larger one torques do not chatter. Meshes settle in seconds, and what different starts led to can be compared: on
the first mesh its error is many times the differences.
"""

from collections.abc import Sequence
from dataclasses import replace

from hopopt.nlp.ipopt import GENTLE, NlpSolution, NlpSolver
from hopopt.nlp.mesh_refinement import MET, Aims, Refinement, Report
from hopopt.nlp.tightened_refinement import refinement_of
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.hop import Hop
from hopopt.ocp.problem import Problem

CALM = 10.0  # times the tie-break
ROUGH = 10.0  # times the local error that is allowed at last
UNTIGHTENED = 1.0  # share of its range by which a limit may be passed there: nothing is stated of it


def calm(hop: Hop, begun: NlpSolution, aims: Aims, report: Report = lambda step: None) -> Refinement | None:
    """The hop that ``begun``, a solution of the hop's program, leads to with the larger tie-break, refined so far that its
    value can be compared; None if that is not solved."""
    found = _solved(hop.tied(CALM), begun, aims)
    if not found.success:
        return None
    refinement = refinement_of(found, replace(aims, local_error=ROUGH * aims.local_error, excess=UNTIGHTENED), report)
    refinement.run()
    return refinement


def uncalmed(hop: Hop, found: Refinement | None, aims: Aims) -> NlpSolution | None:
    """The hop's own program solved from one with the larger tie-break, on its mesh; None if it is not solved."""
    solution = None if found is None else _solved(hop.problem, found.solution, aims)
    return solution if solution and solution.success else None


def least_first(hop: Hop, found: Sequence[Refinement | None]) -> list[int]:
    """Numbers of those that were solved, the best first, by the objective without the tie-break; those last whose meshes did
    not settle, so that their values tell little."""
    rank = {k: (r.ended == MET, hop.objective.merit(r.solution.value)) for k, r in enumerate(found) if r is not None}
    return sorted(rank, key=rank.__getitem__, reverse=True)


def _solved(problem: Problem, begun: NlpSolution, aims: Aims) -> NlpSolution:
    """A problem that differs in its tie-break, from a solution and on its mesh."""
    t = Transcription(problem, begun.transcription.scheme, begun.transcription.mesh)
    solver = NlpSolver(t, GENTLE | {"ipopt.max_iter": aims.iterations})
    return solver(t.guess_from(begun.phases), t.free_from(begun.parameters))
