"""Families of hops on the screen."""

from collections.abc import Mapping, Sequence
from typing import Any

from rich.table import Table

from hopopt.cli.screen.console import ROOM, console, print_lines, print_table

EVERY, FEW = 6, 3  # values that all have a column, where there is room and where there is not
ROWS = 8  # families; the rest is in the file


def print_families(data: Mapping[str, Any]) -> None:
    """A row for each family, where the best changes, what is contradicted, where it all lies."""
    out = console()
    most, shown = EVERY if out.width >= ROOM else FEW, data["families"][:ROWS]
    columns = _every(data) if len(data["best"]) <= most else _three(data)
    over = f" over {data['entry']}" if data["entry"] else ""
    table = Table(title=f"{data['problem']}: families of hops{over}", title_justify="left", box=None, pad_edge=False)
    table.add_column("")
    table.add_column("what the leg does", max_width=60)
    for head, _ in columns:
        table.add_column(head, justify="right", no_wrap=True)
    for f in shown:
        table.add_row(f["name"], f["words"], *(cell(f) for _, cell in columns))
    print_table(out, table)
    out.print("clearance in m; * the best there; ~ of the first mesh, neither refined nor verified")
    if more := len(data["families"]) - len(shown):
        out.print(f"and {more} more in families.json, none of them the best anywhere")
    for f in shown:
        print_lines(out, f"{f['name']} from", [_found_by(f["found_by"])])
    print_lines(out, "best", [*_crossings(data), *_faults(data)])
    out.print(f"results {data['result_dir']}")


def _every(data: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """A column for each value: its head, and the cell of a family."""
    heads = [f"{v:g}" for v in data["values"]] or ["clearance"]
    return [(head, lambda f, k=k: _cell(data, f, k)) for k, head in enumerate(heads)]


def _three(data: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Columns for the first value, for each family's best, and for the last value."""
    first, *_, last = data["values"]
    return [
        (f"at {first:g}", lambda f: _cell(data, f, 0)),
        ("highest", lambda f: _highest(data, f)),
        (f"at {last:g}", lambda f: _cell(data, f, -1)),
    ]


def _highest(data: Mapping[str, Any], f: Mapping[str, Any]) -> str:
    k = max(range(len(f["clearance_m"])), key=lambda k: f["clearance_m"][k] or 0.0)
    return f"{_cell(data, f, k)} at {data['values'][k]:g}"


def _cell(data: Mapping[str, Any], f: Mapping[str, Any], k: int) -> str:
    height = f["clearance_m"][k]
    if height is None:
        return "-"
    star = "*" if data["best"][k] == f["name"] else " "
    return f"{'~' if f['verified'][k] is None else ''}{height:.4f}{star}"


def _found_by(names: Sequence[str]) -> str:
    more = f"; and {len(names) - 3} more" if len(names) > 3 else ""
    return f"{'; '.join(names[:3])}{more}"


def _crossings(data: Mapping[str, Any]) -> list[str]:
    if data["entry"] is None:
        return []
    found = [
        f"between {data['entry']} = {c['between'][0]:g} and {c['between'][1]:g} the best hop changes from family "
        f"{c['from']} to family {c['to']}"
        for c in data["crossings"]
    ]
    known = {name for name in data["best"] if name}
    return found or [f"family {known.pop()} is the best at every value where a hop was found"]


def _faults(data: Mapping[str, Any]) -> list[str]:
    entry, rows = data["entry"], {f["name"]: f for f in data["families"]}
    places = data["values"] or [None]
    ended = [f"{where}: {sentence}" for where, sentence in data.get("faults", {}).items()]
    missing = (
        [f"{entry} = {v:g}: no hop was found" for v, name in zip(data["values"], data["best"], strict=True) if not name]
        if entry
        else []
    )
    failed = [
        f"{'' if v is None else f'{entry} = {v:g}: '}the best hop is NOT verified"
        for k, (v, name) in enumerate(zip(places, data["best"], strict=True))
        if name and rows[name]["verified"][k] is False
    ]
    wrong = [
        f"{entry} = {c['at']:g}: a better hop was missed, for {entry} = {c['better_at']:g} limits more and reaches "
        f"{c['better_clearance_m']:.4f} m, not {c['clearance_m']:.4f} m"
        for c in data["contradictions"]
    ]
    return [*ended, *missing, *failed, *wrong]
