"""A counter-movement: as far down as was chosen, up as high as was computed, and higher than pushes that begin elsewhere."""

import numpy as np
import pytest

from hopopt.control.closed_loop import Run, make_controller, simulate
from hopopt.control.counter_movement import LOADED, CounterMovement, Movement
from hopopt.control.strategies import find
from hopopt.errors import UsageError
from hopopt.problem.load import load
from hopopt.sim.controller import Measurement

QUICK = {"simulation.control_rate": 1000.0, "simulation.encoder_bits": 0, "simulation.speed_window": 1}
GO2 = load("go2_leg", QUICK)


def hop(name: str, controller: CounterMovement | None = None) -> Run:
    return simulate(GO2, find(name), past_apex=True, controller=controller)


def fresh() -> CounterMovement:
    found = make_controller(GO2, find("counter_movement"))
    assert isinstance(found, CounterMovement)
    return found


@pytest.mark.slow
def test_it_goes_down_as_chosen_and_up_as_computed() -> None:
    chosen = fresh()
    run, tuck = hop("counter_movement", chosen), hop("force_tuck")
    figures, trace = run.figures, run.trace
    heights = trace.q[figures.stance, 1]
    assert chosen.movement.depth > 0.05 * GO2.leg.length
    assert heights[0] - heights.min() == pytest.approx(chosen.movement.depth, abs=0.05 * chosen.movement.depth)
    assert trace.t[figures.stance][heights.argmin()] == pytest.approx(chosen.movement.duration, abs=0.03)
    assert trace.f[figures.stance, 1].min() > -2.0
    assert figures.clearance > tuck.figures.clearance + 0.01
    assert run.limited_by.startswith(
        f"goes down {chosen.movement.depth:.3f} m in {chosen.movement.duration:.3f} s, then pushes "
    )
    rising = trace.points["com"][figures.flight][:, 1].max()
    assert rising == pytest.approx(chosen._rise(chosen._thrown(chosen.movement)), abs=0.02 * GO2.leg.length)


@pytest.mark.slow
def test_another_depth_throws_it_less_high_or_takes_too_long() -> None:
    """In the plant, not as computed."""
    chosen = fresh()
    best = hop("counter_movement", chosen).trace.points["com"][:, 1].max()
    for depth in (0.0, 0.4 * chosen.movement.depth, 1.4 * chosen.movement.depth):
        other = fresh()
        other.movement = Movement(depth, np.pi * float(np.sqrt(depth / other.two_mass.g)))
        run = hop("counter_movement", other)
        late = any(words.startswith("stance of") for words in run.figures.limits_exceeded)
        assert late or run.trace.points["com"][:, 1].max() < best + 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("friction", [None, 0.7])
def test_a_light_quick_leg_is_braked_before_its_end_stops(friction: float | None) -> None:
    """At 4 kHz with encoders of 14 bits, whose speeds are late: its knee turns at 50 rad/s as the foot leaves, which grips until then."""
    solo12 = load("solo12_leg", {"contact.friction": friction} if friction else {})
    found, tuck = (simulate(solo12, find(name), past_apex=True).figures for name in ("counter_movement", "force_tuck"))
    assert found.limits_exceeded == []
    assert found.clearance > 1.2 * tuck.clearance


def test_a_sinking_leg_keeps_its_foot_on_the_ground_and_within_its_grip() -> None:
    """Whatever coarse speeds ask for: else it lets go of the ground after milliseconds, as a humanoid's leg did."""
    found, random = fresh(), np.random.default_rng(0)
    q = found.angles(found.lowest - 0.02)
    held = 0
    for asked in random.normal(0.0, 0.1 * float(found.drive.clamp(np.zeros(2), np.full(2, np.inf))[1]), (50, 2)):
        v = random.normal(0.0, 0.3, 2)
        s, now = found.machine.stance_terms(q, v), Measurement(0.01, q, v, True, 0.01, 0)
        wanted = s.contact_force(found.drive.at(q).clamp(v, asked))
        along, up = s.contact_force(found._held(s, now, asked))
        assert up > 0.099 * found.weight
        assert abs(along) < 1.001 * found.grip * up
        kept = wanted[1] >= LOADED * found.weight and abs(wanted[0]) <= found.grip * wanted[1]
        if kept:
            np.testing.assert_allclose([along, up], wanted, rtol=1e-9)
        held += not kept
    assert 5 < held < 45


def test_a_push_that_is_computed_once_ends_as_each_movement_says() -> None:
    """The centre of mass is fastest where the ground carries the weight; the longer the way down, the less time is left."""
    found = fresh()
    rising = [found._thrown(Movement(0.05, 0.2, released)).rising for released in (0.0, 0.5, 1.0, 2.0)]
    assert max(rising) == rising[2]
    assert found._thrown(Movement(0.05, 0.36)).rising < 0.5 * rising[0]


def test_a_movement_begins_and_ends_at_rest() -> None:
    movement = Movement(0.06, 0.25)
    t = np.linspace(0.0, movement.duration, 2001)
    y, rate, rise = (np.array(x) for x in zip(*map(movement.down, t), strict=True))
    np.testing.assert_allclose([y[0], y[-1], rate[0], rate[-1]], [0.0, -0.06, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(np.gradient(y, t)[1:-1], rate[1:-1], atol=1e-5)
    np.testing.assert_allclose(np.gradient(rate, t)[1:-1], rise[1:-1], atol=1e-3)


def test_where_none_is_allowed_it_says_so() -> None:
    design = load("go2_leg", {"hop.counter_movement": False})
    with pytest.raises(UsageError, match=r"hop\.counter_movement is false: simulate force_tuck"):
        make_controller(design, find("counter_movement"))
