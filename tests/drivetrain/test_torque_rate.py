"""A motor whose torque changes no faster than a rate: closed forms of the plan and of the plant, and a hop that keeps it."""

from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from hopopt.control.closed_loop import make_plant
from hopopt.drivetrain.dynamics import DYNAMICS, JointDynamics, added_states
from hopopt.errors import UsageError
from hopopt.leg.kinematics import start_angles
from hopopt.leg.robot import BASE, Robot
from hopopt.nlp.mesh import uniform
from hopopt.nlp.schemes import radau
from hopopt.nlp.solver.ipopt import NlpSolver
from hopopt.nlp.transcription import Guess, Transcription
from hopopt.ocp.problem import Control, Instant, Objective, PathConstraint, Phase, Problem, State
from hopopt.planner.solve import solve
from hopopt.problem.load import load
from hopopt.sim.controller import Measurement
from hopopt.sim.state import Timing
from hopopt.storage.seal.recheck import recheck
from hopopt.storage.solution import read, save
from hopopt.verify.plan import verify_plan
from hopopt.verify.table import NORMALISED_TIMES, Table
from once import solved_once

RATE = 50.0  # [N m/s] of the motor, 100 times as much behind its gear
LIMITED = {"leg.motor.torque_rate": RATE}
SHORT = {"hop.stance_duration": [0.03, 0.2]}


@pytest.mark.parametrize("cap", [np.inf, 50.0])
def test_a_double_integrator_goes_from_rest_to_rest(cap: float) -> None:
    """The inertia J over the way d in least time: the torque's rate r is at its limit throughout, T^3 = 32 d J / r; with a cap
    that is reached within a fourth of each half, d = 12 cap^3 / (J r^2) and T = 8 cap / r."""
    J, p = 0.7, {**load("paper", LIMITED).leg.model_dump(), **{"leg.motor.torque_rate": RATE, "leg.gear.ratio": 100.0}}
    drive = added_states(load("paper", LIMITED).leg, p).of["knee"]
    r = 100 * RATE
    way = 0.8 if cap == np.inf else 12 * cap**3 / (J * r**2)
    T = (32 * way * J / r) ** (1 / 3) if cap == np.inf else 8 * cap / r

    def rates(s: Instant) -> dict[str, ca.SX]:
        return {"x": s.v, "v": drive.torque([s.tau], s.tau, s.v) / J, "tau": drive.rates([s.tau], s.u, s.v)[0]}

    states = (
        State("x", scale=way, initial=0.0, final=way),
        State("v", scale=way / T, initial=0.0, final=0.0),
        State("tau", lower=-cap, upper=cap, scale=r * T, initial=0.0, final=0.0),
    )
    path = (PathConstraint("rate", lambda s: s.u / drive.rate, -1.0, 1.0),)
    phase = Phase("move", states, (Control("u", scale=r),), rates, (0.2 * T, 5 * T), path)
    problem = Problem("rest to rest", (phase,), Objective("time", lambda e: e.duration["move"], scale=T))
    solver = NlpSolver(
        Transcription(problem, radau(3), {"move": uniform(8)})
    )  # the torque turns at eighths of the time
    guess = Guess(1.5 * T, np.array([0.0, 1.0]), np.array([[0.0, 0.0, 0.0], [way, 0.0, 0.0]]), np.zeros((2, 1)))
    solution = solver({"move": guess})
    assert solution.success
    assert solution.phases["move"].duration == pytest.approx(T, rel=1e-6)
    tau = solution.phases["move"].everywhere(np.array([1.0]))[1][..., 2].ravel()
    assert np.abs(tau).max() == pytest.approx(min(cap, r * T / 4), rel=1e-6)


class Step:
    """A constant command, 30 N m less than what the hip holds, 20 N m more than what the knee holds."""

    def __init__(self, held: np.ndarray):
        self.command = held + np.array([-30.0, 20.0])

    def torque(self, now: Measurement) -> np.ndarray:
        return self.command


def held_by_hand(q_j: np.ndarray) -> np.ndarray:
    """Torques (2,) [N m] that hold the paper's leg over its foot: of gravity by Pinocchio, less those of its weight at the foot."""
    plant = make_plant(load("paper"))
    model, data, q = plant.robot.model, plant.robot.model.createData(), np.r_[0.0, 0.0, q_j]
    frame = model.getFrameId("point_foot")
    J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)[2]
    return np.array((pin.computeGeneralizedGravity(model, data, q) - 8.27 * 9.81 * J)[BASE:])


def test_the_plants_torque_follows_its_command_at_that_rate() -> None:
    """From what holds the leg, straight to the command."""
    design = load("paper", LIMITED)
    q_j = start_angles(design)
    held = held_by_hand(q_j)
    run = make_plant(design).run(q_j, Step(held), 0.02, timing=Timing(1e-3))
    ramp = 100 * RATE * run.t[:, None]
    arrives = np.array([30.0, 20.0])
    expected = held + np.minimum(ramp, arrives) * [-1, 1]
    early = ramp < arrives - 1.0  # the last part of a step is followed as its end is approached
    assert np.abs(run.tau - expected)[early].max() < 1e-9
    assert np.abs(run.tau - expected).max() < 0.5
    assert run.tau[-1] == pytest.approx(held + np.array([-30.0, 20.0]), abs=1e-6)


def test_rates_of_a_tables_torques() -> None:
    """Of polynomials of time, interval by interval."""
    t = np.array([[0.0], [0.5]]) + np.array([[0.5], [0.2]]) * NORMALISED_TIMES
    tau = np.stack([3 * t**2 - t, t**5], axis=-1)
    still = np.zeros((2, 9, 4))
    table = Table(t, still, still, still, tau, np.zeros((2, 9, 2)))
    assert table.asked_rate == pytest.approx(np.stack([6 * t - 1, 5 * t**4], axis=-1))


def test_without_a_limit_nothing_is_added() -> None:
    assert added_states(load("paper").leg, {}).size == 0
    one = load("paper", {"leg.knee.motor.torque_rate": RATE}).leg
    assert added_states(one, {"leg.knee.motor.torque_rate": RATE, "leg.gear.ratio": 100.0}).at == [1]


def test_what_cannot_be_is_refused_in_a_sentence() -> None:
    with pytest.raises(UsageError, match="planned with gears that lose nothing"):
        solve(load("paper", {**LIMITED, "leg.gear.efficiency": 0.9}), starts=1)

    def second(leg: object, joint: str, p: object) -> JointDynamics:
        return JointDynamics(("x",), ("N m",), (1.0,), lambda x, u, w: [u], lambda x, u, w: x[0], lambda tau: [tau])

    DYNAMICS.append(second)
    try:
        with pytest.raises(
            UsageError, match=r"the drive of the hip has two dynamics: leave out its motor's torque_rate"
        ):
            make_plant(load("paper", LIMITED))
    finally:
        DYNAMICS.remove(second)


def foot_acceleration(robot: Robot, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> float:
    """Upwards, of a foot that is free [m/s^2], by Pinocchio."""
    model, data, frame = robot.model, robot.model.createData(), robot.model.getFrameId("point_foot")
    pin.forwardKinematics(model, data, q, v, pin.aba(model, data, q, v, np.r_[0.0, 0.0, tau]))
    return float(pin.getFrameClassicalAcceleration(model, data, frame, pin.LOCAL_WORLD_ALIGNED).linear[2])


@pytest.mark.rarely
def test_a_hop_keeps_the_limit(tmp_path: Path) -> None:
    """By differences of its torques; from what holds the leg; through lift-off without a jump; stored and read."""
    plan = solved_once({**LIMITED, **SHORT})
    assert plan.verified, plan.summary.failed_checks
    assert plan.clearance < solved_once(SHORT).clearance
    tables = plan.tables
    assert tables["stance"].tau[0, 0] == pytest.approx(held_by_hand(start_angles(plan.design)), abs=1e-6)
    assert tables["flight"].tau[0, 0] == pytest.approx(tables["stance"].tau[-1, -1], abs=1e-6)
    for table in tables.values():
        rates = np.diff(table.tau, axis=1) / np.diff(table.t, axis=1)[..., None]
        assert np.abs(rates).max() <= 100 * RATE * (1 + 1e-4)
    assert np.abs(tables["stance"].asked_rate).max() > 0.999 * 100 * RATE
    assert foot_acceleration(plan.robot, *(getattr(tables["flight"], name)[0, 0] for name in ("q", "v", "tau"))) > -1e-3
    assert recheck(read(save(plan, tmp_path).result_dir or tmp_path)).verified
    quicker = replace(tables["stance"], t=0.999 * tables["stance"].t)
    failed = {c.name for c in verify_plan(plan.design, {**tables, "stance": quicker}, plan.claims()) if not c.passed}
    assert {"stance hip torque rate", "stance knee torque rate"} <= failed
