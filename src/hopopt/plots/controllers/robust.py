"""What a share of drawn legs reaches: every leg, the promise, and the bounds."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from hopopt.comparison.robust.robust import RobustHop
from hopopt.plots.hop import save_figure
from hopopt.plots.style import BLACK, GREY, called_after, describe, legend, new_figure
from hopopt.report.robust import COLORS


def share_of_legs(found: RobustHop) -> Figure:
    """Share [%] of the drawn legs that clear at least a height [m], tracked and under PD control; both bounds."""
    figure = new_figure(f"{called_after(found.best.design)}: what {found.share:.0%} of the legs reach")
    ax = figure.subplots()
    for (name, reached), color in zip(found.reached.items(), COLORS, strict=False):
        heights, promised = np.sort(reached.clearances), reached.promised(found.share, found.confidence)
        shares = 100 * (1 - np.arange(len(heights)) / len(heights))
        fell = f", {reached.fell} fell" if reached.fell else ""
        ax.step(heights, shares, where="pre", color=color, lw=2, label=f"{name}: {promised:.3f} m{fell}")
        ax.plot(promised, 100 * found.share, "o", color=color, ms=9)
    for bound, words, style in ((found.bound, "this ground", "-"), (found.ideal_bound, "ideal ground", ":")):
        if bound.verified:
            ax.axvline(bound.clearance, color=BLACK, lw=1.5, ls=style, label=f"bound, {words}: {bound.clearance:.3f} m")
    ax.axhline(100 * found.share, color=GREY, lw=0.8)
    ax.set_ylim(0, 103)
    words = f"dot: {found.share:.0%} of all legs reach it, with {found.confidence:.0%} confidence"
    describe(ax, f"clearance [m]; {words}", f"legs that reach it [% of {len(found.tracked.clearances)}]")
    legend(figure)
    return figure


def save_all(found: RobustHop, folder: Path) -> None:
    """Write the figure to a folder."""
    save_figure(share_of_legs(found), folder / "share_of_legs")
