"""The hop as a row of stick figures."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle

from hopopt.design import Leg
from hopopt.leg.closed_chains import chain_lines
from hopopt.leg.geometry.solids import Solid, outline, solids
from hopopt.leg.kinematics import reach
from hopopt.leg.robot import BASE
from hopopt.leg.scales import Scale
from hopopt.ocp.phases import LANDING
from hopopt.planner.solution import Solution
from hopopt.plots.style import (
    BLACK,
    COLOR,
    FIGURE_SIZE,
    GREEN,
    GREY,
    TEXT,
    describe,
    headline,
    height_arrow,
    legend,
    solution_figure,
)

POSE_STEP, TIDY = 0.04, 0.005  # [s] between two stick figures on the paper's leg; of what steps are multiples
LABEL = 0.08  # share of a row's width that the time below a pose needs
CAPTION = 0.14  # that the height reached needs beside the apex
WIDE = 1.25  # share of a slide's width over its height, divided by the rows, that a row may have


def pose_step(leg: Leg) -> float:
    """Time between two stick figures of a leg [s]."""
    return TIDY * max(1, round(POSE_STEP * Scale.of(leg).time / TIDY))


def every(step: float) -> str:
    """How often a leg is drawn, in words."""
    return f"every {1000 * step:.0f} ms"


def time_label(t: float, step: float) -> str:
    """A time [s] with as many digits as its step has."""
    return f"{t:.{2 if round(1000 * step) % 10 == 0 else 3}f}"


def stick(solution: Solution) -> Figure:
    """The leg every 40 ms, or as it suits its size, at the end of flight and where it lands, each pose beside the one before it
    and all to one scale [m]."""
    poses = _HopPoses(solution)
    figure = solution_figure(solution, f"the hop {every(poses.step)}, poses side by side")
    for ax, row in zip(figure.subplots(len(poses.rows), squeeze=False)[:, 0], poses.rows, strict=True):
        for k in row:
            poses.draw(ax, k)
        ax.axhline(0, color=GREY, lw=3, zorder=1, label="ground")
        ax.set(xlim=(0, poses.width), ylim=(-0.04 * poses.height, poses.height), aspect="equal")
        describe(ax, "time [s]", "height [m]")
        ax.grid(False, axis="x")
        ax.set_xticks([poses.middle[k] for k in row], [poses.label(k) for k in row])
        if poses.apex in row:
            poses.draw_apex(ax)
    legend(figure)
    return figure


class _HopPoses:
    """Where each pose of the hop is drawn: x, z (k, points) and body x [m], in rows that fill a slide."""

    def __init__(self, solution: Solution):
        self.solution, self.leg = solution, solution.design.leg
        self.step = step = pose_step(self.leg)
        early = np.arange(0, solution.duration - step / 4, step)  # none just before the apex
        times, self.apex = [*early, solution.duration], len(early)
        if solution.end > solution.duration:
            times += [*np.arange(solution.duration + step, solution.end - step / 4, step), solution.end]
        self.samples = solution.sample(times)
        chain = np.stack([self.samples.points[name] for name in self.leg.chain], axis=1)
        self.x, self.z = chain[..., 0], chain[..., 1]
        self.reach, self.solids = reach(self.leg), [solid for solid in solids(self.leg) if solid.counts]
        self.shapes = [[self._outline(solid, k) for solid in self.solids] for k in range(len(times))]
        self.radius = 0.09 * self.reach
        # the window is a limit of the clearance only; a wider one than the leg would only shrink the leg
        self.window = min(solution.design.hop.foot_window, self.reach) if solution.objective != "apex" else 0.0
        highest = max((corners[:, 1].max() for shapes in self.shapes for corners in shapes), default=0.0)
        self.height = 1.05 * max(self.z.max() + self.radius, headline(solution)[1], highest)
        self._arrange()

    def _arrange(self) -> None:
        """Cut the poses into rows of about one width and shift each pose so that it touches no other."""
        left, right = (f(self.x, axis=1) for f in (np.min, np.max))
        body = self.x[:, 0]
        margin = np.full(len(body), self.radius)
        margin[self.apex] = max(self.radius, self.window)
        left, right = np.minimum(left, body - margin), np.maximum(right, body + margin)
        for k, shapes in enumerate(self.shapes):
            left[k] = min([left[k], *(body[k] + corners[:, 0].min() for corners in shapes)])
            right[k] = max([right[k], *(body[k] + corners[:, 0].max() for corners in shapes)])
        widths = right - left + 0.1 * self.reach
        widths[self.apex] += 0.8 * self.reach  # the height stands to the right of the apex
        count = max(1, round(math.sqrt(widths.sum() / self.height * FIGURE_SIZE[1] / FIGURE_SIZE[0])))
        room = max(widths.sum() / count, WIDE * count * self.height * FIGURE_SIZE[0] / FIGURE_SIZE[1])  # of a row
        widths = np.maximum(widths, LABEL * room)
        widths[self.apex] = max(widths[self.apex], right[self.apex] - left[self.apex] + CAPTION * room)
        spread = max(room * count - widths.sum(), 0.0) / len(widths)  # where poses would not fill the row
        widths += spread
        row_of = np.minimum((np.cumsum(widths) - 0.5 * widths) * count // widths.sum(), count - 1)
        self.rows = [np.flatnonzero(row_of == row).tolist() for row in np.unique(row_of)]
        starts = np.concatenate([np.cumsum([0.05 * self.reach, *widths[row[:-1]]]) for row in self.rows])
        self.width = max(starts[row[-1]] + widths[row[-1]] for row in self.rows)
        starts += 0.5 * spread
        self.x = self.x + (starts - left)[:, None]
        self.middle, self.right = starts + 0.5 * (right - left), starts + right - left

    def _outline(self, solid: Solid, k: int) -> np.ndarray:
        """Corners (m, 2) [m] of a solid in pose k, along from the body and above the ground."""
        return outline(self.leg, solid, self.samples.q[k, BASE:]) + np.array([0.0, self.z[k, 0]])

    def label(self, k: int) -> str:
        """Time [s] of pose k."""
        last = "rest" if LANDING in self.solution.phases else "touchdown"
        names = {len(self.x) - 1: last, self.apex: self.solution.end_of_flight}
        return f"{self.samples.t[k]:.3f}\n({names[k]})" if k in names else time_label(self.samples.t[k], self.step)

    def draw(self, ax: Axes, k: int) -> None:
        """Body, links, joints and foot of pose k in the colour of its phase."""
        phase = str(self.samples.phase[k])
        label = phase if self.samples.phase[:k].tolist().count(phase) == 0 else None
        for line in chain_lines(self.leg, self.samples.q[k, BASE:]):
            x, z = line.T + np.array([[self.x[k, 0]], [self.z[k, 0]]])
            ax.plot(x, z, "-o", color=GREY, lw=1.5, ms=3, zorder=2)
        ax.plot(self.x[k], self.z[k], "-o", color=COLOR[phase], lw=3, ms=5, mfc="white", zorder=3, label=label)
        for j, corners in enumerate(self.shapes[k]):
            label = "shapes of body and links" if k == j == 0 else None
            corners = corners + np.array([self.x[k, 0], 0.0])
            ax.add_patch(Polygon(corners, fc=GREY, ec="none", alpha=0.35, zorder=2, label=label))
        ax.add_patch(Circle((self.x[k, 0], self.z[k, 0]), self.radius, fc=COLOR[phase], ec="none", zorder=4))

    def draw_apex(self, ax: Axes) -> None:
        """The body's plumb line, the foot window about it and the height reached [m], at the apex."""
        apex = self.apex
        body, top = self.x[apex, 0], self.z[apex, 0]
        if self.window:
            label = f"foot window, ±{self.solution.design.hop.foot_window:g} m"
            ax.add_patch(Rectangle((body - self.window, 0), 2 * self.window, top, fc=GREEN, alpha=0.2, label=label))
        ax.plot([body, body], [0, top], color=BLACK, lw=1.2, ls=":", label="plumb line of the body")
        (name, height), lowest = headline(self.solution), int(self.z[apex].argmin())
        x = self.x[apex, lowest] if name == "clearance" else self.right[apex]
        height_arrow(ax, x, height)
        y = max(0.5 * height, 0.15 * self.height)
        ax.text(self.right[apex] + 0.05 * self.reach, y, f"{name}\n{height:.3f} m", fontsize=TEXT, va="center")
