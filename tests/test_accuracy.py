"""The answer does not hang on the mesh."""

import numpy as np
import pytest

from hopopt.nlp.ipopt import NlpSolver
from hopopt.nlp.mesh import PhaseMesh
from hopopt.nlp.transcribe import Transcription
from hopopt.ocp.hop import Hop
from hopopt.planner import solve
from hopopt.problem_file import load
from hopopt.solution import Solution


@pytest.fixture(scope="module")
def answer() -> Solution:
    return solve(load("paper"), starts=1)


def halved(solution: Solution, phase: str, times: int) -> PhaseMesh:
    """The solution's mesh with every interval cut in two, ``times`` times; ramps (switches) stay as they are."""
    trajectory, ramp = solution.phases[phase], np.zeros(len(solution.phases[phase].x_start), dtype=bool)
    ramp[solution.summary["ramps"][phase]] = True
    edges = trajectory.edges / trajectory.duration
    for _ in range(times):
        middle = 0.5 * (edges[1:] + edges[:-1])[~ramp]
        parts = np.where(ramp, 1, 2)
        edges, ramp = np.sort(np.concatenate([edges, middle])), np.repeat(ramp, parts)
    return PhaseMesh(tuple(edges.tolist()), (), tuple(int(k) for k in np.flatnonzero(ramp)))


@pytest.mark.slow
def test_twice_as_fine_a_mesh(answer: Solution) -> None:
    assert answer.verified
    mesh = {name: halved(answer, name, 1) for name in answer.phases}
    transcription = Transcription(Hop(answer.design).problem, answer.phases["stance"].scheme, mesh)
    solver = NlpSolver(transcription, {"ipopt.max_iter": 600, "ipopt.tol": 1e-9})
    again = solver(transcription.guess_from(answer.phases), {"clearance": answer.clearance})
    assert again.success
    assert again.objective == pytest.approx(answer.clearance, rel=1e-4)
