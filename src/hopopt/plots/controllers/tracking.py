"""What a tracker adds to its plan: planned and commanded torques, and between them the feedback's share."""

import numpy as np
from matplotlib.figure import Figure

from hopopt.control.reference import PlanReference
from hopopt.leg.scales import standstill_torques
from hopopt.plots.controllers.runs_style import COLORS, last, runs_figure
from hopopt.plots.style import BLACK, FIGURE_SIZE, GREY, describe, jumping_curve, legend
from hopopt.sim.hop_metrics import HopFigures

FEEDBACK = COLORS[2]
LEAST_AXIS = 1.0  # [%] of full torque, the least half height of an axis of added torque


def tracking(name: str, run: HopFigures, plan: PlanReference) -> Figure:
    """Torque [N m] of every joint over time [s] up to the clearance, as planned and as commanded, and below it their
    difference in percent of what the drive gives at standstill: there the encoders' steps and what errors cost can be seen.

    The plan's clock follows the contact, as the tracker's does: its flight begins at the run's lift-off.
    """
    joints, stall, until = run.trace.robot.joints, standstill_torques(run.design.leg), last(run) + 1
    figure = runs_figure(
        {name: run}, f"torques of {name}, planned and commanded", (FIGURE_SIZE[0], 1.4 + 3.4 * len(joints))
    )
    axes = figure.subplots(2 * len(joints), sharex=True, height_ratios=[5, 3] * len(joints))
    t, asked = run.trace.t[:until], run.trace.command[:until]
    planned = np.array([_planned(plan, run, k) for k in range(until)])
    shares = 100 * (asked - planned) / stall
    most = max(
        LEAST_AXIS, 1.3 * float(np.percentile(np.abs(shares), 99))
    )  # where the plan jumps within a period they are larger
    for j, (torques, added) in enumerate(zip(axes[::2], axes[1::2], strict=True)):
        jumping_curve(torques, t, t, asked[:, j], label="commanded", color=FEEDBACK, lw=3.5, alpha=0.55, zorder=2)
        jumping_curve(torques, t, t, planned[:, j], label="planned", color=BLACK, lw=1.2, zorder=3)
        jumping_curve(added, t, t, shares[:, j], label="added by feedback", color=FEEDBACK, lw=0.9)
        added.set_ylim(-most, most)
        added.axhline(0, color=GREY, lw=1, zorder=1)
        for ax in (torques, added):
            ax.axvline(run.lift_off["time_s"], color=GREY, lw=1, ls=":", zorder=1)
        describe(torques, "", run.design.leg.units(joints[j]).labels[2], joints[j])
        describe(added, "time [s]; dotted: lift-off" if j == len(joints) - 1 else "", "added\n[% of full]")
    legend(figure)
    return figure


def _planned(plan: PlanReference, run: HopFigures, k: int) -> np.ndarray:
    """Planned torques (n) [N m] at a sample of a run; after the planned stance those with which flight begins."""
    t, lift = run.trace.t[k], run.lift_off["time_s"]
    if t < lift and t < plan.stance.duration:
        return plan.stance.at(t)[2]
    return plan.flight.at(max(t - lift, 0.0))[2]
