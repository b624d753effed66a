"""The paper's gains on other legs: nothing changes on its own, similar legs hop alike, and what is given wins."""

from dataclasses import replace

import numpy as np
import pytest

from hopopt.control.closed_loop import make_controller, simulate
from hopopt.control.paper_pd import PaperOptions
from hopopt.control.similarity import Size, factors, similar_height
from hopopt.control.strategies import find
from hopopt.leg.robot import build_robot
from hopopt.leg.scales import weight
from hopopt.problem.load import load

PAPERS = ("paper", "paper_four_quadrant", "paper_no_countermovement")
SHAPES = ("a1_leg", "hyq_leg", "solo12_leg")  # the others are the first in other sizes
LEGS = ("a1_leg", "b1_leg", "go1_leg", "go2_leg", "hyq_leg", "solo12_leg")
QUICK = {"simulation.control_rate": 1000.0, "simulation.encoder_bits": 0, "simulation.speed_window": 1}


@pytest.mark.parametrize("name", PAPERS)
def test_on_the_papers_leg_every_number_is_the_printed_one(name: str) -> None:
    """To the last digit."""
    assert PaperOptions.of(load(name), {}) == PaperOptions()
    assert set(factors(Size.of(load(name))).values()) == {1.0}


@pytest.mark.parametrize("by", [0.3, pytest.param(1.6, marks=pytest.mark.slow)])
def test_a_similar_leg_hops_alike(by: float) -> None:
    """Lengths times ``by``, masses its cube, torques its fourth power, times its root: so is every height, by Newton."""
    paper = load("paper", QUICK)
    leg, root = paper.leg, float(np.sqrt(by))
    entries = {f"leg.{link}.length": leg.link[link].length * by for link in leg.links}
    entries |= {f"leg.{link}.mass": leg.link[link].mass * by**3 for link in leg.links}
    entries |= {"leg.body.mass": leg.body.mass * by**3, "leg.motor.max_torque": leg.motor.max_torque * by**4}
    entries |= {"leg.motor.max_speed": leg.motor.max_speed / root, "start.hip_height": 0.28 * by}
    entries |= {"leg.motor.rotor_inertia": leg.motor.rotor_inertia * by**5, "hop.foot_window": 0.1 * by}
    other = load("paper", {**QUICK, **entries, "simulation.control_rate": 1000.0 / root})
    small, big = (simulate(d, find("force"), past_apex=False).figures for d in (other, paper))
    assert small.lift_off["time_s"] == pytest.approx(root * big.lift_off["time_s"], rel=1e-3)
    assert small.clearance == pytest.approx(by * big.clearance, rel=5e-3)


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
