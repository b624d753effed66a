"""The figure of a choice of motors and gears: clearance against the mass of the drives, the front drawn."""

from pathlib import Path

from matplotlib.figure import Figure

from hopopt.plots.hop import FORMATS
from hopopt.plots.style import BLACK, COLOR, DPI, GREEN, GREY, SMALL, called_after, describe, legend, new_figure
from hopopt.studies.choose.choice import CLEARS, Choice

BLUE = next(iter(COLOR.values()))
LOOKS = {  # of a clearance that is verified and of one that is preliminary
    "verified": {"marker": "o", "color": GREEN, "mec": BLACK, "ms": 11},
    "preliminary": {"marker": "o", "color": "white", "mec": BLUE, "mew": 1.8, "ms": 8},
}


def figure(found: Choice) -> Figure:
    """Clearance [m] over the mass of the drives [kg] of every pair that was solved."""
    picture = new_figure(f"{called_after(found.drives.design)}: clearance of motors and gears by their mass")
    ax, front = picture.subplots(), found.front
    ax.axhline(found.wish, color=BLACK, lw=1.2, ls=":", label=f"asked for: {found.wish:g} m")
    at = [(c.mass or 0.0, c.clearance or 0.0) for c in front]
    ax.step(
        [x for x, _ in at], [y for _, y in at], where="post", color=GREY, lw=1.5, label="no lighter pair clears more"
    )
    for state, look in LOOKS.items():
        chosen = [c for c in found.candidates if c.clearance is not None and c.state == state]
        label = state if state == "verified" else "preliminary: first mesh alone, not verified"
        if chosen:
            x, y = [c.mass or 0.0 for c in chosen], [c.clearance or 0.0 for c in chosen]
            ax.plot(x, y, ls="none", label=label, zorder=3, **look)
    named = {c.pair.name: c for c in (*front, *(c for c in found.clearing if c.outcome == CLEARS))}
    middle = sum(ax.get_xlim()) / 2
    for name, c in named.items():
        mass = c.mass or 0.0
        side = {"xytext": (6, 6), "ha": "left"} if mass < middle else {"xytext": (-6, 6), "ha": "right"}
        ax.annotate(name, (mass, c.clearance or 0.0), textcoords="offset points", fontsize=SMALL, **side)
    legs = f" of {found.drives.legs} legs" if found.drives.legs > 1 else ""
    describe(ax, f"drives of {', '.join(found.drives.joints)}{legs} [kg]", "clearance [m]")
    ax.margins(x=0.15, y=0.1)
    legend(picture)
    return picture


def save(found: Choice, folder: Path) -> None:
    """The figure as PNG and SVG."""
    folder.mkdir(exist_ok=True)
    for kind in FORMATS:
        figure(found).savefig(folder / f"choice.{kind}", dpi=DPI)
