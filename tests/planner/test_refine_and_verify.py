"""Smaller tolerances where differences of optima are looked at: never larger than the problem's, nothing else changed."""

import pytest

from hopopt.planner.refine_and_verify import PRICE_TOLERANCE, TOLERANCE, with_tighter_tolerances
from hopopt.problem.load import changed, load


def test_defaults_become_smaller_and_nothing_else_changes() -> None:
    design = load("paper")
    fine = with_tighter_tolerances(design)
    assert (fine.solver.tolerance, fine.solver.price_tolerance) == (TOLERANCE, PRICE_TOLERANCE)
    assert fine.solver.tolerance < design.solver.tolerance
    assert fine.solver.price_tolerance < design.solver.price_tolerance
    again = {"solver.tolerance": design.solver.tolerance, "solver.price_tolerance": design.solver.price_tolerance}
    assert changed(fine, again) == design
    assert with_tighter_tolerances(fine) == fine


@pytest.mark.parametrize("entry", ["tolerance", "price_tolerance"])
def test_what_is_smaller_stays(entry: str) -> None:
    design = load("paper", {f"solver.{entry}": 3e-7})
    assert getattr(with_tighter_tolerances(design).solver, entry) == 3e-7
