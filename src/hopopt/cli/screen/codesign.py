"""What the command line shows of a co-design: which numbers were free, what they became, and what holds them back."""

from collections.abc import Iterator

from rich.table import Column

from hopopt.cli.screen.console import Shown, table
from hopopt.planner.answer.extras import CoDesign, FreeEntry


def codesign(found: CoDesign) -> Iterator[Shown]:
    """A line for each free entry, and the couplings."""
    heads = ("entry", "was", "optimal", "lowest", "highest", "unit", "")
    rows = []
    for p in found.parameters:
        numbers = [f"{x:.5g}" for x in (p.was, p.optimal, p.lower, p.upper)]
        rows.append([p.entry, *numbers, p.unit, f"at its {p.at_bound} bound" if p.at_bound else ""])
    yield table([Column(head, no_wrap=True) for head in heads], rows, "free design parameters")
    for p in found.parameters:
        yield from _between(p)
    for c in found.couplings:
        yield f"{c.coupling}   ({'active' if c.active else 'not active'})"
        if c.coupling.startswith("catalogue"):
            yield f"  that is {c.equation}"
    for part, law in found.mass_laws.items():
        yield (
            f"  law of {law.entries} {part}s from {law.lowest:.3g} to {law.highest:.3g} N m, "
            f"typically off by a factor of {law.scatter:.2g}: hopopt actuators --fit"
        )


def _between(p: FreeEntry) -> list[str]:
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
