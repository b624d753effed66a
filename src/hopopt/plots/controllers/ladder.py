"""Why PD control is lower than the optimum: a staircase from its clearance to the bound, one freedom a step."""

from matplotlib.figure import Figure

from hopopt.comparison.ladder import Ladder
from hopopt.plots.style import BLACK, GREY, PALE, SMALL, TEXT, describe, new_figure

CM = 100.0  # [cm/m]
STEP_COLOR = "#0072B2"
LEAST_AXIS = 0.04  # of the bound: of an axis around the clearances
WHISKER = 1e-4  # of the bound: gains of other orders that differ by less are one


def staircase(found: Ladder, title: str) -> Figure:
    """Clearances [cm] of the rungs, from PD at the top to the bound; the whisker of a step: its gain over all orders. Below,
    how much higher the bound is without collisions and losses, where there are any."""
    rows = len(found.rungs) + 1 + len(found.beyond)
    figure = new_figure(f"{title}: what PD control lacks", (11.0, 2.4 + 0.55 * (rows + 1)))
    ax = figure.subplots()
    ax.barh(0, CM * found.from_m, 0.7, color=PALE)
    end, low = found.from_m, CM * found.from_m
    names = [f"{found.strategy}, simulated"]
    for row, rung in enumerate(found.rungs, start=1):
        ax.barh(row, CM * rung.gain_m, 0.7, left=CM * end, color=STEP_COLOR)
        ax.plot([CM * end, CM * end], [row - 1, row + 0.35], color=GREY, lw=0.8)
        if rung.most_gain_m > rung.least_gain_m + WHISKER * found.rungs[-1].clearance_m:
            span = [CM * (end + rung.least_gain_m), CM * (end + rung.most_gain_m)]
            ax.plot(span, [row, row], color=BLACK, lw=1.4, marker="|", ms=9)
        end = rung.clearance_m
        doubt = "" if rung.verified else ", not verified"
        ax.annotate(
            f"{round(CM * rung.gain_m, 1) or 0:+.1f} cm{doubt}", (CM * max(end, end - rung.gain_m + rung.most_gain_m), row),
            xytext=(8, 0), textcoords="offset points", fontsize=SMALL, va="center", zorder=3,
            bbox={"color": "white", "lw": 0, "pad": 1.5},  # the bound's line may pass behind it
        )  # fmt: skip
        names.append(rung.allows)
    ax.text(CM * found.from_m, 0, f"  {CM * found.from_m:.1f} cm", fontsize=SMALL, va="center")
    high = CM * max(rung.clearance_m - rung.gain_m + rung.most_gain_m for rung in found.rungs)
    above = end
    for row, lifted in enumerate(found.beyond, start=1 + len(found.rungs)):
        ax.barh(row, CM * lifted.bound_gains_m, 0.7, left=CM * above, color=PALE)
        gains = [f"{round(CM * x, 1) or 0:+.1f}" for x in (lifted.bound_gains_m, lifted.strategy_gains_m)]
        doubt = "" if lifted.verified else ", not verified"
        words = f"  bound {gains[0]} cm{doubt}, {found.strategy} {gains[1]} cm"
        ax.text(CM * max(above, lifted.bound_m), row, words, fontsize=SMALL, va="center")
        names.append(lifted.lifts)
        above, high = lifted.bound_m, max(high, CM * lifted.bound_m)
    room = 0.18 * (high - low) + LEAST_AXIS * CM * end
    ax.axvline(CM * end, color=BLACK, lw=1.2)
    ax.text(CM * end, -0.62, f"bound {CM * end:.1f} cm ", fontsize=TEXT, ha="right", va="center")
    ax.set_yticks(range(rows), names, fontsize=TEXT)
    ax.set(xlim=(low - room, high + (6 if found.beyond else 2) * room), ylim=(rows - 0.5, -1.0))
    grey = "; right of the bound: lifted for both" if found.beyond else ""
    describe(ax, f"clearance [cm]; black: the same gain in other orders{grey}", "")
    ax.grid(False, axis="y")
    return figure
