"""The picture of families of hops: how their clearances cross over an entry, and what the leg does in the leading ones."""

import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Circle
from matplotlib.patheffects import withStroke

from hopopt.evidence.families import Family, FamilyStudy, crossings
from hopopt.evidence.family_optima import POSE_SHARES
from hopopt.leg.kinematics import reach
from hopopt.plots.style import BLACK, DPI, FIGURE_SIZE, GREY, PALE, SMALL, TEXT, describe, height_arrow, new_figure
from hopopt.studies.sweep.shown import entry_label

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")  # Okabe and Ito; one for each line
POSED = 3  # families with stick figures
LINE_LETTERS = 66  # letters of a line above stick figures
LABEL_DISTANCE = 0.055  # of the axis, between two labels
HEADS = ("start", *(f"{100 * share:.0f} %" for share in POSE_SHARES[1:-1]), "lift-off", "apex")


def figure(study: FamilyStudy) -> Figure:
    """Clearances [m] over the entry on the left, if there is one; on the right the leading families at one value."""
    families = study.families()[: len(COLORS)]
    at = common_value(study, families)
    posed = [f for f in families if f.poses[at] is not None][:POSED]
    picture = new_figure(_title(study), (FIGURE_SIZE[0] * 1.15, FIGURE_SIZE[1]))
    right: Figure | SubFigure = picture
    if study.entry:
        left, right = picture.subfigures(1, 2, squeeze=False, width_ratios=(1, 1.25), wspace=0.04)[0]
        _lines(left.subplots(), study, families, at)
    _rows(right, study, posed, at)
    return picture


def save(study: FamilyStudy, folder: Path) -> None:
    """families.png, whole or not at all."""
    temporary = folder / ".families.png"
    figure(study).savefig(temporary, dpi=DPI, format="png")
    temporary.replace(folder / "families.png")


def common_value(study: FamilyStudy, families: Sequence[Family]) -> int:
    """Index of the value at which most of the leading families are known: of those the nearest to where the best changes,
    or to the middle."""
    best = study.best()
    count = len(best)
    changes = [k + 0.5 for k in range(count - 1) if best[k] != best[k + 1]] or [0.5 * (count - 1)]
    known = [sum(f.poses[k] is not None for f in families[:POSED]) for k in range(count)]
    return max(range(count), key=lambda k: (known[k], -min(abs(k - c) for c in changes)))


def _title(study: FamilyStudy) -> str:
    """What the picture says, in a sentence."""
    name, entry, best = study.definition.design.name, study.entry, study.best()
    changes = crossings(study.values, best)
    if entry is None:
        return f"{name}: kinds of hop that are locally the best"
    if len(changes) == 1:
        (low, high), one, other = changes[0]["between"], changes[0]["from"], changes[0]["to"]
        return f"{name}: the best kind of hop changes from {one} to {other} between {entry} = {low:g} and {high:g}"
    if changes:
        return f"{name}: which kind of hop is the best depends on {entry}"
    return f"{name}: one kind of hop, A, is the best at every {entry}"


def _lines(ax: Axes, study: FamilyStudy, families: Sequence[Family], at: int) -> None:
    """A line for each family, named at its end; the best in bold, and where it changes."""
    x = np.array(study.values)
    fine = np.unique(np.concatenate([x, np.linspace(x[:-1], x[1:], 50).ravel()]))
    best = np.fmax.reduce([_between(x, _heights(f), fine) for f in families])
    ax.plot(fine, best, color=PALE, lw=16, solid_capstyle="round", zorder=1)
    for f, color in zip(families, COLORS, strict=False):
        y, refined = _heights(f), np.array([v is not None for v in f.verified])
        ax.plot(x, y, "-", color=color, lw=2.5, zorder=3)
        ax.plot(x, y, "o", color=color, mfc="white", ms=6, mew=1.5, zorder=3)
        ax.plot(x[refined], y[refined], "o", color=color, ms=8, zorder=4)
    ax.axvline(x[at], color=GREY, lw=1.2, ls=":", zorder=0)
    describe(ax, entry_label(study.definition.design, study.entry or ""), "clearance [m]")
    _names(ax, x, families)
    _key(ax, study, at)


def _between(x: np.ndarray, y: np.ndarray, at: np.ndarray) -> np.ndarray:
    """A line's heights [m] at other places, not-a-number where it has none."""
    known = np.isfinite(y)
    return np.interp(at, x[known], y[known], left=np.nan, right=np.nan)


def _heights(f: Family) -> np.ndarray:
    return np.array([np.nan if h is None else h for h in f.clearance])


def _names(ax: Axes, x: np.ndarray, families: Sequence[Family]) -> None:
    """Each family's letter to the right of its last point, none on top of another."""
    low, high = ax.get_ylim()
    ends = []
    for f, color in zip(families, COLORS, strict=False):
        k = int(np.flatnonzero(np.isfinite(_heights(f)))[-1])
        ends.append((k, float(_heights(f)[k]), f.name, color))
    placed: list[tuple[int, float]] = []
    for k, y, name, color in sorted(ends, key=lambda end: -end[1]):
        above = [other for column, other in placed if column == k]
        place = min([y, *(other - LABEL_DISTANCE * (high - low) for other in above)])
        placed.append((k, place))
        ax.annotate(
            name, (x[k], place), (9, 0), textcoords="offset points", color=color, fontsize=TEXT + 3, fontweight="bold",
            va="center", zorder=6, path_effects=[withStroke(linewidth=4, foreground="white")],
        )  # fmt: skip
    ax.margins(x=0.09)


def _key(ax: Axes, study: FamilyStudy, at: int) -> None:
    """What marks and lines mean, above the axes."""
    words = "wide band: the best    ● refined, verified    ○ first mesh only\n"
    words += f"dotted: {study.entry} = {study.values[at]:g}, shown on the right"
    if False in [v for f in study.families() for v in f.verified]:
        words = words.replace("refined, verified", "refined (not all verified)")
    ax.set_title(words, fontsize=SMALL, color=BLACK, loc="left")


def _rows(figure: Figure | SubFigure, study: FamilyStudy, families: Sequence[Family], at: int) -> None:
    """One row of poses for each family, all to one scale, columns at the same shares of the stance."""
    drawn = {f.name: _placed(f.poses[at]) for f in families}
    size = reach(study.definition.design.leg)
    left, right = (g([g(p[..., 0]) for p in drawn.values()]) for g in (np.min, np.max))
    step, top = float(right - left) + 0.25 * size, float(max(p[..., 1].max() for p in drawn.values())) + 0.16 * size
    axes = figure.subplots(len(families), squeeze=False)[:, 0]
    for ax, f in zip(axes, families, strict=True):
        color = COLORS[ord(f.name[-1]) - ord("A")]
        _row(ax, drawn[f.name], color, step, size)
        middle = 0.5 * float(left + right)
        ax.set(
            xlim=(left - 0.2 * size, left + len(HEADS) * step + 0.45 * size), ylim=(-0.03 * size, top), aspect="equal"
        )
        ax.set_xticks([middle + k * step for k in range(len(HEADS))], HEADS, fontsize=SMALL)
        ax.set_yticks([])
        ax.tick_params(length=0)
        ax.spines[:].set_visible(False)
        words = "\n".join(textwrap.wrap(f"{f.name}   {f.words}", LINE_LETTERS if study.entry else 2 * LINE_LETTERS))
        ax.set_title(words, fontsize=SMALL, color=color, loc="left", fontweight="bold")
        height = f.clearance[at] or 0.0
        x = middle + (len(HEADS) - 1) * step + 0.55 * step
        height_arrow(ax, x, height)
        ax.text(x + 0.05 * size, 0.5 * height, f"{height:.3f} m", fontsize=SMALL, va="center")
    axes[-1].set_xlabel("share of the stance; pale line: above the foot", fontsize=SMALL)


def _placed(poses: np.ndarray | None) -> np.ndarray:
    """Poses (poses, points, 2) [m] with x from where the foot stands, at the apex from below the body."""
    poses = np.array(poses)
    poses[:-1, :, 0] -= poses[0, -1, 0]
    poses[-1, :, 0] -= poses[-1, 0, 0]
    return poses


def _row(ax: Axes, poses: np.ndarray, color: str, step: float, size: float) -> None:
    ax.axhline(0, color=GREY, lw=3, zorder=1)
    for k, pose in enumerate(poses):
        x, z = pose[:, 0] + k * step, pose[:, 1]
        if k < len(poses) - 1:
            ax.plot([k * step] * 2, [0, 1.05 * size], color=PALE, lw=1.2, zorder=0)  # above the foot
        ax.plot(x, z, "-o", color=color, lw=3, ms=5, mfc="white", zorder=3)
        ax.add_patch(Circle((x[0], z[0]), 0.09 * size, fc=color, ec="none", zorder=4))
