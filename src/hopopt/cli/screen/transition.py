"""What the command line shows of hops that lead onto an orbit."""

from collections.abc import Mapping
from typing import Any

from rich.table import Table

from hopopt.cli.screen.console import console, print_table
from hopopt.ocp.hops.several_hops import in_words


def print_transition(found: Mapping[str, Any], where: str) -> None:
    """Where the hops begin and end, each of them, and why fewer do not do."""
    out, count = console(), found["hops"]
    begin = "rest" if found["from"] is None else f"the periodic hop of {found['from']['clearance_m']:.4f} m"
    status = "verified" if found["verified"] else "NOT verified"
    out.print(
        f"{found['problem']}: from {begin} onto the periodic hop of {found['to']['clearance_m']:.4f} m in "
        f"{in_words(count)}, {found['duration_s']:.3f} s, {status}"
    )
    if not found["verified"]:
        out.print(f"failed: {', '.join(found['failed_checks']) or 'a periodic hop at one of the ends is not verified'}")
    table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False)
    for head in ("hop", "stance\ns", "in the air\ns", "lowest point\nup to m"):
        table.add_column(head, justify="right", no_wrap=True)
    for k, (lasts, clears) in enumerate(zip(found["durations_s"], found["clearances_m"], strict=True), 1):
        stance, air = lasts["stance"], sum(lasts.values()) - lasts["stance"]
        table.add_row(str(k), f"{stance:.3f}", f"{air:.3f}", f"{clears:.3f}")
    print_table(out, table)
    sure = "certified" if found["certified"] else "not certified"
    out.print(
        f"of all ways in {in_words(count)} that of least effort; first-order optimality {sure}; "
        f"{found['checks'] - len(found['failed_checks'])} of {found['checks']} checks passed"
    )
    for k, why in enumerate(found["fewer_hops"], 1):
        out.print(f"in {in_words(k)} no way was found: {why}")
    out.print(f"results {where}   ({found['wall_s']:.1f} s)")
