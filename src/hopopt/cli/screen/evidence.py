"""Global evidence on the screen."""

from collections.abc import Mapping
from typing import Any

from rich.table import Table

from hopopt.cli.screen.answer import bound_line
from hopopt.cli.screen.console import console, print_lines, print_table
from hopopt.studies.dynamic_programming import TELLING


def print_evidence(data: Mapping[str, Any]) -> None:
    """The best hop, the bound, the reduced hop by two methods, and the families of local optima."""
    out, best = console(), data["best"]
    state = "verified" if best["verified"] else f"NOT verified ({', '.join(best['failed_checks'])})"
    out.print(
        f"[bold]{data['problem']}[/bold]: best of {data['starts']['count']} starts {best['clearance_m']:.4f} m, {state}",
        markup=True,
    )
    print_lines(out, "bound", bound_line(data["upper_bound"]["clearance_m"], data["objective"]))
    if data["contradicted"]:
        out.print(
            "[bold red]the global method finds more than the planner in the reduced hop[/bold red]: neither is to be trusted",
            markup=True,
        )
    print_lines(out, "reduced", _reduced(data["reduced"]))
    table = Table(title="local optima on the first mesh", title_justify="left", box=None, pad_edge=False)
    for column, side in (
        ("height [m]", "right"),
        ("starts", "right"),
        ("what it does", "left"),
        ("first found by", "left"),
    ):
        table.add_column(column, justify=side)  # type: ignore[arg-type]
    for f in data["starts"]["families"]:
        table.add_row(f"{f['objective']:.4f}", str(f["count"]), f["words"], f["name"])
    print_table(out, table)
    if failed := data["starts"]["count"] - data["starts"]["solved"]:
        out.print(f"{failed} of the starts led to no hop")
    out.print(f"results {data['result_dir']}")


def _reduced(reduced: Mapping[str, Any]) -> list[str]:
    if "reason" in reduced:
        return [f"left out: {reduced['reason']}"]
    rows = ", ".join(
        f"{r['height_m']:.4f} m ({r['difference']:+.2%}) on {r['size']} x {r['size']}" for r in reduced["grids"]
    )
    coarse = f"; grids below {TELLING} are too coarse to tell" if reduced["grids"][-1]["size"] < TELLING else ""
    return [
        f"foot under the hip, body on a slider: the centre of mass can be thrown to {reduced['planned_m']:.4f} m (planner)",
        f"by dynamic programming, which knows no local optima: {rows}{coarse}",
    ]
