"""What the command line shows of a Pareto front."""

from typing import TYPE_CHECKING

from rich.table import Table

from hopopt.cli.screen.console import console, print_table

if TYPE_CHECKING:
    from hopopt.studies.pareto import Front


def print_front(front: "Front") -> None:
    """A line for each point, by clearance, and where they are kept."""
    name, unit = front.against.name.replace("_", " "), front.against.unit
    title = f"{front.design.title or front.design.name}: clearance against {name}"
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for column in ("point", "clearance [m]", f"{name} [{unit}]" if unit != "1" else name, "", "folder"):
        table.add_column(column, no_wrap=True)
    for p in sorted(front.points, key=lambda p: p.asked_m):
        figures = [f"{x:.4f}" if x is not None else "-" for x in (p.clearance_m or p.asked_m, p.value)]
        table.add_row(
            p.kind if p.least else f"{p.kind} (not the least)",
            *figures,
            "verified" if p.verified else p.sentence,
            (p.result_dir or "").split("/")[-1],
        )
    out = console()
    print_table(out, table)
    good = len(front.verified_points)
    out.print(
        f"{good} of {len(front.points)} points verified{'' if front.complete else ', not complete'}; {front.folder}"
    )
