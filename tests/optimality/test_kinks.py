"""Limits that trade places at an optimum, on a problem whose optimum is known in closed form."""

from typing import Any

import casadi as ca
import numpy as np
import pytest

from hopopt.nlp.mesh import uniform
from hopopt.nlp.schemes import radau
from hopopt.nlp.solver.ipopt import NlpSolution, NlpSolver
from hopopt.nlp.transcription import Guess, Transcription
from hopopt.ocp.problem import Control, Objective, Parameter, PathConstraint, Phase, Problem, State
from hopopt.optimality.directions.kinks import kink
from hopopt.optimality.directions.parametric_sensitivity import slopes
from known_problems import double_integrator

D = 1.3  # [m]


def quickest(first: float, second: float, sign: int = 1, intervals: int = 7) -> NlpSolution:
    """From rest to rest over D with |u| at most ``first`` and ``second``: T = 2 sqrt(D / min), made small, or -T large."""
    states = (State("x", initial=0.0, final=D), State("v", initial=0.0, final=0.0))

    def use(s: Any) -> ca.SX:
        return ca.vertcat(s.u / s.p["first"], s.u / s.p["second"])

    caps = PathConstraint("caps", use, -1.0, 1.0, scale=2.0, labels=("first", "second"))
    phase = Phase(
        "move", states, (Control("u"),), double_integrator, (0.01, 20.0), (caps,), {"time": lambda s: ca.SX(1.0)}
    )
    goal = Objective("time", lambda e: sign * e.integral["move"]["time"], maximize=sign < 0)
    numbers = (Parameter("first", value=first), Parameter("second", value=second))
    line = Guess(3.0, np.array([0.0, 1.0]), np.array([[0.0, 0.0], [D, 0.0]]), np.zeros((2, 1)))
    s = NlpSolver(Transcription(Problem("caps", (phase,), goal, numbers), radau(3), {"move": uniform(intervals)}))(
        {"move": line}
    )
    assert s.success
    return s


def by_caps(s: NlpSolution) -> np.ndarray:
    found = slopes(s).parameters
    return np.array([found[name][0] for name in ("first", "second")])


@pytest.mark.parametrize("sign", [1, -1], ids=["time", "minus time"])
@pytest.mark.parametrize("u", [0.7, 3.0])
def test_two_caps_at_the_same_height(u: float, sign: int) -> None:
    """More of one alone gains nothing, less of it costs T / (2 u), and the other one's share is the rest."""
    s, slope = quickest(u, u, sign, 6), -sign * np.sqrt(D / u) / u
    at = kink(s)
    assert at is not None
    low, high = at.ranges(by_caps)
    np.testing.assert_allclose(
        (low, high) if sign > 0 else (high, low), [[slope] * 2, [0.0] * 2], atol=1e-6 * abs(slope)
    )
    assert {str(limit.name) for limit in at.limits()} == {"caps[first]", "caps[second]"}
    sums = at.ranges(lambda s: by_caps(s).sum(keepdims=True))
    np.testing.assert_allclose(sums, slope, rtol=1e-6)  # both together have a derivative


def test_a_cap_that_does_not_act_makes_no_kink() -> None:
    assert kink(quickest(1.0, 1.1)) is None


def test_a_cap_that_nearly_acts_counts() -> None:
    """The second acts as soon as the first is raised by 0.05 %. (The switch lies within an interval: hence 0.2 %.)"""
    at = kink(quickest(1.0, 1.0005))
    assert at is not None
    low, high = at.ranges(by_caps)
    np.testing.assert_allclose(low, -np.sqrt(D), rtol=5e-3)
    np.testing.assert_allclose(high, 0.0, atol=1e-3)


def test_a_variable_that_is_taken_as_given_has_a_slope_to_both_sides() -> None:
    """x at the end: D is a value given already, and a kink of nothing."""
    assert kink(quickest(1.0, 2.0), fixed=[0]) is None
