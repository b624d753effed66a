"""What the command line shows of an installation."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.table import Table

from hopopt.cli.screen.console import console, print_table

if TYPE_CHECKING:
    from hopopt.cli.setup.installation import Finding


def print_findings(findings: "Sequence[Finding]") -> None:
    """A table of everything that was looked at, then whether hopopt works here and what to do if not."""
    out, table = console(), Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for column in ("", "name", "found", "state"):
        table.add_column(column, overflow="fold")
    before = ""
    for f in findings:
        state = "ok" if f.ok else "FAILED" if f.needed else "unusable"
        table.add_row(f.group if f.group != before else "", f.name, f.found, state)
        before = f.group
    print_table(out, table)
    for f in findings:
        if f.advice:
            out.print(f"{f.name}: {f.advice}")
    works = all(f.ok for f in findings if f.needed)
    out.print("hopopt works here" if works else "hopopt does NOT work here: see what failed above")
