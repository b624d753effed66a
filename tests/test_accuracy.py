"""The answer does not hang on the mesh or on the scheme."""

from typing import Any

import numpy as np
import pytest

from hopopt.nlp.ipopt import NlpSolver
from hopopt.nlp.mesh import PhaseMesh
from hopopt.nlp.schemes import HERMITE_SIMPSON, Scheme
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


def solve_again(
    answer: Solution,
    scheme: Scheme,
    mesh: dict[str, PhaseMesh],
    tolerance: float,
    options: dict[str, Any] | None = None,
) -> float:
    """The objective of the same problem on another mesh or by another scheme, from the answer."""
    transcription = Transcription(Hop(answer.design).problem, scheme, mesh)
    solver = NlpSolver(transcription, {"ipopt.max_iter": 600, "ipopt.tol": tolerance, **(options or {})})
    again = solver(transcription.guess_from(answer.phases), {"clearance": answer.clearance})
    assert again.success
    return again.objective


@pytest.mark.slow
def test_twice_as_fine_a_mesh(answer: Solution) -> None:
    assert answer.verified
    mesh = {name: halved(answer, name, 1) for name in answer.phases}
    scheme = answer.phases["stance"].scheme
    assert solve_again(answer, scheme, mesh, 1e-9) == pytest.approx(answer.clearance, rel=1e-4)


@pytest.mark.slow
def test_hermite_simpson_agrees(answer: Solution) -> None:
    """Another scheme (order 4, controls linear and continuous), on intervals of 0.4 to 1.7 ms in stance.

    Its continuous controls smear every switch over an interval, so it falls short by a few 1e-4 at most.
    """
    edges = answer.phases["stance"].edges / answer.lift_off
    kept = [0.0]
    for edge in np.union1d(edges, np.linspace(0, 1, 241))[1:]:
        if edge - kept[-1] > 4e-4 and 1 - edge > 4e-4:
            kept.append(float(edge))
    mesh = {"stance": PhaseMesh((*kept, 1.0)), "flight": halved(answer, "flight", 0)}
    near = {"ipopt.mu_strategy": "monotone", "ipopt.mu_init": 1e-3, "ipopt.bound_push": 1e-4, "ipopt.bound_frac": 1e-4}
    assert solve_again(answer, HERMITE_SIMPSON, mesh, 1e-8, near) == pytest.approx(answer.clearance, rel=3e-4)
