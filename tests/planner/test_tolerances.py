"""Refinements that once gave up: with tighter tolerances, and where carried multipliers need more iterations."""

import pytest

from hopopt.planner.solve import solve
from hopopt.problem.load import load

STRONG = {"leg.motor.max_torque": 20.0}
TIGHT = {"solver.tolerance": 1e-6, "solver.price_tolerance": 1e-5}


@pytest.mark.rarely
def test_tighter_tolerances_make_a_strong_leg_no_worse() -> None:
    """Whose meshes would be too fine if all that is asked for were cut at once."""
    usual, tight = (solve(load("paper", STRONG | more), starts=1, processes=1) for more in ({}, TIGHT))
    assert usual.verified
    assert tight.verified, tight.summary.failed_checks
    assert tight.summary.objective_value >= usual.summary.objective_value * (1 - 1e-6)


@pytest.mark.rarely
def test_a_wide_box_on_slippery_ground_is_verified_in_time() -> None:
    """Its meshes take over a hundred iterations from carried multipliers, and many times as long without."""
    box = {"hop.obstacle.width": 0.2, "contact.friction": 0.7}
    found = solve(load("paper", box), "obstacle", starts=1, processes=1)
    assert found.verified, found.summary.failed_checks
    assert found.summary.objective_value == pytest.approx(0.509, abs=1e-3)
    assert not found.summary.late
