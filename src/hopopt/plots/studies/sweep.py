"""Figures of a design study: a curve over one entry, a map over two, one panel for each of more.

Points and cells have the colour of the limit that holds their hop back; a map has its values written into its cells, or
as contours where there are too many. Points without a hop are never left out: they are crosses, and hatched cells of a map.
"""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hopopt.ocp.objectives.registry import find
from hopopt.plots.hop import FORMATS
from hopopt.plots.style import (
    BLACK,
    COLOR,
    DPI,
    GREEN,
    GREY,
    PALE,
    SMALL,
    TEXT,
    called_after,
    describe,
    legend,
    new_figure,
)
from hopopt.studies.sweep.definition import Axis
from hopopt.studies.sweep.point_file import ENDED, IMPOSSIBLE, NOT_SOLVED, NOT_VERIFIED
from hopopt.studies.sweep.run import Study
from hopopt.studies.sweep.shown import cell_edges, colors, entry_label, kind_label, value

ORANGE = COLOR["flight"]
MOST_WRITTEN_CELLS = 120  # cells of a map that have room for their values
FAILED_COLORS = {
    NOT_VERIFIED: (ORANGE, "x", "///"), NOT_SOLVED: (GREY, "x", "xxx"), IMPOSSIBLE: (BLACK, "+", "..."),
    ENDED: (BLACK, "x", "+++"),
}  # fmt: skip


def figures(study: Study) -> dict[str, Figure]:
    """The study's figures by name."""
    axes = study.definition.axes
    draw = {1: _curve, 2: _map}.get(len(axes), _panels)
    mark = ", preliminary: the first mesh alone" if study.definition.preliminary else ""
    figure = new_figure(
        f"{called_after(study.definition.design)}: best {study.definition.objective} over {_listed(study)}{mark}"
    )
    draw(figure, study)
    legend(figure)
    return {"study": figure}


def save_all(study: Study, folder: Path) -> None:
    """Every figure as PNG and SVG."""
    folder.mkdir(exist_ok=True)
    for name, figure in figures(study).items():
        for kind in FORMATS:
            figure.savefig(folder / f"{name}.{kind}", dpi=DPI)


def _listed(study: Study) -> str:
    names = [axis.entry for axis in study.definition.axes]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _goal(study: Study) -> str:
    """The objective with its unit."""
    return f"{study.definition.objective} [{find(study.definition.objective).unit}]"


def _heights(study: Study) -> np.ndarray:
    """Clearance [m], or another objective's value; not-a-number where there is none."""
    return np.array([value(study, p) for p in study.points])


def _curve(figure: Figure, study: Study) -> None:
    ax, x, z = figure.subplots(), study.definition.points[:, 0], _heights(study)
    order = np.argsort(x)
    if not study.definition.axes[0].names:
        ax.plot(x[order], z[order], "-", color=GREY, lw=1.5, zorder=2)  # broken where a point failed
    _by_limit(ax, study, x, z)
    _failures_below(ax, study, x, z)
    _best(ax, study, x, z)
    describe(ax, entry_label(study.definition.design, study.definition.axes[0].entry), _goal(study))
    _name(ax.xaxis, study.definition.axes[0])


def _panels(figure: Figure, study: Study) -> None:
    """The heights over each entry, whatever the others are."""
    d, z = len(study.definition.axes), _heights(study)
    for k, ax in enumerate(np.ravel(figure.subplots(1, d, sharey=True))):
        x = study.definition.points[:, k]
        _by_limit(ax, study, x, z)
        _failures_below(ax, study, x, z)
        _best(ax, study, x, z)
        describe(
            ax, entry_label(study.definition.design, study.definition.axes[k].entry), _goal(study) if k == 0 else ""
        )
        _name(ax.xaxis, study.definition.axes[k])


def _name(line: Any, axis: Axis) -> None:
    """Names of motors or gears along a line of the figure, in place of numbers."""
    if axis.names:
        line.set_ticks(axis.values, axis.names)


def _by_limit(ax: Axes, study: Study, x: np.ndarray, y: np.ndarray, size: float = 8) -> None:
    """A dot for each verified point in the colour of its limit, and for each preliminary one in that of its family."""
    for kind, color in colors(study).items():
        at = [k for k, p in enumerate(study.points) if p.has_value and p.kind == kind]
        ax.plot(
            x[at], y[at], "o", color=color, mec=BLACK, mew=0.6, ms=size, label=kind_label(study.points[at[0]]), zorder=3
        )


def _failures_below(ax: Axes, study: Study, x: np.ndarray, z: np.ndarray) -> None:
    """Failed points as marks in a strip below the heights z, where the axis has no scale."""
    if all(p.has_value for p in study.points):
        return
    known = z[np.isfinite(z)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    span = (high - low) or 0.1 * abs(high) or 1.0
    bottom, top = low - 0.25 * span, high + 0.1 * span
    strip = 0.1  # of the axis
    ax.set_ylim(bottom, top)
    ax.set_yticks([t for t in ax.get_yticks() if bottom + strip * (top - bottom) < t <= top])
    ax.fill_between([0, 1], 0, strip, color=PALE, lw=0, zorder=0, transform=ax.transAxes)
    if (place := ax.get_subplotspec()) and place.is_first_col():
        ax.text(-0.01, strip / 2, "no value", fontsize=SMALL, ha="right", va="center", transform=ax.transAxes)
    _failed(ax, study, x, np.full(len(x), strip / 2), transform=ax.get_xaxis_transform())


def _failed(ax: Axes, study: Study, x: np.ndarray, y: np.ndarray, **look: Any) -> None:
    """A mark for each point without a verified hop, by its outcome."""
    for outcome, (color, marker, _) in FAILED_COLORS.items():
        at = [k for k, p in enumerate(study.points) if p.outcome == outcome]
        if at:
            ax.plot(x[at], y[at], marker, color=color, ms=10, mew=2, label=outcome, **look)


def _best(ax: Axes, study: Study, x: np.ndarray, y: np.ndarray) -> None:
    best = study.best
    if best:
        label = f"best: {_heights(study)[best.index]:.4f} {find(study.definition.objective).unit}"
        ring = {"mfc": "none", "mec": GREEN, "mew": 3, "ms": 16, "ls": "none"}  # the point itself stays in sight
        ax.plot(x[best.index], y[best.index], "o", label=label, zorder=5, **ring)


def _map(figure: Figure, study: Study) -> None:
    ax, z, (x, y) = figure.subplots(), _heights(study), study.definition.points.T
    if study.definition.shape:
        _cells(ax, study, z.reshape(study.definition.shape))
    else:
        _by_limit(ax, study, x, y, 10)
        for at in np.flatnonzero(np.isfinite(z))[:MOST_WRITTEN_CELLS]:
            ax.annotate(
                f"{z[at]:#.4g}", (x[at], y[at]), (0, 7), textcoords="offset points", ha="center", fontsize=SMALL
            )
        _failed(ax, study, x, y)
        _best(ax, study, x, y)
    first, second = (entry_label(study.definition.design, axis.entry) for axis in study.definition.axes)
    describe(ax, first, second, _goal(study))
    for line, axis in zip((ax.xaxis, ax.yaxis), study.definition.axes, strict=True):
        _name(line, axis)
    ax.grid(False)


def _cells(ax: Axes, study: Study, z: np.ndarray) -> None:
    """A grid's cells with their values z in the colour of their limit; those without a verified hop are hatched, and the
    best has a frame."""
    edges = [cell_edges(np.array(axis.values)) for axis in study.definition.axes]
    order = np.ix_(*(np.argsort(axis.values) for axis in study.definition.axes))
    grid: Any = np.array(study.points, dtype=object).reshape(z.shape)[order]
    z, by_limit = z[order], colors(study)
    shortest = min(8.0 / z.shape[0], 3.6 / z.shape[1] * 2.5)  # [in] that a value has in a cell
    for i, j in np.ndindex(z.shape):
        p, (a, b), (c, d) = grid[i, j], edges[0][i : i + 2], edges[1][j : j + 2]
        corners = [a, b, b, a], [c, c, d, d]
        if p.has_value:
            ax.fill(*corners, fc=by_limit[p.kind], ec="white", lw=0.5, alpha=0.75, label=kind_label(p))
            if z.size <= MOST_WRITTEN_CELLS:
                size = min(TEXT, 20 * shortest)
                ax.text((a + b) / 2, (c + d) / 2, f"{z[i, j]:#.4g}", fontsize=size, ha="center", va="center")
        else:
            color, _, hatch = FAILED_COLORS[p.outcome]
            ax.fill(*corners, facecolor="white", edgecolor=color, hatch=hatch, lw=0, label=p.outcome)
        if p is study.best:
            label = f"best: {z[i, j]:.4f} {find(study.definition.objective).unit}"
            ax.fill(*corners, fill=False, ec=BLACK, lw=3.5, label=label, zorder=5)
    if z.size > MOST_WRITTEN_CELLS and min(z.shape) > 1:
        middle = [np.sort(np.array(axis.values)) for axis in study.definition.axes]
        ax.clabel(ax.contour(*middle, z.T, colors=BLACK, linewidths=0.8), fontsize=SMALL)
    ax.set(xlim=edges[0][[0, -1]], ylim=edges[1][[0, -1]])
