"""The figure of a Pareto front: what a clearance costs at least, with the highest hop (whose cost is what it happens
to be) and the points that failed marked."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from hopopt.plots.hop import FORMATS
from hopopt.plots.style import BLACK, COLOR, DPI, GREEN, describe, legend, new_figure

if TYPE_CHECKING:
    from hopopt.studies.pareto.front import Front

BLUE, ORANGE = list(COLOR.values())[:2]
HIGHEST = "highest, with what it happens to cost"


def figure(front: "Front") -> Figure:
    """The other objective [its unit] over the clearance [m]."""
    name, unit = front.against.words, front.against.unit
    picture = new_figure(f"{front.design.title or front.design.name}: the least {name} for each clearance")
    ax, good = (
        picture.subplots(),
        np.array([(p.clearance_m, p.value) for p in front.verified_points], float).reshape(-1, 2),
    )
    joined = "verified hops (joined to guide the eye)"
    ax.plot(*good.T, "o--", color=BLUE, lw=1.2, ms=8, clip_on=False, label=joined)
    least = sorted((p for p in front.verified_points if p.least), key=lambda p: p.value or 0.0)
    ends = least[:1], [p for p in front.verified_points if not p.least]
    for point, label, marker, color in zip(ends, ("least", HIGHEST), "s*", (ORANGE, GREEN), strict=True):
        for x, y in ((p.clearance_m or 0.0, p.value or 0.0) for p in point):
            text = f"{label}: {y:.4g}{'' if unit in ('', '1') else f' {unit}'} at {x:.3f} m"
            ax.plot(x, y, marker, color=color, ms=14, mec=BLACK, label=text, zorder=4, clip_on=False)
    for p in front.points:
        if not p.verified:
            ax.axvline(p.asked_m, color=BLACK, lw=1.5, ls=":", label="no verified hop at this clearance")
    describe(ax, "clearance [m]", front.against.label)
    ax.set_ylim(bottom=0)
    legend(picture)
    return picture


def save(front: "Front", folder: Path) -> None:
    """The figure as PNG and SVG."""
    folder.mkdir(exist_ok=True)
    for kind in FORMATS:
        figure(front).savefig(folder / f"front.{kind}", dpi=DPI)
