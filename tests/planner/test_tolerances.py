"""Tighter tolerances lead to an answer that is as good, and verified."""

import pytest

from hopopt.planner.solve import solve
from hopopt.problem.load import load

STRONG = {"leg.motor.max_torque": 20.0}
TIGHT = {"solver.tolerance": 1e-6, "solver.price_tolerance": 1e-5}


@pytest.mark.slow
def test_tighter_tolerances_make_a_strong_leg_no_worse() -> None:
    """Whose meshes would be too fine if all that is asked for were cut at once."""
    usual, tight = (solve(load("paper", STRONG | more), starts=1, processes=1) for more in ({}, TIGHT))
    assert usual.verified
    assert tight.verified, tight.summary.failed_checks
    assert tight.summary.objective_value >= usual.summary.objective_value * (1 - 1e-6)
