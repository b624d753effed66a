"""A supply that motors share, against closed forms; and the optimum, the plant and verification with it."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from hopopt.control.closed_loop import make_plant, simulate
from hopopt.control.strategies import BUILT_IN
from hopopt.design import Design
from hopopt.drivetrain.drives import Drive
from hopopt.drivetrain.gear import Gear
from hopopt.drivetrain.motor import rated
from hopopt.drivetrain.supply import power_drawn, power_limits, sag, share_at, voltage_share
from hopopt.errors import ProblemFileError
from hopopt.leg.robot import BASE, build_robot
from hopopt.nlp.solver.ipopt import NlpSolver
from hopopt.nlp.solver.reuse import with_numbers_of
from hopopt.ocp.guesses.feasibility import drives_too_weak
from hopopt.ocp.guesses.initial_guess import make_guess, starts_of
from hopopt.ocp.hop import Hop
from hopopt.optimality.directions.parametric_sensitivity import slopes
from hopopt.planner.answer.notes import sharper_note
from hopopt.planner.reserve import reference_of
from hopopt.planner.search.multistart import first_transcription
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.problem.load import changed, load
from hopopt.sim.mujoco import replay
from hopopt.verify.drives import losses, supply_figures
from hopopt.verify.whole_hop import Simulated, whole_hop_rollout
from once import plan_with_reserve, solved_once

V, R_S = 48.0, 0.2
HUGE = 1e9  # N m, that no motor gives
SUPPLY = {"supply.voltage": V, "supply.internal_resistance": R_S}


def drive_of(design: Design) -> Drive:
    robot = build_robot(design.leg)
    return Drive.of(design.leg, robot.parameters, robot.model.armature[BASE:], Gear())


def stall_and_speed(design: Design) -> tuple[float, float]:
    """Stall torque [N m] and no-load speed [rad/s] at the joints without load on the supply."""
    (torque, speed), ratio = rated(design.leg, "hip"), design.leg.gear.ratio
    return ratio * torque, speed / ratio


def test_a_motor_with_series_resistance_on_a_sagging_bus() -> None:
    """At standstill, the other motor idle, the same current flows through both resistances: i = V / (R + R_s)."""
    design = load("paper", SUPPLY)
    stall, speed = stall_and_speed(design)
    resistance = V**2 / (stall * speed)  # that the line implies: k = V / speed, stall = k V / R
    given = drive_of(design).clamp(np.zeros(2), np.array([HUGE, 0.0]))
    assert given[0] == pytest.approx(stall * resistance / (resistance + R_S), rel=1e-4)
    share = voltage_share(design.leg, build_robot(design.leg).parameters, [given[0], 0.0], [0.0, 0.0])
    assert share == pytest.approx(resistance / (resistance + R_S), rel=1e-4)


@pytest.mark.parametrize("w", [0.0, 3.0, 7.0])
def test_two_motors_on_one_bus_are_one_on_twice_the_resistance(w: float) -> None:
    both = drive_of(load("paper", SUPPLY)).clamp(np.full(2, w), np.full(2, HUGE))
    alone = drive_of(load("paper", SUPPLY | {"supply.internal_resistance": 2 * R_S})).clamp(
        np.array([w, 0.0]), np.array([HUGE, 0.0])
    )
    assert both[0] == pytest.approx(both[1], rel=1e-9)
    assert both[0] == pytest.approx(alone[0], rel=1e-4)
    spared = SUPPLY | {"supply.internal_resistance": 2 * R_S, "supply.count": 2.0}
    np.testing.assert_allclose(drive_of(load("paper", spared)).clamp(np.full(2, w), np.full(2, HUGE)), both, rtol=1e-9)


def test_the_clamp_finds_the_voltage_at_which_the_motors_draw_what_they_get() -> None:
    """Against a root by SciPy: torque on the line at v, v what is left when it is drawn."""
    design, w = load("paper", SUPPLY), np.array([4.0, -2.0])
    leg, p = design.leg, build_robot(design.leg).parameters
    stall, speed = stall_and_speed(design)

    def torques(v: float) -> np.ndarray:
        return np.array([stall * (v - w[0] / speed), -stall * (v - abs(w[1]) / speed)])

    root: Any = brentq(lambda v: share_at(sag(leg, p), power_drawn(leg, p, torques(v), w)) - v, 0.4, 1.0, xtol=1e-13)
    np.testing.assert_allclose(drive_of(design).clamp(w, np.array([HUGE, -HUGE])), torques(root), rtol=1e-8)


@pytest.mark.parametrize(("entry", "value"), [("power_cap", 900.0), ("current_cap", 20.0), ("least_voltage", 44.0)])
def test_no_cap_of_the_supply_is_passed(entry: str, value: float) -> None:
    design = load("paper", SUPPLY | {f"supply.{entry}": value})
    leg, p, w = design.leg, build_robot(design.leg).parameters, np.array([5.0, 5.0])
    given = drive_of(design).clamp(w, np.full(2, HUGE))
    power = power_drawn(leg, p, given, w)
    voltage = V * share_at(sag(leg, p), power)
    told = {"power_cap": power, "current_cap": power / voltage, "least_voltage": voltage}
    assert told[entry] == pytest.approx(value, rel=1e-3)
    assert power <= power_limits(leg, p)[entry] * (1 + 1e-9)


def test_what_flows_back_raises_the_voltage_only_of_a_supply_that_takes_it() -> None:
    w, tau = [8.0, 8.0], [-20.0, -20.0]
    for takes, above in ((True, True), (False, False)):
        leg = load("paper", SUPPLY | {"supply.recuperation": takes}).leg
        assert (voltage_share(leg, build_robot(leg).parameters, tau, w) > 1.0 + 1e-6) is above


@pytest.mark.parametrize(
    "entry", ["supply.voltage=0", "leg.gear.efficiency=0", "leg.gear.efficiency=1.2", "supply.volts=3"]
)
def test_wrong_entries_get_one_sentence(entry: str) -> None:
    with pytest.raises(ProblemFileError) as fault:
        load("paper", ["supply.voltage=48", entry])
    assert len(fault.value.problems) == 1
    assert entry.split("=")[0].split(".")[-1] in fault.value.problems[0]


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ({"supply.power_cap": 0.2}, "supply.power_cap = 0.2 lets 0 W through"),
        ({"supply.internal_resistance": 40.0}, "supply.internal_resistance = 40 lets 14 W through"),
        ({"supply.internal_resistance": 1.0, "leg.motor.max_torque": 0.3}, "V that the supply keeps meanwhile"),
    ],
)
def test_a_supply_that_cannot_hold_the_start_pose_is_named(entries: dict[str, float], words: str) -> None:
    design = load("paper", SUPPLY | entries)
    faults = drives_too_weak(design, build_robot(design.leg))
    assert any(words in fault for fault in faults)


# ---- the optimum with all of it -------------------------------------------------------------------------------------

REAL = SUPPLY | {"supply.internal_resistance": 0.05, "leg.gear.efficiency": 0.7}


@pytest.fixture(scope="module")
def hop() -> Solution:
    """The plan to track, whose torques are calm, so that it is solved within seconds."""
    return plan_with_reserve(REAL)


@pytest.mark.rarely
def test_a_plan_replayed_and_tracked_reaches_what_it_claims(hop: Solution) -> None:
    """In one piece, by MuJoCo's dynamics, and by a controller on the plant."""
    assert hop.verified
    assert hop.summary.supply is not None
    assert 0.85 * V < hop.summary.supply.lowest_voltage_V < 0.92 * V
    found = whole_hop_rollout(hop.design, hop.tables)
    assert found.values["clearance_m"] == pytest.approx(hop.clearance, abs=1e-4)
    assert replay(hop.robot, hop).lowest[-1] == pytest.approx(hop.clearance, rel=1e-2)
    run = simulate(load("paper", REAL), BUILT_IN["track"], plan=reference_of(hop), past_apex=True)
    assert run.figures.clearance == pytest.approx(hop.clearance, rel=2e-2)


@pytest.mark.rarely
def test_losses_and_supply_are_told_and_balance(hop: Solution) -> None:
    """What the supply gives is what each machine gains and what becomes heat in it, and what is fed back and burnt, to 1e-6."""
    s, (stall, speed) = hop.summary, stall_and_speed(hop.design)
    assert s.losses is not None
    assert s.supply is not None
    assert s.supply.burnt_J is not None
    heat = sum(x.gear + x.friction + (x.winding or 0.0) for x in s.losses.values())
    machine, gained = make_plant(hop.design).machine, 0.0
    for table in hop.tables.values():
        gained += machine.energy(table.q[-1, -1], table.v[-1, -1]) - machine.energy(table.q[0, 0], table.v[0, 0])
    used = drawn = 0.0
    for name, table in hop.tables.items():  # each interval by itself: commands jump from one to the next
        began, last = table.t[:, 0] - table.t[0, 0], table.t[:, -1] - table.t[:, 0]
        middles = began[:, None] + last[:, None] * (np.arange(1000) + 0.5) / 1000
        samples, lasts = hop.sample_phase(name, middles.ravel()), np.repeat(last / 1000, 1000)
        each = zip(samples.command.T, samples.v[:, BASE:].T, strict=True)
        power = sum(t * w + speed / stall * t * t for t, w in each)
        used += float(lasts @ power)
        drawn += float(lasts @ np.maximum(power, 0.0))
    assert used == pytest.approx(heat + gained, rel=1e-6)
    assert s.supply.energy_J == pytest.approx(heat + gained + s.supply.burnt_J, rel=1e-6)
    two = supply_figures(build_robot(changed(hop.design, {"supply.legs": 2.0}).leg), hop.tables)
    assert two is not None
    assert two.burnt_J is not None
    assert two.energy_J == pytest.approx(2 * (heat + gained) + two.burnt_J, rel=1e-6)
    assert s.supply.energy_J == pytest.approx(drawn, rel=1e-4)  # its law is smooth where motors feed back
    assert all(x.gear > 0 for x in losses(hop.robot, hop.tables).values())


@pytest.mark.rarely
def test_clearance_falls_as_efficiency_falls_and_as_the_supply_weakens() -> None:
    several = [{}, {"leg.gear.efficiency": 0.9}, {"leg.gear.efficiency": 0.7}, REAL]
    found = [solve(load("paper", entries), starts=1).clearance for entries in several]
    assert all(a > b + 1e-3 for a, b in pairwise(found))


@pytest.mark.rarely
@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize(
    ("entries", "least"),
    [
        ({"leg.gear.efficiency": 0.9}, 0.7680),
        ({"leg.gear.efficiency": 0.7}, 0.6915),
        ({"leg.gear.efficiency": 0.7, "contact.friction": 0.7}, 0.6595),
    ],
)
def test_the_search_finds_what_other_codes_found(entries: dict[str, float], least: float, seed: int) -> None:
    """Trials of stance alone, with cubic intervals and sgn smoothed over 0.02 rad/s: 0.7687, 0.692 and 0.6599 m."""
    found = solve(load("paper", {**entries, "solver.seed": seed}))
    assert found.verified
    assert found.summary.certified
    assert found.clearance > least


@pytest.mark.slow
def test_the_optimum_tells_what_gears_and_supply_are_worth() -> None:
    """By multipliers, and by solving the first mesh again with each entry a thousandth more and less."""
    entries = {"leg.gear.efficiency": 0.8, "leg.gear.friction": 1.0, "supply.voltage": V, "supply.current_cap": 70.0}
    entries["supply.internal_resistance"] = 0.05
    t = first_transcription(hop := Hop(load("paper", entries)))
    best = NlpSolver(t)(make_guess(hop, starts_of(hop, 1)[0]))
    assert best.success
    told = slopes(best).parameters

    def height(entry: str, value: float) -> float:
        again = with_numbers_of(t, Hop(load("paper", entries | {entry: value})).problem)
        found = NlpSolver(again).from_vector(best.z, (best.lam_g, best.lam_x))
        assert found.success
        return found.value

    for entry in ("leg.gear.efficiency", "leg.gear.friction", "supply.internal_resistance"):
        value = entries[entry]
        slope = (height(entry, 1.001 * value) - height(entry, 0.999 * value)) / (0.002 * value)
        assert told[entry.replace("supply", "leg.supply")][0] == pytest.approx(slope, rel=1e-4), entry


def test_a_hop_that_owes_much_to_the_smooth_law_of_its_gears_says_so() -> None:
    """By more than a hundredth of what the same torques clear with the program's own gears."""
    (note,) = sharper_note(Simulated(clearance_m=0.97, sharper_gears_m=0.92))
    assert "clears 0.920 m, 5.2% less" in note
    assert not sharper_note(Simulated(clearance_m=0.97, sharper_gears_m=0.968))
    assert not sharper_note(Simulated(clearance_m=0.97))


@pytest.mark.slow
def test_a_hop_owes_little_to_the_smooth_law_of_its_gears() -> None:
    """Told beside the claim; a hop without losses has nothing to tell."""
    hop = solved_once({"leg.gear.efficiency": 0.9})
    sharper = hop.summary.objective_error.simulated.sharper_gears_m
    assert sharper is not None
    assert sharper == pytest.approx(hop.clearance, abs=5e-3)
    assert solved_once({}).summary.objective_error.simulated.sharper_gears_m is None
