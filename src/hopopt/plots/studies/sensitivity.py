"""What to change first, as a tornado: a bar for each entry, the longest on top."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hopopt.planner.solution import Solution
from hopopt.plots.hop import save_figure
from hopopt.plots.style import BLACK, SMALL, describe, headline, legend, solution_figure
from hopopt.studies.influence import PERCENT, Influence

MOST_BARS = 18
CM = 100.0  # [cm/m]
SHORTEST_BAR = 2e-3  # share of the longest bar, below which one is not drawn
COLORS = {"the leg": "#0072B2", "one joint's part of it": "#56B4E9", "what the hop is asked to be": "#E69F00"}


def tornado(solution: Solution, influences: Sequence[Influence]) -> Figure:
    """What 1 % more of each entry changes in the objective (of a height: [cm]), the largest on top; diamonds: solved again. Where 1 % less
    changes something else, an outlined bar says what."""
    least = SHORTEST_BAR * max((i.most for i in influences), default=0.0)
    shown = [i for i in influences if i.most > least][:MOST_BARS]
    summary = solution.summary
    if summary.objective_unit == "m":
        (what, height), (unit, times) = headline(solution), ("cm", CM)
        reached = f"{height:.3f} m {what}"
    else:
        what, unit, times = solution.objective.replace("_", " "), summary.objective_unit, 1.0
        reached = f"{summary.reached:.4g} {unit} {what}"
    figure = solution_figure(solution, f"what 1 % more changes of {reached}", (11.0, 2.4 + 0.36 * len(shown)))
    ax = figure.subplots()
    for row, i in enumerate(shown):
        _bar(ax, row, i, times)
    ax.axvline(0, color=BLACK, lw=1.2)
    describe(ax, f"change of the {what} [{unit}] for 1 % more of the entry's value", "")
    ax.set_yticks(range(len(shown)), [f"{i.name} = {i.value:g} {i.unit}".removesuffix(" 1") for i in shown])
    ax.set_ylim(len(shown) - 0.4, -0.6)
    ax.margins(x=0.14)
    ax.grid(False, axis="y")
    legend(figure)
    return figure


def _bar(ax: Axes, row: int, i: Influence, times: float) -> None:
    kind = "one joint's part of it" if i.part_of else ("the leg" if i.of_leg else "what the hop is asked to be")
    more, less = times * i.per_percent, times * i.per_percent_less
    ax.barh(row, more, 0.5 if i.part_of else 0.74, label=kind, color=COLORS[kind])
    if i.kinked:
        ax.barh(row, less, 0.3, label="1 % less, where it differs", fill=False, ec=BLACK)
    side = 1 if more > 0 else -1
    same_side = [less] if i.kinked and less * side > 0 else []
    longest = side * max(abs(x) for x in (more, *same_side))  # the label stands clear of both bars
    ax.annotate(
        f"{more:+#.2g}".rstrip("."), (longest, row), xytext=(9 * side, 0), textcoords="offset points",
        ha="left" if side > 0 else "right", va="center", fontsize=SMALL,
    )  # fmt: skip
    if i.difference is not None and not i.difference.fault:
        gained = times * PERCENT * i.value * (i.difference.forward if i.kinked else i.difference.central)
        ax.plot(gained, row, "D", ms=6, mfc="white", mec=BLACK, label="solved again, a little more and less", zorder=4)


def save_all(solution: Solution, influences: Sequence[Influence], folder: Path) -> list[Path]:
    """Write the figure to a folder; the files written."""
    return save_figure(tornado(solution, influences), folder / "tornado")
