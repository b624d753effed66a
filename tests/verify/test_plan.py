"""Verification of plans: a true one passes, and every kind of lie is found by the check that should find it."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import BarycentricInterpolator

from hopopt.errors import NotSolvedError
from hopopt.leg.kinematics import start_angles
from hopopt.leg.robot import BASE, build_robot
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.problem.load import load
from hopopt.sim.machine import Machine
from hopopt.verify.check import Check, failed
from hopopt.verify.plan import verify_plan
from hopopt.verify.table import FLIGHT, NORMALISED_TIMES, STANCE, Table
from once import solved_once

Tables = Mapping[str, Table]
G = 9.81
COARSE = {"solver.refine": False, "solver.stance_intervals": 20, "solver.flight_intervals": 8}


@pytest.fixture(scope="module")
def coarse() -> Solution:
    return solved_once(COARSE)


@pytest.fixture(scope="module")
def short() -> Solution:
    """A verified plan of a short stance, which needs few intervals."""
    s = solved_once({"hop.stance_duration": [0.03, 0.2]})
    assert s.verified
    return s


def failures(plan: Solution, tables: Tables | None = None, **changed: Any) -> dict[str, Check]:
    """The checks that fail, by name, when tables or claims are what is given, or the problem has other values."""
    design = load("paper", changed.pop("overrides", {}))
    checks = verify_plan(design, tables or plan.tables, {**plan.claims(), **changed})
    return {c.name: c for c in failed(checks)}


def found_in(plan: Solution, tables: Tables | None = None, **changed: Any) -> set[str]:
    """The checks that fail now and did not before."""
    return failures(plan, tables, **changed).keys() - failures(plan).keys()


def altered(plan: Solution, phase: str, name: str, change: Any) -> dict[str, Table]:
    """The plan's tables with one array of one phase changed in place by a function."""
    array = getattr(plan.tables[phase], name).copy()
    change(array)
    return {**plan.tables, phase: replace(plan.tables[phase], **{name: array})}


def longest(plan: Solution, phase: str) -> int:
    """Index of the longest interval."""
    return int(np.argmax(np.ptp(plan.tables[phase].t, axis=1)))


# ---- a true plan ------------------------------------------------------------------------------------------


def test_the_papers_leg_is_verified(hop: Solution) -> None:
    assert hop.verified
    assert hop.summary.failed_checks == ()
    assert all(c.passed for c in hop.summary.verification)
    assert failures(hop) == {}


def test_clearance_is_the_lowest_points_height_by_pinocchio(hop: Solution) -> None:
    machine = Machine(hop.robot)
    end = hop.tables[FLIGHT].q[-1, -1]
    points = machine.points(end)
    assert abs(min(points[name][1] for name in ("hip", "knee", "foot")) - hop.clearance) < 1e-9
    assert abs(points["foot"][0] - points["hip"][0]) <= hop.design.hop.foot_window * (1 + 1e-4)


def test_parts_sum_to_the_clearance(hop: Solution) -> None:
    """Height at lift-off + ballistic rise - height over the lowest point then; each by Pinocchio and by g."""
    p = hop.summary.parts
    assert abs(p.sum - hop.clearance) < 1e-12
    machine, stance, flight = Machine(hop.robot), hop.tables[STANCE], hop.tables[FLIGHT]
    assert abs(machine.points(stance.q[-1, -1])["com"][1] - p.com_height_at_lift_off_m) < 1e-9
    assert abs(machine.points(flight.q[-1, -1])["com"][1] + p.com_height_over_lowest_point_m - hop.clearance) < 1e-9
    speed, T = machine.com_velocity(stance.q[-1, -1], stance.v[-1, -1])[1], hop.phases[FLIGHT].duration
    assert abs(speed * T - G * T**2 / 2 - p.ballistic_rise_m) < 1e-8
    assert p.ballistic_rise_m <= speed**2 / (2 * G) + 1e-9


def test_saturation_is_a_share(hop: Solution) -> None:
    assert set(hop.summary.saturation_mean) == {"hip", "knee"}
    assert all(0 <= c <= 1 for c in hop.summary.saturation_mean.values())
    assert all(0 < share <= 1 + 1e-12 for share in hop.summary.active_limits.values())


def share_of_stance(plan: Solution, active: np.ndarray) -> float:
    """Share of time in which a condition (N, K) at the table's places holds."""
    t = plan.tables[STANCE].t
    return float(np.trapezoid(active.astype(float), t, axis=1).sum() / (t[-1, -1] - t[0, 0]))


def test_active_limits_of_the_paper(hop: Solution) -> None:
    """More time would help, the ground may not pull, the foot never slips and the body may descend."""
    active, f = hop.summary.active_limits, hop.tables[STANCE].f
    assert active["longest stance"] == pytest.approx(1.0, abs=1e-12)
    assert active["ground cannot pull"] == pytest.approx(share_of_stance(hop, f[..., 1] < 0.5), abs=0.02)
    assert not {"shortest stance", "friction cone", "body never descends"} & active.keys()


def test_active_limits_on_slippery_ground() -> None:
    limits = {"contact.friction": 0.3, "hop.counter_movement": False}
    plan = solved_once({**COARSE, **limits})
    active, table = plan.summary.active_limits, plan.tables[STANCE]
    sliding = np.abs(table.f[..., 0]) > 0.299 * table.f[..., 1]
    assert active["friction cone"] == pytest.approx(share_of_stance(plan, sliding), abs=0.03)
    level = table.v[..., 1] < 1e-3  # at the limit, or past it between the nodes: the mesh is not refined
    assert active["body never descends"] == pytest.approx(share_of_stance(plan, level), abs=0.03)
    assert min(active["friction cone"], active["body never descends"]) > 0.1
    assert table.t[-1, -1] < 0.39
    assert "longest stance" not in active


def test_a_stance_that_must_be_long() -> None:
    plan = solved_once({**COARSE, "hop.stance_duration": [0.35, 0.35]})
    assert {"longest stance", "shortest stance"} <= plan.summary.active_limits.keys()


@pytest.mark.parametrize("phase", [STANCE, FLIGHT])
def test_work_of_the_joints_is_what_the_leg_gains(hop: Solution, phase: str) -> None:
    """By energies of Pinocchio; the summary's trapezoids are good to a per cent."""
    machine, table, figures = Machine(hop.robot), hop.tables[phase], hop.summary.energy
    gained = machine.energy(table.q[-1, -1], table.v[-1, -1]) - machine.energy(table.q[0, 0], table.v[0, 0])
    positive = figures[f"{phase}_positive_J"]
    assert abs(figures[f"{phase}_net_J"] - gained) < 1e-2 * positive
    assert positive >= figures[f"{phase}_net_J"]


def test_work_pays_for_the_rise(hop: Solution) -> None:
    """From rest to the apex: no joint work is lost but what is left in motion at the apex."""
    machine, start, end = Machine(hop.robot), hop.tables[STANCE], hop.tables[FLIGHT]
    potential = [
        machine.mass * G * machine.points(q)["com"][1] for q in (start.q[0, 0], end.q[-1, -1])
    ]  # fmt: skip
    work = sum(hop.summary.energy[f"{phase}_net_J"] for phase in (STANCE, FLIGHT))
    assert work >= (potential[1] - potential[0]) * (1 - 1e-3)


def test_the_whole_plan_replays_from_its_start(hop: Solution) -> None:
    """Torques only, interval after interval without ever going back to the plan, thshort lift-off to the apex.

    The pushing leg is an inverted pendulum: what errors there are grow, yet the clearance comes out to 0.1 mm.
    """
    machine = Machine(hop.robot)
    q = start_angles(hop.design)
    x = np.concatenate([-machine.points(np.concatenate([[0, 0], q]))["foot"], q, np.zeros(4)])
    for phase, table in hop.tables.items():
        for t, tau in zip(table.t, table.tau, strict=True):
            x = replayed(machine, x, t[-1] - t[0], tau, phase == STANCE)
    points = machine.points(x[: BASE + 2])
    assert abs(min(points[name][1] for name in ("hip", "knee", "foot")) - hop.clearance) < 1e-4


def replayed(machine: Machine, x: np.ndarray, h: float, tau: np.ndarray, contact: bool) -> np.ndarray:
    """State after an interval of h [s] with torques tau at NORMALISED_TIMES."""
    torque = BarycentricInterpolator(NORMALISED_TIMES, tau)

    def rates(s: float, x: np.ndarray) -> np.ndarray:
        q, v = np.split(x, 2)
        return h * np.concatenate([v, machine.acceleration(q, v, torque(s), contact)])

    return solve_ivp(rates, (0, 1), x, "RK45", rtol=1e-8, atol=1e-10, first_step=1.0).y[:, -1]


# ---- lies -------------------------------------------------------------------------------------------------


def test_the_verified_plan_with_other_torques(hop: Solution) -> None:
    found = failures(hop, altered(hop, STANCE, "tau", lambda tau: np.multiply(tau, 1.01, out=tau)))
    assert {"stance replay", "stance inverse dynamics", "stance energy balance"} <= found.keys()
    assert not any(name.startswith("flight") for name in found)


@pytest.mark.parametrize("phase", [STANCE, FLIGHT])
def test_torques_of_one_percent_more(short: Solution, phase: str) -> None:
    found = found_in(short, altered(short, phase, "tau", lambda tau: np.multiply(tau, 1.01, out=tau)))
    assert {f"{phase} replay", f"{phase} inverse dynamics", f"{phase} energy balance"} <= found


@pytest.mark.parametrize("phase", [STANCE, FLIGHT])
def test_a_torque_in_one_interval(short: Solution, phase: str) -> None:
    """Found, and found there."""
    k = longest(short, phase)

    def shift(tau: np.ndarray) -> None:
        tau[k, :, 1] -= 0.5

    found = failures(short, altered(short, phase, "tau", shift))
    assert {f"{phase} replay", f"{phase} inverse dynamics"} <= found.keys()
    assert found[f"{phase} replay"].where == f"interval from {short.tables[phase].t[k, 0]:.4f} s"


@pytest.mark.parametrize("phase", [STANCE, FLIGHT])
@pytest.mark.parametrize(("name", "by"), [("q", 1e-5), ("v", 1e-4), ("a", 1e-3)])
def test_a_state_at_one_place(short: Solution, phase: str, name: str, by: float) -> None:
    """Inside an interval, where neither continuity nor replay looks."""
    k = longest(short, phase)

    def shift(x: np.ndarray) -> None:
        x[k, 4, -1] += by

    found = found_in(short, altered(short, phase, name, shift))
    assert f"{phase} inverse dynamics" in found
    if name == "q" and phase == STANCE:
        assert f"{phase} continuity" not in found


@pytest.mark.parametrize("name", ["q", "v", "t"])
def test_a_jump_between_intervals(short: Solution, name: str) -> None:
    k = longest(short, STANCE)

    def shift(x: np.ndarray) -> None:
        x[k] += 1e-6

    assert "stance continuity" in found_in(short, altered(short, STANCE, name, shift))


@pytest.mark.parametrize("by", [1e-6, -1e-6, 0.1])
def test_a_claim_of_another_height(short: Solution, by: float) -> None:
    assert found_in(short, clearance_m=short.clearance + by) == {"claimed height"}


def test_a_contact_force_that_is_not_there(short: Solution) -> None:
    found = found_in(short, altered(short, STANCE, "f", lambda f: np.multiply(f, 1.001, out=f)))
    assert found == {"stance inverse dynamics", "stance impulse balance"}
    found = found_in(short, altered(short, STANCE, "f", lambda f: np.negative(f, out=f)))
    assert {"stance inverse dynamics", "stance impulse balance"} <= found
    down = np.full_like(short.tables[STANCE].f, -1.0)
    pulling = failures(short, {**short.tables, STANCE: replace(short.tables[STANCE], f=down)})
    five_weights = 5 * G * sum(b.mass for b in (short.design.leg.body, *short.design.leg.link.values()))
    assert pulling["stance ground pushes"].residual == pytest.approx(1.0 / five_weights, rel=1e-9)
    found = found_in(short, altered(short, FLIGHT, "f", lambda f: np.add(f, 1.0, out=f)))
    assert found == {"flight inverse dynamics", "flight impulse balance"}


@pytest.mark.parametrize("name", ["q", "v"])
def test_another_start(short: Solution, name: str) -> None:
    def shift(x: np.ndarray) -> None:
        x[0, 0, -1] += 1e-6

    assert "start" in found_in(short, altered(short, STANCE, name, shift))


@pytest.mark.parametrize("name", ["q", "v"])
def test_a_flight_that_begins_elsewhere(short: Solution, name: str) -> None:
    def shift(x: np.ndarray) -> None:
        x[0, 0, 0] += 1e-6

    assert "lift-off" in found_in(short, altered(short, FLIGHT, name, shift))


def test_numbers_that_are_none(short: Solution) -> None:
    assert "claimed height" in found_in(short, clearance_m=float("nan"))
    assert not Check("c", float("nan"), 1.0, "m").passed
    assert not Check("c", float("inf"), float("inf"), "m").passed


@pytest.mark.parametrize(
    ("overrides", "name"),
    [
        ({"leg.body.mass": 5.656}, "stance replay"),
        ({"leg.body.mass": 5.656}, "stance impulse balance"),
        ({"leg.shank.mass": 0.808}, "flight inverse dynamics"),
        ({"leg.thigh.length": 0.381}, "start"),
        ({"leg.motor.rotor_inertia": 1.2e-5}, "flight energy balance"),
        ({"leg.motor.max_torque": 1.98}, "stance hip operating region"),
        ({"leg.motor.max_speed": 1244.0}, "stance knee operating region"),
        ({"leg.gear.torque_cap": 107.0}, "stance hip operating region"),
        ({"leg.knee.lower": -2.38}, "flight knee angle"),
        ({"contact.friction": 0.01}, "stance friction cone"),
        ({"hop.counter_movement": False}, "stance body never descends"),
        ({"hop.foot_window": 0.001}, "flight foot window"),
        ({"start.hip_height": 0.281}, "start"),
        ({"start.foot_x": 0.001}, "start"),
    ],
    ids=lambda x: x if isinstance(x, str) else next(iter(x)),
)
def test_the_same_plan_for_another_problem(short: Solution, overrides: dict[str, Any], name: str) -> None:
    """What was optimal for one leg and its limits breaks the tighter limit or the heavier leg's dynamics."""
    before = {c.name: c.residual for c in verify_plan(short.design, short.tables, short.claims())}
    found = failures(short, overrides=overrides)
    assert found[name].residual > before.get(name, 0.0) + found[name].tolerance


# ---- plans of coarse meshes ---------------------------------------------------------------------------------


def test_a_solved_program_is_not_a_verified_hop() -> None:
    """Twelve intervals a phase: Ipopt is content, the replay is not."""
    few = {"solver.refine": False, "solver.stance_intervals": 12, "solver.flight_intervals": 12}
    s = solved_once(few)
    assert s.summary.starts.each[0].status == "Solve_Succeeded"
    assert not s.verified
    assert s.summary.status == "solved, not verified"
    assert s.summary.exit_code == 3
    assert {"stance replay", "local error of the intervals"} <= set(s.summary.failed_checks)


def residuals(s: Solution) -> dict[str, float]:
    return {c.name: c.residual for c in s.summary.verification}


def test_replay_of_a_coarse_radau_plan_improves_with_its_mesh(coarse: Solution) -> None:
    """Inverse dynamics hold at every place of every mesh; only the states between are approximate."""
    finer = solved_once({**COARSE, "solver.stance_intervals": 40, "solver.flight_intervals": 16})
    a, b = residuals(coarse), residuals(finer)
    for phase in (STANCE, FLIGHT):
        assert b[f"{phase} replay"] < a[f"{phase} replay"] / 2
        assert max(r[f"{phase} inverse dynamics"] for r in (a, b)) < 1e-12


# ---- what a limit is worth ----------------------------------------------------------------------------------

WIDER = {  # one per cent of each limit's range, up and down
    "longest stance": [{"hop.stance_duration": [0.03, 0.4 * (1 + s)]} for s in (0.01, -0.01)],
    "knee angle": [{"leg.knee.lower": -2.4 - s * 2.25, "leg.knee.upper": -0.15 + s * 2.25} for s in (0.01, -0.01)],
} | {
    f"{joint} operating region": [
        {f"leg.{joint}.motor.max_torque": 2 * (1 + s), f"leg.{joint}.motor.max_speed": 1256.637 * (1 + s)}
        for s in (0.01, -0.01)
    ]
    for joint in ("hip", "knee")
}


QUICK = ("longest stance",)


@pytest.mark.parametrize(
    "limit", [pytest.param(limit, marks=() if limit in QUICK else pytest.mark.slow) for limit in WIDER]
)
def test_gain_of_a_limit_is_what_moving_it_brings(coarse: Solution, limit: str) -> None:
    """The multipliers' prediction against the same mesh solved with the limit one per cent wider and narrower."""
    wide, narrow = (solved_once({**COARSE, **change}) for change in WIDER[limit])
    gain = coarse.summary.gains[limit]
    assert gain > 0
    values = [s.summary.objective_value for s in (wide, coarse, narrow)]
    assert abs((values[0] - values[2]) / 2 / gain - 1) < 0.01
    assert abs((values[0] - values[1]) / gain - 1) < 0.05


@pytest.mark.slow
def test_gain_of_a_longer_stance_on_refined_meshes(hop: Solution) -> None:
    longer = solved_once({"hop.stance_duration": [0.03, 0.404]})
    gain = longer.summary.objective_value - hop.summary.objective_value
    assert abs(gain / hop.summary.gains["longest stance"] - 1) < 0.05


# ---- no hop ---------------------------------------------------------------------------------------------------

WEAK = {"leg.motor.max_torque": 0.1, "solver.max_iterations": 100, **COARSE}


def holding_torque() -> float:
    """Torque of the knee [N m] that holds the start pose: with the foot under the hip, by gravity's work."""
    design = load("paper")
    robot, q = build_robot(design.leg), start_angles(design)
    machine, h = Machine(robot), 1e-6

    def potential(knee: float) -> float:
        x = np.array([0.0, 0.0, q[0], knee])
        x[:BASE] = -machine.points(x)["foot"]
        return float(pin.computePotentialEnergy(machine.model, machine.data, x))

    return (potential(q[1] + h) - potential(q[1] - h)) / (2 * h)


@pytest.mark.parametrize(
    "more",
    [
        pytest.param({}, id="free"),
        pytest.param({"hop.counter_movement": False}, marks=pytest.mark.slow, id="never descends"),
    ],
)
def test_a_motor_that_cannot_hold_the_leg(more: dict[str, Any]) -> None:
    """Not a hop, even if the foot leaves the ground as the leg falls; the error says which joint, where, how much."""
    with pytest.raises(NotSolvedError) as caught:
        solve(load("paper", {**WEAK, **more}), starts=1)
    needed = abs(holding_torque())
    assert needed > 10
    for part in ("knee", "stance", " at 0 s", f"{needed:.1f} N m", "10.0 N m"):
        assert part in str(caught.value), part
    assert caught.value.exit_code == 1


def test_a_flight_that_is_too_long_for_the_motors() -> None:
    """A leg that can stand, but not stay 0.9 s in the air on the way up: the error names what is missed, and the entry."""
    impossible = {"hop.flight_duration": [0.9, 1.0], "solver.max_iterations": 100, **COARSE}
    with pytest.raises(NotSolvedError) as caught:
        solve(load("paper", impossible), starts=1)
    assert "upright push" in str(caught.value)
    missed = [sentence for sentence in caught.value.diagnosis if "is missed by" in sentence]
    assert missed
    assert all("s after it began" in sentence or "between the phases" in sentence for sentence in missed)
    (conflict,) = (sentence for sentence in caught.value.diagnosis if "cannot hold together" in sentence)
    assert "hop.flight_duration = [0.9, 1]" in conflict
