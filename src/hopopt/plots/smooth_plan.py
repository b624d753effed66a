"""A smooth plan over the hop that it was made from: the torques of both, over time and in the drives' operating regions."""

import numpy as np
from matplotlib.figure import Figure

from hopopt.planner.checks.smooth_plan import SmoothPlan
from hopopt.planner.motion import Motion, Samples
from hopopt.planner.solution import Solution
from hopopt.plots.style import (
    GREY,
    NORMALISED_TIMES,
    PALE,
    describe,
    joined,
    jumping_curve,
    legend,
    mark_lift_off,
    solution_figure,
)

LOOKS = {
    "hop": {"color": "#D55E00", "lw": 2.2},
    "smooth plan": {"color": "#0072B2", "lw": 1.1},
}  # the second over the first


def torques(solution: Solution, plan: SmoothPlan) -> Figure:
    """Torque [N m; N] of every motor over time [s] and over its drive's speed, of a hop and of its smooth plan."""
    names, units = solution.robot.joints, solution.design.leg.units
    figure = solution_figure(solution, "torques of the hop and of its smooth plan", (max(11.0, 5.5 * len(names)), 8.0))
    grid = figure.subplots(2, len(names), squeeze=False)
    for k, name in enumerate(names):
        over_time, region = grid[:, k]
        region.fill(*solution.region(name).outline().T, fc=PALE, ec=GREY, lw=1.0, label="what the drive can give")
        for (label, look), motion in zip(LOOKS.items(), (solution, plan.motion), strict=True):
            samples = _samples(motion)
            t, w, torque = (
                joined(samples, value) for value in (_time, lambda s, k=k: s.w[:, k], lambda s, k=k: s.command[:, k])
            )
            jumping_curve(over_time, t, t, torque, label=label, **look)
            jumping_curve(region, t, w, torque, label=label, **look)
        mark_lift_off(over_time, solution)
        describe(over_time, "time [s]", units(name).labels[2], name)
        describe(region, *units(name).labels[1:])
    legend(figure)
    return figure


def _samples(motion: Motion) -> dict[str, Samples]:
    return {phase: motion.everywhere(phase, NORMALISED_TIMES) for phase in motion.phases}


def _time(s: Samples) -> np.ndarray:
    return s.t
