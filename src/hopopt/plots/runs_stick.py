"""Runs as rows of stick figures, one row a strategy."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from hopopt.plots.runs_style import Runs, called, last, looks, reached, runs_figure
from hopopt.plots.stick import POSE_STEP
from hopopt.plots.style import GREY, SMALL, TEXT, describe, height_arrow
from hopopt.sim.hop_metrics import HopFigures

LONGEST = 1.0  # [s] of a run that is drawn
PALER = 0.4  # opacity of the poses in stance


def stick(runs: Runs) -> Figure:
    """The leg of every run every 40 ms up to its clearance [m], as in the paper's Fig. exp_picture.

    Poses of one instant stand in one column, all to one scale [m], side by side however far the leg travels; the last
    is that of the clearance. Poses in stance are paler.
    """
    poses, look = [_Poses(run) for run in runs.values()], looks(runs)
    widths = [max(p.widths[k] for p in poses if k < len(p.t)) for k in range(max(len(p.t) for p in poses))]
    middles, width, top = np.cumsum(widths) - np.array(widths) / 2, sum(widths), max(p.top for p in poses)
    figure = runs_figure(runs, "every 40 ms up to the clearance, paler in stance", _size(len(runs), width, top))
    axes = figure.subplots(len(runs), squeeze=False)[:, 0]
    for ax, p, (name, run) in zip(axes, poses, runs.items(), strict=True):
        p.draw(ax, middles, look[name]["color"])
        ax.axhline(0, color=GREY, lw=2, zorder=1)
        ax.set(xlim=(0, 1.005 * width), ylim=(-0.04 * top, top), aspect="equal")
        describe(ax, "time [s]" if ax is axes[-1] else "", "height [m]")
        ax.grid(False, axis="x")
        ax.set_xticks(middles[: len(p.t)], [*(f"{t:.2f}" for t in p.t[:-1]), f"{p.t[-1]:.3f}"], fontsize=SMALL)
        ax.set_title(f"{called(name, run)}: {reached(run)}", loc="left", fontsize=TEXT, fontweight="bold")
    return figure


def _size(rows: int, width: float, top: float) -> tuple[float, float]:
    """Size [in] of the figure: rows of about one width, no taller than they are readable."""
    across = min(14.0, 0.8 + 3.6 * width / top)
    return max(8.0, across), 0.9 + rows * (0.65 + (across - 0.8) * top / width)


class _Poses:
    """The poses of a run: t (k,) [s], x about their own middle and z (k, points) [m], and the width each needs [m]."""

    def __init__(self, run: HopFigures):
        trace, links = run.trace, run.design.leg.link.values()
        end = min(last(run), int(np.searchsorted(trace.t, LONGEST)) - 1)
        early = np.arange(0, trace.t[end] - POSE_STEP / 4, POSE_STEP)  # none just before the last
        reach = sum(link.length for link in links)
        self.radius, self.t = 0.09 * reach, np.append(early, trace.t[end])
        self.contact = trace.contact[np.searchsorted(trace.t, self.t, side="right") - 1]
        chain = np.stack([_at(self.t, trace.t, trace.points[name]) for name in (*trace.robot.joints, "foot")], axis=1)
        left = np.minimum(chain[..., 0].min(axis=1), chain[:, 0, 0] - self.radius)
        right = np.maximum(chain[..., 0].max(axis=1), chain[:, 0, 0] + self.radius)
        self.x, self.z = chain[..., 0] - 0.5 * (left + right)[:, None], chain[..., 1]
        self.widths = right - left + 0.15 * reach
        self.top = 1.04 * (self.z.max() + self.radius)
        self.clearance = run.clearance if end == run.highest else None

    def draw(self, ax: Axes, middles: np.ndarray, color: str) -> None:
        """Body, links, joints and foot of every pose, and the clearance at the last."""
        across = self.x + middles[: len(self.t), None]
        for x, z, contact in zip(across, self.z, self.contact, strict=True):
            look = {"color": color, "alpha": PALER if contact else 1.0}
            ax.plot(x, z, "-o", lw=2.5, ms=4, mfc="white", zorder=3, **look)
            ax.add_patch(Circle((x[0], z[0]), self.radius, lw=0, zorder=4, **look))
        if self.clearance is not None and self.clearance > 0.1 * self.top:  # there is room for an arrow
            height_arrow(ax, across[-1, self.z[-1].argmin()], self.clearance)


def _at(t: np.ndarray, known: np.ndarray, points: np.ndarray) -> np.ndarray:
    """A point's way [m], (samples, 2), at other instants [s], between its samples."""
    return np.stack([np.interp(t, known, points[:, k]) for k in range(points.shape[1])], axis=1)
