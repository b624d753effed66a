"""What the command line shows of a co-design: which numbers were free, what they became, and what holds them back."""

from typing import TYPE_CHECKING

from rich.table import Table

from hopopt.cli.screen.console import console, print_table

if TYPE_CHECKING:
    from hopopt.planner.answer.extras import CoDesign, FreeEntry


def _between(p: "FreeEntry") -> list[str]:
    """The limits that an entry sits between, and what it would be without each."""
    if (at := p.between) is None:
        return []
    lines = [f"{p.entry} = {p.optimal:.5g} sits where limits trade places: {' and '.join(at.limits)}"]
    for k, w in enumerate(at.without):
        which = " (the lesser)" if k == 0 and len(at.without) > 1 else ""
        lines.append(
            f"  without the {w.limit}{which}: {w.objective_value:.5g} at {w.optimal:.5g} {p.unit}".removesuffix(" 1")
        )
    return lines


def print_codesign(found: "CoDesign") -> None:
    """A line for each free entry, and the couplings."""
    table = Table(title="free design parameters", title_justify="left", box=None, pad_edge=False)
    for column in ("entry", "was", "optimal", "lowest", "highest", "unit", ""):
        table.add_column(column, no_wrap=True)
    for p in found.parameters:
        figures = [f"{x:.5g}" for x in (p.was, p.optimal, p.lower, p.upper)]
        table.add_row(p.entry, *figures, p.unit, f"at its {p.at_bound} bound" if p.at_bound else "")
    out = console()
    print_table(out, table)
    for p in found.parameters:
        for line in _between(p):
            out.print(line)
    for c in found.couplings:
        out.print(f"{c.coupling}   ({'active' if c.active else 'not active'})")
        if c.coupling.startswith("catalogue"):
            out.print(f"  that is {c.equation}")
    for part, law in found.mass_laws.items():
        out.print(
            f"  law of {law.entries} {part}s from {law.lowest:.3g} to {law.highest:.3g} N m, "
            f"typically off by a factor of {law.scatter:.2g}: hopopt actuators --fit"
        )
