"""The second-order test against problems whose minima and saddles are known in closed form."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hopopt.cli.screen.checks import second_order_line
from hopopt.nlp.mesh import uniform
from hopopt.nlp.schemes import HERMITE_SIMPSON, Scheme, radau
from hopopt.nlp.solver.ipopt import LEAST_MAGNITUDE, NlpSolution, NlpSolver
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.problem import Control, Objective, Phase, Problem, State
from hopopt.optimality import second_order
from hopopt.optimality.second_order import Curvature, curvature
from hopopt.planner.answer.notes import saddle_note
from hopopt.planner.answer.notes import second_order as entry
from hopopt.planner.solution import Solution, stored_nlp
from known_problems import Known, bryson_denham, guesses, minimum_effort, solve

INTERVALS = 8


def found(solution: NlpSolution) -> Curvature:
    counted = curvature(solution)
    assert counted is not None
    return counted


def string(k: float, idle: bool = False) -> Known:
    """Integral of x'^2 - k x^2 from 0 to 0 in time 1. x = 0 satisfies all first-order conditions; the second variation has
    the eigenvalues 1 - k / (n pi)^2, so that it is a minimum for k < pi^2 and a saddle above (a conjugate point)."""
    controls = (Control("u"), *((Control("w", lower=-1.0, upper=1.0),) if idle else ()))
    phase = Phase(
        "run", (State("x", initial=0.0, final=0.0),), controls, lambda s: {"x": s.u}, (1.0, 1.0),
        integrands={"action": lambda s: s.u**2 - k * s.x**2},
    )  # fmt: skip
    goal = Objective("action", lambda e: e.integral["run"]["action"])
    return Known(Problem("string", (phase,), goal), 0.0, {"run": (1.0, ([0.0], [0.0], 0.0))}, INTERVALS)


def stationary(known: Known, scheme: Scheme) -> NlpSolution:
    """The program at its guess, which satisfies its first-order conditions."""
    t = Transcription(known.problem, scheme, {"run": uniform(known.intervals)})
    solution = NlpSolver(t, {"ipopt.max_iter": 0})(guesses(known))
    assert solution.objective == 0.0
    return solution


@pytest.mark.parametrize("scheme", [radau(3), HERMITE_SIMPSON], ids=lambda s: s.name)
@pytest.mark.parametrize(("k", "better"), [(5.0, 0), (15.0, 1), (50.0, 2)])
def test_a_planted_saddle_is_told_from_a_minimum(scheme: Scheme, k: float, better: int) -> None:
    counted = found(stationary(string(k), scheme))
    assert (counted.better, counted.flat) == (better, 0)
    assert counted.lowest == pytest.approx((1 - k / np.pi**2) / LEAST_MAGNITUDE, rel=1e-3)


def test_the_count_is_the_inertia_of_the_kkt_matrix() -> None:
    """As many negative eigenvalues as independent equations, and one more for each direction that gains."""
    solution = stationary(string(50.0), radau(3))
    W, A = second_order._derivatives(solution)
    b = solution.bounds
    fixed = np.eye(len(solution.z))[b.low_z == b.high_z]
    rows = np.vstack([A.toarray(), fixed])
    matrix = np.block([[W.toarray(), rows.T], [rows, np.zeros((len(rows), len(rows)))]])
    negative = int((np.linalg.eigvalsh(matrix) < -1e-9).sum())
    assert negative == np.linalg.matrix_rank(rows) + found(solution).better


def test_a_control_that_does_nothing_is_flat() -> None:
    counted, scheme = found(stationary(string(5.0, idle=True), radau(3))), radau(3)
    assert (counted.better, counted.flat) == (0, INTERVALS * len(scheme.control_c))


@pytest.mark.parametrize("known", [minimum_effort, bryson_denham], ids=lambda k: k.__name__)
def test_known_minima_are_minima(known: Any) -> None:
    counted = found(solve(known(), radau(3)))
    assert (counted.better, counted.flat) == (0, 0)


def test_the_mesh_does_not_matter() -> None:
    lowest = [found(solve(minimum_effort(), radau(3), factor=n)).lowest for n in (1, 3)]
    assert lowest[0] == pytest.approx(lowest[1], rel=1e-3)


def test_the_papers_hop_is_a_minimum_whose_flight_is_flat(hop: Solution) -> None:
    """Most limits act, so that hardly any direction is left but the torques of the flight."""
    counted = entry(stored_nlp(hop))
    assert counted is not None
    assert counted == hop.summary.second_order
    assert counted.better == 0
    assert counted.flat > 10 * counted.worse
    assert saddle_note(counted) == ()


def test_a_saddle_is_noted() -> None:
    (note,) = saddle_note(entry(stationary(string(15.0), radau(3))))
    assert "1 direction would make it better" in note


def test_a_direction_that_a_limit_forbids_is_no_saddle() -> None:
    """x' >= 0 leaves x = 0 alone; no multiplier says so."""
    free = stationary(string(15.0), radau(3))
    low = free.bounds.low_z.copy()
    low[free.transcription.variables["run"].u] = 0.0
    held = entry(replace(free, bounds=replace(free.bounds, low_z=low)))
    assert held is not None
    assert (held.better, held.saddle) == (1, 0)
    assert (found(free).better, found(free).saddle) == (1, 1)
    assert saddle_note(held) == ()
    assert second_order_line(held)[0].endswith("1 gain, but limits on which the hop lies forbid that")


def test_a_program_that_is_too_large_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(second_order, "MOST_VARIABLES", 3)
    assert curvature(stationary(string(5.0), radau(3))) is None
