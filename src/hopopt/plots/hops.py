"""The figures of strategies that hop on and on: clearance of every hop, orbits, and from where they come back."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from hopopt.comparison.hops.hop_after_hop import HopsComparison
from hopopt.comparison.ladder import Ladder
from hopopt.leg.robot import BASE
from hopopt.plots.controllers.ladder import staircase
from hopopt.plots.controllers.runs_style import looks
from hopopt.plots.hop import save_figures
from hopopt.plots.style import BLACK, FIGURE_SIZE, GREEN, GREY, PALE, SMALL, called_after, describe, legend, new_figure

MOST_ORBITS = 5  # orbits in a figure; with more it cannot be read


def clearances(found: HopsComparison) -> Figure:
    """Clearance [m] of every hop of every strategy, and the periodic bound."""
    figure = new_figure(f"{called_after(found.solution.design)}: clearance hop after hop")
    ax, look = figure.subplots(), looks(found.shown)
    ax.axhline(found.bound, color=BLACK, lw=1.5, ls=":", label=f"periodic bound, {found.bound:.3f} m")
    for name, hops in found.hops.items():
        end = f"fell after {len(hops.clearances)}" if hops.fell else f"keeps up {hops.kept:.3f} m"
        each = np.arange(1, len(hops.clearances) + 1)
        ax.plot(each, hops.clearances, label=f"{name}: {end}", marker=".", ms=5, **look[name])
    ax.set_ylim(bottom=0)
    describe(ax, "hop", "clearance [m]")
    legend(figure)
    return figure


def orbit(found: HopsComparison) -> Figure:
    """Speed [rad/s] over angle [rad] of every joint: the optimum's cycle, and the hop on which each strategy settles."""
    runs = dict(list(found.shown.items())[:MOST_ORBITS])
    joints = found.solution.robot.joints
    figure = new_figure(
        f"{called_after(found.solution.design)}: the cycle of every joint", (FIGURE_SIZE[0], FIGURE_SIZE[1])
    )
    look = looks(found.shown)
    for k, ax in enumerate(figure.subplots(1, len(joints), squeeze=False)[0]):
        for name, run in runs.items():
            q, v, contact = run.trace.q[:, BASE + k], run.trace.v[:, BASE + k], run.trace.contact
            ax.plot(q, v, label=name, **look[name])
            first = int(np.argmin(contact))
            for row, marker in ((0, "o"), (first, "s")):
                ax.plot(q[row], v[row], marker, mfc="white", mec=look[name]["color"], mew=1.5, ms=6, zorder=5)
        for marker, label in (("o", "stance begins"), ("s", "lift-off")):
            ax.plot([], [], marker, mfc="white", mec=GREY, mew=1.5, ms=6, label=label)
        place, speed, _ = found.solution.design.leg.units(joints[k]).labels
        describe(ax, f"{joints[k]} {place}", f"{joints[k]} {speed}")
    legend(figure)
    return figure


def basin(found: HopsComparison) -> Figure:
    """From where at its apex each strategy comes back to its orbit: higher [m] and faster forward [m/s]."""
    maps = found.basins
    figure = new_figure(
        f"{called_after(found.solution.design)}: starts from which the orbit is reached again", FIGURE_SIZE
    )
    for ax, (name, area) in zip(
        figure.subplots(1, len(maps), squeeze=False, sharey=True)[0], maps.items(), strict=True
    ):
        for i, h in enumerate(area.higher):
            for j, v in enumerate(area.faster):
                back = area.hops[i, j]
                ax.plot(v, 100 * h, "o" if back else "x", color=GREEN if back else GREY, ms=9, mew=2)
        ax.axhline(0, color=PALE, lw=1, zorder=0)
        ax.axvline(0, color=PALE, lw=1, zorder=0)
        describe(ax, "faster forward [m/s]", "higher [cm]" if name == next(iter(maps)) else "", name)
        ax.tick_params(labelsize=SMALL)
    for marker, color, label in (("o", GREEN, "comes back"), ("x", GREY, "falls, or keeps up less")):
        figure.axes[0].plot([], [], marker, color=color, ms=9, mew=2, ls="", label=label)
    legend(figure)
    return figure


FIGURES: dict[str, Callable[[HopsComparison], Figure]] = {"clearances": clearances, "orbit": orbit, "basin": basin}


def save_all(found: HopsComparison, folder: Path, steps: Ladder | None = None) -> list[Path]:
    """``save_figures`` of a comparison, with that of the ladder if there is one."""
    figures = dict(FIGURES)
    if not found.basins:
        del figures["basin"]
    if steps is not None:
        figures["why"] = lambda found: staircase(steps, called_after(found.solution.design))
    return save_figures(found, figures, folder)
