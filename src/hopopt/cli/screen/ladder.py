"""Why PD control is lower, as the command line shows it: one freedom a row."""

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.table import Table

from hopopt.cli.screen.console import print_table


def print_ladder(out: Console, comparison: Mapping[str, Any]) -> None:
    """The ladder of a comparison, if it has one."""
    if "ladder" not in comparison:
        return
    table, start = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False), comparison["ladder_from"]
    table.add_column("why PD is lower", style="bold", no_wrap=True)
    for head in ("clears\nm", "gain\ncm", "orders\ncm", ""):
        table.add_column(head, justify="right", no_wrap=True)
    table.add_row(f"{start['strategy']}, simulated", f"{start['clearance_m']:.3f}", "", "", "")
    for rung in comparison["ladder"]:
        span = f"{cm(rung['least_gain_m'])} to {cm(rung['most_gain_m'])}"
        doubt = "" if rung["verified"] else "not verified"
        table.add_row(rung["allows"], f"{rung['clearance_m']:.3f}", cm(rung["gain_m"]), span, doubt)
    print_table(out, table)
    out.print(
        f"orders: the least and the most that a freedom gains in {len(comparison['ladder_orders'])} orders of lifting "
        "them; the gains of each sum to the whole gap"
    )


def cm(gap: float) -> str:
    """A difference [m] in centimetres, signed."""
    return f"{round(100 * gap, 1) or 0:+.1f}"
