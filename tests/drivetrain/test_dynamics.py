"""A drive with one more state: a torque that lags behind its command. One function and one line make it solve, verify,
survive storage and simulate; without it nothing changes."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hopopt.control.closed_loop import make_plant, simulate
from hopopt.control.strategies import find
from hopopt.design import Leg
from hopopt.drivetrain.dynamics import DYNAMICS, JointDynamics, added_states
from hopopt.leg.kinematics import start_angles
from hopopt.leg.robot import BASE
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.problem.load import load
from hopopt.sim.controller import Measurement
from hopopt.sim.state import Timing
from hopopt.storage.seal.recheck import recheck
from hopopt.storage.solution import read, save

LAG = 0.01  # [s]


def lagging_knee(leg: Leg, joint: str, p: Mapping[str, Any]) -> JointDynamics | None:
    """LAG tau' + tau = command, at the knee."""
    if joint != "knee":
        return None
    return JointDynamics(
        ("torque",), ("N m",), (100.0,),
        rates=lambda x, u, w: [(u - x[0]) / LAG],
        torque=lambda x, u, w: x[0],
        at_rest=lambda tau: [tau],
    )  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def _registered() -> Iterator[None]:
    DYNAMICS.append(lagging_knee)
    yield
    DYNAMICS.remove(lagging_knee)


@pytest.fixture(scope="module")
def lagging(_registered: None) -> Solution:
    return solve("paper", starts=1)


def test_what_the_drives_of_a_leg_add() -> None:
    added = added_states(load("paper").leg, {})
    assert (added.size, added.at, added.labels()) == (1, [1], ("knee torque",))
    assert added.at_rest([1.0, 2.0]) == [2.0]


@pytest.mark.rarely
def test_its_hop_is_verified_and_obeys_the_law(lagging: Solution) -> None:
    """Recomputed from the table: tau' LAG + tau is the command, which is within the operating region. It may clear more than
    a prompt drive's 0.799 m: the torque outlasts the command when the knee turns fast."""
    assert lagging.verified, lagging.summary.failed_checks
    assert lagging.clearance > 0.7
    assert {"stance drives", "flight drives", "stance drive torque"} <= {c.name for c in lagging.summary.verification}
    for table in lagging.tables.values():
        assert table.command is not None
        h = (table.t[:, -1] - table.t[:, 0])[:, None]
        series = np.polynomial.Chebyshev.fit
        for k in range(len(h)):
            fit = series(table.t[k], table.tau[k, :, 1], 8, domain=table.t[k, [0, -1]])
            there = fit.deriv()(table.t[k]) * LAG + table.tau[k, :, 1]
            assert there == pytest.approx(table.command[k, :, 1], abs=0.5)
    region = lagging.region("knee")
    stance = lagging.tables["stance"]
    assert np.max(region.use(stance.v[..., BASE + 1], stance.asked[..., 1])) < 1 + 1e-3


@pytest.mark.rarely
def test_it_is_stored_read_and_checked_again(lagging: Solution, tmp_path: Path) -> None:
    stored = read(save(lagging, tmp_path).result_dir or tmp_path)
    assert stored.tables["stance"].drive == pytest.approx(lagging.tables["stance"].drive, abs=0)
    assert recheck(stored).verified


class Step:
    """A constant command to the knee."""

    def torque(self, now: Measurement) -> np.ndarray:
        return np.array([0.0, 20.0])


def test_the_plant_has_the_closed_form_of_a_lag() -> None:
    """After a step from what holds the leg the torque is 20 + (held - 20) exp(-t / LAG) N m."""
    design = load("paper")
    run = make_plant(design).run(start_angles(design), Step(), 0.05, timing=Timing(1e-3))
    expected = 20 + (run.tau[0, 1] - 20) * np.exp(-run.t / LAG)
    assert run.tau[:, 1] == pytest.approx(expected, abs=1e-3)
    assert run.energy_error < 1e-6


@pytest.mark.slow
def test_a_controller_hops_with_it() -> None:
    """The paper's force control on a drive that lags hops, and differently from a prompt one."""
    paper = load("paper")
    late = simulate(paper, find("force"), past_apex=True).figures.clearance
    DYNAMICS.remove(lagging_knee)
    try:
        prompt = simulate(paper, find("force"), past_apex=True).figures.clearance
    finally:
        DYNAMICS.append(lagging_knee)
    assert min(late, prompt) > 0.3
    assert abs(late - prompt) > 1e-3


def test_a_gear_that_rubs_takes_the_torque_of_the_states() -> None:
    design = load("paper", ["simulation.gear_efficiency=0.9"])
    run = make_plant(design).run(start_angles(design), Step(), 0.02, timing=Timing(1e-3))
    assert run.energy_error < 1e-6
