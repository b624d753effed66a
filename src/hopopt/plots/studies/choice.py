"""The figure of a choice of motors and gears: clearance against the mass of the drives or their peak power, the front drawn."""

from pathlib import Path

from matplotlib.figure import Figure

from hopopt.plots.hop import FORMATS
from hopopt.plots.style import BLACK, COLOR, DPI, GREEN, GREY, SMALL, called_after, describe, legend, new_figure
from hopopt.studies.choose.choice import CLEARS, ORDERS, Choice

BLUE = next(iter(COLOR.values()))
LOOKS = {  # of a clearance that is verified and of one that is preliminary
    "verified": {"marker": "o", "color": GREEN, "mec": BLACK, "ms": 11},
    "preliminary": {"marker": "o", "color": "white", "mec": BLUE, "mew": 1.8, "ms": 8},
}
AGAINST = {"mass": "mass", "peak_power": "peak-power"}  # figures by name, and the order of candidates that each shows


def figure(found: Choice, against: str = "mass") -> Figure:
    """Clearance [m] of every pair that was solved, over the mass of the drives [kg] or the most that they give together [W]."""
    size = ORDERS[AGAINST[against]]
    picture = new_figure(
        f"{called_after(found.drives.design)}: clearance of motors and gears by their {against.replace('_', ' ')}"
    )
    ax, front = picture.subplots(), found.front(AGAINST[against])
    ax.axhline(found.wish, color=BLACK, lw=1.2, ls=":", label=f"asked for: {found.wish:g} m")
    at = [(size(c) or 0.0, c.clearance or 0.0) for c in front]
    ax.step(
        [x for x, _ in at], [y for _, y in at], where="post", color=GREY, lw=1.5, label="none with less clears more"
    )
    for state, look in LOOKS.items():
        chosen = [c for c in found.candidates if c.clearance is not None and c.state == state]
        label = state if state == "verified" else "preliminary: coarse meshes alone, not verified"
        if chosen:
            x, y = [size(c) or 0.0 for c in chosen], [c.clearance or 0.0 for c in chosen]
            ax.plot(x, y, ls="none", label=label, zorder=3, **look)
    named = {c.pair.name: c for c in front if c.outcome == CLEARS or not found.clearing}
    middle = sum(ax.get_xlim()) / 2
    for name, c in named.items():
        place = size(c) or 0.0
        side = {"xytext": (6, 6), "ha": "left"} if place < middle else {"xytext": (-6, 6), "ha": "right"}
        ax.annotate(name, (place, c.clearance or 0.0), textcoords="offset points", fontsize=SMALL, **side)
    legs = f" of {found.drives.legs} legs" if found.drives.legs > 1 else ""
    of = f"drives of {', '.join(found.drives.joints)}{legs}"
    describe(ax, f"{of} [kg]" if against == "mass" else f"most that {of} give together [W]", "clearance [m]")
    ax.margins(x=0.15, y=0.1)
    legend(picture)
    return picture


def save(found: Choice, folder: Path) -> None:
    """The figure as PNG and SVG."""
    folder.mkdir(exist_ok=True)
    for name in AGAINST:
        for kind in FORMATS:
            figure(found, name).savefig(folder / f"choice_{name}.{kind}", dpi=DPI)
