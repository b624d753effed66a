"""Studies of a hop that repeats itself: sensitivities, sweeps, co-design and fronts, each against single solves."""

from functools import cache
from pathlib import Path

import pytest

import hopopt as ho
from hopopt.api import sweep
from hopopt.planner.solution import Solution
from hopopt.problem.load import load
from hopopt.studies.codesign import codesign
from hopopt.studies.finite_differences import confirmed
from hopopt.studies.pareto.trace import front
from hopopt.studies.sensitivity import sensitivity
from once import solved_once

PERIODIC = {"hop.kind": "periodic"}


@cache
def highest(**more: float) -> Solution:
    """The paper's leg, from one start."""
    entries = {f"hop.{name}": value for name, value in more.items()}
    return solved_once({**PERIODIC, **entries})


@pytest.mark.rarely
@pytest.mark.parametrize(
    ("more", "names"),
    [
        ({"hop.touchdown_loss": 1.0, "hop.speed": 0.5}, ("hop.touchdown_loss", "hop.speed", "leg.knee.lower")),
        ({"contact.friction": 0.6}, ("contact.friction",)),
        (
            {"hop.touchdown_loss": 1.0, "hop.touchdown_speed": 2.0, "hop.touchdown_gear_torque": 20.0},
            ("hop.touchdown_gear_torque", "hop.touchdown_time"),
        ),
    ],
    ids=lambda part: [*part][-1] if isinstance(part, dict) else "",
)
def test_sensitivities_agree_with_solving_again(more: dict[str, float], names: tuple[str, ...]) -> None:
    """The multipliers of the touchdown's own limits too; central differences know them to their curvature."""
    solution = solved_once({**PERIODIC, **more})
    assert solution.verified, solution.summary.failed_checks
    influences = {i.name: i for i in sensitivity(solution)}
    assert not any(name.startswith("start.") for name in influences)
    for name in names:
        again = confirmed(solution, influences[name]).difference
        assert again is not None
        assert influences[name].per_unit == pytest.approx(again.central, rel=0.02)
        assert abs(again.central) > 10 * again.noise


@pytest.mark.rarely
def test_points_of_a_sweep_are_those_of_solve(tmp_path: Path) -> None:
    vary = {"leg.gear.ratio": [90.0, 100.0]}
    study = sweep(load("paper", PERIODIC), vary, starts=1, processes=1, results=tmp_path)
    assert [p.outcome for p in study.points] == ["verified", "verified"]
    alone = [highest().clearance, solved_once({**PERIODIC, "leg.gear.ratio": 90.0}).clearance]
    assert study.points[1].clearance_m == pytest.approx(alone[0], abs=1e-4)
    smaller_ratio = study.points[0].clearance_m or 0.0
    assert smaller_ratio >= alone[1] - 1e-4
    assert smaller_ratio > alone[0]


@pytest.mark.rarely
def test_a_codesign_is_no_worse_than_what_was_given() -> None:
    """At the shank length that it finds, solving for the hop alone gives the same clearance."""
    found = codesign(load("paper", PERIODIC), {"leg.shank.length": (0.34, 0.38)}, starts=1, processes=1)
    assert found.verified, found.summary.failed_checks
    assert found.clearance > highest().clearance
    again = ho.solve(found.design, starts=1)
    assert again.clearance == pytest.approx(found.clearance, rel=1e-3)


@pytest.mark.rarely
def test_a_front_ends_at_the_highest_hop() -> None:
    """Where it begins the leg still hops."""
    found = front(load("paper", PERIODIC), "peak_force", points=3, starts=1, processes=1)
    least, _, top = sorted(found.points, key=lambda p: p.asked_m)
    assert top.clearance_m == pytest.approx(highest().clearance, abs=1e-6)
    assert least.verified
    assert least.clearance_m is not None
    assert 0.19 * highest().clearance < least.clearance_m < highest().clearance
    assert least.value is not None
    assert top.value is not None
    assert least.value < top.value
