"""What a diagnosis says of problems whose conflicts and flat directions are known in closed form."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy import sparse

from hopopt.nlp.mesh import uniform
from hopopt.nlp.schemes import HERMITE_SIMPSON, TRAPEZOIDAL, Scheme, radau
from hopopt.nlp.solver.ipopt import NlpSolution, NlpSolver
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.problem import (
    BoundaryConstraint,
    Control,
    Ends,
    Objective,
    PathConstraint,
    Phase,
    Problem,
    State,
    linkage,
)
from hopopt.optimality.directions import flat_directions as nlp_flat
from hopopt.optimality.directions.flat_directions import (
    INSENSITIVE,
    Flat,
    NotInvertible,
    flat,
    longer_or_shorter,
    sensitivities,
)
from hopopt.optimality.directions.infeasibility import LEAST_CONFLICT_SHARE, Conflict, ConflictPart, conflict
from known_problems import (
    PROBLEMS,
    Known,
    double_integrator,
    growth,
    guesses,
    minimum_effort,
    moved,
    solve,
    throw,
    two_prices,
)

pytestmark = pytest.mark.filterwarnings("error")
EFFORT = {"effort": lambda s: s.u**2}
REST = {"move": (1.0, ([0.0, 0.0], [1.0, 0.0], 0.0))}


# ---- conflicts ----------------------------------------------------------------------------------------------


def attempt(known: Known) -> NlpSolution:
    """Wherever the solver gives up."""
    meshes = {phase.name: uniform(known.intervals) for phase in known.problem.phases}
    return NlpSolver(Transcription(known.problem, radau(3), meshes))(guesses(known))


def found_conflict(known: Known) -> dict[tuple[str, str, bool], ConflictPart]:
    """The conflict's parts by kind, name and side."""
    solution = attempt(known)
    assert not solution.success
    found = conflict(solution)
    assert isinstance(found, Conflict)
    return {(p.limit.kind, str(p.limit.name), p.limit.upper): p for p in found.parts}


def too_short(limit: float = 1.0, distance: float = 1.0) -> Known:
    """x'' = u from rest to rest over a distance within 1 s: with |u| <= a it takes 2 sqrt(distance / a)."""
    phase = moved((-limit, limit), distance, (0.5, 1.0), integrands=EFFORT)
    goal = Objective("effort", lambda e: e.integral["move"]["effort"])
    return Known(Problem("short", (phase,), goal), np.nan, {"move": (1.0, ([0, 0], [distance, 0], 0.0))}, 24)


def test_a_time_too_short_conflicts_with_the_force_and_the_end() -> None:
    """Within T the mass comes a T^2 / 4 far: 3/4 is missing. Derivatives of that by T (T/2), by one side's force
    (T^2 / 8 each) and by the speed at the end (T/2) are the other limits' shares; the last two as far as the mesh knows
    when the force changes sign."""
    parts = found_conflict(too_short())
    assert next(iter(parts)) == ("final", "x", False)
    assert parts["final", "x", False].gives == pytest.approx(0.75, abs=1e-4)
    assert parts["duration", "duration", True].share == pytest.approx(0.5, rel=1e-3)
    for upper in (False, True):
        assert parts["control", "u", upper].share == pytest.approx(0.125, rel=2e-2)
    assert parts["final", "v", True].share == pytest.approx(0.5, rel=2e-2)
    assert [p.gives > 0 for p in parts.values()].count(True) == 1
    assert len(parts) == 5


def test_when_each_limit_of_a_conflict_pushes() -> None:
    """Forward in the first half, backward in the second, each with a push that falls to nothing in the middle: more than a
    tenth of its largest until 0.45 and from 0.55 on."""
    parts = found_conflict(too_short())
    forward, backward = (parts["control", "u", upper].when for upper in (True, False))
    assert forward[0] < 0.1
    assert backward[1] > 0.9
    assert forward[1] == pytest.approx(0.45, abs=1 / 24)
    assert backward[0] == pytest.approx(0.55, abs=1 / 24)


def test_a_path_limit_and_an_initial_speed() -> None:
    """x(0) = 0, x'(0) = 1, |u| <= 1: x rises to 1/2 at least, so x <= 0.3 has to give 0.2 in the middle."""
    phase = Phase(
        "rise", (State("x", initial=0.0), State("v", initial=1.0)), (Control("u", lower=-1.0, upper=1.0),),
        double_integrator, (2.0, 2.0), (PathConstraint("ceiling", lambda s: s.x, upper=0.3, unit="m"),), EFFORT,
    )  # fmt: skip
    goal = Objective("effort", lambda e: e.integral["rise"]["effort"])
    parts = found_conflict(Known(Problem("rise", (phase,), goal), np.nan, {"rise": (2.0, ([0, 1], [0, 0], -0.5))}, 20))
    ceiling = parts["path", "ceiling", True]
    assert ceiling.gives == pytest.approx(0.2, abs=1e-3)
    assert ceiling.when == pytest.approx((1.0, 1.0), abs=0.11)
    assert parts["control", "u", False].share == pytest.approx(0.5, rel=2e-2)  # of v^2 / 2 u
    assert set(parts) == {("path", "ceiling", True), ("control", "u", False)}


def test_limits_that_can_hold_together_are_no_conflict() -> None:
    """A solver that gave up in reach of a solution is told so."""
    known = minimum_effort()
    meshes = {phase.name: uniform(known.intervals) for phase in known.problem.phases}
    given_up = NlpSolver(Transcription(known.problem, radau(3), meshes), {"ipopt.max_iter": 0})(guesses(known))
    assert not given_up.success
    found = conflict(given_up)
    assert found is not None
    assert found.parts == ()


def test_a_conflict_of_many_alike_is_still_told() -> None:
    """The end said 300 times over: each pushes with 1/300 of the whole, less than what is named for its push alone."""
    known, many = too_short(), 300
    (phase,) = known.problem.phases
    free = replace(phase, states=tuple(replace(s, final=None) if s.name == "x" else s for s in phase.states))
    far = BoundaryConstraint("far", lambda e: ca.repmat(e.final["move"].x, many, 1), 1.0, np.inf)
    problem = Problem("many", (free,), known.problem.objective, (), (far,))
    parts = found_conflict(replace(known, problem=problem))
    giving = [p for p in parts.values() if p.gives]
    assert giving
    assert all(p.limit.constraint == "far" and p.share < LEAST_CONFLICT_SHARE for p in giving)
    assert giving[0].gives == pytest.approx(0.75, abs=1e-3)


# ---- flat directions ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", [radau(3), HERMITE_SIMPSON, TRAPEZOIDAL], ids=lambda s: s.name)
@pytest.mark.parametrize("make", PROBLEMS, ids=lambda f: f.__name__)
def test_nothing_is_flat_where_the_optimum_is_unique(make: Callable[[], Known], method: Scheme) -> None:
    """On coarse and on fine meshes, with room of an order of magnitude to the threshold."""
    for factor in (1, 3):
        assert min(q.felt for q in sensitivities(solve(make(), method, factor=factor))) > 10 * INSENSITIVE


@pytest.mark.parametrize("make", PROBLEMS, ids=lambda f: f.__name__)
def test_what_is_felt_does_not_depend_on_pivots(make: Callable[[], Known], monkeypatch: pytest.MonkeyPatch) -> None:
    solution = solve(make(), radau(3), factor=3)
    without = np.array([q.felt for q in sensitivities(solution)])
    monkeypatch.setattr(nlp_flat, "PIVOTS", ({},))
    np.testing.assert_allclose(without, [q.felt for q in sensitivities(solution)], rtol=1e-4)


def test_what_cannot_be_solved_without_pivots_is_solved_with_them(monkeypatch: pytest.MonkeyPatch) -> None:
    right = np.array([[1.0, 0.0], [2.0, 1.0], [0.0, 3.0]])
    for corner in (1e-14, 1e-10):
        matrix = sparse.csc_matrix(np.ones((3, 3)) + (corner - 1) * np.eye(3))
        np.testing.assert_allclose(matrix @ nlp_flat.solved(matrix, right), right, atol=1e-9)
        with monkeypatch.context() as without:
            without.setattr(nlp_flat, "PIVOTS", nlp_flat.PIVOTS[:1])
            with pytest.raises(NotInvertible, match="cannot be inverted"):
                nlp_flat.solved(matrix, right)
    with pytest.raises(NotInvertible, match="cannot be inverted"):
        nlp_flat.solved(sparse.csc_matrix(np.ones((3, 3))), right)


@pytest.mark.parametrize("reach", [1.0, 0.1, 0.01])
def test_what_a_limit_holds_through_two_integrations_is_not_flat(reach: float) -> None:
    """y'' = w on the rail y = a t^2 (3 - 2 t) / 2: w has no freedom, however small it is; u of the effort stays as it is."""
    alone, both = (solve(known, radau(3)) for known in (on_a_rail(0.0), on_a_rail(reach)))
    held = [q.felt for q in sensitivities(both) if str(q.name) == "w"]
    assert min(held) > 100 * INSENSITIVE
    effort = [[q.felt for q in sensitivities(s) if str(q.name) == "u"] for s in (alone, both)]
    np.testing.assert_allclose(*effort, rtol=1e-4)


def on_a_rail(a: float) -> Known:
    states = (State("x", initial=0.0, final=1.0), State("v", initial=0.0, final=0.0))
    states += (State("y", initial=0.0), State("r", initial=0.0))
    rail = PathConstraint("rail", lambda s: s.y - a * s.t**2 * (3 - 2 * s.t) / 2, lower=0.0, upper=0.0)
    phase = Phase(
        "go", states, (Control("u"), Control("w")), lambda s: {"x": s.v, "v": s.u, "y": s.r, "r": s.w}, (1.0, 1.0),
        (rail,), {"effort": lambda s: s.u**2},
    )  # fmt: skip
    goal = Objective("effort", lambda e: e.integral["go"]["effort"])
    return Known(Problem("rail", (phase,), goal), 12.0, {"go": (1.0, ([0, 0, 0, 0], [1, 0, a / 2, 0], 0.0))}, 20)


def quantity(solution: NlpSolution, kind: str, phase: str) -> Flat:
    return next(q for q in sensitivities(solution) if (q.kind, q.phase) == (kind, phase))


def test_what_is_felt_of_a_free_parameter() -> None:
    """v^2 sin(2 a) / g has the second derivative - 4 v^2 / g at a = pi / 4."""
    assert quantity(solve(throw(), radau(3)), "parameter", "").felt == pytest.approx(
        0.5 * 4 * (np.pi / 4) ** 2, rel=1e-5
    )


def test_what_is_felt_of_a_duration() -> None:
    """4 d^2 / (1 + 3 s) + s of two_prices; x0 exp(a s) (T - s) of growth."""
    d, known = 0.7, two_prices()
    s = (np.sqrt(12) * d - 1) / 3
    curvature = 72 * d**2 / (1 + 3 * s) ** 3
    found = quantity(solve(known, radau(3)), "duration", "cheap")
    assert found.felt == pytest.approx(0.5 * curvature * s**2 / known.optimum, rel=1e-4)
    a, T, x0, known = 1.5, 2.0, 0.4, growth()
    s = T - 1 / a
    curvature = x0 * np.exp(a * s) * a  # a^2 (T - s) - 2 a = -a at the optimum
    found = quantity(solve(known, radau(3), factor=2), "duration", "grow")
    assert found.felt == pytest.approx(0.5 * curvature * s**2 / known.optimum, rel=1e-4)


def test_what_is_felt_of_a_control() -> None:
    """Least integral of the square of a change of u that keeps both ends and has the mean 1 over one tenth: with the
    functionals 1, 1 - t and the tenth's mean c it is 1 / (c' c) projected off the first two."""
    known = replace(minimum_effort(), intervals=20)
    found = [q for q in sensitivities(solve(known, radau(3))) if q.kind == "control"]
    t = (np.arange(100000) + 0.5) / 100000
    basis = np.stack([np.ones_like(t), np.sqrt(12) * (t - 0.5)])  # orthonormal
    for q in found:
        assert q.when is not None
        c = ((t > q.when[0]) & (t < q.when[1])) / (q.when[1] - q.when[0])
        free = c - basis.T @ (basis @ c) / len(t)
        assert q.felt == pytest.approx(6.0**2 / np.mean(free**2) / 12.0, rel=2e-3)
    assert len(found) == 10


def two_phases(second: Phase, objective: Callable[[Ends], Any], guess: tuple[float, Any]) -> Known:
    """From rest to rest with the least effort, then a second phase."""
    first = moved((-np.inf, np.inf), 1.0, (1.0, 1.0), integrands=EFFORT)
    joints = tuple(
        linkage(x, lambda e, x=x: getattr(e.initial[second.name], x) - getattr(e.final["move"], x)) for x in "xv"
    )
    problem = Problem("two", (first, second), Objective("effort", objective), (), joints)
    return Known(problem, 12.0, {**REST, second.name: guess}, 12)


def coasting() -> Known:
    """At rest for as long as one likes."""
    coast = Phase("coast", (State("x"), State("v")), (), lambda s: {"x": s.v, "v": 0 * s.v}, (0.1, 2.0))
    return two_phases(coast, lambda e: e.integral["move"]["effort"], (1.0, ([1, 0], [1, 0], 0.0)))


def decided(tie_break: float) -> Known:
    """A bounded force acts on after the outcome is decided."""
    after = Phase(
        "after", (State("x"), State("v")), (Control("u", lower=-1.0, upper=1.0),), double_integrator, (0.5, 0.5), (),
        {"tie": lambda s: s.u**2},
    )  # fmt: skip
    goal = lambda e: e.integral["move"]["effort"] + tie_break * e.integral["after"]["tie"]  # noqa: E731
    return two_phases(after, goal, (0.5, ([1, 0], [1, 0], 0.1)))


def test_a_coasting_phase_of_free_duration_is_flat() -> None:
    (found,) = flat(solve(coasting(), radau(3)))
    assert (found.kind, found.phase, found.when) == ("duration", "coast", None)
    assert found.felt < 1e-2 * INSENSITIVE


@pytest.mark.parametrize("tie_break", [0.0, 1e-6])
def test_a_control_after_the_outcome_is_decided_is_flat(tie_break: float) -> None:
    (found,) = flat(solve(decided(tie_break), radau(3)))
    assert (found.kind, found.phase, str(found.name)) == ("control", "after", "u")
    assert found.when == pytest.approx((0.0, 0.5))
    assert found.felt < 1e-2 * INSENSITIVE


def test_a_control_after_the_outcome_is_decided_is_not_flat_if_it_is_paid_for() -> None:
    assert flat(solve(decided(0.5), radau(3))) == []


def test_a_control_that_enters_nothing_is_flat() -> None:
    phase = moved((-np.inf, np.inf), 1.0, (1.0, 1.0), integrands=EFFORT)
    phase = replace(phase, controls=(*phase.controls, Control("w", lower=-1.0, upper=1.0)))
    problem = Problem("idle", (phase,), Objective("effort", lambda e: e.integral["move"]["effort"]))
    (found,) = flat(solve(Known(problem, 12.0, {"move": (1.0, ([0, 0], [1, 0], 0.0))}, 12), radau(3)))
    assert (str(found.name), found.when) == ("w", pytest.approx((0.0, 1.0)))


def test_a_control_that_matters_until_a_time_only() -> None:
    """x' = u until 0.5, then u does nothing; Radau's interval that ends at 0.5 has a node there."""
    phase = Phase(
        "run", (State("x", initial=0.0, final=1.0),), (Control("u", lower=-9.0, upper=9.0),),
        lambda s: {"x": s.u * ca.if_else(s.t < 0.5 + 1e-9, 1.0, 0.0)}, (1.0, 1.0),
        integrands={"effort": lambda s: s.u**2 * ca.if_else(s.t < 0.5 + 1e-9, 1.0, 0.0)},
    )  # fmt: skip
    problem = Problem("half", (phase,), Objective("effort", lambda e: e.integral["run"]["effort"]))
    (found,) = flat(solve(Known(problem, 2.0, {"run": (1.0, ([0], [1], 1.0))}, 20), radau(3)))
    assert (str(found.name), found.when) == ("u", pytest.approx((0.5, 1.0)))


# ---- durations that may change, all else following ----------------------------------------------------------


def jump() -> Known:
    """Push off from the ground with at most one weight over half a metre: 1 s, or longer after waiting on the ground."""
    stance = Phase(
        "stance",
        (State("x", lower=0.0, upper=0.5, initial=0.0, final=0.5), State("v", lower=0.0, initial=0.0)),
        (Control("u", lower=-1.0, upper=1.0),), double_integrator, (0.1, 3.0),
    )  # fmt: skip
    height = Objective("height", lambda e: e.final["stance"].x + e.final["stance"].v ** 2 / 2, maximize=True)
    return Known(Problem("jump", (stance,), height), 1.0, {"stance": (1.5, ([0, 0], [0.5, 1], 0.5))}, 40)


@pytest.mark.parametrize("method", [radau(3), HERMITE_SIMPSON], ids=lambda s: s.name)
def test_a_jump_may_wait_on_the_ground(method: Scheme) -> None:
    """At the optimum every limit acts, so nothing is flat to second order; but a longer stance jumps as high, and a
    shorter one does not: its distance is not long enough."""
    solution = solve(jump(), method)
    assert [q.kind for q in flat(solution) if q.kind == "duration"] == []
    changes = longer_or_shorter(solution, "stance")
    assert changes["longer"] == pytest.approx(0.0, abs=INSENSITIVE)
    assert changes["shorter"] is None


def test_a_duration_that_is_paid_for() -> None:
    """4 d^2 / (1 + 3 s) + s at s (1 +- 1/10)."""
    d, known = 0.7, two_prices()
    s = (np.sqrt(12) * d - 1) / 3
    changes = longer_or_shorter(solve(known, radau(3)), "cheap")
    for name, factor in (("longer", 1.1), ("shorter", 0.9)):
        change = (4 * d**2 / (1 + 3 * s * factor) + s * factor) / known.optimum - 1
        assert changes[name] == pytest.approx(change, rel=1e-4)
        assert change > 10 * INSENSITIVE


def test_a_given_duration_cannot_change() -> None:
    assert longer_or_shorter(solve(minimum_effort(), radau(3)), "move") == {"shorter": None, "longer": None}
