"""What a hop leans on, against its own forces and times."""

from dataclasses import replace

import numpy as np
import pytest

from hopopt.comparison.compare import planned_trace
from hopopt.leg.scales import force_range
from hopopt.ocp.phases import STANCE
from hopopt.planner.answer.motion_figures import SAMPLES_OF_INTERVAL, leans_on
from hopopt.planner.solution import Solution
from hopopt.problem.load import changed
from hopopt.sim.hop_metrics import HopFigures


def test_the_papers_hop_leans_on_ground_that_no_friction_is(hop: Solution) -> None:
    """By the stored table: share of the time without load, and a sideways grip in it."""
    found, table = hop.summary.leans_on, hop.tables[STANCE]
    t, f = table.t.ravel(), table.f.reshape(-1, 2)
    free = f[:, 1] < 1e-3 * force_range(hop.robot.model)
    share = np.sum(np.diff(t) * (free[1:] & free[:-1])) / hop.lift_off
    assert found.load_free_share == pytest.approx(share, abs=0.02)
    assert np.abs(f[free, 0]).max() > 50.0
    assert found.friction_needed == np.inf
    assert found.stance_at_its_limit == "longest"
    assert hop.lift_off == pytest.approx(hop.design.hop.stance_duration[1], rel=1e-6)


@pytest.mark.parametrize("slope", [0.0, 0.6, -0.6])
def test_friction_needed_is_the_steepest_force(hop: Solution, slope: float) -> None:
    stance = hop.everywhere(STANCE, SAMPLES_OF_INTERVAL)
    up = 100.0 + 50.0 * np.sin(stance.t)
    leaning = np.linspace(0.0, slope, len(up)) * up
    found = leans_on(hop, replace(stance, f=np.stack([leaning, up], axis=1)))
    assert found.friction_needed == pytest.approx(abs(slope))
    assert found.load_free_share == 0.0


def test_a_hop_within_its_friction_needs_no_more_of_it(hop: Solution) -> None:
    """Two forces that are nearly nothing pass the cone by less than verification tells: their ratio is no need. Where a
    force passes it by more, the need is said. The figures of a simulated hop do the same."""
    rough = replace(hop, design=changed(hop.design, {"contact.friction": 0.8}))
    stance, size = hop.everywhere(STANCE, SAMPLES_OF_INTERVAL), force_range(hop.robot.model)
    for share, loaded, needed in ((0.9e-4, 1.1e-3, 0.8), (0.2, 1.0, 1.0)):
        up = np.full(len(stance.t), size)
        along = 0.8 * up
        up[7] = loaded * size
        along[7] = 0.8 * up[7] + share * size
        found = leans_on(rough, replace(stance, f=np.stack([along, up], axis=1)))
        assert found.friction_needed == pytest.approx(needed, rel=1e-12)
    trace = planned_trace(hop)
    up = np.full(len(trace.t), size)
    along = 0.8 * up
    up[5], along[5] = 0.025 * size, 0.8 * 0.025 * size + 1e-4 * size  # an eighth of the weight
    figures = HopFigures(rough.design, replace(trace, f=np.stack([along, up], axis=1)))
    assert figures.slip_ratio == 0.8
    assert not [words for words in figures.limits_exceeded if "friction" in words]
