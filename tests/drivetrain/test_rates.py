"""How fast forces, torques and accelerations change, as limits and in functions of the user's own: where no torque jumps."""

from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import hopopt as ho
from hopopt.errors import UsageError
from hopopt.ocp.custom import Moment, custom, moment
from hopopt.ocp.hop import Hop
from hopopt.ocp.phases import stance
from hopopt.ocp.problem import Instant, symbols
from hopopt.problem.load import load
from hopopt.sim.machine import Machine
from hopopt.storage.seal.recheck import recheck, with_functions
from hopopt.storage.solution import read, save
from hopopt.verify.plan import verify_plan

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
        with pytest.raises(UsageError, match=r"contact\.force_rate needs torques that cannot jump"):
            Hop(load("paper", {**given, "contact.force_rate": MOST}))


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
