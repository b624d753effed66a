"""The gap between the bound and PD control, as what feedback and what the reference take."""

from types import SimpleNamespace
from typing import Any

import pytest

from hopopt.comparison.gap_steps import gap_steps


def hop(clearance: float, limits: tuple[str, ...] = (), no_hop: str = "") -> Any:
    return SimpleNamespace(clearance=clearance, limits_exceeded=list(limits), no_hop=no_hop)


BOUND: Any = SimpleNamespace(clearance=0.8, verified=True)
PLAN: Any = SimpleNamespace(clearance=0.75, verified=True)
HOPS = {
    "track": hop(0.74),
    "track_pd": hop(0.73),
    "counter_movement": hop(0.6),
    "force": hop(0.4),
    "force_tuck": hop(0.5),
}


def test_the_steps_lead_from_the_bound_to_the_papers_best_and_sum_to_its_gap() -> None:
    steps = gap_steps(BOUND, PLAN, {**HOPS, "my.module:Own": hop(0.7)})
    assert [s.gives_up for s in steps] == ["reserve", "feedback", "reference", "counter-movement"]
    assert [s.reaches for s in steps] == ["plan", "track_pd", "counter_movement", "force_tuck"]
    assert [s.costs_m for s in steps] == pytest.approx([0.05, 0.02, 0.13, 0.1])
    assert sum(s.costs_m for s in steps) == pytest.approx(0.8 - 0.5)


def test_a_hop_beyond_a_limit_is_no_step() -> None:
    steps = gap_steps(
        BOUND, PLAN, HOPS | {"track_pd": hop(0.7, ("knee too fast",)), "counter_movement": hop(0.9, no_hop="folds")}
    )
    assert [s.reaches for s in steps] == ["plan", "track", "force_tuck"]
    assert [s.gives_up for s in steps] == ["reserve", "feedback", "reference"]


@pytest.mark.parametrize("left_out", ["track", "force"])
def test_nothing_is_told_where_feedback_and_reference_cannot_be_told_apart(left_out: str) -> None:
    without = {name: f for name, f in HOPS.items() if not name.startswith(left_out) and name != "counter_movement"}
    assert gap_steps(BOUND, PLAN, without) == []
    assert gap_steps(BOUND, None, HOPS) == []
    assert gap_steps(SimpleNamespace(clearance=0.8, verified=False), PLAN, HOPS) == []  # type: ignore[arg-type]
    assert gap_steps(BOUND, SimpleNamespace(clearance=0.75, verified=False), HOPS) == []  # type: ignore[arg-type]
