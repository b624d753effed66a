"""What the figures of simulated runs share: how many are drawn, one look a strategy, the title, names, and the clock."""

from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from hopopt.comparison.compare import OPTIMUM
from hopopt.plots.style import BLACK, FIGURE_SIZE, TITLE, Picture, called_after, new_figure
from hopopt.sim.hop_metrics import HopFigures

COLORS = (  # Okabe and Ito, all that show on white, and darker ones of Tol's: one for each built-in strategy
    "#0072B2", "#56B4E9", "#D55E00", "#E69F00", "#009E73", "#CC79A7", "#882255", "#332288", "#999933", "#661100", "#999999",
    "#44AA99",
)  # fmt: skip
STYLES = ("-", (0, (4, 1.5)), "-.", ":")  # in turn, for dashes over a full line show both
LIMIT_MARK = "*"  # after the name of a run that did not keep every limit

MOST_RUNS = 5  # runs in a figure; with more it cannot be read

Runs = Mapping[str, HopFigures]


def few(draw: Callable[[Runs], Figure]) -> Callable[[Runs], Figure]:
    """A figure of at most MOST_RUNS runs: the optimum, then those that clear most, in the order given; the title says so."""

    @wraps(draw)
    def drawn(runs: Runs) -> Figure:
        ranked = sorted(runs, key=lambda name: (name != OPTIMUM, -runs[name].clearance))[:MOST_RUNS]
        figure = draw({name: run for name, run in runs.items() if name in ranked})
        if len(runs) > MOST_RUNS:
            figure.suptitle(f"{figure.get_suptitle()} (the highest {MOST_RUNS} of {len(runs)})", fontsize=TITLE)
        return figure

    return drawn


def since_lift_off(run: HopFigures) -> np.ndarray:
    """Times of a run's samples from its lift-off on, (k,) [s]; from its beginning where it never lifts off."""
    return run.trace.t - run.lift_off["time_s"]


def looks(runs: Runs) -> dict[str, dict[str, Any]]:
    """Colour, line style and width of every run; the optimum black, thick, and below the others."""
    found: dict[str, dict[str, Any]] = {}
    for k, name in enumerate(name for name in runs if name != OPTIMUM):
        color, style = COLORS[k % len(COLORS)], STYLES[(k % 2 + k // len(COLORS) * 2) % 4]
        found[name] = {"color": color, "ls": style, "lw": 1.8, "zorder": 3 + 0.01 * k}
    return {**found, OPTIMUM: {"color": BLACK, "lw": 3.2, "zorder": 2.5, "solid_capstyle": "butt"}}


def by_stance(runs: Runs) -> tuple[dict[str, HopFigures], dict[str, dict[str, Any]]]:
    """Runs whose stance differs, for figures of stance, and their looks; runs of the same stance are named together
    and look as the first of them does in every figure."""
    groups: list[tuple[list[str], HopFigures]] = []
    for name, run in runs.items():
        same = next((names for names, other in groups if _same_stance(run, other)), None)
        if same is None:
            groups.append(([name], run))
        else:
            same.append(name)
    look = looks(runs)
    return {", ".join(names): run for names, run in groups}, {", ".join(names): look[names[0]] for names, _ in groups}


def _same_stance(a: HopFigures, b: HopFigures) -> bool:
    """Whether both moved alike in stance and are marked alike."""
    ways = [(run.trace.t[run.stance], run.trace.q[run.stance]) for run in (a, b)]
    alike = all(np.array_equal(x, y) for x, y in zip(*ways, strict=True))
    return alike and bool(a.limits_exceeded) == bool(b.limits_exceeded)


def runs_figure(runs: Runs, title: str, size: tuple[float, float] = FIGURE_SIZE) -> Picture:
    """An empty figure that says which problem it shows, and whether a run did not keep its limits."""
    marked = any(f.limits_exceeded for f in runs.values())
    note = f" ({LIMIT_MARK}: a limit exceeded)" if marked else ""
    return new_figure(f"{called_after(next(iter(runs.values())).design)}: {title}{note}", size)


def called(name: str, run: HopFigures) -> str:
    """A run's name, marked if it did not keep every limit of the problem."""
    return name + LIMIT_MARK * bool(run.limits_exceeded)


def reached(run: HopFigures) -> str:
    """The clearance [m] of a run in words."""
    return "no clearance" if run.highest is None else f"clears {run.clearance:.3f} m"


def last(run: HopFigures) -> int:
    """The sample at which the clearance is reached; without one, that before touchdown or the last."""
    return run.highest if run.highest is not None else (run.flight.stop if run.flies else len(run.trace.t)) - 1
