"""What the command line shows of a sensitivity study: the ranked table, and the sentences that say what to change."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich.table import Table

from hopopt.cli.screen.console import console, print_table

if TYPE_CHECKING:
    from hopopt.studies.influence import Influence

ROWS = 16  # of the table
LEAST = 5e-4  # [cm] per per cent, below which an entry is left out of it


def print_sensitivity(data: Mapping[str, Any], influences: "Sequence[Influence]") -> None:
    """The optimum, the leading entries, what to change first, and how well the figures are known."""
    out = console()
    if data["failed_checks"]:
        out.print(f"{data['problem']}: the optimum was NOT verified, so nothing is reported about what it depends on.")
        out.print(f"Failed: {', '.join(data['failed_checks'])}")
        return
    what, height = ("body apex", data["apex_m"]) if "apex_m" in data else ("clearance", data["clearance_m"])
    out.print(f"{data['problem']}: {what} {height:.4f} m, verified. What 1 % more of an entry would change:")
    print_table(out, _table(influences))
    for line in (
        *_kinks(influences),
        *_indented(influences),
        *left_out(influences),
        *sentences(influences),
        *_rest(influences),
        _precision(data),
    ):
        out.print(line)
    out.print(f"results {data['result_dir']}")


def _table(influences: "Sequence[Influence]") -> Table:
    again, kinked = any(i.difference for i in influences), any(i.kinked for i in influences)
    table = Table(box=None, pad_edge=False)
    table.add_column("entry", style="bold", no_wrap=True)
    sides = ["1 % more gives", *(["1 % less gives"] if kinked else []), "m per unit"]
    for head in ("value", *sides, *(["solved again"] if again else [])):
        table.add_column(head, justify="right", no_wrap=head == "value")
    if again:
        table.add_column("")
    for i in _shown(influences):
        cells = [f"{i.value:g} {i.unit}".removesuffix(" 1"), f"{i.cm_per_percent:+.3f} cm"]
        cells += [f"{i.cm_per_percent_less:+.3f} cm"] if kinked else []
        cells += [f"{i.m_per_unit:+.4g}" + (f", {i.less_m_per_unit:+.4g}" if i.kinked else "")]
        if again:
            d = i.difference
            found = "" if d is None or d.fault or i.kinked else f"{d.central:+.4g}"
            cells += [found, "" if d is None else d.verdict(i.m_per_unit, i.less_m_per_unit)]
        table.add_row(f"  {i.name}" if i.part_of else i.name, *cells)
    return table


def _shown(influences: "Sequence[Influence]") -> "list[Influence]":
    return [i for k, i in enumerate(influences) if (k < ROWS and i.most_cm >= LEAST) or i.difference]


def _kinks(influences: "Sequence[Influence]") -> list[str]:
    """Which limits trade places at the optimum."""
    at = next((i for i in influences if i.kinked), None)
    if at is None:
        return []
    return [f"Limits trade places at this optimum, so that more and less of an entry differ: {'; '.join(at.between)}."]


def _indented(influences: "Sequence[Influence]") -> list[str]:
    parts = any(i.part_of for i in _shown(influences))
    return ["Indented: what one joint has of an entry that the whole leg shares."] if parts else []


def left_out(influences: "Sequence[Influence]") -> list[str]:
    """How many entries that matter have no row."""
    shown = _shown(influences)
    count = sum(i.most_cm >= LEAST and i not in shown for i in influences)
    return [f"({count} more that matter less: --json)"] if count > 0 else []


def sentences(influences: "Sequence[Influence]") -> list[str]:
    """What to change first: of the leg, of the joints apart, and of what the hop is asked to be."""
    gains = [i for i in influences if i.best_cm >= LEAST]
    if any(i.kinked for i in influences):  # they are ranked by their larger side, which may be a loss
        gains.sort(key=lambda i: -i.best_cm)
    first = next((i for i in gains if i.of_leg), None)
    if first is None:
        return ["No entry of the leg makes the height more to first order."]
    lines = [f"What to change first: {_advice(first)}."]
    for whole in influences:
        parts = [i for i in gains if i.part_of == whole.name]
        if len({_up(i) for i in parts}) > 1:
            lines.append(f"{whole.name} pulls both ways, give the joints their own: {'; '.join(map(_advice, parts))}.")
    asked = next((i for i in gains if not i.of_leg), None)
    return lines + ([f"Of what the hop is asked to be: {_advice(asked)}."] if asked else [])


def _up(i: "Influence") -> bool:
    """Whether more of it is the better way."""
    return i.cm_per_percent >= i.cm_per_percent_less


def _advice(i: "Influence") -> str:
    """leg.gear.ratio 1 % down, from 100 to 99, gains 0.24 cm"""
    up = _up(i)
    to = i.value * (1.01 if up else 0.99)
    unit = "" if i.unit == "1" else f" {i.unit}"
    size = "1 % more" if up else "1 % less"
    return f"{i.name} {size}, from {i.value:g} to {to:.4g}{unit}, gains {i.best_cm:.2f} cm"


def _rest(influences: "Sequence[Influence]") -> list[str]:
    """Entries that are 0, of which there is no per cent."""
    zero = [i for i in influences if not i.value and abs(i.m_per_unit) > 1e-6]
    each = ", ".join(f"{i.name} {i.m_per_unit:+.3g} m per {i.unit}" for i in zero)
    return [f"At 0 now, so by the unit: {each}"] if zero else []


def _precision(data: Mapping[str, Any]) -> str:
    return (
        f"From the multipliers of the optimum, as long as the same limits stay active. The height depends on the mesh "
        f"within {data['settled_within_m']:.0e} m, on the tie-break within {data['tie_break_bias_m']:.0e} m; "
        "a derivative depends on the mesh more than the height does (--confirm solves again)."
    )
