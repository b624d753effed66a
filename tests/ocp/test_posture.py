"""The posture that clears most: against a grid of all poses; and a leg whose nearer way to fold is the lower one."""

import numpy as np
import pytest

from hopopt.ocp.guesses.posture import Posture
from hopopt.ocp.hop import Hop
from hopopt.planner.solve import solve
from hopopt.problem.load import load
from hopopt.sim.machine import Machine

TWO_WAYS = [  # found by a second program (tests/second_program.py), which cleared 1.1 % more
    "leg.thigh.length=0.30015", "leg.shank.length=0.34238", "leg.body.mass=3.0224", "leg.motor.max_torque=2.489",
    "leg.motor.max_speed=592.47", "leg.gear.ratio=82.808", "leg.hip.lower=-0.9282", "start.hip_height=0.43654",
    "hop.foot_window=0.17707", "hop.stance_duration=[0.03,0.392]",
]  # fmt: skip


@pytest.mark.parametrize("entries", [[], TWO_WAYS, ["leg.knee.upper=-1", "hop.foot_window=0.03"]])
def test_no_pose_of_a_grid_clears_more(entries: list[str]) -> None:
    """By Pinocchio's kinematics."""
    hop = Hop(load("paper", entries))
    posture, machine = Posture(hop), Machine(hop.robot)
    best = posture.best()
    axes = [np.linspace(*limits, 41) for limits in zip(*hop.limits, strict=True)]
    poses = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    heights = []
    for q in [best, *poses]:
        points = machine.points(np.concatenate([np.zeros(2), q]))
        beside = abs(points["foot"][0] - points["hip"][0])
        lowest = min(points[name][1] for name in ("hip", "knee", "foot")) - points["com"][1]
        heights.append(lowest if beside < hop.design.hop.foot_window + 1e-6 else -np.inf)
    assert posture.height(best[None])[0] == pytest.approx(heights[0], abs=1e-6)
    assert max(heights) < heights[0] + 1e-6


@pytest.mark.rarely
def test_of_two_ways_to_fold_the_search_finds_the_better() -> None:
    """The nearer way ends with the foot over the hip and the knee lowest, at 0.6398 m."""
    s = solve(load("paper", TWO_WAYS), processes=1)
    assert s.verified
    assert s.clearance == pytest.approx(0.6475, abs=3e-4)
