"""The command that lists the catalogue of motors and gears."""

import json
from typing import Annotated, Any

from cyclopts import Parameter

from hopopt.cli.options import AsJson

FIGURES = {  # columns of the two tables: entry -> heading
    "motor": {
        "max_torque": "at standstill\nN m",
        "torque_cap": "drive's cap\nN m",
        "max_speed": "no-load speed\nrad/s",
        "rotor_inertia": "rotor inertia\nkg m^2",
        "mass": "mass\nkg",
    },
    "gear": {
        "ratio": "ratio\n1",
        "torque_cap": "repeated peak\nN m",
        "speed_cap": "input speed\nrad/s",
        "inertia": "input inertia\nkg m^2",
        "efficiency": "efficiency\n1",
        "mass": "mass\nkg",
    },
}


FIT = {"torque": "torque\nN m", "mass": "mass\nkg", "fitted": "fitted\nkg"}
Fit = Annotated[bool, Parameter(name="--fit", negative=())]


def actuators(*, fit: Fit = False, json_: AsJson = False) -> int:
    """List the motors and gears that a problem can name.

    As in hopopt solve --set leg.gear=csg-20-100. A question mark stands behind what is unverified. The files say where every value is from: problems/actuators.

    Parameters
    ----------
    fit
        Show what torque weighs instead: power laws of mass against torque, fitted over motors and over gears, which
        co-design takes as --couple "catalogue: leg.body.mass by leg.motor.max_torque" (docs/codesign.md).
    """
    if json_:
        print(json.dumps({f"{part}s": (_law_as_json if fit else _as_json)(part) for part in FIGURES}))
        return 0
    from hopopt.cli.screen.console import console, print_table

    out = console()
    for part in FIGURES:
        print_table(out, _law_table(part) if fit else _table(part))
        out.print(_law_in_words(part) if fit else "")
    if fit:
        out.print("To use one: --free leg.motor.max_torque=1:3 --free leg.body.mass=5:6.5")
        out.print('--couple "catalogue: leg.body.mass by leg.motor.max_torque". docs/codesign.md has more.')
        return 0
    out.print("? unverified. To use one: --set leg.motor=NAME, --set leg.knee.gear=NAME, or in a problem file")
    out.print('motor = "NAME" under [leg] or [leg.knee] in place of its table; masses change nothing there.')
    out.print("docs/actuators.md has more.")
    return 0


def _as_json(part: str) -> dict[str, Any]:
    """{name: {"title", entry or "mass": {"value", "unit", "source"}}} of all motors or gears."""
    from hopopt.problem.catalogue import MARKS, catalogue, names
    from hopopt.problem.checking.entries import entry_at, unit_of

    fields, found = (entry_at(("leg", part)) or {})["properties"], {}
    units = {key: unit_of(field) or "1" for key, field in fields.items()} | {"mass": "kg"}
    for name in names(part):
        entry = catalogue()[name]
        found[name] = {"title": entry.title} | {
            key: {"value": value, "unit": units[key], "source": MARKS[entry.marks[part][key]]}
            for key, value in entry.stated(part).items()
        }
    return found


def _law_as_json(part: str) -> dict[str, Any]:
    from hopopt.problem.checking.mass_law import as_json

    return as_json(part)


def _table(part: str) -> Any:
    from hopopt.problem.catalogue import catalogue, names

    table = _head(f"{part}s", FIGURES[part])
    for name in names(part):
        entry = catalogue()[name]
        values, marks = entry.stated(part), entry.marks[part]
        figures = [
            f"{values[key]:.4g}{'?' if marks[key] == 'U' else ' '}" if key in values else "- " for key in FIGURES[part]
        ]
        table.add_row(*[name, *figures, entry.title][: len(table.columns)])
    return table


def _law_table(part: str) -> Any:
    """What the law was fitted to, and what it says of it."""
    from hopopt.problem.catalogue import MARKS, catalogue

    table = _head(f"{part}s", FIT)
    for name, row in _law_as_json(part)["fitted_to"].items():
        mass = f"{row['mass']:.3g}{'?' if row['source'] == MARKS['U'] else ' '}"
        cells = [name, f"{row['torque']:.3g}", mass, f"{row['fitted']:.3g}", catalogue()[name].title]
        table.add_row(*cells[: len(table.columns)])
    return table


def _law_in_words(part: str) -> str:
    from hopopt.problem.catalogue import MARKS

    law = _law_as_json(part)
    unverified = sum(row["source"] == MARKS["U"] for row in law["fitted_to"].values())
    return (
        f"mass = {law['coefficient']:.3g} kg (torque / N m)^{law['exponent']:.3g}: {law['entries']} {part}s from "
        f"{law['lowest']:.3g} to {law['highest']:.3g} N m, typically off by a factor of {law['scatter']:.2g}; "
        f"exponent known to {law['exponent_error']:.2g}; {unverified} of the masses are unverified\n"
    )


def _head(title: str, headings: dict[str, str]) -> Any:
    """An empty table; the last column, what an entry is called in full, only where the screen has room for it."""
    from rich.table import Table

    from hopopt.cli.screen.console import ROOM, console

    table = Table(box=None, pad_edge=False)
    table.add_column(title, style="bold", no_wrap=True)
    for heading in headings.values():
        table.add_column(heading, justify="right")
    if console().width >= ROOM:
        table.add_column("")
    return table
