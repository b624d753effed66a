"""The answer does not hang on the mesh."""

import numpy as np
import pytest

from hopopt.nlp.mesh import PhaseMesh
from hopopt.nlp.solver.ipopt import NlpSolver
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.hop import Hop
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.problem.load import load


def halved(solution: Solution, phase: str) -> PhaseMesh:
    """The solution's mesh with every interval cut in two."""
    edges = solution.phases[phase].edges / solution.phases[phase].duration
    return PhaseMesh(tuple(np.sort(np.concatenate([edges, 0.5 * (edges[1:] + edges[:-1])])).tolist()))


@pytest.mark.slow
def test_twice_as_fine_a_mesh(hop: Solution) -> None:
    assert hop.verified
    mesh = {name: halved(hop, name) for name in hop.phases}
    transcription = Transcription(Hop(hop.design).problem, hop.phases["stance"].scheme, mesh)
    solver = NlpSolver(transcription, {"ipopt.max_iter": 600, "ipopt.tol": 1e-9})
    again = solver(transcription.guess_from(hop.phases), {"clearance": hop.clearance})
    assert again.success
    assert again.objective == pytest.approx(hop.clearance, rel=1e-4)


@pytest.mark.slow
def test_hermite_simpson_agrees(hop: Solution) -> None:
    """Another scheme, other nodes, other multipliers: the same height."""
    design = load("paper", ["solver.scheme=hermite-simpson", "solver.max_refinements=1"])
    other = solve(design, starts=1)
    assert len(other.summary.mesh) > 1
    assert other.phases["stance"].scheme.name == "hermite-simpson"
    assert other.clearance == pytest.approx(hop.clearance, rel=1e-4)
