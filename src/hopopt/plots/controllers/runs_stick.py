"""Runs as rows of stick figures, one row a strategy."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from hopopt.leg.closed_chains import chain_lines
from hopopt.leg.robot import BASE
from hopopt.leg.scales import Scale
from hopopt.plots.controllers.runs_style import Runs, called, few, last, looks, reached, runs_figure, since_lift_off
from hopopt.plots.stick import every as how_often
from hopopt.plots.stick import pose_step, time_label
from hopopt.plots.style import FIGURE_SIZE, GREY, SMALL, describe, height_arrow
from hopopt.sim.hop_metrics import HopFigures

LONGEST_DRAWN = 1.0  # [s] on the paper's leg, of a run that is drawn
WIDEST, TITLE = 9.8, 0.5  # [in] what a slide has for a row of poses across, and what the row needs beside them
SMALL_HEAD = 8.0  # [pt] of an arrow in so low a row
CROWDED = 8  # columns, above which every other one has its time written
PALER = 0.4  # opacity of the poses in stance


@few
def stick(runs: Runs) -> Figure:
    """The leg of every run every 40 ms, or as it suits its size, up to its clearance [m], as in the paper's Fig. exp_picture.

    Poses as long after their lift-off stand in one column, all to one scale [m], side by side however far the leg
    travels; the last of a row is that of the clearance. Poses in stance are paler. It has the shape of a slide.
    """
    step = pose_step(next(iter(runs.values())).design.leg)
    poses, look = [_Poses(run, step) for run in runs.values()], looks(runs)
    first, last_one = min(p.first for p in poses), max(p.first + len(p.t) for p in poses)
    widths = [max((p.width(k) for p in poses), default=0.0) for k in range(first, last_one)]
    top = max(p.top for p in poses)
    fill = WIDEST * top / (FIGURE_SIZE[1] / len(runs) - TITLE) - sum(widths)
    widths = [
        w + max(fill, 0.0) / len(widths) for w in widths
    ]  # poses farther apart, where they would not fill the slide
    middles, width = np.cumsum(widths) - np.array(widths) / 2, sum(widths)
    figure = runs_figure(runs, f"{how_often(step)} up to the clearance, paler in stance")
    axes = figure.subplots(len(runs), squeeze=False)[:, 0]
    for ax, p, (name, run) in zip(axes, poses, runs.items(), strict=True):
        p.draw(ax, middles[p.first - first :][: len(p.t)], look[name]["color"])
        ax.axhline(0, color=GREY, lw=2, zorder=1)
        ax.set(xlim=(0, 1.005 * width), ylim=(-0.04 * top, top), aspect="equal")
        describe(ax, "time since lift-off [s]" if ax is axes[-1] else "", "height [m]" if len(runs) < 4 else "z [m]")
        ax.grid(False, axis="x")
        every = 2 if len(middles) > CROWDED else 1
        ticks = [
            (m, time_label(step * k, step)) for k, m in enumerate(middles, first) if k % every == 0 and ax is axes[-1]
        ]
        ax.set_xticks([m for m, _ in ticks], [text for _, text in ticks], fontsize=SMALL)
        at = f" at {p.t[-1]:.3f} s" if run.highest is not None else ""
        ax.set_title(f"{called(name, run)}: {reached(run)}{at}", loc="left", fontsize=SMALL, fontweight="bold")
    return figure


class _Poses:
    """The poses of a run: t (k,) [s] since lift-off, of which the first is ``first`` steps from it; x about their own
    middle and z (k, points) [m], and the width each needs [m]."""

    def __init__(self, run: HopFigures, step: float):
        trace, links, clock = run.trace, run.design.leg.link.values(), since_lift_off(run)
        end = min(last(run), int(np.searchsorted(trace.t, LONGEST_DRAWN * Scale.of(run.design.leg).time)) - 1)
        self.first = int(np.ceil(clock[0] / step - 1e-9))
        early = step * np.arange(self.first, clock[end] / step - 0.25)  # none just before the last
        reach = sum(link.length for link in links)
        self.radius, self.t = 0.09 * reach, np.append(early, clock[end])
        self.contact = trace.contact[np.maximum(np.searchsorted(clock, self.t, side="right") - 1, 0)]
        chain = np.stack([_at(self.t, clock, trace.points[name]) for name in trace.robot.leg.chain], axis=1)
        leg = trace.robot.leg
        poses = np.stack([np.interp(self.t, clock, trace.q[:, BASE + k]) for k in range(len(leg.joints))], axis=1)
        self.bars = [np.array(chain_lines(leg, q)).reshape(-1, 3, 2) for q in poses]  # of five-bars, from the body
        left = np.minimum(chain[..., 0].min(axis=1), chain[:, 0, 0] - self.radius)
        right = np.maximum(chain[..., 0].max(axis=1), chain[:, 0, 0] + self.radius)
        self.x, self.z = chain[..., 0] - 0.5 * (left + right)[:, None], chain[..., 1]
        self.widths = right - left + 0.15 * reach
        self.top = 1.04 * (self.z.max() + self.radius)
        self.clearance = run.clearance if end == run.highest else None

    def width(self, column: int) -> float:
        """What the pose in a column, counted in steps from lift-off, needs [m]; 0 where there is none."""
        k = column - self.first
        return float(self.widths[k]) if 0 <= k < len(self.t) else 0.0

    def draw(self, ax: Axes, middles: np.ndarray, color: str) -> None:
        """Body, links, joints and foot of every pose, and the clearance at the last."""
        across = self.x + middles[:, None]
        for x, z, bars, contact in zip(across, self.z, self.bars, self.contact, strict=True):
            look = {"color": color, "alpha": PALER if contact else 1.0}
            for along, up in bars.swapaxes(1, 2):
                ax.plot(x[0] + along, z[0] + up, lw=1.0, zorder=2, **look)
            ax.plot(x, z, "-o", lw=2.5, ms=4, mfc="white", zorder=3, **look)
            ax.add_patch(Circle((x[0], z[0]), self.radius, lw=0, zorder=4, **look))
        if self.clearance is not None and self.clearance > 0.1 * self.top:  # there is room for an arrow
            height_arrow(ax, across[-1, self.z[-1].argmin()], self.clearance, SMALL_HEAD)


def _at(t: np.ndarray, known: np.ndarray, points: np.ndarray) -> np.ndarray:
    """A point's way [m], (samples, 2), at other instants [s], between its samples."""
    return np.stack([np.interp(t, known, points[:, k]) for k in range(points.shape[1])], axis=1)
