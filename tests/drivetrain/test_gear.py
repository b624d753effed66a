"""The law of lossy gears against closed forms, its inverse, and the leg that it drives."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopopt.drivetrain.gear import Gear, driven_joints, gears_of, joint_torque, motor_torque
from hopopt.drivetrain.teeth.law import passed_torque, teeth_torque
from hopopt.leg.robot import Robot, build_robot
from hopopt.problem.load import load
from hopopt.verify.drives import Drives, at_drives, losses, without_bends
from hopopt.verify.hops.one_piece import planned
from hopopt.verify.table import NORMALISED_TIMES, POWERS, Table

SHARP: dict[str, Any] = {"slow": 1e-4, "sharp": 1e-6}  # so that closed forms hold to 1e-6
LOSSES = (st.floats(0.05, 1), st.floats(0, 10), st.floats(0, 5))


@given(*LOSSES, st.floats(-20, 20), st.floats(-300, 300))
def test_the_two_sides_of_the_teeth_are_inverse(
    eta: float, friction: float, damping: float, w: float, tau: float
) -> None:
    law = Gear(eta, friction, damping).law(w)
    back, slope = passed_torque(teeth_torque(tau, w, *law), w, *law)
    assert back == pytest.approx(tau, rel=1e-9, abs=1e-9)
    d = 1e-4
    steep = (passed_torque(tau + d, w, *law)[0] - passed_torque(tau - d, w, *law)[0]) / (2 * d)
    assert passed_torque(tau, w, *law)[1] == pytest.approx(steep, rel=1e-5)
    assert slope > 0


@given(*LOSSES, st.floats(-20, 20), st.floats(-300, 300))
def test_a_gear_never_gives_power(eta: float, friction: float, damping: float, w: float, tau: float) -> None:
    assert (teeth_torque(tau, w, *Gear(eta, friction, damping).law(w)) - tau) * w >= -1e-9


def test_a_gear_without_losses_passes_on_what_it_gets() -> None:
    assert teeth_torque(7.0, 3.0, *Gear().law(3.0)) == 7.0
    assert motor_torque(Gear(), 7.0, 3.0, 5.0, 0.1) == pytest.approx(7.0, rel=1e-15)


@pytest.mark.parametrize(("torque", "share"), [(40.0, 0.7), (-40.0, 1 / 0.7)])
def test_an_inertia_through_a_lossy_gear(torque: float, share: float) -> None:
    """Of the motor's torque the rotor takes A a; of the rest the load J has eta driving, 1 / eta braking."""
    rotor, load, friction = 0.3, 0.5, 2.0
    gear = Gear(0.7, friction, 0.0, **SHARP)
    expected = share * (torque - friction) / (load + share * rotor)
    tau = driven_joints(
        gear, np.array([torque]), np.ones(1), np.zeros(1), np.array([[1 / (load + rotor)]]), np.array([rotor])
    )
    assert tau[0] / (load + rotor) == pytest.approx(expected, rel=1e-6)
    assert motor_torque(gear, tau[0], 1.0, expected, rotor) == pytest.approx(torque, rel=1e-9)
    assert joint_torque(gear, torque, 1.0, expected, rotor) == pytest.approx(tau[0], rel=1e-9)


def test_a_mass_lowered_by_a_gear_needs_less_and_raised_more() -> None:
    """At a steady speed m g r = 10 N m takes 10 / eta upwards, 10 eta downwards; at rest the gear holds all between."""
    gear = Gear(0.6, 0.0, 0.0, **SHARP)
    assert teeth_torque(10.0, 1.0, *gear.law(1.0)) == pytest.approx(10.0 / 0.6, rel=1e-6)
    assert teeth_torque(10.0, -1.0, *gear.law(-1.0)) == pytest.approx(10.0 * 0.6, rel=1e-6)
    assert teeth_torque(10.0, 0.0, *gear.law(0.0)) == 10.0  # of all that it holds, what no power comes of
    locked = Gear(0.6, 20.0, 0.0, **SHARP)  # friction above the load: it comes down only if it is pushed
    assert teeth_torque(10.0, -1.0, *locked.law(-1.0)) < 0


def test_driven_joints_move_as_they_are_said_to() -> None:
    """Two coupled joints: what the motors give is what joints, rotors and teeth take at the acceleration that follows."""
    gear = Gear(np.array([0.7, 0.85]), np.array([1.0, 0.0]), np.array([0.0, 0.3]))
    mass, rotor = np.array([[0.9, 0.2], [0.2, 0.5]]), np.array([0.4, 0.2])
    response, still = np.linalg.inv(mass), np.array([3.0, -20.0])
    motor, w = np.array([50.0, -30.0]), np.array([4.0, 2.0])
    tau = driven_joints(gear, motor, w, still, response, rotor)
    a = still + response @ tau
    np.testing.assert_allclose(motor_torque(gear, tau, w, a, rotor), motor, rtol=1e-10)


def test_driven_joints_are_found_where_whole_steps_of_newton_go_to_and_fro() -> None:
    """The leg in the air, hardly a torque at the teeth of the hip, where the efficiency falls with the torque: found to rounding."""
    table = "leg.gear.efficiency_table"
    entries = {
        f"{table}.speed": [52.4, 104.7, 209.4, 366.5], f"{table}.efficiency": [0.76, 0.71, 0.64, 0.57],
        f"{table}.torque": [5.0, 20.0, 60.0, 100.0], f"{table}.factor": [0.5, 0.8, 0.97, 1.0], "leg.gear.friction": 2.15,
    }  # fmt: skip
    robot = build_robot(load("paper", entries).leg)
    gear, rotor = gears_of(robot.leg, robot.parameters), robot.rotors
    response, still = np.array([[3.108, -1.006], [-1.006, 6.938]]), np.array([0.982, 8.773])
    w = np.array([-5.862, 9.779])
    for motor in np.stack(np.meshgrid(np.linspace(-30, 30, 31), np.linspace(-30, 30, 31)), -1).reshape(-1, 2):
        tau = driven_joints(gear, motor, w, still, response, rotor)
        np.testing.assert_allclose(motor_torque(gear, tau, w, still + response @ tau, rotor), motor, atol=1e-8)


def turning_round(robot: Robot) -> Table:
    """An interval of 0.01 s at 3 rad/s, in which the teeth of both gears pass 18 N m at first and -22 N m at last."""
    at, still = NORMALISED_TIMES[:, None], np.zeros((1, 9, 4))
    tau, v = 40.0 * (0.45 - at) * np.ones(2), still + np.array([0.0, 0.0, 3.0, 3.0])
    command = motor_torque(gears_of(robot.leg, robot.parameters), tau, v[0, :, 2:], still[0, :, 2:], robot.rotors)
    return Table(0.01 * at.T, still, v, still, tau[None], still[..., :2], command[None])


def test_heat_of_a_gear_is_exact_where_it_goes_from_driving_to_braking_within_an_interval() -> None:
    """tau (1 / eta - 1) w before and -tau (1 - eta) w after, but for what the smooth law adds: sqrt(tau^2 + sharp^2) for |tau|."""
    robot = build_robot(load("paper", {"leg.gear.efficiency": 0.7}).leg)
    plan, gear = turning_round(robot), gears_of(robot.leg, robot.parameters)
    closely = without_bends(robot, plan)
    assert closely.t.shape == (2, 9)
    assert closely.t[0, -1] == pytest.approx(0.0045, abs=1e-9)
    ends, s = np.array([18.0, 22.0]), gear.sharp[0]
    smooth = (ends * np.hypot(ends, s) + s**2 * np.arcsinh(ends / s)).sum() / 2  # integral of sqrt(tau^2 + s^2)
    heat = (
        3.0
        * 0.01
        / 40.0
        * (((1 / 0.7 + 0.7) / 2 - 1) * (ends[0] ** 2 - ends[1] ** 2) / 2 + (1 / 0.7 - 0.7) / 2 * smooth)
    )
    for told in losses(robot, {"stance": plan}).values():
        assert told.gear == pytest.approx(heat, rel=1e-4)


def test_heat_of_friction_is_exact_where_a_joint_turns_back_within_an_interval() -> None:
    """2 N m times the integral of |w| over 0.01 s, w from -4 to 4 rad/s: 0.04 J, but for where friction sets in smoothly."""
    robot = build_robot(load("paper", {"leg.gear.friction": 2.0}).leg)
    at, still = NORMALISED_TIMES[:, None], np.zeros((1, 9, 4))
    v, a = still.copy(), still.copy()
    v[0, :, 2:], a[0, :, 2:] = 8.0 * (at - 0.5), 800.0
    command = motor_torque(gears_of(robot.leg, robot.parameters), 10.0, v[0, :, 2:], a[0, :, 2:], robot.rotors)
    plan = Table(0.01 * at.T, still, v, a, still[..., 2:] + 10.0, still[..., :2], command[None])
    for told in losses(robot, {"stance": plan}).values():
        assert told.friction == pytest.approx(0.04, rel=2e-3)


def test_a_plan_asks_its_motor_by_the_law_between_nodes_too() -> None:
    """Where a gear goes from driving to braking within an interval: tau / eta before and tau eta after, which no polynomial is."""
    robot = build_robot(load("paper", {"leg.gear.efficiency": 0.7}).leg)
    drives, plan = Drives.of(robot), turning_round(robot)
    asked = planned(drives, plan, 0, at_drives(robot, plan))
    for place in (0.03, 0.4, 0.5, 0.97):
        out = 40.0 * (0.45 - place)
        exact = out / 0.7 if out > 0 else out * 0.7
        np.testing.assert_allclose(asked((2 * place - 1) ** POWERS), exact, atol=0.01)
    interpolated = planned(drives, plan, 0, None)((2 * 0.45 - 1) ** POWERS)
    assert np.abs(interpolated).min() > 0.1  # it is none there
