"""Gravity and slope: by similarity, by a leg that is turned instead of gravity, and by the parabola of free flight."""

from functools import cache

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from hopopt.control.closed_loop import simulate
from hopopt.control.strategies import find
from hopopt.errors import UsageError
from hopopt.evidence.dynamic_programming import reduced
from hopopt.global_search.applicability import applies
from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.kinematics import start_angles
from hopopt.leg.robot import BASE, build_robot
from hopopt.leg.scales import Scale
from hopopt.problem.load import load
from hopopt.sim.hop_metrics import HopFigures
from hopopt.sim.machine import Machine
from hopopt.verify.upper_bound import upper_bound
from once import solved_once

MOON, SLOPE = 1.62 / 9.81, 0.2
CALM = {"simulation.encoder_bits": 0, "simulation.speed_window": 1}


def elsewhere(gravity: float) -> dict[str, object]:
    """The paper's leg where gravity is so many times the earth's, its motors changed so that every hop is as high."""
    rate = gravity**0.5
    return {
        "environment.gravity": 9.81 * gravity, "leg.motor.max_torque": 2.0 * gravity, "leg.motor.max_speed": 1256.637 * rate,
        "hop.stance_duration": [0.03 / rate, 0.2 / rate], "hop.flight_duration": [0.03 / rate, 1.0 / rate],
        "simulation.control_rate": 4000.0 * rate,
    }  # fmt: skip


@cache
def hopped(gravity: float) -> HopFigures:
    """The paper's force control there."""
    return simulate(load("paper", {**elsewhere(gravity), **CALM}), find("force"), past_apex=True).figures


@pytest.mark.slow
@pytest.mark.parametrize("gravity", [4.0, MOON])
def test_the_best_hop_elsewhere_is_as_high(gravity: float) -> None:
    """Times by its root down, speeds by its root up, torques by it."""
    here, there = solved_once({"hop.stance_duration": [0.03, 0.2]}), solved_once(elsewhere(gravity))
    assert there.verified
    assert there.clearance == pytest.approx(here.clearance, abs=1e-6)
    assert there.lift_off * gravity**0.5 == pytest.approx(here.lift_off, abs=1e-6)


@pytest.mark.parametrize("gravity", [4.0, MOON])
def test_a_controlled_hop_elsewhere_is_as_high(gravity: float) -> None:
    """Gains too follow the leg's weight."""
    here, there = hopped(1.0), hopped(gravity)
    assert there.clearance == pytest.approx(here.clearance, rel=1e-4)
    assert there.lift_off["time_s"] * gravity**0.5 == pytest.approx(here.lift_off["time_s"], rel=1e-4)


@pytest.mark.parametrize("gravity", [4.0, MOON])
def test_units_bounds_and_defaults_follow_gravity(gravity: float) -> None:
    design, paper = load("paper", elsewhere(gravity)), load("paper", elsewhere(1.0))
    scale, found, expected = Scale.of(design.leg), upper_bound(design), upper_bound(paper)
    assert (scale.force, scale.speed, scale.time) == pytest.approx((gravity, gravity**0.5, gravity**-0.5))
    assert found.by_energy_m == pytest.approx(expected.by_energy_m)
    assert found.by_speed_m == pytest.approx(expected.by_speed_m)
    left_out = load("paper", {"environment.gravity": 9.81 * gravity, "hop.stance_duration": None})
    assert left_out.hop.stance_duration == pytest.approx((0.03 * gravity**-0.5, 0.4 * gravity**-0.5))


def test_a_slope_is_a_leg_that_leans_with_its_guides() -> None:
    """Pinocchio's forces on a leg whose first guide is turned up by the slope, where gravity points down."""
    robot, rng = build_robot(load("paper", {"environment.slope": SLOPE}).leg), np.random.default_rng(0)
    turned = pin.Model(robot.model)
    turned.gravity.linear = np.array([0.0, 0.0, -9.81])
    uphill = pin.rpy.rpyToMatrix(0.0, -SLOPE, 0.0)
    assert (uphill @ [1.0, 0.0, 0.0])[2] > 0
    turned.jointPlacements[1] = pin.SE3(uphill, np.zeros(3))
    q, v, a = (ca.SX.sym(name, robot.model.nv) for name in "qva")
    planners = ca.Function("forces", [q, v, a], [LegDynamics(robot, robot.parameters).inverse_dynamics(q, v, a)])
    machine, data = Machine(robot), turned.createData()
    for state in rng.uniform(-1, 1, (20, 3, robot.model.nv)):
        expected = pin.rnea(turned, data, *state)
        np.testing.assert_allclose(np.array(planners(*state)).ravel(), expected, rtol=0, atol=1e-10)
        np.testing.assert_allclose(pin.rnea(robot.model, machine.data, *state), expected, rtol=0, atol=1e-10)
        tau = expected[BASE:]
        falling = pin.aba(turned, data, *state[:2], np.r_[0.0, 0.0, tau])
        np.testing.assert_allclose(machine.acceleration(state[0], state[1], tau, False), falling, rtol=1e-9, atol=1e-9)


def assert_thrown(t: np.ndarray, places: np.ndarray, slope: float) -> None:
    """Places along and over a slope (k, 2) [m] at times [s], seen level: ahead at one speed, up and down by 9.81 m/s^2."""
    ahead = places @ [np.cos(slope), -np.sin(slope)]
    up = places @ [np.sin(slope), np.cos(slope)]
    assert 2 * np.polyfit(t - t[0], ahead, 2)[0] == pytest.approx(0.0, abs=1e-6)
    assert 2 * np.polyfit(t - t[0], up, 2)[0] == pytest.approx(-9.81, abs=1e-6)


def test_free_flight_on_a_slope_is_a_parabola_upright() -> None:
    run = simulate(load("paper", {"environment.slope": SLOPE, **CALM}), find("force"), past_apex=True)
    flight = run.figures.flight
    assert run.figures.clearance > 0.3
    assert_thrown(run.trace.t[flight], run.trace.points["com"][flight], SLOPE)


@pytest.mark.slow
@pytest.mark.parametrize("more", [{}, {"leg.guides": ["z"]}, {"hop.kind": "periodic", "hop.speed": 0.5}])
def test_a_hop_on_a_slope_is_verified(more: dict[str, object]) -> None:
    """By Pinocchio, in one piece; its energy, also that of the climb, balances."""
    plan = solved_once({"environment.slope": SLOPE, "hop.stance_duration": [0.03, 0.2], **more})
    assert plan.verified
    assert plan.clearance < upper_bound(plan.design).clearance_m
    if "x" in plan.design.leg.guides:
        t = np.linspace(0.0, plan.phases["flight"].duration, 30)
        flown = plan.sample_phase("flight", t)
        assert_thrown(t, flown.points["com"], SLOPE)


def test_the_bound_on_a_slope_counts_the_way_down() -> None:
    """With a foot under the body: what gravity gives along the ground over the height of the stretched leg's centre of mass."""
    flat, steep = (upper_bound(load("paper", {"environment.slope": slope})) for slope in (0.0, SLOPE))
    stretched = flat.by_speed_m - flat.lift_off_speed_m_s**2 / (2 * 9.81)
    start = flat.by_energy_m - 0.4 * flat.power_W / (8.27 * 9.81)
    q = start_angles(load("paper"))
    aside = float(com_over_foot(q)[0])
    by_drives = 0.4 * flat.power_W / (8.27 * 9.81 * np.cos(SLOPE))
    assert steep.by_energy_m == pytest.approx(start + by_drives + np.tan(SLOPE) * (stretched + abs(aside)))


def com_over_foot(q_j: np.ndarray) -> np.ndarray:
    """Centre of mass from the foot (x, z) [m] of the paper's leg, by its links' middles."""
    knee = 0.38 * np.array([np.sin(q_j[0]), -np.cos(q_j[0])])
    foot = knee + 0.361 * np.array([np.sin(q_j.sum()), -np.cos(q_j.sum())])
    return (1.87 * knee / 2 + 0.8 * (knee + foot) / 2) / 8.27 - foot


def test_what_knows_level_ground_alone_says_so() -> None:
    sloping = load("paper", {"environment.slope": SLOPE})
    assert applies(sloping) == "the ground slopes"
    with pytest.raises(UsageError, match=r"leave out environment\.slope"):
        reduced(sloping)
    assert applies(load("paper", {"environment.gravity": 1.62})) is None
