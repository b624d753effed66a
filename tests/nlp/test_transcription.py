"""Transcriptions solved against problems whose answers are known in closed form.

Where a scheme is not exact, the tolerance is its own error estimate: with an error of order p >= 1 in the number
of intervals, |J(2N) - J*| <= |J(N) - J(2N)|.
"""

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

from hopopt.nlp.mesh import mesh_of_arcs, uniform
from hopopt.nlp.schemes import TRAPEZOIDAL, Scheme, radau
from hopopt.nlp.solver.ipopt import NlpSolver
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.problem import Control, Ends, Objective, Phase, Problem, State
from known_problems import (
    PROBLEMS,
    SCHEMES,
    Known,
    brachistochrone,
    bryson_denham,
    growth,
    guesses,
    moved,
    solve,
    throw,
    two_prices,
)

each_scheme = pytest.mark.parametrize("method", SCHEMES, ids=lambda s: s.name)
SOLVER = 1e-6  # Ipopt stops at a scaled error of 1e-9; the multipliers of these problems are below 1e3


# ---- optima -----------------------------------------------------------------------------------------------


@each_scheme
@pytest.mark.parametrize("make", PROBLEMS, ids=lambda f: f.__name__)
def test_optimum_is_the_known_one(make: Callable[[], Known], method: Scheme) -> None:
    known = make()
    fine = solve(known, method, factor=2).objective
    estimate = 0.0
    if method.name not in known.exact:
        estimate = abs(solve(known, method).objective - fine)
    assert estimate < 0.05 * known.optimum  # the estimate means something
    assert abs(fine - known.optimum) <= estimate + SOLVER * max(1.0, known.optimum)


def test_switch_of_a_time_optimal_control_falls_on_a_free_edge() -> None:
    """Bang-bang, T = 2 sqrt(d / u_max), switched half-way; with linear controls, which keep their bounds everywhere.

    One interval for each arc: with more, an arc may vanish and the switch fall on a fixed edge of the other, which is
    a local optimum too.
    """
    d, limit = 0.7, 1.3
    problem = Problem(
        "time", (moved((-limit, limit), d, (0.1, 10.0)),), Objective("time", lambda e: e.duration["move"])
    )
    known = Known(problem, 2 * np.sqrt(d / limit), {"move": (1.0, ([0, 0], [d, 0], 0.0))})
    solution = solve(known, TRAPEZOIDAL, mesh_of_arcs([0, 0.6, 1], [1, 1]))
    assert abs(solution.objective - known.optimum) < SOLVER
    trajectory = solution.phases["move"]
    np.testing.assert_allclose(trajectory.edges[1], known.optimum / 2, atol=1e-4)
    np.testing.assert_allclose(trajectory.u[0], limit, atol=1e-4)
    np.testing.assert_allclose(trajectory.u[1], -limit, atol=1e-4)


def test_throw_is_at_45_degrees() -> None:
    assert abs(solve(throw(), radau(3)).parameters["angle"][0] - np.pi / 4) < 1e-4


def test_switching_time_is_where_the_marginal_prices_meet() -> None:
    duration = solve(two_prices(), radau(3)).phases["cheap"].duration
    assert abs(duration - (np.sqrt(12) * 0.7 - 1) / 3) < 1e-4


# ---- accuracy ---------------------------------------------------------------------------------------------

# fine enough to be asymptotic; with order 9, the widest range that round-off (1e-12) leaves
MESHES = {2: (16, 32, 64), 3: (8, 16, 32), 4: (8, 16, 32), 5: (8, 16, 32), 9: (2, 3, 4, 5, 6, 8)}


@each_scheme
def test_order_of_convergence_at_the_mesh_points(method: Scheme) -> None:
    """x' = x^2 cos t, x = 1 / (2 - sin t): errors fall as N^-order."""
    phase = Phase("ode", (State("x", initial=0.5),), (), lambda s: {"x": s.x**2 * ca.cos(s.t)}, (2.0, 2.0))
    problem = Problem("ode", (phase,), Objective("end", lambda e: e.final["ode"].x))
    known = Known(problem, 1 / (2 - np.sin(2)), {"ode": (2.0, ([0.5], [1], 0))})
    errors = []
    for n in MESHES[method.order]:
        trajectory = solve(known, method, uniform(n)).phases["ode"]
        x = np.append(trajectory.x_start[:, 0], trajectory.x_end)
        errors.append(np.abs(x - 1 / (2 - np.sin(trajectory.edges))).max())
    slope = -np.polyfit(np.log(MESHES[method.order]), np.log(errors), 1)[0]
    assert abs(slope - method.order) < 0.15 * method.order


@each_scheme
def test_state_interpolant_collocates_the_dynamics(method: Scheme) -> None:
    """Its derivative at the abscissae is the right-hand side there, and intervals join without a gap."""
    solution = solve(brachistochrone(), method)
    trajectory, c = solution.phases["slide"], np.array(method.c)
    places = np.linspace(0, 1, len(c) + 1)
    x = trajectory.everywhere(places)[1]
    _, at_c, u = trajectory.everywhere(c)
    v, a = at_c[..., 2], u[..., 0]
    f = np.stack([v * np.sin(a), v * np.cos(a), 9.81 * np.cos(a)], axis=2)
    for i, h in enumerate(trajectory.lengths):
        slope = [np.polynomial.Polynomial.fit(places, column, len(c)).deriv()(c) / h for column in x[i].T]
        np.testing.assert_allclose(np.transpose(slope), f[i], atol=1e-6)
    np.testing.assert_allclose(x[:-1, -1], x[1:, 0], atol=1e-8)


@pytest.mark.parametrize("path", [False, True])
def test_multiplier_of_a_limit_is_what_moving_it_costs(path: bool) -> None:
    """CasADi's Lagrangian is f + lam' g, so dJ/d(upper) = -lam, over the scale as bounds are scaled.

    Against central differences of the transcribed optimum, and -4 / (9 l^2) to the order of the mesh.
    """
    limit, step = 1 / 9, 1e-4
    solution = solve(bryson_denham(limit, path), radau(3))
    t = solution.transcription
    if path:
        rows = next(r for r in t.rows if r.name == "height")
        multipliers = solution.lam_g[rows.start : rows.stop] / rows.scale
    else:
        x = slice(2, t.variables["move"].x.stop - 2, 2)  # without the ends, which are fixed
        multipliers = solution.lam_x[x] / 0.5
    up, down = (solve(bryson_denham(limit + side * step, path), radau(3)).objective for side in (1, -1))
    assert multipliers.min() > -1e-6
    np.testing.assert_allclose(-multipliers.sum(), (up - down) / (2 * step), rtol=1e-3)
    np.testing.assert_allclose(-multipliers.sum(), -4 / (9 * limit**2), rtol=2 / 18)


# ---- bookkeeping ------------------------------------------------------------------------------------------


@each_scheme
def test_pack_and_unpack_are_inverse(method: Scheme) -> None:
    """A guess the scheme can represent comes back: here linear states and constant controls."""
    known = brachistochrone()
    t = Transcription(known.problem, method, {"slide": mesh_of_arcs([0, 0.3, 1], [2, 3])})
    low, high = t.bounds(guesses(known))
    z = t.pack(guesses(known))
    trajectory = t.unpack(z, t.parameter_values())[0]["slide"]
    assert len(z) == len(low) == len(high) == len(t.scale)
    np.testing.assert_allclose(trajectory.edges, 0.6 * np.array(t.mesh["slide"].edges), atol=1e-14)
    np.testing.assert_allclose(trajectory.u, 0.8, atol=1e-14)
    np.testing.assert_allclose(trajectory.x_start[:, 0], trajectory.edges[:-1] / 0.6, atol=1e-14)


def test_rows_say_what_they_are() -> None:
    """Groups cover all rows in order, and a boundary constraint's name is its own."""
    known = growth()
    t = Transcription(known.problem, radau(3), {"grow": uniform(2), "reap": mesh_of_arcs([0, 0.5, 1], [1, 1])})
    assert [r.start for r in t.rows] == [0, *(r.stop for r in t.rows[:-1])]
    assert t.rows[-1].stop == len(t.lbg) == len(t.ubg) == len(t.row_scale) == t.nlp["g"].numel()
    expected = ["defect", "defect", "duration", "boundary", "boundary"]
    assert [r.kind for r in t.rows] == expected
    assert [tuple(map(str, r.labels)) for r in t.rows[1:]] == [("x", "y"), ("duration",), ("x",), ("total",)]


def final_cost(e: Ends) -> ca.SX:
    return e.final["a"].x


def test_maximize_changes_the_sign_only() -> None:
    """max x(1) for x' = u in [-1, 2] is 2, min is -1; the objective is reported with its own sign."""
    phase = Phase("a", (State("x", initial=0.0),), (Control("u", lower=-1, upper=2),), lambda s: {"x": s.u}, (1, 1))
    for maximize, optimum in ((True, 2.0), (False, -1.0)):
        problem = Problem("p", (phase,), Objective("x", final_cost, maximize))
        known = Known(problem, optimum, {"a": (1.0, ([0], [0], 0.0))}, 3)
        assert abs(solve(known, radau(3)).objective - optimum) < SOLVER


def test_an_answer_as_a_guess_is_the_answer() -> None:
    """Its trajectories alone leave out the free parameters, the height among them."""
    import hopopt as ho
    from hopopt.ocp.guesses.initial_guess import NAMED_STARTS, make_guess
    from hopopt.ocp.hop import Hop
    from hopopt.planner.search.multistart import first_transcription

    hop = Hop(ho.load("paper", ["solver.stance_intervals=16", "solver.flight_intervals=4"]))
    t = first_transcription(hop)
    answer = NlpSolver(t)(make_guess(hop, NAMED_STARTS[0]))
    assert [q.name for q in t.free] == ["clearance"]
    again = t.pack(t.guess_from(answer.phases), t.free_from(answer.parameters))
    np.testing.assert_allclose(again, answer.z, atol=1e-6)
    assert abs(t.pack(t.guess_from(answer.phases)) - answer.z).max() > 0.1
