"""A counter-movement: as far down as was chosen, up as high as was computed, and higher than pushes that begin elsewhere."""

import numpy as np
import pytest

from hopopt.control.closed_loop import Run, make_controller, simulate
from hopopt.control.counter_movement import CounterMovement, Movement
from hopopt.control.strategies import find
from hopopt.errors import UsageError
from hopopt.problem.load import load

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
    assert run.limited_by.startswith(f"goes down {chosen.movement.depth:.3f} m first")
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
def test_a_light_quick_leg_is_braked_before_its_end_stops() -> None:
    """At 4 kHz with encoders of 14 bits, whose speeds are late: its knee turns at 50 rad/s as the foot leaves."""
    solo12 = load("solo12_leg")
    found, tuck = (simulate(solo12, find(name), past_apex=True).figures for name in ("counter_movement", "force_tuck"))
    assert found.limits_exceeded == []
    assert found.clearance > 1.2 * tuck.clearance


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
