"""Of solutions that are equally good the smoothest, against closed forms."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from hopopt.nlp.mesh import uniform
from hopopt.nlp.refinement import smoothing
from hopopt.nlp.refinement.interval_errors import interval_errors
from hopopt.nlp.refinement.next_mesh import Aims
from hopopt.nlp.refinement.smoothing import JUMP, Slopes, smoothed
from hopopt.nlp.schemes import radau
from hopopt.nlp.solver.ipopt import NlpSolution, NlpSolver
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.guesses.guess import Guess
from hopopt.ocp.problem import Control, Ends, Instant, Objective, Phase, Problem, State

SMALL = 0.01  # what a force counts as: its slopes then count by their squares
ALLOWANCE, EXCESS, LOCAL = 5e-5, 5e-5, 1e-5
AIMS = Aims(LOCAL, change=1e-4, excess=EXCESS, tightening_cost=1e-4, meshes=4, iterations=100)


def pushed_and_carried() -> Problem:
    """Within 1 s a mass is pushed as far as a force of at most 1 gets it. Another is carried by 1 from rest to rest: by which force,
    the objective does not depend on."""
    states = (
        State("x", initial=0.0),
        State("v", initial=0.0),
        State("y", initial=0.0, final=1.0),
        State("w", initial=0.0, final=0.0),
    )
    controls = (Control("push", lower=-1.0, upper=1.0), Control("carry", lower=-40.0, upper=40.0, scale=5.0))

    def rates(s: Instant) -> dict[str, ca.SX]:
        return {"x": s.v, "v": s.push, "y": s.w, "w": s.carry}

    def place(e: Ends) -> ca.SX:
        return e.final["way"].x

    return Problem(
        "push and carry", (Phase("way", states, controls, rates, (1.0, 1.0)),), Objective("place", place, maximize=True)
    )


def solved() -> NlpSolution:
    """From a guess with teeth, which the solver has no reason to take out."""
    t = Transcription(pushed_and_carried(), radau(3), {"way": uniform(20)})
    teeth = np.column_stack([np.full(61, 0.5), np.random.default_rng(3).uniform(-10, 10, 61)])
    found = NlpSolver(t)({"way": Guess(1.0, np.linspace(0, 1, 61), np.zeros((61, 4)), teeth)})
    assert found.success
    return found


def forces(phase: str, s: Instant) -> ca.SX:
    return SMALL * ca.vertcat(s.push, s.carry)


def test_a_force_on_which_nothing_depends_becomes_the_smoothest_and_one_that_counts_stays() -> None:
    """The least integral of the square of the force's slope from rest to rest: 5 - 10 (3 t^2 - 2 t^3), by Euler and Lagrange."""
    before = solved()
    found = smoothed(before, forces, ALLOWANCE, AIMS)
    assert found is not None
    after = found.solution
    t, x, u = after.phases["way"].everywhere(np.linspace(0, 1, 9))
    push, carry = u[..., 0], u[..., 1]
    assert np.abs(before.phases["way"].everywhere(np.linspace(0, 1, 9))[2][..., 1] - carry).max() > 3.0
    np.testing.assert_allclose(carry, 5 - 10 * (3 * t**2 - 2 * t**3), atol=0.02)
    np.testing.assert_allclose(push[:-1], 1.0, atol=1e-3)
    np.testing.assert_allclose(push[-1], 1.0, atol=0.03)  # which hardly matters: it comes too late to move the mass
    np.testing.assert_allclose(x[-1, -1, 2:], [1.0, 0.0], atol=1e-9)
    assert before.objective - ALLOWANCE <= after.objective <= 0.5 + 1e-9
    assert interval_errors(after, "way").excess.max() <= EXCESS


def test_roughness_is_the_integral_that_it_says_and_never_rises() -> None:
    """1/2 of the integral of (60 t (1 - t))^2 is 60. An interval and the jump beside it share a rise as springs in series do."""
    before = solved()
    slopes = Slopes.of(before, forces)
    found = smoothed(before, forces, ALLOWANCE, AIMS)
    assert found is not None
    after = found.solution
    assert slopes.roughness(after) < 0.5 * slopes.roughness(before)
    assert slopes.roughness(after) == pytest.approx(SMALL**2 * 60 / (1 + 1 / JUMP), rel=5e-3)


def test_a_smoother_solution_that_the_last_solve_finds_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(smoothing, "MOST_SOLVES", 2)  # limits are passed after the first
    before = solved()
    found = smoothed(before, forces, ALLOWANCE, AIMS)
    assert found is not None
    after = found.solution
    slopes = Slopes.of(before, forces)
    assert slopes.roughness(after) < slopes.roughness(before)


def test_what_errs_by_more_than_is_allowed_is_no_smoother_solution() -> None:
    """No local error is below rounding, and no finer mesh is allowed."""
    assert smoothed(solved(), forces, ALLOWANCE, replace(AIMS, local_error=1e-20, meshes=0)) is None
