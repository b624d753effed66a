"""The figures of simulated runs in the paper's form, for one strategy or several side by side.

Runs are given by name; one called "optimum" is the bound. Samples are drawn as recorded.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hopopt.errors import ResultError
from hopopt.leg.actuator import operating_region
from hopopt.leg.robot import BASE
from hopopt.plots.hop import FORMATS, save_figure
from hopopt.plots.runs_budget import budget
from hopopt.plots.runs_stick import stick
from hopopt.plots.runs_style import Runs, by_stance, called, looks, reached, runs_figure
from hopopt.plots.style import BLACK, GREY, PALE, SIZE, TEXT, describe, jumping_curve, legend
from hopopt.sim.hop_metrics import HopFigures
from hopopt.studies.compare import OPTIMUM
from hopopt.studies.stiffness import MARGIN, NEUTRAL, PAPER_RANGE, secant_stiffness


def foot_height(runs: Runs) -> Figure:
    """Height [m] of the foot over time [s] (the paper's Fig. sim_graph a), lift-off and clearance [m] of the first hop.

    The clearance is the height of the leg's lowest point: it lies below the curve where that is not the foot.
    """
    figure = runs_figure(runs, "height of the foot")
    ax, look = figure.subplots(), looks(runs)
    ax.axhline(0, color=GREY, lw=3, zorder=1)
    for name, run in runs.items():
        t, z, color = run.trace.t, run.trace.points["foot"][:, 1], look[name]["color"]
        ax.plot(t, z, label=f"{called(name, run)}: {reached(run)}", **look[name])
        if run.flies:
            ax.plot(run.lift_off["time_s"], 0, "^", mfc="white", mec=color, mew=2, ms=9, zorder=4)
        if run.highest is not None:
            ax.plot(t[run.highest], run.clearance, "o", mfc=color, mec="white", ms=10, zorder=4)
    if OPTIMUM in runs:
        bound = runs[OPTIMUM].clearance
        ax.axhline(bound, color=BLACK, lw=1.5, ls=":", label=f"the optimum's clearance, {bound:.3f} m")
    ax.plot([], [], "^", mfc="white", mec=GREY, mew=2, ms=9, label="lift-off")
    ax.plot([], [], "o", mfc=GREY, mec="white", ms=10, label="clearance (of the leg's lowest point)")
    describe(ax, "time [s]", "height of the foot [m]")
    ax.set_xlim(0, 1.02 * max(run.trace.t[-1] for run in runs.values()))
    legend(figure)
    return figure


def saturation(runs: Runs) -> Figure:
    """Saturation ratio C of every joint over time [s] in stance (eq. sim_cact), and its mean C_avg."""
    runs, look = by_stance(runs)
    joints = _joints(runs)
    figure = runs_figure(runs, "saturation ratio in stance", (SIZE[0], 2.2 + 2.6 * len(joints)))
    for k, ax in enumerate(figure.subplots(len(joints), sharex=True, squeeze=False)[:, 0]):
        ax.axhline(1, color=GREY, lw=1, zorder=1)
        for name, run in runs.items():
            t, means = run.trace.t[run.stance], [f"{joint} {c:.2f}" for joint, c in run.saturation_mean.items()]
            label = f"{called(name, run)}: C_avg {', '.join(means)}"
            jumping_curve(ax, t, t, run.saturation(k), label=label, **look[name])
        describe(ax, "time [s]" if k == len(joints) - 1 else "", "saturation ratio [-]", joints[k])
        longest = max(run.trace.t[run.stance][-1] for run in runs.values())
        ax.set(ylim=(-0.04, 1.08), xlim=(0, 1.01 * longest or None))  # where nothing ever pushed, whatever is drawn
    legend(figure)
    return figure


def _joints(runs: Runs) -> tuple[str, ...]:
    return next(iter(runs.values())).trace.robot.joints


def speed_torque(runs: Runs) -> Figure:
    """Torque [N m] over speed [rad/s] of every joint in stance on its operating region (Fig. sim_graph c)."""
    runs, look = by_stance(runs)
    joints = _joints(runs)
    single = len(runs) == 1
    rows, columns = (1, len(joints)) if single else (len(joints), len(runs))
    size = max(SIZE[0], 2.3 * columns), max(SIZE[1], 1.6 + 2.3 * rows)
    figure = runs_figure(runs, "speed and torque in stance on the operating region", size)
    grid = figure.subplots(rows, columns, squeeze=False, sharey=False if single else "row")
    grid = grid.reshape(len(joints), len(runs))
    for column, (name, run) in zip(grid.T, runs.items(), strict=True):
        for k, ax in enumerate(column):
            _region(ax, run, k, common=ax is grid[-1, -1])
            _way(ax, run, k, {**look[name], "ls": "-", "lw": 1.8, "label": called(name, run)})
            label, title = f"{joints[k]} torque [N m]", called(name, run).replace(", ", ",\n")
            describe(ax, "speed [rad/s]", label if ax is grid[k, 0] else "", "" if single or k else title)
    figure.align_ylabels(grid)
    legend(figure)
    return figure


def _region(ax: Axes, run: HopFigures, k: int, common: bool) -> None:
    """The operating region of joint k, start and end of stance; named in the legend by one axes, after the runs."""
    trace = run.trace
    region = operating_region(run.design.leg, trace.robot.joints[k], trace.robot.parameters)
    ax.fill(*region.corners().T, fc=PALE, ec=GREY, lw=1.2, label="admissible operating region" if common else None)
    for row, marker, label in ((0, "o", "start"), (run.stance.stop - 1, "s", "end of stance")):
        point = trace.v[row, BASE + k], trace.motor[row, k]
        ax.plot(*point, marker, mfc="white", mec=BLACK, ms=6, zorder=5, label=label if common else None)


def _way(ax: Axes, run: HopFigures, k: int, look: dict[str, Any]) -> None:
    """Torque [N m] of joint k's motor over the joint's speed [rad/s] in stance."""
    span = run.stance
    jumping_curve(ax, run.trace.t[span], run.trace.v[span, BASE + k], run.trace.motor[span, k], **look)


def stiffness(runs: Runs) -> Figure:
    """Secant stiffness [N/m] of the two-mass model in stance over the body's height [m] above the foot.

    k = (f_z - m_e g) / (y_neu - y), with the last link's mass for m_e and the paper's y_neu (Fig.
    exp_sitff_clearance a); only up to a margin below y_neu, where it diverges, and where the ground pushes.
    """
    runs, look = by_stance(runs)
    figure = runs_figure(runs, "actual stiffness of the two-mass model in stance")
    ax = figure.subplots()
    for name, run in runs.items():
        ax.plot(*secant_stiffness(run), label=called(name, run), **look[name])
    ax.axvspan(*PAPER_RANGE, color=PALE, alpha=0.6, lw=0, zorder=0, label="heights that the paper compares")
    if not any(np.isfinite(secant_stiffness(run)[1]).any() for run in runs.values()):
        ax.text(0.5, 0.5, "the body is never this low", fontsize=TEXT, ha="center", transform=ax.transAxes)
    cut = f"cut {MARGIN:g} m below y_neu = {NEUTRAL:g} m, where it diverges"
    describe(ax, f"height of the body above the foot ({cut}) [m]", "stiffness [N/m]")
    legend(figure)
    return figure


FIGURES: dict[str, Callable[[Runs], Figure]] = {
    "foot_height": foot_height,
    "saturation": saturation,
    "speed_torque": speed_torque,
    "stiffness": stiffness,
    "stick": stick,
    "budget": budget,
}


def save_all(runs: Runs, folder: Path, formats: Sequence[str] = FORMATS) -> list[Path]:
    """Write every figure in every format to a folder, which is made if need be; the files written.

    The budget is left out unless there is an optimum and something beside it. Raises ResultError, naming the
    figures that failed and why, when the others are written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths, faults = [], []
    for name, draw in FIGURES.items():
        if name == "budget" and not (OPTIMUM in runs and len(runs) > 1):
            continue
        try:
            paths += save_figure(draw(runs), folder / name, formats)
        except Exception as error:  # whatever is wrong with one figure, the others are drawn
            faults.append(f"{name}: {type(error).__name__}: {error}")
    if faults:
        raise ResultError("; ".join(faults))
    return paths
