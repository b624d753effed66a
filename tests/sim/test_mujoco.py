"""MuJoCo against closed forms, Pinocchio and a plan: a third party's dynamics agree with ours."""

import sys
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

from hopopt.control.closed_loop import in_mujoco, make_plant
from hopopt.errors import HopoptError, MissingExtraError, UsageError
from hopopt.leg.files.export import to_mjcf
from hopopt.leg.kinematics import foot_offset, start_angles
from hopopt.leg.robot import BASE, Robot, build_robot
from hopopt.planner.solution import Solution
from hopopt.problem.load import load
from hopopt.sim.controller import Measurement
from hopopt.sim.machine import Machine
from hopopt.sim.mujoco import PIN_PULL, MujocoTrace, replay, simulate
from once import solved_once

G = 9.81
POSE = np.array([0.6, -1.2])  # rad: foot near the plumb line


@pytest.fixture(scope="module")
def robot() -> Robot:
    return build_robot(load("paper").leg)


@cache
def plan() -> Solution:
    """A verified hop of the paper's leg; a stance of at most 0.2 s is solved in half the time."""
    solution = solved_once({"hop.stance_duration": [0.03, 0.2]})
    assert solution.verified
    return solution


def torque(*tau: float) -> Any:
    """A controller that always asks for the same [N m]."""
    return lambda t, q, v, contact: np.array(tau)


def standing(robot: Robot, q_j: np.ndarray = POSE) -> np.ndarray:
    """q with the foot at the origin."""
    return np.concatenate([-foot_offset(robot.leg, q_j), q_j])


def pinocchio(robot: Robot, run: MujocoTrace, tau: Any, contact: bool) -> np.ndarray:
    """The same run by Pinocchio's dynamics and a tight integrator: q, v at its end (2 (2 + n),)."""
    machine, m = Machine(robot), run.q.shape[1]

    def rates(t: float, x: np.ndarray) -> np.ndarray:
        return np.concatenate([x[m:], machine.acceleration(x[:m], x[m:], np.array(tau), contact)])

    x0 = np.concatenate([run.q[0], run.v[0]])
    return solve_ivp(rates, (0, run.t[-1]), x0, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]


def difference(robot: Robot, run: MujocoTrace, tau: Any, contact: bool) -> float:
    """Largest difference of q [m, rad] and v [m/s, rad/s] at the end."""
    return float(np.abs(np.concatenate([run.q[-1], run.v[-1]]) - pinocchio(robot, run, tau, contact)).max())


# ---- flight -----------------------------------------------------------------------------------------------


def test_flight_is_ballistic(robot: Robot) -> None:
    """The centre of mass falls with g whatever the joints do."""
    q0, v0 = np.array([0.1, 1.0, 0.3, -1.0]), np.array([0.5, 2.0, 3.0, -4.0])
    run, machine = simulate(robot, q0, v0, torque(20.0, -10.0), 0.2, contact=False), Machine(robot)
    com, speed = np.array([machine.points(q)["com"] for q in run.q]), machine.com_velocity(q0, v0)
    fall = np.outer(run.t, speed) - np.outer(run.t**2, [0.0, G / 2])
    np.testing.assert_allclose(com, com[0] + fall, rtol=0, atol=1e-9)
    assert not run.contact.any()
    assert not run.f.any()


def test_passive_leg_in_flight_moves_as_in_pinocchio(robot: Robot) -> None:
    """Half a turn of the shank; fourth order: a step of 1e-4 s leaves rounding."""
    q0, v0 = np.array([0.0, 1.0, 0.3, -1.0]), np.array([0.2, 1.0, 6.0, -12.0])
    run = simulate(robot, q0, v0, torque(0.0, 0.0), 0.3, contact=False)
    assert difference(robot, run, (0.0, 0.0), False) < 1e-8
    coarse = [
        simulate(robot, q0, v0, torque(0.0, 0.0), 0.3, control_period=h, time_step=h, contact=False)
        for h in (0.02, 0.01)
    ]
    errors = [difference(robot, c, (0.0, 0.0), False) for c in coarse]
    assert 10 < errors[0] / errors[1] < 25  # 2^4


def test_trace_has_the_places_of_the_leg(robot: Robot) -> None:
    """Foot and lowest point by MuJoCo are Pinocchio's, also with the foot above the knee."""
    q0, v0, machine = np.array([0.0, 1.0, 0.3, -1.0]), np.array([0.0, 0.0, 2.0, -15.0]), Machine(robot)
    run = simulate(robot, q0, v0, torque(0.0, 0.0), 0.15, contact=False)
    points = [machine.points(q) for q in run.q]
    np.testing.assert_allclose(run.foot, [p["foot"] for p in points], rtol=0, atol=1e-12)
    lowest = [min(p[name][1] for name in robot.points) for p in points]
    np.testing.assert_allclose(run.lowest, lowest, rtol=0, atol=1e-12)
    assert (run.foot[:, 1] > run.lowest + 0.01).any()


# ---- stance -----------------------------------------------------------------------------------------------

PUSH = (-20.0, 80.0)  # N m: from a crouch, up


def test_push_in_stance_moves_as_with_the_foot_held_in_pinocchio(robot: Robot) -> None:
    """MuJoCo's constraints give way by design, ever less with the time step: the error falls, and is small at last."""
    runs = [
        simulate(robot, standing(robot), np.zeros(4), torque(*PUSH), 0.05, time_step=h, control_period=1e-3)
        for h in (2e-4, 1e-4, 5e-5)
    ]
    assert all(run.contact.all() for run in runs)
    errors = [difference(robot, run, PUSH, True) for run in runs]
    assert errors[1] < 0.6 * errors[0]
    assert errors[2] < 0.6 * errors[1]
    assert errors[2] < 1e-6
    assert np.abs(runs[2].v[-1]).max() > 1.0  # it did move
    assert np.abs(runs[2].foot).max() < 1e-8


def test_contact_force_is_what_holds_the_foot_in_pinocchio(robot: Robot) -> None:
    """Once the pin has settled, at every instant; and its impulse is the leg's gain in momentum."""
    run, machine = simulate(robot, standing(robot), np.zeros(4), torque(*PUSH), 0.05), Machine(robot)
    held = [machine.acceleration(q, v, np.array(PUSH), True) for q, v in zip(run.q, run.v, strict=True)]
    needed = [pin.rnea(machine.model, machine.data, *x)[:BASE] for x in zip(run.q, run.v, held, strict=True)]
    settled = run.t > 0.01
    np.testing.assert_allclose(run.f[settled], np.array(needed)[settled], rtol=0, atol=1e-5 * run.f.max())
    speeds = np.array([machine.com_velocity(q, v) for q, v in zip(run.q, run.v, strict=True)])
    impulse = np.sum((run.f[1:] + run.f[:-1]) / 2 * np.diff(run.t)[:, None], axis=0)
    weight = machine.mass * machine.gravity * run.t[-1]
    gained = machine.mass * (speeds[-1] - speeds[0])
    np.testing.assert_allclose(impulse + weight, gained, rtol=0, atol=1e-4 * impulse.max())


def test_work_of_a_push_is_the_energy_gained(robot: Robot) -> None:
    """The ground does no work; torques are constant, so their work is torque times angle."""
    run, machine = simulate(robot, standing(robot), np.zeros(4), torque(*PUSH), 0.05), Machine(robot)
    work = np.array(PUSH) @ (run.q[-1] - run.q[0])[BASE:]
    gained = machine.energy(run.q[-1], run.v[-1]) - machine.energy(run.q[0], run.v[0])
    assert abs(gained - work) < 1e-5 * work


def test_ground_lets_go_when_it_would_have_to_pull(robot: Robot) -> None:
    """Push, then fold the leg: the foot leaves at that instant, for good, and from then on nothing but gravity acts."""
    turn = 0.06

    def controller(t: float, q: np.ndarray, v: np.ndarray, contact: bool) -> np.ndarray:
        seen.append(contact)
        return np.array(PUSH) if t < turn - 1e-9 else np.array([30.0, -60.0])

    seen: list[bool] = []
    run = simulate(robot, standing(robot), np.zeros(4), controller, 0.15)
    weight = Machine(robot).mass * G
    assert run.lift_off == pytest.approx(turn, abs=1e-12)
    assert run.f[run.contact, 1].min() >= -PIN_PULL * weight
    assert not run.f[~run.contact].any()
    assert not np.any(np.diff(run.contact.astype(int)) > 0)
    assert seen[:-1] == [True, *run.contact[:-2]]  # a controller learns of it at the next instant
    assert run.foot[-1, 1] > 0.01
    machine, k = Machine(robot), int(np.argmin(run.contact))
    fall = machine.com_velocity(run.q[k], run.v[k])[1] - machine.com_velocity(run.q[-1], run.v[-1])[1]
    assert fall == pytest.approx(G * (run.t[-1] - run.t[k]), abs=1e-9)


def test_a_foot_that_pushes_never_lets_go(robot: Robot) -> None:
    run = simulate(robot, standing(robot), np.zeros(4), torque(0.0, 0.0), 0.05)
    assert run.lift_off is None
    assert run.f[:, 1].min() > 0


def test_controller_is_asked_at_its_rate_and_its_torque_held(robot: Robot) -> None:
    """Two runs whose torques have the same steps agree, whatever the period; between instants nobody asks."""
    asked: list[float] = []

    def controller(t: float, q: np.ndarray, v: np.ndarray, contact: bool) -> np.ndarray:
        asked.append(t)
        return np.array(PUSH) * (1.0 if t < 0.01 - 1e-9 else 0.5)

    slow = simulate(robot, standing(robot), np.zeros(4), controller, 0.02, control_period=1e-2, time_step=1e-4)
    np.testing.assert_allclose(asked, [0.0, 0.01, 0.02])
    np.testing.assert_allclose(slow.t, asked)
    quick = simulate(robot, standing(robot), np.zeros(4), controller, 0.02, control_period=1e-3, time_step=1e-4)
    np.testing.assert_allclose(slow.q[-1], quick.q[-1], rtol=0, atol=1e-9)


# ---- a plan -----------------------------------------------------------------------------------------------


def test_a_plan_hops_as_high_in_mujoco() -> None:
    """From rest to the apex under feedback; torques that are held cost an error that falls with the period."""
    runs = [replay(plan().robot, plan(), control_period=period, time_step=1e-4) for period in (4e-4, 1e-4)]
    wrong = [abs(run.lowest[-1] - plan().clearance) for run in runs]
    assert wrong[1] < 1e-3
    assert wrong[1] < 0.5 * wrong[0]
    run = runs[1]
    assert run.lift_off == pytest.approx(plan().lift_off, abs=2e-4)
    samples = plan().sample(run.t)
    np.testing.assert_allclose(run.q, samples.q, rtol=0, atol=5e-3)
    for k, joint in enumerate(plan().robot.joints):
        use = np.array(plan().region(joint).use(run.v[:, BASE + k], run.tau[:, k]))
        assert use.max() <= 1 + 1e-9


@pytest.mark.slow
def test_even_without_feedback_a_plan_hops_almost_as_high() -> None:
    """Torques alone from rest: nothing but MuJoCo's equations of motion leads to the plan's height."""
    run = replay(plan().robot, plan(), stiffness=0.0, damping=0.0, control_period=2.5e-5, time_step=2.5e-5)
    assert run.lowest[-1] == pytest.approx(plan().clearance, abs=5e-3)


def test_a_plan_does_not_hop_as_high_on_a_heavier_leg() -> None:
    """Twenty grams more on the body, the same torques and feedback: MuJoCo is not told where the plan ends up."""
    run = replay(build_robot(plan().design.leg, {"leg.body.mass": 5.62}), plan())
    assert run.lift_off == pytest.approx(plan().lift_off, abs=2e-4)
    assert run.lowest[-1] < plan().clearance - 1e-3


def test_a_run_ends_where_the_foot_comes_down(robot: Robot) -> None:
    """Dropped from 0.1 m with its joints at rest relative to each other: after sqrt(2 h / g)."""
    q0 = standing(robot) + np.array([0.0, 0.1, 0.0, 0.0])
    run = simulate(robot, q0, np.zeros(4), torque(0.0, 0.0), 1.0, contact=False)
    assert run.t[-1] == pytest.approx(np.sqrt(2 * 0.1 / G), abs=1e-4)
    assert run.foot[-1, 1] < 0 < run.foot[-2, 1]


# ---- what a user sees -------------------------------------------------------------------------------------


def test_without_mujoco_one_is_told_what_to_install(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(MissingExtraError) as error:
        simulate(robot, standing(robot), np.zeros(4), torque(0.0, 0.0), 0.01)
    assert str(error.value) == "MuJoCo is not installed: pip install 'hopopt[mujoco]'"
    assert error.value.exit_code == 2


def test_stance_that_begins_elsewhere_is_refused(robot: Robot) -> None:
    q0 = standing(robot) + np.array([0.0, 0.1, 0.0, 0.0])
    with pytest.raises(UsageError, match=r"foot at the origin, not at x = .* z = 0\.1 m"):
        simulate(robot, q0, np.zeros(4), torque(0.0, 0.0), 0.01)


def test_a_motion_that_runs_away_is_said_to(robot: Robot) -> None:
    with pytest.raises(HopoptError, match=r"ran away at 0\.\d+ s"):
        simulate(robot, standing(robot), np.zeros(4), lambda t, q, v, contact: 1e5 * v[BASE:] + 1.0, 1.0)


@pytest.mark.parametrize("periods", [0.0, 2.0, 1.25])
def test_a_command_acts_its_delay_later_there_too(periods: float) -> None:
    """The k-th call's torque acts from k period + delay to (k + 1) period + delay; before that there is none."""

    class Counting:
        calls = 0

        def torque(self, now: Measurement) -> np.ndarray:
            assert now.t == pytest.approx(self.calls / 1000, abs=1e-12)
            self.calls += 1
            return np.full(2, 0.1 * self.calls)

    entries = {
        "simulation.control_rate": 1000.0,
        "simulation.torque_delay": periods / 1000,
        "hop.stance_duration": [0.03, 0.05],
    }
    design = load("paper", entries)
    run = in_mujoco(design, Counting(), make_plant(design).stance_start(start_angles(design)))
    early = run.t < 0.1  # before the drives' limits
    called = np.floor(1000 * run.t[early] - periods + 1e-6) + 1
    np.testing.assert_allclose(run.tau[early], 0.1 * np.clip(called, 0, None)[:, None] * np.ones(2), rtol=1e-12)


# ---- DC motors ----------------------------------------------------------------------------------------------


def test_a_dc_motor_has_the_torque_speed_line_of_the_problem() -> None:
    """Stall torque at full voltage and rest, none at the no-load speed, and the torque cap in between."""
    mujoco = pytest.importorskip("mujoco")
    robot = build_robot(load("paper", {"supply.voltage": 48.0, "leg.knee.motor.torque_cap": 1.5}).leg)
    model = mujoco.MjModel.from_xml_string(to_mjcf(robot, dc_motors=True))
    data, p = mujoco.MjData(model), robot.parameters
    ratio, stall, fastest = p["leg.gear.ratio"], p["leg.motor.max_torque"], p["leg.motor.max_speed"]
    for share in (0.0, 0.4, 1.0):
        data.ctrl[:], data.qvel[BASE:] = 48.0, share * fastest / ratio
        mujoco.mj_forward(model, data)
        wanted = (1 - share) * stall
        assert data.qfrc_actuator[BASE:] == pytest.approx(ratio * np.minimum(wanted, [np.inf, 1.5]), abs=1e-9 * ratio)
    warm = load("paper", {"leg.motor": "maxon-ec90-flat-260"}).leg
    heated = mujoco.MjModel.from_xml_string(to_mjcf(build_robot(warm), dc_motors=True))
    assert heated.na == 2  # the temperature of each winding
    with pytest.raises(UsageError, match=r"give leg\.motor\.voltage or supply\.voltage"):
        to_mjcf(build_robot(load("paper").leg), dc_motors=True)


def test_a_plan_replayed_by_dc_motors_reaches_its_clearance() -> None:
    """Within 1 per cent."""
    s = plan()
    robot = build_robot(load("paper", {"supply.voltage": 48.0}).leg)
    run = replay(robot, s, dc_motors=True)
    assert run.lowest[-1] == pytest.approx(s.clearance, rel=1e-2)
    lossy = build_robot(load("paper", {"supply.voltage": 48.0, "leg.gear.efficiency": 0.9}).leg)
    with pytest.raises(UsageError, match="no gear that loses"):
        replay(lossy, s, dc_motors=True)
