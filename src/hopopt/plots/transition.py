"""The way onto an orbit: heights of foot and body over all hops, between the orbits at both ends."""

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hopopt.comparison.hops.transition import Transition
from hopopt.ocp.hops.several_hops import in_words
from hopopt.ocp.phases import FLIGHT, STANCE
from hopopt.planner.motion import Motion
from hopopt.plots.hop import save_figure
from hopopt.plots.style import BLACK, COLOR, GREEN, GREY, NORMALISED_TIMES, called_after, describe, legend, new_figure

ORBIT = 0.45  # opacity of the hops of an orbit: they are not what was planned


def heights(found: Transition) -> Figure:
    """Heights [m] of the leg's lowest point and of the body over time [s]: every hop in turn, before them a hop of the orbit
    that is left, after them one of the orbit that is reached."""
    doubt = "" if found.verified else " (NOT verified)"
    title = f"{in_words(len(found.plan.hops))} onto the orbit of {found.orbit.clearance:.3f} m{doubt}"
    figure = new_figure(f"{called_after(found.design)}: {title}")
    ax, t = figure.subplots(), 0.0
    if found.begin is not None:
        _curves(ax, found.begin, -found.begin.end, ORBIT)
    for k, hop in enumerate(found.plan.hops, 1):
        ax.axvline(t, color=BLACK, lw=1.0, ls=":", label="touchdown" if k > 1 else None)
        _curves(ax, hop, t, 1.0)
        t += hop.end
    ax.axvline(t, color=BLACK, lw=1.0, ls="--", label="on the orbit")
    _curves(ax, found.orbit, t, ORBIT)
    ax.axhline(0, color=GREY, lw=3, zorder=1)
    ax.set_ylim(bottom=-0.03)
    describe(ax, "time [s]; pale: the orbits", "height [m]")
    legend(figure)
    return figure


def _curves(ax: Axes, hop: Motion, begin: float, alpha: float) -> None:
    """Lowest point, in stance and in flight, and body of one hop that begins at a time [s]."""
    for phase in hop.phases:
        s = hop.everywhere(phase, NORMALISED_TIMES)
        kind = STANCE if phase == STANCE else FLIGHT
        lowest, body = (f"lowest point, {kind}", "body") if alpha == 1 else (None, None)  # the legend shows the plan's
        ax.plot(begin + s.t, s.lowest, color=COLOR[kind], lw=3, alpha=alpha, label=lowest)
        ax.plot(begin + s.t, s.q[:, 1], color=GREEN, lw=2, alpha=alpha, label=body)


def save_all(found: Transition, folder: Path) -> None:
    """Write the figure to a folder."""
    save_figure(heights(found), folder / "heights")
