"""What to change first, as a tornado: a bar for each entry, the longest on top."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hopopt.planner.solution import Solution
from hopopt.plots.hop import save_figure
from hopopt.plots.style import BLACK, SMALL, describe, headline, legend, solution_figure
from hopopt.studies.influence import CM, PERCENT, Influence

MOST_BARS = 18
SHORTEST_BAR = 2e-3  # share of the longest bar, below which one is not drawn
COLORS = {"the leg": "#0072B2", "one joint's part of it": "#56B4E9", "what the hop is asked to be": "#E69F00"}


def tornado(solution: Solution, influences: Sequence[Influence]) -> Figure:
    """What 1 % more of each entry changes in the height [cm], the largest on top; diamonds: solved again. Where 1 % less
    changes something else, an outlined bar says what."""
    least = SHORTEST_BAR * max((i.most_cm for i in influences), default=0.0)
    shown = [i for i in influences if i.most_cm > least][:MOST_BARS]
    what, height = headline(solution)
    figure = solution_figure(
        solution, f"what 1 % more changes of {height:.3f} m {what}", (11.0, 2.4 + 0.36 * len(shown))
    )
    ax = figure.subplots()
    for row, i in enumerate(shown):
        _bar(ax, row, i)
    ax.axvline(0, color=BLACK, lw=1.2)
    describe(ax, f"change of the {what} [cm] for 1 % more of the entry's value", "")
    ax.set_yticks(range(len(shown)), [f"{i.name} = {i.value:g} {i.unit}".removesuffix(" 1") for i in shown])
    ax.set_ylim(len(shown) - 0.4, -0.6)
    ax.margins(x=0.14)
    ax.grid(False, axis="y")
    legend(figure)
    return figure


def _bar(ax: Axes, row: int, i: Influence) -> None:
    kind = "one joint's part of it" if i.part_of else ("the leg" if i.of_leg else "what the hop is asked to be")
    ax.barh(row, i.cm_per_percent, 0.5 if i.part_of else 0.74, label=kind, color=COLORS[kind])
    if i.kinked:
        ax.barh(row, i.cm_per_percent_less, 0.3, label="1 % less, where it differs", fill=False, ec=BLACK)
    side = 1 if i.cm_per_percent > 0 else -1
    same_side = [i.cm_per_percent_less] if i.kinked and i.cm_per_percent_less * side > 0 else []
    longest = side * max(abs(x) for x in (i.cm_per_percent, *same_side))  # the label stands clear of both bars
    ax.annotate(
        f"{i.cm_per_percent:+#.2g}".rstrip("."), (longest, row), xytext=(9 * side, 0), textcoords="offset points",
        ha="left" if side > 0 else "right", va="center", fontsize=SMALL,
    )  # fmt: skip
    if i.difference is not None and not i.difference.fault:
        gained = CM * PERCENT * i.value * (i.difference.forward if i.kinked else i.difference.central)
        ax.plot(gained, row, "D", ms=6, mfc="white", mec=BLACK, label="solved again, a little more and less", zorder=4)


def save_all(solution: Solution, influences: Sequence[Influence], folder: Path) -> list[Path]:
    """Write the figure to a folder; the files written."""
    return save_figure(tornado(solution, influences), folder / "tornado")
