"""The area that a leg sweeps over an obstacle, and the box that it clears."""

from itertools import pairwise

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from hopopt.leg.geometry.outlines import seen
from hopopt.planner.solution import Solution
from hopopt.plots.style import BLACK, COLOR, GREEN, GREY, PALE, TEXT, describe, legend, solution_figure

AREA_INTERVAL, DRAWN_POSES = 0.004, 14  # s between two instants of the area; poses that are drawn


def obstacle(solution: Solution) -> Figure:
    """All places that the leg passes [m], some of its poses, and the highest box of the given width that it clears."""
    figure, box = solution_figure(solution, "the area that the leg sweeps"), solution.summary.obstacle
    assert box is not None, "a hop over an obstacle"
    ax, samples = figure.subplots(), solution.sample(np.arange(0.0, solution.end, AREA_INTERVAL))
    chain = np.stack([samples.points[name] for name in solution.robot.leg.chain], axis=1)  # (k, points, 2)
    quads = [
        [begin[j], begin[j + 1], end[j + 1], end[j]]
        for begin, end in pairwise(chain)
        for j in range(chain.shape[1] - 1)
    ]
    ax.add_collection(PolyCollection(quads, facecolors=PALE, edgecolors=PALE, linewidths=0.6, zorder=1))
    shapes = seen(solution.robot.leg, samples.q)
    for corners in shapes:
        ax.add_collection(PolyCollection(list(corners), facecolors=PALE, edgecolors=PALE, linewidths=0.6, zorder=1))
    for k in np.unique(np.linspace(0, len(chain) - 1, DRAWN_POSES).astype(int)):
        phase = str(samples.phase[k])
        known = phase in ax.get_legend_handles_labels()[1]
        poses = [corners[k] for corners in shapes]
        ax.add_collection(PolyCollection(poses, facecolors=GREY, edgecolors="none", alpha=0.25, zorder=2.5))
        look = {"color": COLOR[phase], "lw": 2.2, "ms": 4, "mfc": "white", "zorder": 3}
        ax.plot(*chain[k].T, "-o", label=None if known else phase, **look)
        ax.plot(*chain[k, 0], "o", color=COLOR[phase], ms=11, zorder=4)
    look = {"fc": GREEN, "ec": BLACK, "alpha": 0.8, "zorder": 2}
    ax.add_patch(Rectangle((box.begins_m, 0), box.width_m, box.height_m, label="the highest box", **look))
    words = f"{box.width_m:g} m wide\n{box.height_m:.3f} m high"
    beside = {"xytext": (12, 0), "textcoords": "offset points", "va": "center", "fontsize": TEXT, "zorder": 6}
    ax.annotate(words, (box.begins_m + box.width_m, 0.25 * box.height_m), **beside)
    ax.axhline(0, color=GREY, lw=3, zorder=1, label="ground")
    ax.set(aspect="equal")
    ax.margins(0.05)
    describe(ax, "along [m]", "height [m]")
    legend(figure)
    return figure
