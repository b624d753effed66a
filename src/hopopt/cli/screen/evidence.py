"""Global evidence on the screen."""

from collections.abc import Mapping
from typing import Any

from rich.table import Table

from hopopt.cli.screen.answer import bound_line
from hopopt.cli.screen.console import console, print_lines, print_table
from hopopt.evidence.dynamic_programming import TELLING


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
    print_lines(out, "global", _overall(data["global"], best["clearance_m"]))
    print_lines(out, "reduced", _reduced(data["reduced"]))
    table = Table(title="local optima on the first mesh", title_justify="left", box=None, pad_edge=False)
    for column, side in (
        ("height [m]", "right"),
        ("starts", "right"),
        ("what it does", "left"),
        ("first found by", "left"),
    ):
        table.add_column(column, justify=side)  # type: ignore[arg-type]
    for f in data["families"]:
        table.add_row(f"{f['objective_value']:.4f}", str(_count(data, f)), f["words"], f["found_by"][0])
    print_table(out, table)
    if failed := data["starts"]["count"] - data["starts"]["solved"]:
        out.print(f"{failed} of the starts led to no hop")
    out.print(f"results {data['result_dir']}")


def _count(data: Mapping[str, Any], family: Mapping[str, Any]) -> int:
    """How many starts, relaxed problems and motions of a global method ended in a family, or were stopped near it."""
    drawn = {f["name"]: f["count"] for f in data["starts"]["families"]}
    return sum(drawn.get(name, 1) for name in (*family["found_by"], *family.get("stopped", ())))


def _overall(overall: Mapping[str, Any], best: float) -> list[str]:
    """The global method on growing grids, or why not."""
    if "grids" not in overall:
        hops = f"; basin hopping over {overall['basin_hopping']} starts instead" if "basin_hopping" in overall else ""
        return [f"left out: {overall['reason']}{hops}"]
    lines = [f"{overall['method']}; it approximates and is no bound"]
    for g in overall["grids"]:
        motion = (
            "no motion"
            if g["rollout_m"] is None
            else f"a motion of {g['rollout_m']:.4f} m ({g['rollout_m'] / best - 1:+.1%})"
        )
        solved = "no hop" if g["solved_m"] is None else f"{g['solved_m']:.4f} m"
        lines.append(
            f"{g['size']}^4 states: value {g['value_m']:.4f} m ({g['value_m'] / best - 1:+.1%}), {motion}, "
            f"solved from there {solved}, {g['seconds']:.0f} s"
        )
    return [*lines, f"verdict: {overall['verdict']}"]


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
