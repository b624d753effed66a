"""Figures of a design study: a curve over one entry, a map over two, one panel for each of more.

Points without a verified hop are never left out: they are crosses, and hatched cells of a map.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hopopt.ocp.objectives import find
from hopopt.plots.style import (
    BLACK,
    COLOR,
    DPI,
    GREEN,
    GREY,
    PALE,
    SMALL,
    TEXT,
    describe,
    entry_label,
    legend,
    new_figure,
)
from hopopt.studies.sweep.point_file import IMPOSSIBLE, NOT_SOLVED, NOT_VERIFIED

if TYPE_CHECKING:
    from hopopt.studies.sweep.run import Study

BLUE, ORANGE = list(COLOR.values())[:2]
FAILED = {NOT_VERIFIED: (ORANGE, "x", "///"), NOT_SOLVED: (GREY, "x", "xxx"), IMPOSSIBLE: (BLACK, "+", "...")}


def figures(study: "Study") -> dict[str, Figure]:
    """The study's figures by name."""
    axes = study.definition.axes
    draw = {1: _curve, 2: _map}.get(len(axes), _panels)
    figure = new_figure(f"{study.definition.design.name}: best {study.definition.objective} over {_listed(study)}")
    draw(figure, study)
    legend(figure)
    return {"study": figure}


def save_all(study: "Study", folder: Path) -> None:
    """Every figure as PNG and SVG."""
    folder.mkdir(exist_ok=True)
    for name, figure in figures(study).items():
        for kind in ("png", "svg"):
            figure.savefig(folder / f"{name}.{kind}", dpi=DPI)


def _listed(study: "Study") -> str:
    names = [axis.entry for axis in study.definition.axes]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _goal(study: "Study") -> str:
    """The objective with its unit."""
    return f"{study.definition.objective} [{find(study.definition.objective).unit}]"


def _heights(study: "Study") -> np.ndarray:
    """Clearance [m], or another objective's value; not-a-number where it is not verified."""
    what = "clearance_m" if study.definition.objective == "clearance" else "objective_value"
    return np.array([float(getattr(p, what)) if p.verified else np.nan for p in study.points])


def _curve(figure: Figure, study: "Study") -> None:
    ax, x, z = figure.subplots(), study.definition.points[:, 0], _heights(study)
    order = np.argsort(x)
    ax.plot(x[order], z[order], "o-", color=BLUE, lw=2, ms=5, label="verified")  # broken where a point failed
    _failures_below(ax, study, x, z)
    _best(ax, study, x, z)
    describe(ax, entry_label(study.definition.design, study.definition.axes[0].entry), _goal(study))


def _panels(figure: Figure, study: "Study") -> None:
    """The heights over each entry, whatever the others are."""
    d, z = len(study.definition.axes), _heights(study)
    for k, ax in enumerate(np.ravel(figure.subplots(1, d, sharey=True))):
        x = study.definition.points[:, k]
        ax.plot(x, z, "o", color=BLUE, ms=5, label="verified")
        _failures_below(ax, study, x, z)
        _best(ax, study, x, z)
        describe(
            ax, entry_label(study.definition.design, study.definition.axes[k].entry), _goal(study) if k == 0 else ""
        )


def _failures_below(ax: Axes, study: "Study", x: np.ndarray, z: np.ndarray) -> None:
    """Failed points as marks in a strip below the heights z, where the axis has no scale."""
    if all(p.verified for p in study.points):
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
    for outcome, (color, marker, _) in FAILED.items():
        at = [k for k, p in enumerate(study.points) if p.outcome == outcome]
        if at:
            ax.plot(
                x[at], np.full(len(at), strip / 2), marker, color=color, ms=10, mew=2, label=outcome,
                transform=ax.get_xaxis_transform(),
            )  # fmt: skip


def _best(ax: Axes, study: "Study", x: np.ndarray, y: np.ndarray) -> None:
    best = study.best
    if best:
        label = f"best: {_heights(study)[best.index]:.4f} {find(study.definition.objective).unit}"
        ax.plot(x[best.index], y[best.index], "*", color=GREEN, ms=20, mec=BLACK, label=label, zorder=5)


def _map(figure: Figure, study: "Study") -> None:
    ax, z, (x, y) = figure.subplots(), _heights(study), study.definition.points.T
    low, high = (float(f(z)) if np.isfinite(z).any() else 0.0 for f in (np.nanmin, np.nanmax))
    shape = study.definition.shape
    if shape:
        _cells(ax, study, z.reshape(shape), low, high)
    shown = ax.scatter(x, y, c=z, vmin=low, vmax=high, cmap="viridis", s=20 if shape else 90, edgecolors=BLACK, lw=0.5)
    for outcome, (color, marker, _) in FAILED.items():
        at = [k for k, p in enumerate(study.points) if p.outcome == outcome]
        if at:
            ax.plot(x[at], y[at], marker, color=color, ms=10, mew=2, label=outcome)
    _best(ax, study, x, y)
    bar = figure.colorbar(shown, ax=ax)
    bar.set_label(_goal(study), fontsize=TEXT)
    bar.ax.tick_params(labelsize=SMALL)
    describe(
        ax,
        entry_label(study.definition.design, study.definition.axes[0].entry),
        entry_label(study.definition.design, study.definition.axes[1].entry),
    )


def _cells(ax: Axes, study: "Study", z: np.ndarray, low: float, high: float) -> None:
    """A grid's cells coloured by height; those without a verified hop are hatched, so the feasible region stands out."""
    edges = [_edges(np.array(axis.values)) for axis in study.definition.axes]
    order = [np.argsort(axis.values) for axis in study.definition.axes]
    ax.pcolormesh(*edges, z[np.ix_(*order)].T, vmin=low, vmax=high, cmap="viridis", alpha=0.85)
    outcome = np.array([p.outcome for p in study.points]).reshape(z.shape)[np.ix_(*order)]
    for i, j in np.argwhere(np.isnan(z[np.ix_(*order)])):
        color, _, hatch = FAILED[str(outcome[i, j])]
        (a, b), (c, d) = edges[0][i : i + 2], edges[1][j : j + 2]
        ax.fill([a, b, b, a], [c, c, d, d], facecolor="white", edgecolor=color, hatch=hatch, lw=0)


def _edges(values: np.ndarray) -> np.ndarray:
    """Edges of cells around sorted values."""
    v = np.sort(values)
    if len(v) == 1:
        return np.array([v[0] - 0.5, v[0] + 0.5])
    middle = 0.5 * (v[1:] + v[:-1])
    return np.concatenate([[2 * v[0] - middle[0]], middle, [2 * v[-1] - middle[-1]]])
