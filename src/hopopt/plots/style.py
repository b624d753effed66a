"""What all figures share: size, colours, labels, legend, and curves that jump; made without pyplot.

Colours are those of Okabe and Ito, which colour-blind readers can tell apart. Torques jump at switches: a curve
is drawn solid where it is smooth and thin across a jump.
"""

import io
import textwrap
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hopopt.design import Design
from hopopt.ocp.phases import DESCENT, FLIGHT, LANDING, STANCE
from hopopt.planner.motion import Samples
from hopopt.planner.solution import Solution

DPI = 150  # 1650 pixels across
FIGURE_SIZE = (11.0, 6.2)  # [in], the shape of a slide
NORMALISED_TIMES = np.array([1e-6, 0.25, 0.5, 0.75, 1 - 1e-6])  # of every interval: close to both ends, across none
JUMP, AT_ONCE = 0.02, 1e-3  # a jump changes more than this share of the range within this share of the time

BLACK, GREY, PALE, GREEN = "#000000", "#666666", "#dcdcdc", "#009E73"
COLOR = {STANCE: "#0072B2", FLIGHT: "#D55E00", DESCENT: "#CC79A7", LANDING: "#009E73"}
JOINT_COLORS, JOINT_STYLES = ("#E69F00", "#56B4E9", "#CC79A7"), ("-", "--", "-.")
TITLE, TEXT, SMALL = 15, 13, 11  # font sizes [pt]
BAND = {"color": PALE, "lw": 0}
LIMIT = {"color": GREY, "lw": 1.2, "ls": "--"}

PhaseSamples = dict[str, Samples]  # by phase
Value = Callable[[Samples], np.ndarray]  # of every sample


class Picture(Figure):
    """A figure that a notebook shows although pyplot does not know it."""

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        self.savefig(buffer, format="png")
        return buffer.getvalue()


def new_figure(title: str, size: tuple[float, float] = FIGURE_SIZE) -> Picture:
    """An empty figure of a size [in] with its title."""
    figure = Picture(figsize=size, dpi=DPI, layout="constrained")
    figure.suptitle(textwrap.fill(title, int(8 * size[0])), fontsize=TITLE)
    return figure


def called_after(design: Design) -> str:
    """What a figure calls a problem: its title, or its name."""
    return design.title or design.name


def solution_figure(solution: Solution, title: str, size: tuple[float, float] = FIGURE_SIZE) -> Picture:
    """An empty figure that says which problem it shows, and whether its checks failed."""
    warning = "" if solution.verified else " (NOT verified)"
    return new_figure(f"{called_after(solution.design)}: {title}{warning}", size)


def describe(ax: Axes, x: str, y: str, title: str = "") -> None:
    """Label the axes (with units), in sizes that a slide needs."""
    ax.set_xlabel(x, fontsize=TEXT)
    ax.set_ylabel(y, fontsize=TEXT)
    ax.set_title("\n".join(textwrap.wrap(title, 22)), fontsize=TEXT, fontweight="bold")
    ax.tick_params(labelsize=SMALL)
    ax.grid(True, color=PALE, lw=0.6)
    ax.set_axisbelow(True)


def legend(figure: Figure) -> None:
    """One legend for all axes, below them, where it covers no curve; each label once, read line by line."""
    handles: dict[str, Artist] = {}
    for ax in figure.axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    columns = _columns(list(handles), figure.get_figwidth())
    order = [label for k in range(columns) for label in list(handles)[k::columns]]  # matplotlib fills columns
    figure.legend(
        [handles[label] for label in order], order, loc="outside lower center", ncols=columns, fontsize=TEXT, frameon=False
    )  # fmt: skip


def _columns(labels: Sequence[str], width: float) -> int:
    """As many columns as fit side by side into a width [in], no line left almost empty."""
    lengths = [1.0 + 0.1 * len(label) for label in labels]  # [in], line, text and gap
    fits = [n for n in range(1, len(labels) + 1) if sum(max(lengths[k::n]) for k in range(n)) <= width]
    lines = -(-len(labels) // max(fits, default=1))
    return -(-len(labels) // lines)


def motion_of(solution: Solution) -> PhaseSamples:
    """Every phase, sampled inside every interval."""
    return {phase: solution.everywhere(phase, NORMALISED_TIMES) for phase in solution.phases}


def joined(motion: PhaseSamples, value: Value) -> np.ndarray:
    """A value of all phases, one after the other."""
    return np.concatenate([value(s) for s in motion.values()])


def by_phase(ax: Axes, motion: PhaseSamples, x: Value, y: Value) -> None:
    """A curve in the colours of the phases."""
    for phase, s in motion.items():
        jumping_curve(ax, s.t, x(s), y(s), color=COLOR[phase], lw=2, label=phase)


def jumping_curve(ax: Axes, t: np.ndarray, x: np.ndarray, y: np.ndarray, **look: Any) -> None:
    """y over x, (k,) each, at times t (k,) [s]: thin where y jumps."""
    size = max(float(np.ptp(y)), 1e-12)
    jumps = (np.abs(np.diff(y)) > JUMP * size) & (np.diff(t) < AT_ONCE * np.ptp(t))
    at = np.flatnonzero(jumps) + 1
    if len(at):
        ax.plot(x, y, color=look["color"], lw=0.6, zorder=1.9)
    ax.plot(np.insert(x, at, np.nan), np.insert(y, at, np.nan), **look)


def mark_lift_off(ax: Axes, solution: Solution) -> None:
    """A dotted line at lift-off [s]."""
    ax.axvline(solution.lift_off, color=BLACK, lw=1.2, ls=":", label=f"lift-off at {solution.lift_off:.3f} s")


def headline(solution: Solution) -> tuple[str, float]:
    """Name and height [m] of what the hop was made for: the clearance, or the body's apex."""
    claims = solution.claims()
    return ("body apex", claims["apex_m"]) if "apex_m" in claims else ("clearance", claims["clearance_m"])


def height_arrow(ax: Axes, x: float, height: float) -> None:
    """A double arrow from the ground to a height [m]."""
    look = {"arrowstyle": "<|-|>", "color": BLACK, "lw": 1.5, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 14}
    ax.annotate("", (x, height), (x, 0), arrowprops=look)
