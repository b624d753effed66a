"""The figures of a solved hop, as matplotlib objects made without pyplot: the same headless and in notebooks.

Torques jump at switches, so curves go through samples inside every interval (``PLACES``), close to both of its
ends but never across one. Colours are those of Okabe and Ito, which colour-blind readers can tell apart.
"""

import io
import math
import textwrap
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from hopopt.ocp.hop import FLIGHT, STANCE
from hopopt.solution import Samples, Solution

FORMATS = ("png", "svg")
DPI = 150  # 1650 pixels across
SIZE = (11.0, 6.2)  # [in], the shape of a slide
PLACES = np.array([1e-6, 0.25, 0.5, 0.75, 1 - 1e-6])  # of every interval
POSE_STEP = 0.04  # [s] between two stick figures

BLACK, GREY, PALE, GREEN = "#000000", "#666666", "#dcdcdc", "#009E73"
COLOR = {STANCE: "#0072B2", FLIGHT: "#D55E00"}
JOINT_COLORS, JOINT_STYLES = ("#E69F00", "#56B4E9", "#CC79A7"), ("-", "--", "-.")
TITLE, TEXT, SMALL = 15, 13, 11  # font sizes [pt]
BAND = {"color": PALE, "lw": 0}
LIMIT = {"color": GREY, "lw": 1.2, "ls": "--"}

Motion = dict[str, Samples]  # by phase


class Picture(Figure):
    """A figure that a notebook shows although pyplot does not know it."""

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        self.savefig(buffer, format="png")
        return buffer.getvalue()


def _figure(solution: Solution, title: str, size: tuple[float, float] = SIZE) -> Picture:
    """An empty figure of a size [in] that says which problem it shows, and whether its checks failed."""
    figure = Picture(figsize=size, dpi=DPI, layout="constrained")
    warning = "" if solution.verified else " (NOT verified)"
    figure.suptitle(textwrap.fill(f"{solution.design.name}: {title}{warning}", int(8 * size[0])), fontsize=TITLE)
    return figure


def _describe(ax: Axes, x: str, y: str, title: str = "") -> None:
    """Label the axes (with units), in sizes that a slide needs."""
    ax.set_xlabel(x, fontsize=TEXT)
    ax.set_ylabel(y, fontsize=TEXT)
    ax.set_title("\n".join(textwrap.wrap(title, 22)), fontsize=TEXT, fontweight="bold")
    ax.tick_params(labelsize=SMALL)
    ax.grid(True, color=PALE, lw=0.6)
    ax.set_axisbelow(True)


def _legend(figure: Figure) -> None:
    """One legend for all axes, below them, where it covers no curve; each label once."""
    handles: dict[str, Any] = {}
    for ax in figure.axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    widest = 0.7 + 0.1 * max(map(len, handles))  # [in], line and text
    columns = max(1, min(len(handles), int(figure.get_figwidth() / widest)))
    figure.legend(
        list(handles.values()), list(handles), loc="outside lower center", ncols=columns, fontsize=TEXT, frameon=False
    )


def _motion(solution: Solution) -> Motion:
    """Both phases, sampled inside every interval."""
    return {phase: solution.everywhere(phase, PLACES) for phase in (STANCE, FLIGHT)}


def _joined(motion: Motion, value: Callable[[Samples], np.ndarray]) -> np.ndarray:
    """A value of both phases, one after the other."""
    return np.concatenate([value(s) for s in motion.values()])


def _by_phase(ax: Axes, motion: Motion, x: Callable[[Samples], np.ndarray], y: Callable[[Samples], np.ndarray]) -> None:
    """A curve in the colours of the phases."""
    for phase, s in motion.items():
        ax.plot(x(s), y(s), color=COLOR[phase], lw=2, label=phase)


def _mark_lift_off(ax: Axes, solution: Solution) -> None:
    """A dotted line at lift-off [s]."""
    ax.axvline(solution.lift_off, color=BLACK, lw=1.2, ls=":", label=f"lift-off at {solution.lift_off:.3f} s")


# ---- heights ---------------------------------------------------------------------------------------------


def heights(solution: Solution) -> Figure:
    """Heights [m] of foot, joints, body and centre of mass over time [s], with the clearance at the apex."""
    figure = _figure(solution, "heights of the hop")
    ax, motion = figure.subplots(), _motion(solution)
    t = _joined(motion, lambda s: s.t)
    for name, label, look in _height_curves(solution):
        ax.plot(t, _joined(motion, lambda s, name=name: s.points[name][:, 1]), label=label, **look)
    ax.axhline(0, color=GREY, lw=3, zorder=1, label="ground")
    _mark_lift_off(ax, solution)
    _describe(ax, "time [s]", "height [m]")
    _annotate_clearance(ax, solution)
    _legend(figure)
    return figure


def _height_curves(solution: Solution) -> Iterable[tuple[str, str, dict[str, Any]]]:
    """Point, label and look of every curve."""
    body, *joints = solution.robot.joints
    yield "foot", "foot", {"color": BLACK, "lw": 3, "zorder": 3}
    for k, name in enumerate(joints):
        yield name, name, {"color": JOINT_COLORS[k % 3], "ls": JOINT_STYLES[k // 3 % 3], "lw": 2}
    yield body, f"body ({body})", {"color": GREEN, "lw": 2}
    yield "com", "centre of mass", {"color": GREY, "lw": 2, "ls": "--"}


def _annotate_clearance(ax: Axes, solution: Solution) -> None:
    """The clearance [m] to the right of the last instant, where no curve is."""
    end, top = solution.duration, ax.get_ylim()[1]
    ax.set(xlim=(0, 1.18 * end), ylim=(-0.05 * top, top))
    _arrow(ax, 1.02 * end, solution.clearance)
    y = max(0.5 * solution.clearance, 0.08 * top)  # two lines of text stay above the ground
    ax.text(1.035 * end, y, _clearance_text(solution), fontsize=TEXT, va="center")


def _arrow(ax: Axes, x: float, height: float) -> None:
    """A double arrow from the ground to a height [m]."""
    look = {"arrowstyle": "<|-|>", "color": BLACK, "lw": 1.5, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 14}
    ax.annotate("", (x, height), (x, 0), arrowprops=look)


def _clearance_text(solution: Solution) -> str:
    return f"clearance\n{solution.clearance:.3f} m"


# ---- joints ----------------------------------------------------------------------------------------------


def joints(solution: Solution) -> Figure:
    """Angle [rad], speed [rad/s] and torque [N m] of every joint over time [s], with what they may be."""
    names, motion = solution.robot.joints, _motion(solution)
    figure = _figure(solution, "joint angles, speeds and torques", (max(SIZE[0], 3.4 * len(names)), 7.2))
    grid = figure.subplots(3, len(names), squeeze=False, sharex=True)
    for k, name in enumerate(names):
        _angle(grid[0, k], solution, motion, k)
        _by_phase(grid[1, k], motion, lambda s: s.t, lambda s, k=k: s.v[:, k - len(names)])
        _torque(grid[2, k], solution, motion, k)
        for ax, label in zip(grid[:, k], ("angle [rad]", "speed [rad/s]", "torque [N m]"), strict=True):
            _mark_lift_off(ax, solution)
            _describe(ax, "time [s]" if ax is grid[2, k] else "", label, name if ax is grid[0, k] else "")
            ax.margins(x=0)
    figure.align_ylabels(grid)
    _legend(figure)
    return figure


def _angle(ax: Axes, solution: Solution, motion: Motion, k: int) -> None:
    """Angle [rad] of joint k and its limits."""
    names = solution.robot.joints
    limits = solution.design.leg.joint[names[k]]
    for limit in (limits.lower, limits.upper):
        ax.axhline(limit, label="angle limit", **LIMIT)
    _by_phase(ax, motion, lambda s: s.t, lambda s: s.q[:, k - len(names)])


def _torque(ax: Axes, solution: Solution, motion: Motion, k: int) -> None:
    """Torque [N m] of joint k over the band that its speed allows."""
    names = solution.robot.joints
    bounds = solution.region(names[k]).torque_bounds(_joined(motion, lambda s: s.v[:, k - len(names)]))
    t = _joined(motion, lambda s: s.t)
    ax.fill_between(t, *bounds, label="torque the drive can give at this speed", **BAND)
    for bound in bounds:
        ax.plot(t, bound, color=GREY, lw=0.8, gid="torque bound")
    _by_phase(ax, motion, lambda s: s.t, lambda s: s.tau[:, k])


# ---- operating region ------------------------------------------------------------------------------------


def operating_region(solution: Solution) -> Figure:
    """Each joint's way through its drive's admissible speeds [rad/s] and torques [N m]."""
    names, motion = solution.robot.joints, _motion(solution)
    columns = min(len(names), 4)
    rows = math.ceil(len(names) / columns)
    figure = _figure(solution, "operating regions", (max(SIZE[0], 3.8 * columns), max(SIZE[1], 4.2 * rows)))
    for k, name in enumerate(names):
        ax = figure.add_subplot(rows, columns, k + 1)
        ax.fill(*solution.region(name).corners().T, fc=PALE, ec=GREY, lw=1.2, label="what the drive can give")
        _by_phase(ax, motion, lambda s, k=k: s.v[:, k - len(names)], lambda s, k=k: s.tau[:, k])
        _mark_instants(ax, motion, k, k - len(names))
        _describe(ax, "speed [rad/s]", "torque [N m]", name)
    _legend(figure)
    return figure


def _mark_instants(ax: Axes, motion: Motion, k: int, column: int) -> None:
    """Start, lift-off (on both sides: the torque may jump) and apex of joint k."""
    for phase, row, marker, size, label in (
        (STANCE, 0, "o", 9, "start"),
        (STANCE, -1, "s", 9, "lift-off, end of stance"),
        (FLIGHT, 0, "D", 8, "lift-off, start of flight"),
        (FLIGHT, -1, "*", 15, "apex"),
    ):
        s, look = motion[phase], {"mfc": COLOR[phase], "mec": BLACK, "ms": size, "zorder": 4}
        ax.plot(s.v[row, column], s.tau[row, k], marker, label=label, **look)


# ---- stick figures ---------------------------------------------------------------------------------------


def stick(solution: Solution) -> Figure:
    """The leg every 40 ms and at the apex, each pose beside the one before it and all to one scale [m]."""
    figure = _figure(solution, "the hop every 40 ms, poses side by side")
    poses = _Poses(solution)
    for ax, row in zip(figure.subplots(len(poses.rows), squeeze=False)[:, 0], poses.rows, strict=True):
        for k in row:
            poses.draw(ax, k)
        ax.axhline(0, color=GREY, lw=3, zorder=1, label="ground")
        ax.set(xlim=(0, poses.width), ylim=(-0.04 * poses.height, poses.height), aspect="equal")
        _describe(ax, "time [s]", "height [m]")
        ax.grid(False, axis="x")
        ax.set_xticks([poses.middle[k] for k in row], [poses.label(k) for k in row])
    poses.draw_apex(ax)
    _legend(figure)
    return figure


class _Poses:
    """Where each pose of the hop is drawn: x, z (k, points) and body x [m], in rows that fill a slide."""

    def __init__(self, solution: Solution):
        self.solution, self.leg = solution, solution.design.leg
        early = np.arange(0, solution.duration - POSE_STEP / 4, POSE_STEP)  # none just before the apex
        self.samples = solution.sample([*early, solution.duration])
        chain = np.stack([self.samples.points[name] for name in (*self.leg.joints, "foot")], axis=1)
        self.x, self.z = chain[..., 0], chain[..., 1]
        self.reach = sum(link.length for link in self.leg.link.values())
        self.radius = 0.09 * self.reach
        self.window = min(solution.design.hop.foot_window, self.reach)  # a wider one would only shrink the leg
        self.height = 1.05 * max(self.z.max() + self.radius, solution.clearance)
        self._arrange()

    def _arrange(self) -> None:
        """Cut the poses into rows and shift each pose so that it touches no other."""
        left, right = (f(self.x, axis=1) for f in (np.min, np.max))
        body = self.x[:, 0]
        margin = np.full(len(body), self.radius)
        margin[-1] = max(self.radius, self.window)
        left, right = np.minimum(left, body - margin), np.maximum(right, body + margin)
        widths = right - left + 0.1 * self.reach
        count = max(1, round(math.sqrt(widths.sum() / self.height * SIZE[1] / SIZE[0])))
        self.rows = [[int(k) for k in row] for row in np.array_split(np.arange(len(body)), count)]
        starts = np.concatenate([np.cumsum([0.05 * self.reach, *widths[row[:-1]]]) for row in self.rows])
        ends = [starts[row[-1]] + widths[row[-1]] for row in self.rows]
        self.width = max(*ends, ends[-1] / 0.86)  # the clearance stands to the right of the apex
        self.x = self.x + (starts - left)[:, None]
        self.middle, self.right = starts + 0.5 * (right - left), starts + right - left

    def label(self, k: int) -> str:
        """Time [s] of pose k."""
        return f"{self.samples.t[k]:.2f}" if k < len(self.x) - 1 else f"{self.samples.t[k]:.3f}\n(apex)"

    def draw(self, ax: Axes, k: int) -> None:
        """Body, links, joints and foot of pose k in the colour of its phase."""
        phase = str(self.samples.phase[k])
        label = phase if self.samples.phase[:k].tolist().count(phase) == 0 else None
        ax.plot(self.x[k], self.z[k], "-o", color=COLOR[phase], lw=3, ms=5, mfc="white", zorder=3, label=label)
        ax.add_patch(Circle((self.x[k, 0], self.z[k, 0]), self.radius, fc=COLOR[phase], ec="none", zorder=4))

    def draw_apex(self, ax: Axes) -> None:
        """The body's plumb line, the foot window about it and the clearance [m], at the last pose."""
        body, height = self.x[-1, 0], self.z[-1, 0]
        label = f"foot window, ±{self.solution.design.hop.foot_window:g} m"
        ax.add_patch(Rectangle((body - self.window, 0), 2 * self.window, height, fc=GREEN, alpha=0.2, label=label))
        ax.plot([body, body], [0, height], color=BLACK, lw=1.2, ls=":", label="plumb line of the body")
        lowest, clearance = int(self.z[-1].argmin()), self.solution.clearance
        _arrow(ax, self.x[-1, lowest], clearance)
        y = max(0.5 * clearance, 0.15 * self.height)
        ax.text(self.right[-1] + 0.05 * self.reach, y, _clearance_text(self.solution), fontsize=TEXT, va="center")


# ---- ground force ----------------------------------------------------------------------------------------


def ground_force(solution: Solution) -> Figure:
    """Contact force [N] of the ground on the foot in stance, with the leg's weight and the peak."""
    figure, s = _figure(solution, "ground force in stance"), solution.everywhere(STANCE, PLACES)
    ax, model = figure.subplots(), solution.robot.model
    weight = sum(float(i.mass) for i in model.inertias) * float(np.linalg.norm(model.gravity.linear))
    ax.axhline(weight, color=GREY, lw=1.5, ls="--", label=f"weight, {weight:.0f} N")
    ax.plot(s.t, s.f[:, 1], color=COLOR[STANCE], lw=2.5, label="vertical")
    ax.plot(s.t, s.f[:, 0], color=JOINT_COLORS[0], lw=2, label="horizontal (forward +)")
    _mark_lift_off(ax, solution)
    _describe(ax, "time [s]", "force [N]")
    _annotate_peak(ax, solution, s, max(weight, float(s.f.max())))
    _legend(figure)
    return figure


def _annotate_peak(ax: Axes, solution: Solution, s: Samples, highest: float) -> None:
    """The largest vertical force [N], written above everything drawn."""
    k = int(s.f[:, 1].argmax())
    t, peak = float(s.t[k]), float(s.f[k, 1])
    lowest = min(0.0, float(s.f.min()))
    span = highest - lowest
    ax.set(xlim=(0, 1.02 * solution.lift_off), ylim=(lowest - 0.05 * span, highest + 0.18 * span))
    ax.plot(t, peak, "o", color=COLOR[STANCE], ms=8, zorder=4)
    side = {"x": min(max(t, 0.12 * solution.lift_off), 0.88 * solution.lift_off), "y": highest + 0.1 * span}
    look = {"arrowstyle": "-", "color": GREY, "shrinkB": 5}
    ax.annotate(f"peak {peak:.0f} N", (t, peak), (side["x"], side["y"]), fontsize=TEXT, ha="center", arrowprops=look)


FIGURES: dict[str, Callable[[Solution], Figure]] = {
    "heights": heights,
    "joints": joints,
    "operating_region": operating_region,
    "stick": stick,
    "ground_force": ground_force,
}


def save_all(solution: Solution, folder: Path, formats: Sequence[str] = FORMATS) -> list[Path]:
    """Write every figure in every format to a folder, which is made if need be; the files written."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, draw in FIGURES.items():
        figure = draw(solution)
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # the layout costs most and is the same for every format
        for suffix in formats:
            paths.append(folder / f"{name}.{suffix}")
            figure.savefig(paths[-1], dpi=DPI)
    return paths
