"""Restricted problems as starts of hops that land, and what studies conclude from limits of the touchdown."""

import numpy as np
import pytest

from hopopt.nlp.deadline import NEVER
from hopopt.ocp.guesses.initial_guess import make_guess, starts_of
from hopopt.ocp.hop import Hop
from hopopt.planner.search.first_mesh import posture_starts
from hopopt.planner.search.multistart import first_solver, outcome_of
from hopopt.planner.search.neighbours.restrictions import RESTRICTIONS, restricted_starts, restricting, softened
from hopopt.problem.load import load
from hopopt.studies.consistency import contradicted, direction

SHORT = {"hop.kind": "periodic", "hop.stance_duration": [0.03, 0.2], "hop.touchdown_loss": 0.5}


def test_restrictions_only_restrict() -> None:
    """Every limit of the touchdown is that of a soft one, and one that the problem has is never widened."""
    asked = Hop(load("paper", SHORT))
    soft = softened(asked).design.hop
    assert soft.touchdown_loss == 0.5
    assert (soft.touchdown_impulse, soft.touchdown_speed, soft.touchdown_gear_torque) == pytest.approx((2, 1, 20))
    assert soft.stance_duration == asked.design.hop.stance_duration


def test_only_hops_that_land_have_them_and_a_passed_limit_ends_them() -> None:
    assert restricting(Hop(load("paper"))) == ()
    hop, rough = Hop(load("paper", SHORT)), Hop(load("paper", {**SHORT, "contact.friction": 0.6}))
    assert restricting(rough) == RESTRICTIONS
    assert [r for r in RESTRICTIONS if r not in restricting(hop)] == [r for r in RESTRICTIONS if r.begun_with]
    assert restricted_starts(hop, RESTRICTIONS[0], until=NEVER.within(0)) == []


@pytest.mark.slow
def test_a_released_hop_is_as_high_as_with_a_limit_more() -> None:
    """With a stance of at most 0.2 s guesses end at 0.7022 m without a limit and at 0.7029 m with a loss of 1 J, which is a
    hop of the first problem too."""
    free = Hop(load("paper", {"hop.kind": "periodic", "hop.stance_duration": [0.03, 0.2]}))
    (released,) = restricted_starts(free, RESTRICTIONS[0])
    assert released.success
    assert released.value > 0.7029


@pytest.mark.slow
def test_a_restriction_and_a_relaxation_lead_where_neither_does() -> None:
    """With friction 0.6 and at most 0.4 s of stance, a limit of 1 J is met by a hop of 0.6620 m. Without one, restrictions and
    relaxations alone end 0.2 mm lower."""
    free = Hop(load("paper", {"hop.kind": "periodic", "hop.stance_duration": [0.03, 0.4], "contact.friction": 0.6}))
    (both,) = (r for r in restricting(free) if r.begun_with)
    (released,) = restricted_starts(free, both)
    assert released.success
    assert released.value > 0.66205


def test_a_hop_that_lands_is_folded_the_other_way_at_its_apex() -> None:
    """The foot of this leg is as high under the hip as in front of it. With the foot landing slower, another start ends at
    0.42876 m, a hop of this problem too; without, all starts end at 0.42808 m."""
    lengths = {"leg.thigh.length": 0.34279, "leg.shank.length": 0.27812}
    masses = {"leg.body.mass": 9.90655, "leg.thigh.mass": 1.80381, "leg.shank.mass": 0.68443}
    joints = {
        "leg.hip.lower": -1.06077,
        "leg.hip.upper": 1.26608,
        "leg.knee.lower": -2.58795,
        "leg.knee.upper": -0.39895,
    }
    motor = {"max_torque": 16.45517, "max_speed": 79.96321, "rotor_inertia": 0.00025, "torque_cap": 16.45517}
    drives = {"leg.gear.ratio": 9.0, "leg.motor.laws": ["paper"], **{f"leg.motor.{k}": x for k, x in motor.items()}}
    start = {"start.hip_height": 0.50215, "start.foot_x": -0.00371, "hop.foot_window": 0.07945}
    times = {"hop.stance_duration": [0.02, 0.33826], "hop.flight_duration": [0.01, 1.5], "contact.friction": 0.83567}
    hop = Hop(load("paper", {**lengths, **masses, **joints, **drives, **start, **times, "hop.kind": "periodic"}))
    began = first_solver(hop)(make_guess(hop, starts_of(hop, 1)[0]))
    known = outcome_of("the first start", began, 0.0)
    (folded,) = posture_starts(hop, [known])
    assert folded.success
    assert folded.value > max(0.42876, known.value + 1e-4)
    assert posture_starts(hop, [folded]) == []


def test_studies_know_which_way_limits_of_a_touchdown_relax() -> None:
    """1 J does worse than 0.5 J: the hop of 0.5 J is one of 1 J too."""
    for entry in ("touchdown_loss", "touchdown_impulse", "touchdown_speed", "touchdown_gear_torque"):
        assert direction(f"hop.{entry}") == 1
    assert (direction("hop.landing_duration[1]"), direction("hop.landing_duration[0]")) == (1, -1)
    assert direction("hop.speed") == 0
    found = contradicted(["hop.touchdown_loss"], np.array([[0.5], [1.0], [2.0]]), np.array([0.70, 0.69, 0.71]))
    assert found == {1: [0]}
