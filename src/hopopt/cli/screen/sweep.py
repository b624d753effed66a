"""What the command line shows of a design study."""

from typing import TYPE_CHECKING

from rich.table import Table

from hopopt.cli.screen.console import console, print_table
from hopopt.ocp.objectives.registry import find
from hopopt.planner.stopwatch import duration

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from hopopt.studies.sweep.recheck import Rechecked
    from hopopt.studies.sweep.run import Study

SHOWN = 60  # points; the rest is in the table's file


def print_study(study: "Study") -> None:
    """Every point with its outcome, the best, what failed and why, and where it lies."""
    out, entries = console(), [axis.entry for axis in study.definition.axes]
    table = Table(box=None, pad_edge=False)
    goal = find(study.definition.objective)
    other = [] if goal.figure == "clearance_m" else [f"{goal.name} {goal.unit}"]
    for column in (*entries, *other, "clearance m", "outcome"):
        table.add_column(column)
    best = study.best
    for p in study.points[:SHOWN]:
        height = "" if p.clearance_m is None else f"{p.clearance_m:.4f}"
        what = " best" if best is p else f": {p.sentence}" if p.sentence else ""
        value = [f"{p.objective_value:.5g}" if p.verified else ""] if other else []
        table.add_row(*(f"{x:g}" for x in p.values.values()), *value, height, f"{p.outcome}{what}")
    print_table(out, table)
    if len(study.points) > SHOWN:
        out.print(f"… and {len(study.points) - SHOWN} more in {study.folder / 'table.csv'}")
    verified = sum(p.verified for p in study.points)
    corrected = f", {study.corrected} improved from other neighbours" if study.corrected else ""
    out.print(f"{verified} of {len(study.points)} points verified{corrected}, in {duration(study.seconds)}")
    if best:
        where = ", ".join(f"{entry} = {x:g}" for entry, x in best.values.items())
        edge = f"; {study.at_the_edge}" if study.at_the_edge else ""
        out.print(f"best: {where}: clearance {best.clearance_m:.4f} m{edge}")
    out.print(f"results {study.folder}")


def print_rechecked(folder: "Path", found: "Sequence[Rechecked]", doubts: "Sequence[str]") -> None:
    """Points that were verified again: what each states, and what is wrong with that; and which files were changed."""
    out = console()
    for r in found:
        stated = "nothing" if r.stated.clearance_m is None else f"{r.stated.clearance_m:.4f} m"
        wrong = r.fault or r.doubt
        out.print(f"point {r.stated.index}: states {stated}: {f'FAILED: {wrong}' if wrong else 'verified'}")
    bad = sum(bool(r.fault) for r in found)
    mend = f"remove a point's file to have it solved again, then hopopt sweep --resume {folder} writes the tables"
    files = f"; {'; '.join(doubts)}: {mend}" if doubts else ""
    verdict = "NOT verified" if bad or doubts else "verified"
    out.print(f"{folder}: {verdict}: {len(found) - bad} of {len(found)} points confirmed{files}")
