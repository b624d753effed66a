"""The figures of simulated runs in the paper's form, for one strategy or several side by side.

Runs are given by name; one called "optimum" is the bound. Samples are drawn as recorded.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hopopt.comparison.compare import OPTIMUM
from hopopt.comparison.ladder import Ladder
from hopopt.control.reference import PlanReference
from hopopt.control.similarity import similar_height
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.errors import ResultError
from hopopt.paper.stiffness import PAPER_RANGE, neutral, secant_stiffness
from hopopt.plots.controllers.ladder import staircase
from hopopt.plots.controllers.runs_budget import budget
from hopopt.plots.controllers.runs_stick import stick
from hopopt.plots.controllers.runs_style import (
    Runs,
    by_stance,
    called,
    few,
    looks,
    reached,
    runs_figure,
    since_lift_off,
)
from hopopt.plots.controllers.tracking import tracking
from hopopt.plots.hop import FORMATS, save_figure
from hopopt.plots.style import BLACK, FIGURE_SIZE, GREY, PALE, called_after, describe, jumping_curve, legend
from hopopt.sim.hop_metrics import HopFigures


@few
def foot_height(runs: Runs) -> Figure:
    """Height [m] of the foot over time since lift-off [s] (the paper's Fig. sim_graph a), and the clearance [m] of the
    first hop.

    The clearance is the height of the leg's lowest point: it lies below the curve where that is not the foot.
    """
    figure = runs_figure(runs, "height of the foot")
    ax, look = figure.subplots(), looks(runs)
    ax.axhline(0, color=GREY, lw=3, zorder=1)
    ax.axvline(0, color=GREY, lw=1, ls=":", zorder=1)
    for name, run in runs.items():
        t, z, color = since_lift_off(run), run.trace.points["foot"][:, 1], look[name]["color"]
        ax.plot(t, z, label=f"{called(name, run)}: {reached(run)}", **look[name])
        if run.highest is not None:
            ax.plot(t[run.highest], run.clearance, "o", mfc=color, mec="white", ms=10, zorder=4)
    if OPTIMUM in runs:
        bound = runs[OPTIMUM].clearance
        ax.axhline(bound, color=BLACK, lw=1.5, ls=":", label=f"the optimum's clearance, {bound:.3f} m")
    ax.plot(
        [],
        [],
        "o",
        mfc=GREY,
        mec="white",
        ms=10,
        label="clearance; off its line: the knee is lowest",
    )
    describe(ax, "time since lift-off [s]", "height of the foot [m]")
    begin, end = (f(since_lift_off(run)[k] for run in runs.values()) for f, k in ((min, 0), (max, -1)))
    ax.set_xlim(begin - 0.02 * (end - begin), end + 0.02 * (end - begin))
    legend(figure)
    return figure


@few
def saturation(runs: Runs) -> Figure:
    """Saturation ratio C of every joint over time [s] up to lift-off (the paper's eq. 17), and its mean C_avg."""
    runs, look = by_stance(runs)
    joints = _joints(runs)
    figure = runs_figure(runs, "saturation ratio in stance", (FIGURE_SIZE[0], 2.2 + 2.6 * len(joints)))
    for k, ax in enumerate(figure.subplots(len(joints), sharex=True, squeeze=False)[:, 0]):
        ax.axhline(1, color=GREY, lw=1, zorder=1)
        for name, run in runs.items():
            t, means = since_lift_off(run)[run.stance], [f"{j} {c:.2f}" for j, c in run.saturation_mean.items()]
            label = f"{called(name, run)}: C_avg {', '.join(means)}"
            jumping_curve(ax, t, t, run.saturation(k), label=label, **look[name])
        describe(ax, "time since lift-off [s]" if k == len(joints) - 1 else "", "saturation ratio [-]", joints[k])
        ax.set(ylim=(-0.04, 1.08))
    legend(figure)
    return figure


def _joints(runs: Runs) -> tuple[str, ...]:
    return next(iter(runs.values())).trace.robot.joints


@few
def speed_torque(runs: Runs) -> Figure:
    """Torque [N m] over speed [rad/s] of every joint in stance, all runs on its one operating region (Fig. sim_graph c)."""
    runs, look = by_stance(runs)
    joints = _joints(runs)
    figure = runs_figure(runs, "speed and torque in stance on the operating region")
    for k, ax in enumerate(figure.subplots(1, len(joints), squeeze=False)[0]):
        _region(ax, next(iter(runs.values())), k)
        for name, run in runs.items():
            _way(ax, run, k, {**look[name], "label": called(name, run)})
            for row, marker in ((0, "o"), (run.stance.stop - 1, "s")):
                point = run.trace.w[row, k], run.trace.motor[row, k]
                ax.plot(*point, marker, mfc="white", mec=look[name]["color"], mew=1.5, ms=6, zorder=5)
        for marker, label in (("o", "start"), ("s", "end of stance")):
            ax.plot([], [], marker, mfc="white", mec=GREY, mew=1.5, ms=6, label=label)
        _, speed, torque = next(iter(runs.values())).design.leg.units(joints[k]).labels
        describe(ax, speed, f"{joints[k]} {torque}")
    legend(figure)
    return figure


def _region(ax: Axes, run: HopFigures, k: int) -> None:
    """The operating region of joint k."""
    region = operating_region(run.design.leg, run.trace.robot.joints[k], run.trace.robot.parameters)
    ax.fill(*region.outline().T, fc=PALE, ec=GREY, lw=1.2, label="admissible operating region")


def _way(ax: Axes, run: HopFigures, k: int, look: dict[str, Any]) -> None:
    """Torque [N m] of joint k's motor over the joint's speed [rad/s] in stance."""
    span = run.stance
    jumping_curve(ax, run.trace.t[span], run.trace.w[span, k], run.trace.motor[span, k], **look)


@few
def stiffness(runs: Runs) -> Figure:
    """Secant stiffness [N/m] of the two-mass model in stance over the body's height [m] above the foot.

    k = (f_z - m_e g) / (y_neu - y), with the last link's mass for m_e and the y_neu of this leg (Fig.
    exp_sitff_clearance a); only up to a margin below y_neu, where it diverges, and where the ground pushes.
    """
    design = next(iter(runs.values())).design
    runs, look = by_stance(runs)
    figure = runs_figure(runs, "actual stiffness of the two-mass model in stance")
    ax = figure.subplots()
    for name, run in runs.items():
        ax.plot(*secant_stiffness(run), label=called(name, run), **look[name])
    low, high = (similar_height(design, y) for y in PAPER_RANGE)
    ax.axvspan(low, high, color=PALE, alpha=0.6, lw=0, zorder=0, label="heights that the paper compares, for this leg")
    cut = f"cut shortly below y_neu = {neutral(design):.3g} m, where it diverges"
    describe(ax, f"height of the body above the foot ({cut}) [m]", "stiffness [N/m]")
    legend(figure)
    return figure


TRACKERS = ("track", "track_mpc", "track_pd")  # the first of them that ran is drawn beside its plan
FIGURES: dict[str, Callable[[Runs], Figure]] = {
    "foot_height": foot_height,
    "saturation": saturation,
    "speed_torque": speed_torque,
    "stiffness": stiffness,
    "stick": stick,
    "budget": budget,
}


def save_all(
    runs: Runs,
    folder: Path,
    formats: Sequence[str] = FORMATS,
    steps: Ladder | None = None,
    plan: PlanReference | None = None,
) -> list[Path]:
    """Write every figure in every format to a folder, which is made if need be; the files written.

    steps: of the ladder, if there is one. plan: what the runs called track followed, if one did. The budget is left out unless
    there is an optimum and something beside it.
    Raises ResultError, naming the figures that failed and why, when the others are written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths, faults = [], []
    more: dict[str, Callable[[Runs], Figure]] = {}
    if steps is not None:
        more["why"] = lambda runs: staircase(steps, called_after(next(iter(runs.values())).design))
    if plan is not None and (followed := next((tracker for tracker in TRACKERS if tracker in runs), "")):
        more["tracking"] = lambda runs: tracking(followed, runs[followed], plan)
    for name, draw in (FIGURES | more).items():
        if name == "budget" and not (OPTIMUM in runs and len(runs) > 1):
            continue
        try:
            paths += save_figure(draw(runs), folder / name, formats)
        except Exception as error:  # whatever is wrong with one figure, the others are drawn
            faults.append(f"{name}: {type(error).__name__}: {error}")
    if faults:
        raise ResultError("; ".join(faults))
    return paths
