"""Limits enforced between the nodes: Bernstein polynomials, programs with them, what it costs, against closed forms."""

import numpy as np
import pytest

from hopopt.nlp.mesh import PhaseMesh, uniform
from hopopt.nlp.refinement.continuous_limits import bernstein, bernstein_at, centres, enforcing
from hopopt.nlp.refinement.interval_errors import interval_errors
from hopopt.nlp.refinement.tightening_cost import normalised_switch_times, tightening_cost, tightening_costs
from hopopt.nlp.schemes import Scheme, radau
from hopopt.nlp.solver.ipopt import NlpSolution, NlpSolver
from hopopt.nlp.solver.kkt_residuals import residuals
from hopopt.ocp.problem import Objective, PathConstraint, Problem
from known_problems import SCHEMES, Known, moved, solve

LIMIT = 1.3
each_scheme = pytest.mark.parametrize("method", SCHEMES, ids=lambda s: s.name)


def bang_bang() -> Known:
    """From rest to rest in the shortest time with |u| <= 1.3 as a path constraint: T = 2 sqrt(d / 1.3), a switch half-way."""
    force = PathConstraint("force", lambda s: s.u, -LIMIT, LIMIT)
    phase = moved((-np.inf, np.inf), 0.7, (0.1, 10.0), path=(force,))
    problem = Problem("time", (phase,), Objective("time", lambda e: e.duration["move"]))
    return Known(problem, 2 * np.sqrt(0.7 / LIMIT), {"move": (1.0, ([0, 0], [0.7, 0], 0.0))})


def held(before: NlpSolution) -> tuple[NlpSolution, NlpSolution]:
    """The solution with the force held in all intervals: of the program that holds it, and at the nodes."""
    everywhere = {"move": np.ones((before.transcription.mesh["move"].intervals, 1), dtype=bool)}
    program = enforcing(before.transcription, everywhere)
    solution = NlpSolver(program.transcription)(before.transcription.guess_from(before.phases))
    assert solution.success
    return solution, program.at_nodes(solution)


@pytest.mark.parametrize("count", [2, 3, 5])
def test_bernstein_polynomials_are_shares_with_their_centres(count: int) -> None:
    """Not negative, in all one; int t B_k / int B_k is the centre, int B_k = 1 / count (Farin, 5.1)."""
    t, w = np.polynomial.legendre.leggauss(8)
    B, w = bernstein_at((t + 1) / 2, count), w / 2
    assert np.all(B >= 0)
    np.testing.assert_allclose(B.sum(axis=1), 1.0)
    np.testing.assert_allclose(w @ B, 1 / count)
    np.testing.assert_allclose((w * (t + 1) / 2) @ B * count, centres(count))


@each_scheme
def test_coefficients_bound_what_is_between_the_nodes(method: Scheme) -> None:
    """Any polynomial through the nodes stays within its coefficients; its ends are the first and the last."""
    values = np.random.default_rng(1).normal(size=(len(method.control_c), 50))
    b = np.linalg.solve(bernstein(method.control_c), values)
    between = bernstein_at(np.linspace(0, 1, 101), len(b)) @ b
    assert np.all(between <= b.max(axis=0) + 1e-12)
    assert np.all(between >= b.min(axis=0) - 1e-12)
    np.testing.assert_allclose(between[[0, -1]], b[[0, -1]])


@each_scheme
@pytest.mark.parametrize("intervals", [5, 7])
def test_what_is_held_is_kept_between_the_nodes(method: Scheme, intervals: int) -> None:
    """The force passes its limit between the nodes where it switches, or does not once it is held; then nothing is gained."""
    known = bang_bang()
    before = solve(known, method, uniform(intervals))
    _, after = held(before)
    if method.name == "radau-3":  # others can keep it by their nodes, here
        assert interval_errors(before, "move").excess.max() > 0.1
    assert interval_errors(after, "move").excess.max() < 1e-8
    assert after.objective >= known.optimum * (1 - 1e-9)


@each_scheme
def test_at_the_nodes_it_is_an_optimum_of_the_given_program(method: Scheme) -> None:
    """Drawn in to where the held limits keep it, the given program has the same optimum with the moved multipliers."""
    solution, after = held(solve(bang_bang(), method, uniform(5)))
    r = residuals(after)
    assert max(r.stationarity, r.feasibility, r.complementarity) < 1e-8
    again = NlpSolver(after.transcription).again(after, after.bounds)
    assert again.objective == pytest.approx(solution.objective, rel=1e-8)


def test_nothing_chosen_changes_nothing() -> None:
    before = solve(bang_bang(), radau(3), uniform(5))
    program = enforcing(before.transcription, {"move": np.zeros((5, 1), dtype=bool)})
    assert not program.touched.any()
    assert program.at_nodes(before).objective == before.objective
    assert tightening_cost(program.at_nodes(before)) == 0.0


@pytest.mark.parametrize(("method", "factor"), [(radau(2), 4 / 3), (radau(3), 1.0)], ids=["radau-2", "radau-3"])
@pytest.mark.parametrize("intervals", [9, 27, 81])
def test_tightening_cost_is_what_enforcing_costs(method: Scheme, factor: float, intervals: int) -> None:
    """Against the closed form: with a density b t about the switch and a force straight from limit to limit the loss is
    b h^2 / 12, the estimate b h^2 / 9 for two nodes and the loss for three; the better the shorter the interval."""
    known = bang_bang()
    _, after = held(solve(known, method, uniform(intervals)))
    loss = after.objective / known.optimum - 1
    assert loss > 0
    assert tightening_cost(after) == pytest.approx(factor * loss, rel=3 / intervals)
    assert tightening_costs(after)["move"].argmax() == intervals // 2


@pytest.mark.parametrize("share", [0.2, 0.5, 0.7])
def test_the_place_of_a_switch_is_told(share: float) -> None:
    """Half-way in time, wherever the interval that contains it begins and ends."""
    low = 0.5 - 0.1 * share
    before = solve(bang_bang(), radau(3), PhaseMesh((0.0, low / 2, low, low + 0.1, (low + 1.1) / 2, 1.0)))
    _, after = held(before)
    (place,) = normalised_switch_times(after)["move"][[2]]
    assert place == pytest.approx(share, abs=0.02)


def test_a_program_is_known_by_its_mesh_and_its_limits() -> None:
    before = solve(bang_bang(), radau(3), uniform(5))
    t, none = before.transcription, {"move": np.zeros((5, 1), dtype=bool)}
    program = enforcing(t, none)
    assert program.is_of(t, {"move": none["move"].copy()})
    assert not program.is_of(t, {"move": ~none["move"]})
    assert not program.is_of(solve(bang_bang(), radau(3), uniform(5)).transcription, none)
