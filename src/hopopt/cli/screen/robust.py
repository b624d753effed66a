"""What the command line shows of a robust hop: four numbers, the promise, and the reserve."""

from collections.abc import Mapping
from typing import Any

from rich.table import Table

from hopopt.cli.screen.console import console, print_table
from hopopt.report.robust import UNITS, WAYS


def print_robust(found: Mapping[str, Any], where: str) -> None:
    """The bounds, what the share reaches with the tracker and with PD, and how it was found."""
    out, table = console(), Table(box=None)
    for title, justify in (("", "left"), ("clearance", "right"), ("fell", "right")):
        table.add_column(title, justify=justify)  # type: ignore[arg-type]
    for words, key in (("bound, ideal ground", "ideal_bound_m"), ("bound, this ground", "bound_m")):
        table.add_row(words, "not verified" if found[key] is None else f"{found[key]:.4f} m", "")
    table.add_row(
        f"{found['tracker']}, {100 * found['share']:g} % of the legs",
        f"{found['clearance_m']:.4f} m",
        f"{found['fell']}",
    )
    for name, clearance in found["pd"].items():
        table.add_row(
            f"{name}, {100 * found['share']:g} % of the legs", f"{clearance:.4f} m", f"{found['pd_fell'][name]}"
        )
    print_table(out, table)
    out.print(
        f"{100 * found['share']:g} % of all legs within [uncertainty] reach this, with confidence {100 * found['confidence']:g} %: "
        f"it is number {found['rank']} from below of {found['draws']} legs that the tuning did not see"
    )
    out.print(f"tracked by {found['tracker']}: lowest {found['lowest_m']:.4f} m, median {found['median_m']:.4f} m")
    doubt = "" if found["plan_verified"] else "; it was NOT verified"
    out.print(f"the plan clears {found['plan_m']:.4f} m, best of {found['evaluations']} that were tried{doubt}")
    each = [
        f"{words} {found['lowest_by_way_m'][way]:.4f} m"
        for way, words in WAYS.items()
        if found["lowest_by_way_m"].get(way) is not None
    ]
    out.print(f"lowest of the legs that it was chosen on, by way: {', '.join(each) or 'no way led to a verified plan'}")
    for name, gains in (found["feedback"] or {}).items():
        out.print(f"its feedback {name} = {', '.join(f'{gain:.4g}' for gain in gains)} {UNITS[name]}, joint by joint")
    if (best := found["pd_best"]) and found["pd"][best] > found["clearance_m"]:
        out.print(
            f"{best} reaches more than any plan that was tracked: of those that were tried, none suits these legs"
        )
    out.print("[reserve]\n" + "\n".join(f"{name} = {value:.6g}" for name, value in found["reserve"].items()))
    out.print(f"results {where}   ({found['wall_s']:.1f} s)")
