"""Tracking within limits: the regulator's answer where none is in reach, and the best allowed one where some are."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import nnls

from hopopt.comparison.robust.robustness import drawn, reached
from hopopt.control.closed_loop import make_controller, simulate
from hopopt.control.reference import PlanReference
from hopopt.control.setting import Setting
from hopopt.control.strategies import BUILT_IN
from hopopt.control.tracking.receding_horizon import PENALTY, HorizonProgram, PlanLimits, TrackWithinLimits, solved
from hopopt.drivetrain.operating_region.half_planes import HalfPlane, OperatingRegion
from hopopt.errors import UsageError
from hopopt.planner.reserve import reference_of, reserved
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.problem.load import load
from hopopt.sim.plant import PAST_APEX
from once import solved_once

PLAN = {  # an unrefined plan on ground with friction; it may pass its limits between the nodes
    "solver.refine": False, "solver.stance_intervals": 60, "solver.flight_intervals": 30, "contact.friction": 0.6,
    "contact.least_force": 20.0, "hop.least_height": 0.005, "hop.stance_duration": [0.03, 0.2],
    "simulation.control_rate": 1000.0,
}  # fmt: skip
PERIODS = (20, 60)  # within the planned stance


@pytest.fixture(scope="module")
def solution() -> Solution:
    return solved_once(PLAN)


@pytest.fixture(scope="module")
def plan(solution: Solution) -> PlanReference:
    return reference_of(solution)


@pytest.fixture(scope="module")
def by_period(solution: Solution, plan: PlanReference) -> TrackWithinLimits:
    """A tracker whose blocks are single control periods."""
    return TrackWithinLimits(Setting(solution.design, 1e-3, plan, {"blocks": 6, "block": 1, "hold": 1}))


def errors(count: int) -> np.ndarray:
    """Joint errors (count, 4): up to 0.05 rad and 1 rad/s."""
    return np.random.default_rng(0).uniform(-1, 1, (count, 4)) * [0.05, 0.05, 1.0, 1.0]


@pytest.mark.parametrize("k", PERIODS)
def test_without_a_limit_in_reach_it_is_the_regulator(by_period: TrackWithinLimits, k: int) -> None:
    """Bellman's principle: a few periods and the cost of all that follows have the same first torque as the whole phase."""
    gains, program = by_period.gains[True], by_period.horizons[True].program(k)
    free = replace(program, w=np.full_like(program.w, 1e9))
    for error in errors(5):
        found = solved(free, error)
        assert found is not None
        np.testing.assert_allclose(found[:2], -gains.at(k)[2] @ error, rtol=1e-6, atol=1e-6)


def beyond(program: HorizonProgram, torques: np.ndarray, error: np.ndarray) -> np.ndarray:
    """By how much each limit is passed, in shares of it."""
    return program.G @ torques + program.E @ error - program.w


@pytest.mark.parametrize("k", PERIODS)
def test_within_limits_no_allowed_torque_is_better(by_period: TrackWithinLimits, k: int) -> None:
    """The Karush-Kuhn-Tucker conditions: the cost's slope is a sum of active limits' slopes with multipliers of one sign."""
    program, bound = by_period.horizons[True].program(k), 0
    for error in errors(20):
        found = solved(program, error)
        assert found is not None
        over = beyond(program, found, error)
        excess = max(0.0, over.max())
        active = np.abs(over - excess) < 1e-7
        slope = program.H @ found + program.F @ error
        price = PENALTY[0] + PENALTY[1] * excess  # what all multipliers sum to where limits cannot be kept
        if not active.any() or (excess == 0 and np.linalg.norm(slope) < 1e-6 * PENALTY[0]):
            assert np.linalg.norm(slope) < 1e-6 * PENALTY[0]
            continue
        multipliers, left = nnls(program.G[active].T, -slope)
        assert left < 1e-5 * np.linalg.norm(slope)
        assert multipliers.sum() <= price * (1 + 1e-4)
        bound += 1
    assert bound


def test_its_limits_are_those_of_drives_and_ground(solution: Solution, plan: PlanReference) -> None:
    """A row is used up just where the drive is at its line, or the ground would pull."""
    setting = Setting(solution.design, 1e-3, plan)
    region = OperatingRegion((HalfPlane("+", 0.01, 0.02), HalfPlane("-", -0.01, -0.02)))
    limits = PlanLimits(plan.stance, 1e-3, [region] * 2, setting.machine(), True, 0.6)
    rows, t = limits.rows(40, 1), 0.04
    q, v, _ = plan.stance.at(t)
    tau = plan.stance.mean_torque(t, t + 1e-3)
    u, x = np.array([3.0, -4.0]), np.array([1e-4, -2e-4, 2e-3, 1e-3])
    used = rows.G @ u + rows.E @ x - rows.w
    np.testing.assert_allclose(used[0], 0.01 * (tau[0] + 3.0) + 0.02 * (v[0] + 2e-3) - 1, atol=1e-12)
    np.testing.assert_allclose(used[3], -0.01 * (tau[1] - 4.0) - 0.02 * (v[1] + 1e-3) - 1, atol=1e-12)
    fx, fz = setting.machine().stance_terms(q + x[:2], v + x[2:]).contact_force(tau + u)
    weight = 9.81 * sum(i.mass for i in setting.robot.model.inertias)
    expected = np.array([-fz, fx - 0.6 * fz, -fx - 0.6 * fz]) / weight
    np.testing.assert_allclose(used[4:], expected, atol=2e-4)


def test_its_hop_is_the_planned_one(solution: Solution, plan: PlanReference) -> None:
    run = simulate(solution.design, BUILT_IN["track_mpc"], plan=plan, past_apex=True)
    assert run.trace.outcome == PAST_APEX
    assert run.figures.clearance == pytest.approx(solution.clearance, abs=0.01)


@pytest.mark.rarely
def test_legs_that_the_regulator_lets_fall_hop() -> None:
    """Weak and heavy legs ask for more than their drives and the ground give: what a clamp makes of that is not the best."""
    design = load("paper", {"contact.friction": 0.6, "reserve.torque": 0.0, "reserve.speed": 0.03})
    plan = reference_of(solve(reserved(design), starts=2, processes=1))
    draws = drawn(design, design.uncertainty, 24, 5)
    plain, within = (reached(design, name, plan, draws, 1) for name in ("track", "track_mpc"))
    assert plain.fell > 1
    assert within.fell < plain.fell
    assert within.clearances.min() > 0.5


WHOLE = "feedback stays lqr; blocks, block and hold are whole numbers"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"blocks": 0}, WHOLE), ({"block": 1.5}, WHOLE), ({"feedback": "pd"}, WHOLE), ({"hold": 9}, WHOLE),
        ({"blocks": 1e5}, "blocks is at most 100"), ({"block": 1e9}, "block at most 10000"),
    ],
)  # fmt: skip
def test_what_is_no_horizon_is_refused(
    solution: Solution, plan: PlanReference, options: dict[str, object], words: str
) -> None:
    with pytest.raises(UsageError, match=f"strategy track_mpc: .*{words}"):
        make_controller(solution.design, BUILT_IN["track_mpc"], plan, options)
