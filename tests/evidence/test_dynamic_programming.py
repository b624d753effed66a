"""The reduced hop: its terms against the planner's dynamics, its optimum by two methods that share no code."""

import casadi as ca
import numpy as np
import pytest

from hopopt import load
from hopopt.design import Design
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.errors import UsageError
from hopopt.evidence.dynamic_programming import by_dynamic_programming, by_transcription, reduced
from hopopt.global_search.equations.slider_leg import accelerations, slider_leg
from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.kinematics import dependent_joints
from hopopt.leg.robot import build_robot

CASES = {
    "paper": ["hop.stance_duration=[0.03,0.2]"],
    "strong": ["leg.motor.max_torque=3", "leg.shank.length=0.45", "start.hip_height=0.45", "leg.gear.ratio=60"],
}


@pytest.fixture(scope="module")
def design() -> Design:
    return reduced(load("paper", CASES["paper"]))


def test_terms_are_those_of_the_planners_closed_loop(design: Design) -> None:
    """Torques and vertical force at random speeds, accelerations and horizontal forces."""
    robot, leg, rng = build_robot(design.leg), slider_leg(design, 7), np.random.default_rng(0)
    dynamics, dependent = LegDynamics(robot, robot.parameters), dependent_joints(design)
    q, v, free, force = (ca.SX.sym(s, n) for s, n in zip("qvuf", (2, 2, 1, 1), strict=True))
    m = dynamics.stance(q, v, dynamics.closed(q, v, free, dependent), force)
    evaluate = ca.Function("f", [q, v, free, force], [m.tau, m.f, m.a[1], m.v[1]])
    for k in range(7):
        speed, horizontal, guess = rng.uniform(-3, 3), rng.uniform(-200, 200), rng.uniform(-60, 60)
        tau, f, a, rate = (np.array(x).ravel() for x in evaluate(leg.q[k], leg.dq[k] * speed, guess, horizontal))
        assert rate[0] == pytest.approx(speed)
        terms = np.array([1.0, a[0], speed**2])
        np.testing.assert_allclose(leg.torque[k] @ terms - leg.levers[k] * horizontal, tau, rtol=1e-8, atol=1e-7)
        assert leg.force[k] @ terms == pytest.approx(f[1], rel=1e-8, abs=1e-7)


def test_accelerations_are_the_ends_of_what_drives_and_ground_allow(design: Design) -> None:
    """Against scipy's linear programming at every state."""
    from scipy.optimize import linprog

    leg = slider_leg(design, 6)
    robot = build_robot(design.leg)
    v = np.linspace(-1.5, 1.5, 5) * np.ones((6, 1))
    least, largest = accelerations(design, leg, v)
    for i, j in np.ndindex(v.shape):
        A, b = [[-leg.force[i, 1], 0.0]], [leg.force[i, 0] + leg.force[i, 2] * v[i, j] ** 2]
        for k, joint in enumerate(design.leg.joints):
            still = leg.torque[i, k, 0] + leg.torque[i, k, 2] * v[i, j] ** 2
            for h in operating_region(design.leg, joint, robot.parameters).planes:
                A.append([h.a * leg.torque[i, k, 1], -h.a * leg.levers[i, k]])
                b.append(1 - h.a * still - h.b * leg.dq[i, k] * v[i, j])
        ends = [linprog([s, 0], A_ub=A, b_ub=b, bounds=(None, None)) for s in (1, -1)]
        if ends[0].status == 2:
            assert np.isnan(least[i, j])
        else:
            np.testing.assert_allclose([least[i, j], largest[i, j]], [e.x[0] for e in ends], rtol=1e-6, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("case", ["paper", "strong"])
def test_dynamic_programming_approaches_the_planners_optimum(case: str) -> None:
    problem = reduced(load("paper", CASES[case]))
    planned = by_transcription(problem, 80)
    wrong = [abs(by_dynamic_programming(problem, size) / planned - 1) for size in (40, 120, 320)]
    assert wrong[-1] < 0.005
    assert wrong[-1] < 0.6 * wrong[0]


@pytest.mark.parametrize(
    "overrides",
    [
        pytest.param({"contact.friction": 0.1}, marks=pytest.mark.slow),
        pytest.param({"hop.counter_movement": False, "hop.least_height": 0.02}, marks=pytest.mark.slow),
        pytest.param({"start.joint_angles": [0.9, -1.2]}, marks=pytest.mark.slow),
    ],
)
def test_both_methods_solve_the_same_problem_whatever_the_hop_asks(overrides: dict) -> None:
    """What dynamic programming does not know is taken out for both, the foot put under the hip."""
    problem = reduced(load("paper", overrides | {"hop.stance_duration": [0.1, 0.2]}))
    assert abs(by_dynamic_programming(problem, 250) / by_transcription(problem, 60) - 1) < 0.005


@pytest.mark.rarely
def test_a_drive_whose_speed_nothing_bounds() -> None:
    """The other joint drives it past its no-load speed; half of the grid's speeds are seldom used."""
    problem = reduced(load("paper", {"leg.motor.laws": ["four-quadrant"]}))
    planned = by_transcription(problem, 80)
    wrong = [abs(by_dynamic_programming(problem, size) / planned - 1) for size in (40, 120, 320)]
    assert wrong[0] > 2 * wrong[1] > 4 * wrong[2]
    assert wrong[2] < 0.007


def test_legs_that_it_does_not_fit_are_refused() -> None:
    with pytest.raises(UsageError, match="two joints in the x-z plane"):
        reduced(load("three_joint"))
