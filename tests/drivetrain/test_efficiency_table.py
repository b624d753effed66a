"""A gear whose efficiency falls with its speed: the line through its table, and the leg that it drives."""

from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hopopt.comparison.robust.robustness import drawn
from hopopt.control.setting import gear_of
from hopopt.design import Uncertainty, physical_parameters
from hopopt.drivetrain.drives import Drive
from hopopt.drivetrain.gear import Gear, gears_of, lossless_entries, lossy
from hopopt.drivetrain.teeth.law import teeth_torque
from hopopt.errors import ProblemFileError
from hopopt.leg.robot import BASE, build_robot
from hopopt.planner.reserve import reserved
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.problem.load import changed, load
from hopopt.verify.whole_hop import whole_hop_rollout

RATIO = 100.0
SPEEDS, SHARES = (100.0, 400.0, 900.0), (0.8, 0.7, 0.55)
TABLE = {"leg.gear.efficiency_table.speed": SPEEDS, "leg.gear.efficiency_table.efficiency": SHARES}
FLAT = TABLE | {"leg.gear.efficiency_table.efficiency": (0.8, 0.8, 0.8)}
NUMBER = {"leg.gear.efficiency": 0.8}
TORQUES, FACTORS = (10.0, 40.0, 80.0), (0.6, 0.9, 1.0)
LOADED = TABLE | {"leg.gear.efficiency_table.torque": TORQUES, "leg.gear.efficiency_table.factor": FACTORS}
SIDES = np.array([-1.0, 1.0])


def gear_with(entries: dict[str, Any], joint: str = "hip") -> Gear:
    leg = load("paper", entries).leg
    return Gear.of(leg, joint, build_robot(leg).parameters)


def test_it_runs_straight_between_points_and_level_beyond_them() -> None:
    """Off at a corner by no more than the width of its rounding times the change of slope; both ways of turning alike."""
    gear = gear_with(TABLE)
    w = np.linspace(-14, 14, 2001)
    found = gear.law(w)[0]
    exact = np.interp(RATIO * np.abs(w), SPEEDS, SHARES)
    sharpest = max(abs(b) for b in gear.bends)
    assert np.abs(found - exact).max() < 0.1 * gear.slow * sharpest
    assert np.abs(found - exact)[np.abs(np.abs(w) - 6.5) < 1.0].max() < 1e-4  # far from every corner
    np.testing.assert_allclose(found, found[::-1], rtol=1e-12)


def test_it_stays_monotone_and_within_its_table() -> None:
    eta = gear_with(TABLE).law(np.linspace(0, 50, 20_001))[0]
    assert np.all(np.diff(eta) <= 1e-15)
    assert eta.max() <= SHARES[0]
    assert eta.min() >= SHARES[-1]


@pytest.mark.parametrize("side", SIDES)
def test_planner_plant_and_closed_form_have_one_law(side: float) -> None:
    """Driving at 2.5 rad/s, 250 at the motor: halfway between 0.8 and 0.7; the planner's symbols and the compiled plant agree."""
    leg, w, out = load("paper", TABLE).leg, 2.5 * side, 60.0 * side
    robot = build_robot(leg)
    gear = Gear.of(leg, "hip", robot.parameters)
    needed = teeth_torque(out, w, *gear.law(w))
    assert needed == pytest.approx(out / 0.75, rel=1e-4)
    p = {path: ca.SX.sym(path) for path in robot.parameters}
    planned = Gear.of(leg, "hip", p)
    f = ca.Function("f", list(p.values()), [teeth_torque(out, w, *planned.law(w))])
    assert float(f(*robot.parameters.values())) == pytest.approx(needed, rel=1e-14)
    drive = Drive.of(leg, robot.parameters, robot.model.armature[BASE:], gears_of(leg, robot.parameters))
    np.testing.assert_allclose(drive.passed(np.full(2, w), np.full(2, needed)), out, rtol=1e-9)
    torque = drive.torque(np.full(2, w), np.full(2, needed))
    np.testing.assert_allclose(torque[1], out, rtol=1e-9)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("out", [0.0, 5.0, 40.0, 80.0, -40.0, -85.0])
def test_its_factor_by_torque_is_one_law_too(side: float, out: float) -> None:
    """At 2.5 rad/s 0.75 of the torque at the teeth, times the factor at a torque of the table or beyond; and back in the plant."""
    leg, w = load("paper", LOADED).leg, 2.5 * side
    robot = build_robot(leg)
    gear = Gear.of(leg, "hip", robot.parameters)
    eta = 0.75 * np.interp(abs(out), TORQUES, FACTORS)
    needed = gear.needed(out, w)
    assert needed == pytest.approx(out / eta if out * w > 0 else out * eta, rel=2e-4, abs=1.01 * gear.sharp)
    p = {path: ca.SX.sym(path) for path in robot.parameters}
    f = ca.Function("f", list(p.values()), [ca.SX(Gear.of(leg, "hip", p).needed(out, w))])
    assert float(f(*robot.parameters.values())) == pytest.approx(needed, rel=1e-13)
    drive = Drive.of(leg, robot.parameters, robot.model.armature[BASE:], gears_of(leg, robot.parameters))
    given = np.full(2, w), np.full(2, needed)
    np.testing.assert_allclose(drive.passed(*given), out, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(drive.torque(*given)[1], out, rtol=1e-9, atol=1e-9)


def test_what_passes_a_factor_by_torque_grows_with_what_is_given() -> None:
    """Also where the factor rises nearly as fast as the torque, turning or about to; its slope is that of differences."""
    leg = load("paper", LOADED | {"leg.gear.efficiency_table.factor": (0.3, 0.5, 0.7)}).leg
    gear, step = gears_of(leg, build_robot(leg).parameters), 1e-5
    for w in (-3.0, -0.05, 0.0, 0.05, 3.0):
        speeds, before = np.full(2, w), np.full(2, -np.inf)
        for given in np.linspace(-150, 150, 61):
            out, slope = gear.passed(np.full(2, given), speeds)
            assert np.all(out > before)
            np.testing.assert_allclose(gear.needed(out, speeds), given, rtol=1e-10, atol=1e-10)
            ahead, behind = (gear.passed(np.full(2, given + s), speeds)[0] for s in (step, -step))
            np.testing.assert_allclose(slope, (ahead - behind) / (2 * step), rtol=1e-4)
            before = out


def test_a_brake_through_a_gear_that_gets_better_as_it_slows() -> None:
    """A flywheel under a steady torque: its time over a range of speeds is the integral of J dw / (tau eta(w))."""
    gear, inertia, torque = gear_with(TABLE), 2.0, 50.0
    t = solve_ivp(lambda w, _: inertia / (torque * gear.law(w)[0]), (1.5, 3.5), [0.0], rtol=1e-10).y[0, -1]
    slope = (SHARES[1] - SHARES[0]) / (SPEEDS[1] - SPEEDS[0]) * RATIO
    ends = [SHARES[0] + slope * (w - SPEEDS[0] / RATIO) for w in (1.5, 3.5)]
    assert t == pytest.approx(inertia / torque / slope * np.log(ends[1] / ends[0]), rel=1e-4)


def test_a_level_table_is_the_one_number() -> None:
    for joint in ("hip", "knee"):
        table, number = gear_with(FLAT, joint), gear_with(NUMBER, joint)
        for w in (-5.0, 0.0, 3.0, 12.0):
            np.testing.assert_allclose(table.law(w), number.law(w), rtol=1e-14)


def test_a_scale_of_its_losses_takes_them_away_in_planner_and_plant() -> None:
    """None at 0, as of the start without losses; in the planner's symbols too, where one program has every scale."""
    scale = "leg.gear.efficiency_table.loss_scale"
    leg = load("paper", LOADED).leg
    p = {path: ca.SX.sym(path) for path in build_robot(leg).parameters}
    f = ca.Function("f", list(p.values()), [ca.SX(Gear.of(leg, "hip", p).needed(60.0, 2.5))])
    needed = []
    for share in (0.0, 0.5, 1.0):
        scaled = load("paper", LOADED | {scale: share}).leg
        own = build_robot(scaled).parameters
        needed.append(gears_of(scaled, own).needed(60.0, 2.5)[0])
        assert float(f(*own.values())) == pytest.approx(needed[-1], rel=1e-13)
    assert needed[0] == 60.0
    assert needed[0] < needed[1] < needed[2]
    assert lossless_entries(physical_parameters(leg)) == {scale: 0.0}


def test_a_joint_s_own_number_or_table_counts_over_the_leg_s() -> None:
    own = load("paper", TABLE | {"leg.knee.gear.efficiency": 0.9}).leg
    gear = gears_of(own, build_robot(own).parameters)
    np.testing.assert_allclose(gear.law(np.array([6.5, 6.5]))[0], [0.7 - 0.15 / 2, 0.9], rtol=1e-4)
    other = load("paper", NUMBER | {k.replace("leg.gear", "leg.knee.gear"): v for k, v in TABLE.items()}).leg
    assert lossy(other, "knee")
    gear = gears_of(other, build_robot(other).parameters)
    np.testing.assert_allclose(gear.law(np.array([6.5, 6.5]))[0], [0.8, 0.7 - 0.15 / 2], rtol=1e-4)


def test_a_ratio_moves_it_as_the_motor_turns_faster() -> None:
    faster = changed(load("paper", TABLE), {"leg.gear.ratio": 2 * RATIO}).leg
    at = Gear.of(faster, "hip", build_robot(faster).parameters).law(3.25)[0]
    assert at == pytest.approx(gear_with(TABLE).law(6.5)[0], rel=1e-4)


def test_others_that_read_the_efficiency_know_the_table() -> None:
    """The plant of [simulation] keeps it, the global search takes the best of it, a reserve nothing more, and uncertain legs lose
    a share of all of it."""
    design = load("paper", TABLE | {"simulation.gear_efficiency": 1.0})
    np.testing.assert_allclose(gear_of(design).law(np.full(2, 6.5))[0], 0.625, rtol=1e-4)
    best = gear_with(TABLE).level
    assert best.law(100.0)[0] == best.efficiency == SHARES[0]
    planned, lossless = reserved(design).leg, reserved(load("paper")).leg
    assert planned.motor.max_torque == lossless.motor.max_torque
    true = drawn(design, Uncertainty(gear_loss=0.2), draws=1, seed=0)[0].leg.leg
    lost = gears_of(true, build_robot(true).parameters).law(np.full(2, 6.5))[0] / 0.625
    assert np.all((lost > 0.8) & (lost < 1.0 - 1e-4))


@pytest.mark.parametrize("entries", [TABLE, LOADED])
@pytest.mark.parametrize("scale", [1.0, 0.5, 0.0])
def test_what_uncertain_legs_lose_does_not_depend_on_the_scale_of_known_losses(
    entries: dict[str, Any], scale: float
) -> None:
    """As with an efficiency of one number: the same share of what the believed gear passes, at every speed and torque. Gears at the
    ends of the spread lose none or all of it."""
    design = load("paper", entries | {"leg.gear.efficiency_table.loss_scale": scale})
    legs = [draw.leg for draw in drawn(design, Uncertainty(gear_loss=0.1), draws=8, seed=0, corners=True)]
    believed, *true = (gears_of(each.leg, build_robot(each.leg).parameters) for each in (design, *legs))
    found = np.array([[gear.law(w, out)[0] / believed.law(w, out)[0] for gear in true]
                      for w in (0.0, 2.5, -6.5, 12.0) for out in (0.0, 25.0, -60.0, 200.0)])  # fmt: skip
    np.testing.assert_allclose(found, np.broadcast_to(found[0], found.shape), rtol=1e-12)
    np.testing.assert_allclose(np.unique(found[0].round(12)), [0.9, 1.0])


@pytest.mark.parametrize(
    ("hip", "knee", "turning"),
    [
        ({"factor": FACTORS, "loss_scale": 0.0}, {"factor": FACTORS, "loss_scale": 0.5}, (False, True)),
        ({"factor": (1.0, 1.0, 1.0)}, {"factor": (1.0, 1.0, 0.9)}, (False, True)),
        ({"factor": (0.9, 0.9, 0.9)}, {"efficiency": (1.0, 1.0, 0.9)}, (True, True)),
    ],
)
def test_only_a_gear_that_loses_has_a_reversal(
    hip: dict[str, Any], knee: dict[str, Any], turning: tuple[bool, bool]
) -> None:
    """Each joint by its own table, be it lossless over some of its speeds or torques."""
    plain = {"speed": SPEEDS, "efficiency": (1.0, 1.0, 1.0), "torque": TORQUES, "factor": (1.0, 1.0, 1.0)}
    tables = {"hip": plain | hip, "knee": plain | knee}
    leg = load("paper", {f"leg.{joint}.gear.efficiency_table": table for joint, table in tables.items()}).leg
    gears = gears_of(leg, build_robot(leg).parameters)
    assert not gears.ideal
    np.testing.assert_array_equal(gears.one_sided, turning)


def test_a_motor_s_own_friction_is_in_the_plant_beside_the_gear_s() -> None:
    """R k i_0 at the joint, also where [simulation] says what the gear's friction is."""
    entries = {"leg.motor.torque_constant": 0.05, "leg.motor.no_load_current": 0.4}
    np.testing.assert_allclose(gear_of(load("paper", entries)).friction, RATIO * 0.05 * 0.4, rtol=1e-12)
    more = entries | {"simulation.gear_friction": 1.5}
    np.testing.assert_allclose(gear_of(load("paper", more)).friction, RATIO * 0.05 * 0.4 + 1.5, rtol=1e-12)


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ({"speed": (400.0, 100.0, 900.0)}, "efficiency_table has speeds that do not rise: .*rising order"),
        ({"speed": (100.0, 100.0, 900.0)}, "each once"),
        ({"efficiency": (0.7, 0.8, 0.6)}, "efficiency_table is not monotone in speed"),
        ({"efficiency": (0.8, 0.7)}, "has 3 speeds and 2 efficiencies"),
        ({"efficiency": (0.8, 0.7, 0.0)}, "efficiency"),
        ({"efficiency": (1.2, 0.7, 0.6)}, "efficiency"),
        ({"speed": (-1.0, 100.0, 900.0)}, "speed"),
        ({"torque": TORQUES}, "has no factor: torque and factor go together"),
        ({"torque": TORQUES, "factor": (0.6, 0.9)}, "has 3 torques and 2 factors"),
        ({"torque": (40.0, 10.0, 80.0), "factor": FACTORS}, "has torques that do not rise"),
        ({"torque": TORQUES, "factor": (0.1, 0.5, 1.0)}, "rise too fast at .* N m"),
        ({"torque": TORQUES, "factor": (1.0, 0.9, 0.1)}, "fall too fast at .* N m"),
        ({"torque": TORQUES, "factor": (0.6, 0.9, 1.1)}, "factor"),
        ({"efficiency": (0.06, 0.06, 0.06), "torque": TORQUES, "factor": FACTORS}, "below 0.05"),
    ],
)
def test_wrong_tables_get_one_sentence(entries: dict[str, tuple[float, ...]], words: str) -> None:
    with pytest.raises(ProblemFileError, match=words) as fault:
        load("paper", TABLE | {f"leg.gear.efficiency_table.{name}": value for name, value in entries.items()})
    assert len(fault.value.problems) == 1


def test_a_table_beside_one_number_gets_one_sentence() -> None:
    with pytest.raises(ProblemFileError, match="stands beside efficiency") as fault:
        load("paper", TABLE | NUMBER)
    assert len(fault.value.problems) == 1


# ---- the optimum with it --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def hop() -> Solution:
    return solve(load("paper", TABLE), starts=1)


@pytest.mark.rarely
def test_the_plan_is_verified_and_replayed_in_one_piece(hop: Solution) -> None:
    assert hop.verified
    found = whole_hop_rollout(hop.design, hop.tables)
    assert found.values["clearance_m"] == pytest.approx(hop.clearance, abs=1e-4)
