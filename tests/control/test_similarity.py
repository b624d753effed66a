"""Gains and defaults on other legs: on the paper's nothing changes, similar legs hop alike, and what is given wins."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from hopopt.control.closed_loop import make_controller, simulate
from hopopt.control.paper_options import PaperOptions
from hopopt.control.reference import PlanReference
from hopopt.control.setting import Setting
from hopopt.control.similarity import Size, factors, similar_height
from hopopt.control.strategies import find
from hopopt.control.tracking.track import Track, TrackingOptions
from hopopt.design import Reserve
from hopopt.leg.robot import build_robot
from hopopt.leg.scales import Scale, reserve_of, standstill_torques, weight
from hopopt.planner.reserve import reference_of, reserved
from hopopt.problem.load import load
from hopopt.sim.hop_metrics import HopFigures
from once import plan_with_reserve
from similar_legs import POWERS, similar, similar_plan

PAPERS = ("paper", "paper_four_quadrant", "paper_no_countermovement")
SHAPES = ("a1_leg", "hyq_leg", "solo12_leg")  # the others are the first in other sizes
LEGS = ("a1_leg", "b1_leg", "go1_leg", "go2_leg", "hyq_leg", "solo12_leg")
COARSE = 500.0  # Hz, of the paper's leg: gains of fewer periods
QUICK = {"simulation.control_rate": 1000.0, "simulation.encoder_bits": 0, "simulation.speed_window": 1}


@cache
def plan(size: float) -> PlanReference:
    """What is tracked on a leg so many times as large as the paper's: the paper's plan, scaled."""
    return similar_plan(reference_of(plan_with_reserve()), size)


def track(size: float) -> Track:
    """The tracker of that plan."""
    return Track(Setting(load("paper", similar(size)), size**0.5 / COARSE, plan(size)))


@cache
def hopped(name: str, size: float) -> HopFigures:
    """The figures of a strategy's hop on such a leg, with all its sensors."""
    return simulate(load("paper", similar(size)), find(name), plan=plan(size), past_apex=True).figures


@pytest.mark.parametrize("name", PAPERS)
def test_on_the_papers_leg_every_number_is_the_printed_one(name: str) -> None:
    """To the last digit."""
    assert PaperOptions.of(load(name), {}) == PaperOptions()
    assert set(factors(Size.of(load(name))).values()) == {1.0}


@given(st.floats(0.1, 4.0))
@settings(max_examples=3, deadline=None, phases=[Phase.generate])
def test_regulator_and_filter_of_a_similar_leg_are_similar(size: float) -> None:
    """Blocks of angles and speeds scale with the units of what they make of what; the cost-to-go is a number."""
    n, time, own, papers_own = 2, size**0.5, track(size).gains, track(1.0).gains
    x, u = np.repeat([1.0, 1 / time], n), np.full(n, size**4)  # units of errors and torques
    for contact, gains in own.items():
        of = papers_own[contact]
        for name, rows, columns in (("A", x, x), ("B", x, u), ("K", u, x), ("L", x, x[:n]), ("P", 1 / x, x)):
            papers, found = getattr(of, name), getattr(gains, name) / (rows[:, None] / columns)
            largest = np.abs(papers).max(axis=0)  # of every entry along the phase; some are nothing
            assert np.all(np.abs(found - papers) <= 1e-5 * largest + 1e-9 * largest.max()), name


@pytest.mark.slow
@pytest.mark.parametrize("name", ["force", "position_tuned", "track", "track_pd"])
@given(st.floats(0.1, 4.0))
@settings(max_examples=1, deadline=None, phases=[Phase.generate])
def test_a_similar_leg_hops_alike(name: str, size: float) -> None:
    """Lengths times ``size``, masses its cube, torques its fourth power, times its root: so is every height, by Newton."""
    here, there = hopped(name, 1.0), hopped(name, size)
    assert there.clearance == pytest.approx(size * here.clearance, rel=1e-3)
    assert there.lift_off["time_s"] == pytest.approx(size**0.5 * here.lift_off["time_s"], rel=1e-3)
    assert not there.no_hop


def test_what_counts_as_little_on_a_similar_leg_is_as_little() -> None:
    """Every factor of its units is a power of its size; on the paper's leg they are 1, to the last digit."""
    assert Scale.of(load("paper").leg) == Scale(1.0, 1.0, 1.0)
    small = Scale.of(load("paper", similar(0.25)).leg)
    found = (small.length, small.mass, small.stall, small.time, small.inertia)
    assert found == pytest.approx([0.25**power for power in (1, 3, 4, 0.5, 5)])


@given(st.floats(0.1, 4.0))
@settings(max_examples=3, deadline=None, phases=[Phase.generate])
def test_units_of_a_similar_leg(size: float) -> None:
    """Each is the power of its size that mechanics gives, also those of states; a unit of a user's own has none."""
    leg, powers = load("paper", similar(size)).leg, {**POWERS, "m/s": 0.5, "rad/s": -0.5, "N s": 3.5, "W": 3.5}
    scale = Scale.of(leg)
    for unit, power in powers.items():
        assert scale.unit(unit) == pytest.approx(size**power), unit
    q, v = scale.states(leg)
    assert q == pytest.approx([size, size, 1.0, 1.0])
    assert v == pytest.approx([size**0.5, size**0.5, size**-0.5, size**-0.5])
    assert scale.unit("apples") == 1.0


@given(st.floats(0.1, 4.0))
@settings(max_examples=3, deadline=None, phases=[Phase.generate])
def test_what_a_hop_leaves_out_suits_the_leg(size: float) -> None:
    """Durations by the root of its size, the foot window by its size; what is stated counts as it is."""
    left_out = dict.fromkeys(("hop.stance_duration", "hop.flight_duration", "hop.foot_window"))
    hop, time = load("paper", {**similar(size), **left_out, "hop.touchdown_time": 0.02}).hop, size**0.5
    assert hop.stance_duration == pytest.approx((0.03 * time, 0.4 * time))
    assert hop.flight_duration == hop.landing_duration == pytest.approx((0.03 * time, time))
    assert (hop.foot_window, hop.touchdown_time) == (pytest.approx(0.1 * size), 0.02)


def test_what_the_papers_hop_leaves_out_is_what_it_states() -> None:
    """To the last digit."""
    assert load("paper", dict.fromkeys(("hop.stance_duration", "hop.flight_duration", "hop.foot_window"))) == load(
        "paper"
    )


def test_a_reserve_that_is_left_out_is_a_share_of_the_leg() -> None:
    """What is stated counts as it is; the paper's leg keeps back what it always did."""
    assert reserve_of(load("paper")) == Reserve(ground_force=20.0, height=0.005)
    kept = reserved(load("paper", similar(0.5)))
    assert (kept.contact.least_force, kept.hop.least_height) == pytest.approx((20 * 0.5**3, 0.0025))
    stated = reserved(load("paper", {**similar(0.5), "reserve.ground_force": 1.5, "reserve.height": 0.0}))
    assert (stated.contact.least_force, stated.hop.least_height) == (1.5, 0.0)


def test_a_plan_to_track_holds_back_what_gears_of_the_machine_alone_take() -> None:
    """What a gear loses that the plan knows is in the plan already, and not held back once more."""
    given = ({}, {"leg.gear.efficiency": 0.8}, {"simulation.gear_efficiency": 0.8})
    for entries, passed in zip(given, (1.0, 1.0, 0.8), strict=True):
        leg = reserved(load("paper", entries)).leg
        assert leg.motor is not None
        assert leg.motor.max_torque == pytest.approx(0.98 * passed * 2.0)
    leg = reserved(load("paper", {"leg.hip.gear.efficiency": 0.8, "simulation.gear_efficiency": 0.8})).leg
    torques = [leg.drive(joint, "motor", "max_torque")[1] for joint in ("hip", "knee")]
    assert torques == pytest.approx([0.98 * 2.0, 0.98 * 0.8 * 2.0])  # each gear by itself


def test_caps_of_motor_and_gear_count_at_standstill() -> None:
    for entries, expected in (
        ({}, 200.0),
        ({"leg.motor.torque_cap": 1.5}, 150.0),
        ({"leg.gear.torque_cap": 107.0}, 107.0),
    ):
        leg = load("paper", entries).leg
        np.testing.assert_allclose(standstill_torques(leg), expected)
        assert Scale.of(leg).stall == pytest.approx(expected / 200)


def test_options_of_the_tracker_that_are_given_stay_as_they_are() -> None:
    setting = Setting(load("paper", similar(0.5)), 1e-3, options={"effort": 30.0, "k_d": 0.0})
    found, papers = TrackingOptions.of(setting), TrackingOptions()
    assert (found.effort, found.k_d) == (30.0, 0.0)
    assert (found.k_p, found.disturbance) == pytest.approx((papers.k_p * 0.5**4, papers.disturbance * 0.5**4))
    assert TrackingOptions.of(Setting(load("paper"), 1e-3)) == papers


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in SHAPES else pytest.mark.slow) for name in LEGS]
)
def test_every_leg_of_two_joints_hops(name: str) -> None:
    """It lifts off at a push that takes time, as high as a real hop at least: a tenth of the leg."""
    f = simulate(load(name, QUICK), find("force"), past_apex=True).figures
    size = Size.of(load(name))
    assert f.no_hop == ""
    assert f.lift_off["time_s"] > 0.05
    assert f.parts["ballistic_rise_m"] > 0.1 * size.reach


def test_the_scaled_spring_carries_the_leg_through_its_own_travel() -> None:
    """Its rest length lies as far along the travel as the paper's, and its pull is as many weights."""
    paper = load("paper")
    for name in LEGS:
        design = load(name)
        size, options = Size.of(design), PaperOptions.of(design, {})
        assert size.mass * 9.81 == pytest.approx(weight(build_robot(design.leg).model))
        along = [(y - s.start) / s.travel for y, s in ((options.y_neu, size), (0.45, Size.of(paper)))]
        assert along[0] == pytest.approx(along[1])
        pulls = [k * c / s.mass for k, c, s in ((options.k_s, options.C_amp, size), (1700, 0.12, Size.of(paper)))]
        assert pulls[0] == pytest.approx(pulls[1])
        assert similar_height(design, 0.28) == pytest.approx(size.start)


def test_gains_of_the_file_and_of_the_command_line_win() -> None:
    """As they are, unscaled; a strategy that is named for gains of its own keeps those."""
    design = load("solo12_leg", ["control.k_p=7.0", "control.y_neu=0.2"])
    scaled = PaperOptions.of(load("solo12_leg"), {})
    assert PaperOptions.of(design, {}) == replace(scaled, k_p=7.0, y_neu=0.2)
    own = make_controller(design, find("force"), options={"k_p": 9.0}).options  # type: ignore[attr-defined]
    assert (own.k_p, own.y_neu) == (9.0, 0.2)
    tuned = make_controller(design, find("force_tuned")).options  # type: ignore[attr-defined]
    assert tuned.k_p == pytest.approx(8974.0 * scaled.k_p / 5424.0)
