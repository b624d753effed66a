"""A motor by its datasheet, its friction, and its caps on current and power, against closed forms."""

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hopopt.comparison.losses import lifted_in_turn
from hopopt.design import physical_parameters
from hopopt.drivetrain.drives import Drive
from hopopt.drivetrain.gear import gears_of, lossy
from hopopt.drivetrain.motor import behind, motor_torque_and_speed, rated, voltage_line
from hopopt.drivetrain.operating_region.limits import Line
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.drivetrain.supply import winding_heat
from hopopt.errors import ProblemFileError
from hopopt.leg.robot import BASE, build_robot
from hopopt.leg.scales import standstill_torques
from hopopt.planner.reserve import reserved
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.problem.load import changed, load
from hopopt.verify.whole_hop import whole_hop_rollout

V, R, K, RATIO = 48.0, 0.8, 0.05, 100.0
DATASHEET = {"leg.motor.voltage": V, "leg.motor.winding_resistance": R, "leg.motor.torque_constant": K}
STATED = {"leg.motor.max_torque": K * V / R, "leg.motor.max_speed": V / K}
HUGE = 1e9  # N m, that no motor gives


def drive_of(entries: dict[str, float]) -> Drive:
    leg = load("paper", entries).leg
    robot = build_robot(leg)
    return Drive.of(leg, robot.parameters, robot.model.armature[BASE:], gears_of(leg, robot.parameters))


def test_a_datasheet_is_the_same_as_the_torque_and_speed_that_it_implies() -> None:
    leg, stated = load("paper", DATASHEET).leg, load("paper", STATED).leg
    assert leg.motor.max_torque is None
    for w in (0.0, 5.0, -12.0):
        bounds = [operating_region(x, "hip", build_robot(x).parameters).torque_bounds(w) for x in (leg, stated)]
        np.testing.assert_allclose(*bounds, rtol=1e-12)
    np.testing.assert_allclose(standstill_torques(leg), standstill_torques(stated), rtol=1e-12)


def test_the_supply_s_voltage_takes_the_place_of_one_that_is_not_stated() -> None:
    entries = {name: value for name, value in DATASHEET.items() if not name.endswith("voltage")}
    leg = load(
        "paper", {**entries, "supply.voltage": 24.0, "leg.motor.max_torque": None, "leg.motor.max_speed": None}
    ).leg
    assert rated(leg, "knee") == pytest.approx((K * 24 / R, 24 / K), rel=1e-12)


def test_torque_and_speed_go_from_the_motor_s_own_voltage_to_the_supply_s() -> None:
    """The law k V_0 / R, V_0 / k of a winding, whether stated at V or implied; the heat of a torque stays."""
    stated = {name: value for name, value in DATASHEET.items() if not name.endswith("resistance")}
    legs = [load("paper", {**x, "supply.voltage": 36.0}).leg for x in (DATASHEET, {**stated, **STATED})]
    for leg in legs:
        assert rated(leg, "hip") == pytest.approx((K * 36 / R, 36 / K), rel=1e-12)
        assert {"leg.supply.voltage"} < {*behind(leg, "hip", "max_torque"), "leg.motor.max_torque"}
        p = physical_parameters(leg)
        assert winding_heat(leg, "hip", p) == pytest.approx(R / (RATIO * K) ** 2, rel=1e-12)
        assert voltage_line(leg, "hip", p).at(0.0, 36 / K / RATIO) == pytest.approx(36.0, rel=1e-12)
        freed = leg.model_copy(update={"supply": None})
        assert rated(freed, "hip") == pytest.approx((K * V / R, V / K), rel=1e-12)
    plans = [reserved(load("paper", {**x, "supply.voltage": 36.0, "reserve.torque": 0.1})).leg for x in (DATASHEET, {})]
    shares = [
        rated(plan, "hip")[0] / rated(leg, "hip")[0]
        for plan, leg in zip(plans, (legs[0], load("paper").leg), strict=True)
    ]
    assert shares == pytest.approx([0.9, 0.9])
    *_, (_, alone) = lifted_in_turn(load("paper", {**DATASHEET, **STATED, "supply.voltage": 36.0}))
    assert rated(alone.leg, "hip") == pytest.approx((K * 36 / R, 36 / K), rel=1e-12)


def test_what_is_stated_counts_and_a_joint_s_own_voltage_counts_over_the_leg_s() -> None:
    torque = load("paper", {**DATASHEET, "leg.motor.max_torque": 1.5}).leg
    assert rated(torque, "hip") == pytest.approx((1.5, V / K))
    own = {f"leg.knee.motor.{name.rsplit('.')[-1]}": value for name, value in DATASHEET.items()}
    paper, leg = load("paper").leg, load("paper", own).leg
    assert rated(leg, "hip") == (paper.motor.max_torque, paper.motor.max_speed)
    assert rated(leg, "knee") == pytest.approx((K * V / R, V / K))


def test_a_swept_or_free_voltage_moves_torque_and_speed() -> None:
    more = changed(load("paper", DATASHEET), {"leg.motor.voltage": 1.1 * V}).leg
    assert rated(more, "hip") == pytest.approx((1.1 * K * V / R, 1.1 * V / K), rel=1e-12)
    leg = load("paper", DATASHEET).leg
    p = {path: ca.SX.sym(path) for path in DATASHEET}
    torque, speed = motor_torque_and_speed(leg, "hip", p)
    slopes = ca.Function("slopes", list(p.values()), [ca.gradient(torque, p["leg.motor.torque_constant"]),
                                                      ca.gradient(speed, p["leg.motor.torque_constant"])])  # fmt: skip
    np.testing.assert_allclose([float(x) for x in slopes(*DATASHEET.values())], [V / R, -V / K**2], rtol=1e-12)


def test_the_reserve_is_held_back_from_a_torque_and_speed_that_a_datasheet_implies() -> None:
    entries = {"reserve.torque": 0.1, "reserve.speed": 0.2}
    legs = [reserved(load("paper", {**x, **entries})).leg for x in (DATASHEET, STATED)]
    assert rated(legs[0], "hip") == pytest.approx(rated(legs[1], "hip"), rel=1e-12)


def test_no_load_current_is_coulomb_friction_in_front_of_the_gear() -> None:
    """k i_0 at the motor, so R k i_0 at the joint, beside what the gear's own friction takes."""
    leg = load("paper", {**DATASHEET, "leg.motor.no_load_current": 0.6, "leg.gear.friction": 1.0}).leg
    assert lossy(leg, "hip")
    gear = gears_of(leg, build_robot(leg).parameters)
    np.testing.assert_allclose(gear.friction, 1.0 + RATIO * K * 0.6, rtol=1e-12)


def test_a_cap_on_current_is_one_on_torque() -> None:
    capped = {**DATASHEET, "leg.motor.current_cap": 20.0}
    given = drive_of(capped).clamp(np.zeros(2), np.array([HUGE, -HUGE]))
    np.testing.assert_allclose(given, [RATIO * K * 20, -RATIO * K * 20], rtol=1e-12)
    leg = load("paper", capped).leg
    assert operating_region(leg, "hip", build_robot(leg).parameters).binding(0.0, HUGE) == Line.CURRENT_CAP
    np.testing.assert_allclose(standstill_torques(leg), RATIO * K * 20, rtol=1e-12)


@pytest.mark.parametrize("supply", [{}, {"supply.voltage": V, "supply.internal_resistance": 1e-6}])
def test_a_cap_on_power_is_a_hyperbola_below_the_torque_speed_line(supply: dict[str, float]) -> None:
    power, drive = 300.0, drive_of({**STATED, "leg.motor.power_cap": 300.0, **supply})
    stall, speed = RATIO * K * V / R, V / K / RATIO
    for w in (0.1, 2.0, 5.0, 9.0):
        most = min(power / w, stall * (1 - w / speed))
        given = drive.clamp(np.array([w, -w]), np.array([HUGE, HUGE]))
        np.testing.assert_allclose(given, [most, most], rtol=1e-4 if supply else 1e-12)  # the other brakes


def test_a_flywheel_at_the_cap_on_power_gains_energy_as_fast_as_that() -> None:
    """J w w' = P, so w^2 = w_0^2 + 2 P t / J."""
    drive, inertia, power, w0, t = drive_of({**STATED, "leg.motor.power_cap": 50.0}), 3.0, 50.0, 1.0, 0.5

    def rates(_: float, w: np.ndarray) -> np.ndarray:
        return drive.clamp(np.array([w[0], 0.0]), np.array([HUGE, 0.0]))[:1] / inertia

    w = solve_ivp(rates, (0.0, t), [w0], rtol=1e-10, atol=1e-12).y[0, -1]
    assert w == pytest.approx(np.sqrt(w0**2 + 2 * power * t / inertia), rel=1e-6)


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ({"leg.motor.max_torque": None}, "leg.motor.max_torque is missing: .* lacks: motor.voltage, .*, motor.torque_con"),
        ({"leg.motor.max_speed": None, "leg.motor.torque_constant": K}, "leg.motor.max_speed is missing: .* motor.voltage"),
        ({"leg.motor.current_cap": 20.0}, "current_cap = 20 A is a current.*give motor.torque_constant"),
        ({"leg.motor.no_load_current": 0.5}, "no_load_current = 0.5 A is a current.*give motor.torque_constant"),
        ({"leg.motor.power_cap": 0}, "leg.motor.power_cap"),
    ],
)  # fmt: skip
def test_wrong_entries_get_one_sentence(entries: dict[str, float | None], words: str) -> None:
    with pytest.raises(ProblemFileError, match=words) as fault:
        load("paper", entries)
    assert len(fault.value.problems) == 1


# ---- the optimum with it --------------------------------------------------------------------------------------------

POWER = 600.0  # W


@pytest.fixture(scope="module")
def capped() -> Solution:
    return solve(load("paper", {"leg.motor.power_cap": POWER}), starts=1)


@pytest.mark.slow
def test_no_motor_of_the_optimum_gives_more_than_its_power(capped: Solution) -> None:
    assert capped.verified
    used = {name: 0.0 for name in capped.robot.joints}
    for name, phase in capped.phases.items():
        fine = capped.sample_phase(name, np.linspace(0, phase.duration, 20_001))
        for k, joint in enumerate(used):
            used[joint] = max(used[joint], float(np.abs(fine.command[:, k] * fine.v[:, BASE + k]).max()))
    assert max(used.values()) == pytest.approx(POWER, rel=2e-4)
    assert {"hip motor power cap", "knee motor power cap"} <= capped.summary.active_limits.keys()
    found = whole_hop_rollout(capped.design, capped.tables)
    assert found.values["clearance_m"] == pytest.approx(capped.clearance, abs=1e-4)


@pytest.mark.rarely
def test_clearance_falls_with_the_power(capped: Solution) -> None:
    found = [solve(load("paper", x), starts=1).clearance for x in ({}, {"leg.motor.power_cap": 300.0})]
    assert all(a > b + 1e-3 for a, b in pairwise([found[0], capped.clearance, found[1]]))


@pytest.mark.rarely
def test_the_optimum_by_the_datasheet_is_that_of_the_torque_and_speed_it_implies() -> None:
    by_datasheet, stated = (solve(load("paper", x), starts=1).clearance for x in (DATASHEET, STATED))
    assert by_datasheet == pytest.approx(stated, abs=1e-9)
