"""The command that lists the catalogue of motors and gears: actuators."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any

from rich.table import Column, Table

from hopopt.cli.options import AsJson, Flag, ended
from hopopt.cli.screen.console import WIDE_SCREEN, Shown, console, named, table
from hopopt.problem.catalogue import MARKS, catalogue, names
from hopopt.problem.checking.entries import entry_at, unit_of
from hopopt.problem.checking.mass_law import as_json as law_of

COLUMN_HEADINGS = {  # columns of the two tables: entry -> heading
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


def actuators(*, fit: Annotated[bool, Flag] = False, json_: AsJson = False) -> int:
    """List the motors and gears that a problem can name.

    As in hopopt solve --set leg.gear=csg-20-100. A question mark stands behind what is unverified. The files say where every value is from: problems/actuators.

    Parameters
    ----------
    fit
        Show what torque weighs instead: power laws of mass against torque, fitted over motors and over gears, which
        co-design takes as --couple "catalogue: leg.body.mass by leg.motor.max_torque" (docs/codesign.md).
    """
    laws = {part: law_of(part) for part in COLUMN_HEADINGS} if fit else {}
    data = {f"{part}s": laws.get(part) or _entries(part) for part in COLUMN_HEADINGS}
    return ended(data, json_, _laws(laws) if fit else _tables())


def _entries(part: str) -> dict[str, Any]:
    """{name: {"title", entry or "mass": {"value", "unit", "source"}}} of all motors or gears."""
    fields, found = (entry_at(("leg", part)) or {})["properties"], {}
    units = {key: unit_of(field) or "1" for key, field in fields.items()} | {"mass": "kg"}
    for name in names(part):
        entry = catalogue()[name]
        found[name] = {"title": entry.title} | {
            key: {"value": value, "unit": units[key], "source": MARKS[entry.marks[part][key]]}
            for key, value in entry.stated(part).items()
        }
    return found


def _tables() -> Iterator[Shown]:
    """Motors, and gears, with their figures."""
    for part, heads in COLUMN_HEADINGS.items():
        rows = dict[str, list[str]]()
        for name in names(part):
            values, marks = catalogue()[name].stated(part), catalogue()[name].marks[part]
            rows[name] = [f"{values[k]:.4g}{'?' if marks[k] == 'U' else ' '}" if k in values else "- " for k in heads]
        yield _table(f"{part}s", heads, rows)
        yield ""
    yield "? unverified. To use one: --set leg.motor=NAME, --set leg.knee.gear=NAME, or in a problem file"
    yield 'motor = "NAME" under [leg] or [leg.knee] in place of its table; masses change nothing there.'
    yield "docs/actuators.md has more."


def _laws(laws: Mapping[str, Mapping[str, Any]]) -> Iterator[Shown]:
    """What the laws of mass against torque were fitted to, and what they say of it."""
    for part, law in laws.items():
        rows, unverified = dict[str, list[str]](), 0
        for name, row in law["fitted_to"].items():
            unsure = row["source"] == MARKS["U"]
            unverified += unsure
            rows[name] = [f"{row['torque']:.3g}", f"{row['mass']:.3g}{'?' if unsure else ' '}", f"{row['fitted']:.3g}"]
        yield _table(f"{part}s", FIT, rows)
        yield (
            f"mass = {law['coefficient']:.3g} kg (torque / N m)^{law['exponent']:.3g}: {law['entries']} {part}s from "
            f"{law['lowest']:.3g} to {law['highest']:.3g} N m, typically off by a factor of {law['scatter']:.2g}; "
            f"exponent known to {law['exponent_error']:.2g}; {unverified} of the masses are unverified\n"
        )
    yield "To use one: --free leg.motor.max_torque=1:3 --free leg.body.mass=5:6.5"
    yield '--couple "catalogue: leg.body.mass by leg.motor.max_torque". docs/codesign.md has more.'


def _table(title: str, heads: Mapping[str, str], rows: Mapping[str, list[str]]) -> Table:
    """A row for each name; the last column, what an entry is called in full, only where the screen has room for it."""
    room = console().width >= WIDE_SCREEN
    columns = [named(title), *(Column(head, justify="right") for head in heads.values())]
    cells = [[name, *row, *([catalogue()[name].title] if room else [])] for name, row in rows.items()]
    return table([*columns, *([""] if room else [])], cells)
