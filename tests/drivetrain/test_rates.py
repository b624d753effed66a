"""How fast forces, torques and accelerations change, as limits and in functions of the user's own: where no torque jumps."""

from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import expm

import hopopt as ho
from hopopt.control.closed_loop import make_plant
from hopopt.design import physical_parameters
from hopopt.drivetrain.dynamics import added_states
from hopopt.drivetrain.motor import stall_torque
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.errors import UsageError
from hopopt.leg.kinematics import start_angles
from hopopt.leg.robot import BASE
from hopopt.nlp.mesh import uniform
from hopopt.nlp.schemes import radau
from hopopt.nlp.solver.ipopt import NlpSolver
from hopopt.nlp.transcription import Guess, Transcription
from hopopt.ocp.custom import Moment, custom, moment
from hopopt.ocp.hop import Hop
from hopopt.ocp.phases import stance
from hopopt.ocp.problem import Control, Instant, Objective, PathConstraint, Phase, Problem, State, symbols
from hopopt.problem.load import load
from hopopt.sim.controller import Measurement
from hopopt.sim.machine import Machine
from hopopt.sim.state import Timing
from hopopt.storage.seal.recheck import recheck, with_functions
from hopopt.storage.solution import read, save
from hopopt.verify.plan import verify_plan
from once import solved_once

RATE, MOST, JERK = 50.0, 6000.0, 800.0  # [N m/s] of each motor, [N/s] of the ground force, [m/s^3] of the body
LIMITED = {"leg.motor.torque_rate": RATE}


@ho.constraint(lower=-JERK, upper=JERK, unit="m/s^3", scale=2 * JERK, phases=("stance",))
def smooth_body(now: Moment) -> ca.SX:
    return now.rates.a[1]


def test_rates_are_those_of_the_motion() -> None:
    """Of the body's acceleration, torques and force along the equations of motion, against differences of Pinocchio's."""
    design = load("paper", LIMITED)
    hop, rng = Hop(design), np.random.default_rng(1)
    part = stance(hop)
    x, u = symbols(part.phase.states), symbols(part.phase.controls)
    s = Instant(**x, **u, t=0.0, p=hop.robot.parameters)
    now = moment(hop, part.motion, s)
    assert now.rates is not None
    rates = ca.Function("rates", [*x.values(), *u.values()], [now.rates.a, now.rates.tau, now.rates.f])
    q, v, tau, command = [0.9, -1.8], rng.normal(size=2), 80 * rng.normal(size=2), 3000 * rng.normal(size=2)
    found = [np.array(each).ravel() for each in rates(q, v, tau, command)]
    machine, h = Machine(hop.robot), 1e-5
    a_j = machine.stance_terms(np.array(q), v).acceleration(tau)

    def at(t: float) -> tuple[np.ndarray, np.ndarray]:
        """Acceleration (2 + n) and force at a time t near 0: to the second order in it."""
        moved, speed = q + v * t + a_j * t**2 / 2, v + a_j * t
        whole = machine.pinned(moved, speed, tau + command * t)
        return whole[2], whole[3]

    ahead, behind = at(h), at(-h)
    assert found[0] == pytest.approx((ahead[0] - behind[0]) / (2 * h), rel=1e-5)
    assert found[1] == pytest.approx(command)
    assert found[2] == pytest.approx((ahead[1] - behind[1]) / (2 * h), rel=1e-5)


def test_where_torques_may_jump_there_are_no_rates() -> None:
    for given in ({}, {"leg.knee.motor.torque_rate": RATE}):
        with pytest.raises(UsageError, match=r"rates are there where no torque can jump: give leg\.motor\.torque_rate"):
            Hop(load("paper", given), constraints=(custom(smooth_body),))
        with pytest.raises(UsageError, match=r"contact\.force_rate needs leg\.motor\.torque_rate"):
            Hop(load("paper", {**given, "contact.force_rate": MOST}))


def test_the_hint_about_rates_is_given_for_rates_alone() -> None:
    with pytest.raises(UsageError, match=r"has no attribute 'q' \(a, tau and f are not there at the end"):
        Hop(load("paper"), constraints=(custom(lambda m: m.lift_off.q, "mine"),))


@pytest.mark.slow
def test_a_hop_keeps_the_limit_of_the_ground_force_and_a_function_of_rates(tmp_path: Path) -> None:
    """By differences of the stored force and acceleration; read in a folder and checked again."""
    given = {**LIMITED, "hop.stance_duration": [0.03, 0.2], "contact.force_rate": MOST}
    plan = ho.solve(load("paper", given), constraints=[smooth_body], starts=1, processes=1)
    assert plan.verified, plan.summary.failed_checks
    table = plan.tables["stance"]
    for values, most in ((table.f[..., 1], MOST), (table.a[..., 1], JERK)):
        rates = np.diff(values, axis=1) / np.diff(table.t, axis=1)
        assert 0.99 * most < np.abs(rates).max() <= most * (1 + 1e-3)
    assert plan.summary.gains["ground force rate"] > 0
    again = recheck(with_functions(read(save(plan, tmp_path).result_dir or tmp_path), constraints=[smooth_body]))
    assert again.verified
    quicker = {**plan.tables, "stance": replace(table, t=0.999 * table.t)}
    failed = {c.name for c in verify_plan(plan.design, quicker, plan.claims()) if not c.passed}
    assert "stance ground force rate" in failed


# ---- a winding's inductance: V = R i + k omega + L di/dt -------------------------------------------------------

LATE, RESISTANCE = 0.005, 0.5  # L / R [s], R [ohm]
INDUCTIVE = {"leg.motor.winding_resistance": RESISTANCE, "leg.motor.winding_inductance": LATE * RESISTANCE}


def test_a_rotor_is_spun_up_at_full_voltage() -> None:
    """The most speed of an inertia J in a given time: J w' = tau, late tau' = stall (1 - w / w_0) - tau, by its exponential."""
    leg, J, T = load("paper", {**INDUCTIVE, "leg.motor.laws": ["four-quadrant"]}).leg, 0.5, 0.02
    p = physical_parameters(leg)
    drive, region = added_states(leg, p).of["knee"], operating_region(leg, "knee", p)
    stall, fastest = stall_torque(leg, "knee", p), p["leg.motor.max_speed"] / p["leg.gear.ratio"]
    states = (State("w", scale=fastest, initial=0.0), State("tau", scale=stall, initial=0.0))

    def rates(s: Instant) -> dict[str, ca.SX]:
        return {"w": s.tau / J, "tau": drive.rates([s.tau], s.u, s.w)[0]}

    def used(s: Instant) -> ca.SX:
        return ca.vertcat(*region.use(s.w, s.tau, None, s.u)[::2])

    path = (PathConstraint("voltage", used, -1.0, 1.0), PathConstraint("rate", lambda s: s.u / drive.rate, -1.0, 1.0))
    phase = Phase("spin", states, (Control("u", scale=stall / LATE),), rates, (T, T), path)
    problem = Problem("spin up", (phase,), Objective("speed", lambda e: e.final["spin"].w, True, scale=fastest))
    guess = Guess(T, np.array([0.0, 1.0]), np.zeros((2, 2)), np.zeros((2, 1)))
    solution = NlpSolver(Transcription(problem, radau(5), {"spin": uniform(8)}))({"spin": guess})
    A = np.array([[0.0, 1 / J, 0.0], [-stall / fastest / LATE, -1 / LATE, stall / LATE], [0.0, 0.0, 0.0]])
    assert solution.success
    assert solution.objective == pytest.approx((expm(A * T) @ [0.0, 0.0, 1.0])[0], rel=1e-6)


class FullTorque:
    """More than the motors have, one way and then the other."""

    def torque(self, now: Measurement) -> np.ndarray:
        return np.array([-1e4, 1e4]) if now.t < 0.004 else np.array([1e4, -1e4])


def test_the_plants_current_rises_as_its_voltage_lets_it() -> None:
    design = load("paper", INDUCTIVE)
    run = make_plant(design).run(start_angles(design), FullTorque(), 0.008, timing=Timing(1e-3))
    p = physical_parameters(design.leg)
    stall, fastest = stall_torque(design.leg, "hip", p), p["leg.motor.max_speed"] / p["leg.gear.ratio"]
    new = np.diff(run.t, prepend=-1.0) > 1e-9  # where a command changes an instant is there twice
    w, tau, t = run.v[new, BASE:], run.tau[new], run.t[new]
    rate, middle = np.diff(tau, axis=0) / np.diff(t)[:, None], (tau[1:] + tau[:-1]) / 2
    used = (middle + LATE * rate) / stall + (w[1:] + w[:-1]) / 2 / fastest
    way = np.where(t[:-1, None] < 0.004 - 1e-9, [-1.0, 1.0], [1.0, -1.0])
    assert np.abs(used - way).max() < 1e-3


def test_what_inductance_lacks_is_told() -> None:
    with pytest.raises(UsageError, match=r"leg\.motor\.winding_inductance.* only with motor\.winding_resistance too"):
        load("paper", {"leg.motor.winding_inductance": 1e-3})
    with pytest.raises(UsageError, match="goes with a stiff supply alone"):
        load("paper", {**INDUCTIVE, "supply": {"voltage": 48.0, "internal_resistance": 0.1}})


@pytest.mark.rarely
def test_a_hop_with_inductance_keeps_its_voltage() -> None:
    plan = solved_once({**INDUCTIVE, "hop.stance_duration": [0.03, 0.2]})
    assert plan.verified, plan.summary.failed_checks
    leg, p = plan.design.leg, plan.robot.parameters
    stall, fastest = stall_torque(leg, "hip", p), p["leg.motor.max_speed"] / p["leg.gear.ratio"]
    used = []
    for table in plan.tables.values():
        rate = np.diff(table.tau, axis=1) / np.diff(table.t, axis=1)[..., None]
        middle, w = ((x[:, 1:] + x[:, :-1]) / 2 for x in (table.tau, table.v[..., BASE:]))
        used.append((middle + LATE * rate) / stall + w / fastest)
    assert 0.98 < max(np.abs(x).max() for x in used) < 1.02
