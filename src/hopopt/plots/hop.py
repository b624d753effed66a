"""The figures of a solved hop, as matplotlib objects: the same headless and in notebooks."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hopopt.design.fields import TRUNK
from hopopt.errors import ResultError
from hopopt.leg.scales import weight
from hopopt.ocp.phases import DESCENT, FLIGHT, LANDING, ON_GROUND, STANCE
from hopopt.ocp.rules import steepness
from hopopt.planner.motion import Samples
from hopopt.planner.solution import Solution
from hopopt.plots.stick import stick
from hopopt.plots.studies.swept import obstacle
from hopopt.plots.style import (
    BAND,
    BLACK,
    COLOR,
    DPI,
    FIGURE_SIZE,
    GREEN,
    GREY,
    JOINT_COLORS,
    JOINT_STYLES,
    LIMIT,
    NORMALISED_TIMES,
    PALE,
    TEXT,
    PhaseSamples,
    by_phase,
    describe,
    headline,
    height_arrow,
    joined,
    jumping_curve,
    legend,
    mark_lift_off,
    motion_of,
    solution_figure,
)

FORMATS = ("png", "svg")


# ---- heights ---------------------------------------------------------------------------------------------


def heights(solution: Solution) -> Figure:
    """Heights [m] of foot, joints, body and centre of mass over time [s], with the height reached at the apex."""
    figure = solution_figure(solution, "heights of the hop")
    ax, motion = figure.subplots(), motion_of(solution)
    t = joined(motion, lambda s: s.t)
    for name, label, look in _height_curves(solution):
        ax.plot(t, joined(motion, lambda s, name=name: s.points[name][:, 1]), label=label, **look)
    ax.axhline(0, color=GREY, lw=3, zorder=1, label="ground")
    mark_lift_off(ax, solution)
    describe(ax, "time [s]", "height [m]")
    _annotate_height(ax, solution)
    legend(figure)
    return figure


def _height_curves(solution: Solution) -> Iterable[tuple[str, str, dict[str, Any]]]:
    """Point, label and look of every curve."""
    body, *joints = solution.robot.joints
    yield "foot", "foot", {"color": BLACK, "lw": 3, "zorder": 3}
    for k, name in enumerate(joints):
        yield name, name, {"color": JOINT_COLORS[k % 3], "ls": JOINT_STYLES[k // 3 % 3], "lw": 2}
    yield body, f"body ({body})", {"color": GREEN, "lw": 2}
    if TRUNK in solution.robot.points:
        yield TRUNK, "lowest of the trunk", {"color": GREEN, "lw": 2, "ls": ":"}
    yield "com", "centre of mass", {"color": GREY, "lw": 2, "ls": "--"}


def _annotate_height(ax: Axes, solution: Solution) -> None:
    """What the hop was made for [m], at the apex: where the hop ends there, to the right of it, where no curve is."""
    end, top, (name, height) = solution.end, ax.get_ylim()[1], headline(solution)
    apex = solution.duration
    ends_there, y = (
        not solution.design.hop.lands,
        max(0.5 * height, 0.08 * top),
    )  # two lines of text stay above the ground
    ax.set(xlim=(0, 1.18 * end if ends_there else end), ylim=(-0.05 * top, top))
    ax.set_xticks([t for t in ax.get_xticks() if 0 <= t <= end])
    height_arrow(ax, 1.02 * end if ends_there else apex, height)
    at, side = (1.035 * end, "left") if ends_there else (apex - 0.015 * end, "right")
    ax.text(at, y, f"{name}\n{height:.3f} m", fontsize=TEXT, va="center", ha=side)


# ---- joints ----------------------------------------------------------------------------------------------


def joints(solution: Solution) -> Figure:
    """Angle, speed and torque of every joint, in its units, over time [s], with what they may be."""
    names, motion = solution.robot.joints, motion_of(solution)
    figure = solution_figure(solution, "joint angles, speeds and torques", (max(FIGURE_SIZE[0], 3.4 * len(names)), 7.2))
    grid = figure.subplots(3, len(names), squeeze=False, sharex=True)
    for k, name in enumerate(names):
        _angle(grid[0, k], solution, motion, k)
        by_phase(grid[1, k], motion, lambda s: s.t, lambda s, k=k: s.v[:, k - len(names)])
        if name in solution.design.leg.elastic:
            turning = joined(motion, lambda s, k=k: s.w[:, k])
            grid[1, k].plot(joined(motion, lambda s: s.t), turning, "--", color=GREY, lw=1, label="the drive's speed")
        _torque(grid[2, k], solution, motion, k)
        for ax, label in zip(grid[:, k], solution.design.leg.units(name).labels, strict=True):
            mark_lift_off(ax, solution)
            describe(ax, "time [s]" if ax is grid[2, k] else "", label, name if ax is grid[0, k] else "")
            ax.set_xlim(0, solution.end)
    figure.align_ylabels(grid)
    legend(figure)
    return figure


def _angle(ax: Axes, solution: Solution, motion: PhaseSamples, k: int) -> None:
    """Angle [rad] of joint k and its limits."""
    names = solution.robot.joints
    limits = solution.design.leg.joint[names[k]]
    for limit in (limits.lower, limits.upper):
        ax.axhline(limit, label=f"{solution.design.leg.units(names[k]).place} limit", **LIMIT)
    by_phase(ax, motion, lambda s: s.t, lambda s: s.q[:, k - len(names)])


def _torque(ax: Axes, solution: Solution, motion: PhaseSamples, k: int) -> None:
    """Torque [N m] of joint k over the band that its speed allows."""
    names = solution.robot.joints
    region = solution.region(names[k]).at(_bus_voltage(solution, motion))
    bounds = region.torque_bounds(joined(motion, lambda s: s.w[:, k]))
    t = joined(motion, lambda s: s.t)
    ax.fill_between(t, *bounds, label="what the drive can give", **BAND)
    for bound in bounds:
        ax.plot(t, bound, color=GREY, lw=0.8, gid="torque bound")
    by_phase(ax, motion, lambda s: s.t, lambda s: s.command[:, k])


def _bus_voltage(solution: Solution, motion: PhaseSamples) -> np.ndarray | None:
    """The bus voltage over what it is without load, of all phases one after the other; None without a supply that sags."""
    each = [voltage for s in motion.values() if (voltage := solution.voltage(s)) is not None]
    return np.concatenate(each) if each else None


# ---- operating region ------------------------------------------------------------------------------------


def operating_region(solution: Solution) -> Figure:
    """Each joint's way through its drive's admissible speeds [rad/s] and torques [N m]."""
    names, motion = solution.robot.joints, motion_of(solution)
    voltage = _bus_voltage(solution, motion)
    lowest = None if voltage is None else float(voltage.min())
    columns = min(len(names), 4)
    rows = math.ceil(len(names) / columns)
    figure = solution_figure(
        solution, "operating regions", (max(FIGURE_SIZE[0], 3.8 * columns), max(FIGURE_SIZE[1], 4.2 * rows))
    )
    for k, name in enumerate(names):
        ax = figure.add_subplot(rows, columns, k + 1)
        ax.fill(*solution.region(name).outline().T, fc=PALE, ec=GREY, lw=1.2, label="what the drive can give")
        if lowest is not None:
            corners = solution.region(name).at(lowest).outline()
            ax.plot(
                *np.vstack([corners, corners[:1]]).T,
                "--",
                color=GREY,
                lw=1.2,
                label=f"at the lowest bus voltage, {lowest:.0%}",
            )
        by_phase(ax, motion, lambda s, k=k: s.w[:, k], lambda s, k=k: s.command[:, k])
        _mark_instants(ax, motion, k, solution.end_of_flight)
        describe(ax, *solution.design.leg.units(name).labels[1:], name)
    legend(figure)
    return figure


def _mark_instants(ax: Axes, motion: PhaseSamples, k: int, end: str) -> None:
    """Start, lift-off (on both sides: the torque may jump), the ``end`` of flight and touchdown of joint k."""
    for phase, row, marker, size, label in (
        (STANCE, 0, "o", 9, "start"),
        (STANCE, -1, "s", 9, "lift-off, end of stance"),
        (FLIGHT, 0, "D", 8, "lift-off, start of flight"),
        (FLIGHT, -1, "*", 15, end),
        (DESCENT, -1, "v", 10, "touchdown"),
        (LANDING, -1, "X", 10, "rest"),
    ):
        if phase not in motion:
            continue
        s, look = motion[phase], {"mfc": COLOR[phase], "mec": BLACK, "ms": size, "zorder": 4}
        ax.plot(s.w[row, k], s.command[row, k], marker, label=label, **look)


# ---- ground force ----------------------------------------------------------------------------------------


def ground_force(solution: Solution) -> Figure:
    """Contact force [N] of the ground on the foot in stance, and in a landing, with the leg's weight and the peak."""
    phases = {phase: solution.everywhere(phase, NORMALISED_TIMES) for phase in ON_GROUND if phase in solution.phases}
    largest = max(float(np.linalg.norm(s.f, axis=1).max()) for s in phases.values())
    figure = solution_figure(solution, f"ground force in {' and '.join(phases)}, at most {largest:.0f} N")
    axes = figure.subplots(1, len(phases), squeeze=False, sharey=True)[0]
    heavy, all_of = weight(solution.robot.model), np.concatenate([s.f.ravel() for s in phases.values()])
    between = float(all_of.min(initial=0.0)), float(all_of.max(initial=heavy))
    for ax, (phase, s) in zip(axes, phases.items(), strict=True):
        _forces(ax, solution, s, heavy)
        if phase == STANCE:
            mark_lift_off(ax, solution)
        describe(ax, "time [s]", "force [N]" if ax is axes[0] else "", phase if len(phases) > 1 else "")
        _annotate_peak(ax, s, between, 0.12 * len(phases))
    legend(figure)
    return figure


def _forces(ax: Axes, solution: Solution, s: Samples, heavy: float) -> None:
    """Contact force [N] in a phase, the ``heavy`` weight, and what friction can hold."""
    friction = solution.design.contact.friction
    if friction is not None:
        band = friction * steepness(s.f.shape[1]) * np.maximum(s.f[:, -1], 0.0)
        ax.fill_between(s.t, -band, band, label="horizontal force that friction can hold", **BAND)
    ax.axhline(heavy, color=GREY, lw=1.5, ls="--", label=f"weight, {heavy:.0f} N")
    jumping_curve(ax, s.t, s.t, s.f[:, -1], color=COLOR[STANCE], lw=2.5, label="vertical")
    jumping_curve(ax, s.t, s.t, s.f[:, 0], color=JOINT_COLORS[0], lw=2, label="horizontal (forward +)")
    if s.f.shape[1] > 2:
        jumping_curve(ax, s.t, s.t, s.f[:, 1], color=JOINT_COLORS[2], lw=2, label="sideways (left +)")


def _annotate_peak(ax: Axes, s: Samples, between: tuple[float, float], aside: float) -> None:
    """The largest vertical force [N], written above everything drawn (``between`` two forces) and a share ``aside`` of the
    width from its sides; and what thin lines are."""
    k, (begin, end), (lowest, highest) = int(s.f[:, -1].argmax()), (s.t[0], s.t[-1]), between
    t, peak, span = float(s.t[k]), float(s.f[k, -1]), highest - lowest
    begin = 0.0 if begin < 0.01 * end else begin  # the first sample is a little later, and would hide the tick at 0
    ax.set(xlim=(begin, end + 0.02 * (end - begin)), ylim=(lowest - 0.05 * span, highest + 0.18 * span))
    ax.plot(t, peak, "o", color=COLOR[STANCE], ms=8, zorder=4)
    beside = min(max(t, begin + aside * (end - begin)), end - aside * (end - begin))
    look = {"arrowstyle": "-", "color": GREY, "shrinkB": 5}
    ax.plot([], [], color=COLOR[STANCE], lw=0.6, label="jump at a switch")
    ax.annotate(
        f"vertical peak {peak:.0f} N",
        (t, peak),
        (beside, highest + 0.1 * span),
        fontsize=TEXT,
        ha="center",
        arrowprops=look,
    )


FIGURES: dict[str, Callable[[Solution], Figure]] = {
    "heights": heights,
    "joints": joints,
    "operating_region": operating_region,
    "stick": stick,
    "ground_force": ground_force,
}


def figures_of(solution: Solution) -> dict[str, Callable[[Solution], Figure]]:
    """The figures of a hop, by name: over an obstacle, that of the area it sweeps too."""
    return FIGURES | ({"obstacle": obstacle} if solution.summary.obstacle else {})


def save_all(solution: Solution, folder: Path, formats: Sequence[str] = FORMATS) -> list[Path]:
    """``save_figures`` of a hop."""
    return save_figures(solution, figures_of(solution), folder, formats)


def save_figures(
    shown: Any, figures: Mapping[str, Callable[[Any], Figure]], folder: Path, formats: Sequence[str] = FORMATS
) -> list[Path]:
    """Write every figure of what is shown in every format to a folder, which is made if need be; the files written.

    Raises ResultError, naming the figures that failed and why, when the others are written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths, faults = list[Path](), list[str]()
    for name, draw in figures.items():
        try:
            paths += save_figure(draw(shown), folder / name, formats)
        except Exception as error:  # whatever is wrong with one figure, the others are drawn
            faults.append(f"{name}: {type(error).__name__}: {error}")
    if faults:
        raise ResultError("; ".join(faults))
    return paths


def save_figure(figure: Figure, path: Path, formats: Sequence[str] = FORMATS) -> list[Path]:
    """Write a figure to ``path`` with the ending of each format; the files written."""
    if (layout := figure.get_layout_engine()) is not None:
        layout.execute(figure)
    figure.set_layout_engine(None)  # it costs most and is the same for every format
    paths = [path.with_name(f"{path.name}.{suffix}") for suffix in formats]
    for file in paths:
        figure.savefig(file, dpi=DPI)
    return paths
