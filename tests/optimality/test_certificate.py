"""The certificate of first-order optimality against costates known in closed form, and against what is no optimum."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from hopopt.nlp.mesh import mesh_of_arcs, uniform
from hopopt.nlp.schemes import HERMITE_SIMPSON, TRAPEZOIDAL, Scheme, radau
from hopopt.nlp.solver.ipopt import Bounds, NlpSolution, NlpSolver
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.problem import Objective, Problem, State
from hopopt.optimality.certificate import Certificate, certify
from hopopt.optimality.minimum_principle.costates import phase_multipliers
from known_problems import (
    PROBLEMS,
    Known,
    brachistochrone,
    bryson_denham,
    growth,
    guesses,
    minimum_effort,
    moved,
    solve,
    terminal_and_integral,
    throw,
    timed,
    two_prices,
)

SCHEMES = (radau(2), radau(3), radau(5), HERMITE_SIMPSON, TRAPEZOIDAL)
each_scheme = pytest.mark.parametrize("method", SCHEMES, ids=lambda s: s.name)


def costate(c: Certificate, phase: str) -> tuple[np.ndarray, np.ndarray]:
    """Times of the edges (N + 1,) and the costates there (N + 1, nx)."""
    return c.phases[phase].trajectory.edges, c.phases[phase].costate


def failed(c: Certificate) -> set[str]:
    return {check.name for check in c.checks if not check.passed}


# ---- costates in closed form ------------------------------------------------------------------------------


@each_scheme
def test_minimum_effort(method: Scheme) -> None:
    """J = 12 (1 - x0)^2 and u = 6 - 12 t = -p_v / 2 for J = integral of u^2: p = (-24, 24 t - 12)."""
    t, p = costate(certify(solve(minimum_effort(), method)), "move")
    tolerance = 24 / 12**2 * 1.01 if method.order == 2 else 1e-7  # order 2: the error of J'' = 24 at N = 12
    np.testing.assert_allclose(p[:, 0], -24, atol=tolerance)
    np.testing.assert_allclose(p[:, 1], 24 * t - 12, atol=tolerance)


@pytest.mark.parametrize("path", [False, True])
@pytest.mark.parametrize("method", [radau(2), radau(3), radau(5), HERMITE_SIMPSON], ids=lambda s: s.name)
def test_costate_jumps_where_a_state_constraint_begins_and_ends(path: bool, method: Scheme) -> None:
    """Bryson-Denham with l = 1/9: p_x = 18, 0, -18 with jumps of -18 at 1/3 and 2/3, where edges of the mesh are;
    p_v = -u = 2 / (3 l) (1 - 3 t) up to there. The jumps add up to the derivative of the optimum by l, -36."""
    c = certify(solve(bryson_denham(1 / 9, path), method, factor=3))
    t, p = costate(c, "move")
    near = 2 / 54  # the discrete measure may lie in the intervals next to the contact
    for where, value in ((t < 1 / 3 - near, 18), ((t > 1 / 3 + near) & (t < 2 / 3 - near), 0), (t > 2 / 3 + near, -18)):
        np.testing.assert_allclose(p[where, 0], value, atol=0.05)
    early = t < 1 / 3 - near
    np.testing.assert_allclose(p[early, 1], 6 * (1 - 3 * t[early]), atol=0.05)
    np.testing.assert_allclose(p[0, 0] - p[-1, 0], 36, atol=0.05)


@each_scheme
def test_growth_costates_meet_where_the_phases_are_linked(method: Scheme) -> None:
    """x' = 1.5 x, then y' = x up to T = 2: p_x = exp(a (s - t)) / a before the switch s = T - 1/a, T - t after it."""
    known, a = growth(), 1.5
    fine, coarse = (certify(solve(known, method, factor=f)) for f in (4, 2))
    errors = []
    for c in (coarse, fine):
        t, p = costate(c, "grow")
        switch = t[-1]
        r, q = costate(c, "reap")
        expected = np.exp(a * (switch - t)) / a
        errors.append(np.abs(p[:, 0] - expected).max() + np.abs(q[:, 0] - (2 - switch - r)).max())
        np.testing.assert_allclose(q[:, 1], 1.0, atol=1e-8)  # what is reaped counts
        assert abs(p[-1, 0] - q[0, 0]) < 1e-6
    assert errors[1] < 1e-6 or errors[1] < errors[0] / 2 ** (method.order - 0.5)


def test_time_optimal_costates() -> None:
    """T = 2 sqrt(d / u): p_x = -1 / sqrt(d u), p_v = -(1 - 2 t / T) / u, H = -1 throughout; one interval an arc."""
    d, limit = 0.7, 1.3
    problem = Problem("time", (moved((-limit, limit), d, (0.1, 10)),), Objective("time", lambda e: e.duration["move"]))
    known = Known(problem, 2 * np.sqrt(d / limit), {"move": (1.0, ([0, 0], [d, 0], 0.0))})
    c = certify(solve(known, TRAPEZOIDAL, mesh_of_arcs([0, 0.6, 1], [1, 1])))
    t, p = costate(c, "move")
    np.testing.assert_allclose(p[:, 0], -1 / np.sqrt(d * limit), rtol=1e-6)
    np.testing.assert_allclose(p[:, 1], -(1 - 2 * t / known.optimum) / limit, atol=1e-6)
    np.testing.assert_allclose(c.phases["move"].hamiltonian, -1, rtol=1e-6)
    assert failed(c) <= {"move controls stationary"}  # one trapezium an arc: multipliers are constant on each


def test_costate_of_a_price_at_the_end() -> None:
    """w x(T)^2 + integral of u^2 with x' = u: J = w x0^2 / (1 + w T), so p = 2 w x0 / (1 + w T) throughout."""
    _, p = costate(certify(solve(terminal_and_integral(), radau(3))), "run")
    np.testing.assert_allclose(p[:, 0], 2 * 5 * 3 / 11, rtol=1e-8)


def test_hamiltonian_is_the_price_of_time() -> None:
    """H + dJ/d(time in all) = 0 in both phases of ``two_prices``, where J = 4 d^2 / (T + 3 s) + s."""
    c = certify(solve(two_prices(), radau(3)))
    d, s = 0.7, (np.sqrt(12) * 0.7 - 1) / 3
    slope = -4 * d**2 / (1 + 3 * s) ** 2
    for phase in c.phases.values():
        np.testing.assert_allclose(phase.hamiltonian, slope, rtol=1e-6)


@pytest.mark.parametrize("make", PROBLEMS, ids=lambda f: f.__name__)
def test_every_condition_holds_on_a_fine_mesh(make: Callable[[], Known]) -> None:
    c = certify(solve(make(), radau(3), factor=4))
    assert c.passed, failed(c)


@pytest.mark.parametrize("make", [brachistochrone, timed, growth], ids=lambda f: f.__name__)
def test_residuals_fall_with_the_mesh(make: Callable[[], Known]) -> None:
    """Every residual that is not round-off falls at least with the square of the intervals' length."""
    coarse, fine = (certify(solve(make(), radau(2), factor=f)) for f in (1, 4))
    for a, b in zip(coarse.checks, fine.checks, strict=True):
        assert b.residual < max(a.residual / 16 * 1.5, 1e-9), a.name


# ---- multipliers are derivatives --------------------------------------------------------------------------


def test_signs_by_moving_what_they_belong_to() -> None:
    """Costate at the start and a limit's density against central differences; the duration's against 12 / T^3."""
    step = 1e-4

    def solved(**change: float) -> NlpSolution:
        known = bryson_denham(1 / 9 + change.get("limit", 0.0), path=True)
        (phase,) = known.problem.phases
        x, v = phase.states
        x = replace(x, initial=change.get("x", 0.0))
        phase = replace(phase, states=(x, v))
        return solve(replace(known, problem=replace(known.problem, phases=(phase,))), radau(3))

    c = certify(solved()).phases["move"]
    total = np.einsum("i,j,ijm->m", c.h, radau(3).b, c.multipliers.density)[0] + c.multipliers.atom[0]
    for name, multiplier in (("x", c.costate[0, 0]), ("limit", total)):
        up, down = (solved(**{name: side * step}).objective for side in (1, -1))
        np.testing.assert_allclose(multiplier, (up - down) / (2 * step), rtol=2e-3, err_msg=name)
    effort = certify(solve(minimum_effort(), radau(3))).phases["move"]
    np.testing.assert_allclose(effort.multipliers.duration, -36, rtol=1e-6)


def test_a_maximum_has_the_multipliers_of_the_minimum_with_the_other_sign() -> None:
    known = minimum_effort()
    goal = Objective("less", lambda e: -e.integral["move"]["effort"], maximize=True)
    turned = replace(known, problem=replace(known.problem, objective=goal))
    a, b = (certify(solve(k, radau(3))).phases["move"] for k in (known, turned))
    np.testing.assert_allclose(a.costate, -b.costate, atol=1e-7)
    np.testing.assert_allclose(a.hamiltonian, -b.hamiltonian, atol=1e-6)


# ---- what is no optimum -----------------------------------------------------------------------------------


def shifted(s: NlpSolution, phase: str, change: Callable[[np.ndarray], np.ndarray]) -> NlpSolution:
    """The solution with the controls of a phase changed."""
    z, where = s.z.copy(), s.transcription.variables[phase].u
    z[where] = change(z[where])
    return replace(s, z=z, phases=s.transcription.unpack(z, s.p)[0])


@pytest.mark.parametrize("make", [minimum_effort, brachistochrone, two_prices], ids=lambda f: f.__name__)
def test_other_controls_are_not_stationary(make: Callable[[], Known]) -> None:
    s = solve(make(), radau(3), factor=4)
    phase = next(iter(s.phases))
    assert f"{phase} controls stationary" in failed(certify(shifted(s, phase, lambda u: 1.02 * u)))


def test_a_multiplier_of_the_wrong_sign_is_found() -> None:
    s = solve(bryson_denham(1 / 9, path=True), radau(3), factor=4)
    rows = next(r for r in s.transcription.rows if r.name == "height")
    lam = s.lam_g.copy()
    lam[rows.start : rows.stop] *= -1
    assert "move limits push where they hold" in failed(certify(replace(s, lam_g=lam)))


def test_costates_that_do_not_belong_are_found() -> None:
    s = solve(brachistochrone(), radau(3), factor=4)
    rows = next(r for r in s.transcription.rows if r.kind == "defect")
    lam = s.lam_g.copy()
    middle = (rows.start + rows.stop) // 2
    lam[middle : middle + 9] *= 1.01
    assert "slide costates" in failed(certify(replace(s, lam_g=lam)))


def test_atoms_are_told_from_densities() -> None:
    """Where the final state is given, J = 12 x1^2 + 4 v1^2 - 12 x1 v1 for the end (x1, v1): its derivatives are an
    atom at the end, and none is left in the density."""
    m = phase_multipliers(solve(minimum_effort(), radau(3)), "move")
    np.testing.assert_allclose(m.atom[:2], [24, -12], atol=1e-6)
    assert np.abs(m.density).max() < 1e-6


# ---- what is bounded once: initial states, durations, free parameters ---------------------------------------


def held(known: Known, index: Callable[[Transcription], int], value: float) -> NlpSolution:
    """The solution with one variable of the program, by its index, held at a value that the problem leaves open."""
    t = Transcription(known.problem, radau(3), {p.name: uniform(4 * known.intervals) for p in known.problem.phases})
    (low, high), k = t.bounds({}), index(t)
    low[k] = high[k] = value / t.scale[k]
    solution = NlpSolver(t)(guesses(known), bounds=Bounds(low, high, t.lbg, t.ubg))
    assert solution.success, solution.status
    return solution


def left_open(c: Certificate, name: str) -> float:
    return next(check.residual for check in c.checks if check.name == name)


def run_from(lower: float, upper: float) -> Known:
    """``terminal_and_integral`` from anywhere between two values: J = w x0^2 / (1 + w T) = 5 x0^2 / 11."""
    known = terminal_and_integral()
    (phase,) = known.problem.phases
    phase = replace(phase, states=(State("x", initial=([lower], [upper])),))
    return replace(known, problem=replace(known.problem, phases=(phase,)), optimum=5 * lower**2 / 11)


@pytest.mark.parametrize(("value", "towards"), [(0.2, 1.0), (0.7, 0.05)])
def test_a_held_duration_is_not_certified(value: float, towards: float) -> None:
    """J = 4 d^2 / (1 + 3 s) + s for s between 0.05 and 1: what is open is |dJ/ds| times the way to the bound."""
    c, d = certify(held(two_prices(), lambda t: t.variables["cheap"].durations.start, value)), 0.7
    J, slope = 4 * d**2 / (1 + 3 * value) + value, 1 - 12 * d**2 / (1 + 3 * value) ** 2
    assert failed(c) == {"cheap limits of its duration"}
    np.testing.assert_allclose(left_open(c, "cheap limits of its duration"), abs(slope * (towards - value)) / J)


@pytest.mark.parametrize("value", [2.5, 3.0])
def test_a_held_initial_state_is_not_certified(value: float) -> None:
    """J = 5 x0^2 / 11 and x0 at least 2: dJ/dx0 (x0 - 2) / J = 2 (x0 - 2) / x0."""
    c = certify(held(run_from(2, 4), lambda t: t.variables["run"].x.start, value))
    assert failed(c) == {"run limits of its initial state"}
    np.testing.assert_allclose(left_open(c, "run limits of its initial state"), 2 * (value - 2) / value)


@pytest.mark.parametrize(("angle", "towards"), [(0.5, 1.5), (1.2, 0.1)])
def test_a_held_free_parameter_is_not_certified(angle: float, towards: float) -> None:
    """Range v^2 sin(2 a) / g for a between 0.1 and 1.5: its logarithm has the slope 2 / tan(2 a)."""
    c = certify(held(throw(), lambda t: t.parameters.start, angle))
    assert failed(c) == {"limits of the free parameters"}
    expected = abs(2 / np.tan(2 * angle) * (towards - angle))
    np.testing.assert_allclose(left_open(c, "limits of the free parameters"), expected)


def bounded(what: str) -> Known:
    """A problem whose optimum lies on a bound of a duration, an initial state or a free parameter, and pushes it."""
    if what == "initial state":
        return run_from(2, 4)
    known = two_prices() if what == "duration" else throw()
    if what == "duration":
        cheap, dear = known.problem.phases
        return replace(known, problem=replace(known.problem, phases=(replace(cheap, duration=(0.05, 0.3)), dear)))
    return replace(known, problem=replace(known.problem, parameters=(replace(known.problem.parameters[0], upper=0.6),)))


@pytest.mark.parametrize(
    ("what", "name"),
    [
        ("duration", "cheap limits of its duration"),
        ("initial state", "run limits of its initial state"),
        ("free parameter", "limits of the free parameters"),
    ],
)
def test_a_bound_that_is_met_may_push_one_way_only(what: str, name: str) -> None:
    """The optimum on a bound is certified; the multipliers of the opposite goal, which wants away from it, are not."""
    s = solve(bounded(what), radau(3), factor=4)
    assert certify(s).passed, failed(certify(s))
    goal = s.transcription.problem.objective
    turned = replace(goal, value=lambda e: -1.0 * goal.value(e))
    t = Transcription(replace(s.transcription.problem, objective=turned), radau(3), s.transcription.mesh)
    opposite = replace(s, transcription=t, objective=-s.objective, lam_g=-s.lam_g, lam_x=-s.lam_x)
    assert failed(certify(opposite)) == {name}


def test_the_sum_of_several_arcs_may_push_its_bound_only() -> None:
    """Time 1 is the longest (J = 12 / T^3): its multiplier is the sum's; at 0.8 with the same multipliers it fails."""
    known = minimum_effort()
    (phase,) = known.problem.phases
    known = replace(known, problem=replace(known.problem, phases=(replace(phase, duration=(0.5, 1.0)),)))
    mesh = mesh_of_arcs([0, 0.5, 1], [6, 6])
    assert certify(solve(known, radau(3), mesh)).passed
    t = Transcription(known.problem, radau(3), {"move": mesh})
    row = next(r.start for r in t.rows if r.kind == "duration")
    high = t.ubg.copy()
    high[row] *= 0.8
    c = certify(NlpSolver(t)(guesses(known), bounds=Bounds(*t.bounds(guesses(known)), t.lbg, high)))
    assert failed(c) == {"move limits of its duration"}
    np.testing.assert_allclose(left_open(c, "move limits of its duration"), 3 / 0.8 * 0.2, rtol=1e-6)
