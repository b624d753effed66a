"""Where the centimetres are lost: what each strategy misses of the optimum, by cause."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hopopt.comparison.compare import OPTIMUM
from hopopt.plots.controllers.runs_style import Runs, called, runs_figure
from hopopt.plots.style import BLACK, GREY, PALE, SMALL, TEXT, describe, legend
from hopopt.sim.hop_metrics import HopFigures

CM = 100.0  # [cm/m]
BUDGET_PARTS = {  # of HopFigures.budget: label, colour
    "push_m": ("push: height and speed at lift-off", "#D55E00"),
    "timing_m": ("timing: not at the apex", "#CC79A7"),
    "retraction_m": ("retraction: leg not drawn up as far", "#E69F00"),
}


def budget(runs: Runs) -> Figure:
    """What every strategy misses of the optimum's clearance [cm]: push, timing and retraction, from the bound down.

    Each part begins where the one above it ended; a negative one is better than the optimum's, as in the table.
    """
    others = {name: run for name, run in runs.items() if name != OPTIMUM}
    figure = runs_figure(runs, "where the centimetres are lost (+) or gained (-)", (11.0, 2.6 + 0.9 * len(others)))
    ax, bound = figure.subplots(), CM * runs[OPTIMUM].clearance
    ax.axvline(bound, color=BLACK, lw=2, label=f"the optimum's clearance, {bound:.1f} cm")
    for row, run in enumerate(others.values()):
        ax.barh(row, CM * run.clearance, 0.82, color=PALE)
        if run.highest is None:
            ax.text(0.01 * bound, row, "no clearance", fontsize=TEXT, va="center")
        else:
            ax.text(0.01 * bound, row, f"{CM * run.clearance:.1f} cm", fontsize=TEXT, va="center")
            _losses(ax, row, bound, runs[OPTIMUM], run)
    describe(ax, "clearance [cm]", "")
    ax.set_yticks(range(len(others)), [called(name, run) for name, run in others.items()], fontsize=TEXT)
    ax.set(xlim=(0, 1.12 * bound), ylim=(len(others) - 0.5, -0.5))
    ax.grid(False, axis="y")
    legend(figure)
    return figure


def _losses(ax: Axes, row: int, bound: float, best: HopFigures, own: HopFigures) -> None:
    """The parts of the gap [cm], one below the other, each from where the one before it ended."""
    end = bound
    for k, (part, (label, color)) in enumerate(BUDGET_PARTS.items()):
        y, gained = row + 0.28 * (k - 1), CM * (own.budget[part] - best.budget[part])
        ax.barh(y, gained, 0.26, left=end, color=color, label=label)
        ax.text(1.11 * bound, y, f"{round(-gained, 1) or 0:+.1f} cm", fontsize=SMALL, va="center", ha="right")
        if k:
            ax.plot([end, end], [y - 0.41, y + 0.13], color=GREY, lw=0.8)  # it begins where the one above ended
        end += gained
