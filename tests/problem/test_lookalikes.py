"""What a value out of range may have been meant as."""

import pytest

from hopopt.errors import ProblemFileError
from hopopt.problem.load import load


@pytest.mark.parametrize(
    ("entry", "value", "meant"),
    [
        ("leg.gear.ratio", 5000, ""),
        ("leg.gear.ratio", 0.7, ""),
        ("leg.gear.ratio", 0.01, "0.01 looks like 1/100: write 100"),
        ("leg.gear.ratio", -6, "write 6 if the sign is all that is wrong"),
        ("leg.gear.ratio", -0.5, ""),
        ("leg.gear.ratio", 0.33, "0.33 looks like 1/3: write 3"),
        ("solver.tolerance", 1, ""),
        ("solver.objective_tolerance", 5, ""),
        ("leg.gear.efficiency", 70, "70 looks like per cent: write 0.7"),
        ("leg.gear.efficiency", 1.2, ""),
        ("reserve.torque", 1, ""),
        ("reserve.torque", 5, "5 looks like per cent: write 0.05"),
        ("contact.friction", 80, "80 looks like per cent: write 0.8"),
        ("contact.friction", 900, ""),
    ],
)
def test_a_guess_is_made_only_where_it_is_plausible(entry: str, value: float, meant: str) -> None:
    with pytest.raises(ProblemFileError) as raised:
        load("paper", {entry: value})
    said = str(raised.value)
    assert entry in said
    assert (meant in said) if meant else "looks like" not in said
