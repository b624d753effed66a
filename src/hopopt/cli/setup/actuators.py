"""The command that lists the catalogue of motors and gears: actuators."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from rich.table import Column, Table

from hopopt.cli.options import AsJson, Flag, ended
from hopopt.cli.screen.console import WIDE_SCREEN, Shown, console, named, table
from hopopt.problem.catalogue import MARKS, Entry, catalogue, with_part
from hopopt.problem.catalogue_facts import fields
from hopopt.problem.catalogue_files import own_catalogue
from hopopt.problem.checking.entries import unit_of
from hopopt.problem.checking.mass_law import as_json as law_of

COLUMN_HEADINGS = {  # columns of the two tables: entry -> heading
    "motor": {
        "max_torque": "at standstill\nN m",
        "torque_cap": "short-time\nN m",
        "continuous_torque": "continuous\nN m",
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
VERIFIED = "verified"  # column: of the numbers that are stated, those that are not marked U
FIT = {"torque": "torque\nN m", "mass": "mass\nkg", "fitted": "fitted\nkg"}
Entries = Mapping[str, Entry]


def actuators(
    *,
    catalogue_: Annotated[Path | None, Parameter(name="--catalogue")] = None,
    fit: Annotated[bool, Flag] = False,
    json_: AsJson = False,
) -> int:
    """List the motors and gears that a problem can name.

    As in hopopt solve --set leg.gear=csg-20-100. A question mark stands behind what is unverified, a letter m behind the mass of a whole module. The files say where every value is from: problems/actuators.

    Parameters
    ----------
    catalogue_
        A .toml or .csv file of motors and gears of your own, checked and listed before the built-in ones.
    fit
        Show what torque weighs instead: power laws of mass against torque, fitted over motors and over gears, which
        co-design takes as --couple "catalogue: leg.body.mass by leg.motor.max_torque" (docs/codesign.md).
    """
    own = own_catalogue(catalogue_) if catalogue_ else {}
    listed = {**own, **catalogue()}
    laws = {part: law_of(part) for part in COLUMN_HEADINGS} if fit else {}
    data: dict[str, Any] = {f"{part}s": laws.get(part) or _entries(part, listed) for part in COLUMN_HEADINGS}
    notes = [note for entry in own.values() for note in entry.notes]
    return ended(data | ({"notes": notes} if own else {}), json_, _laws(laws) if fit else _tables(listed, notes))


def _entries(part: str, listed: Entries) -> dict[str, Any]:
    """{name: {"title", "sources", and of each entry or fact {"value", "unit", "source"}}} of all motors or gears."""
    units = {key: unit_of(field) or "1" for key, field in fields(part).items()}
    return {
        name: {"title": entry.title, "sources": [asdict(source) for source in entry.sources]}
        | {
            key: {"value": value, "unit": units[key], "source": MARKS[entry.marks[part][key]]}
            for key, value in entry.stated[part].items()
        }
        for name, entry in with_part(part, listed).items()
    }


def _tables(listed: Entries, notes: list[str]) -> Iterator[Shown]:
    """Motors, and gears, with their figures."""
    for part, heads in COLUMN_HEADINGS.items():
        rows = {
            name: [_cell(entry, part, key) for key in heads] + [_verified(entry, part)]
            for name, entry in with_part(part, listed).items()
        }
        yield _table(f"{part}s", {**heads, VERIFIED: VERIFIED}, rows, listed)
        yield ""
    yield from notes
    yield "? unverified, m of the whole module. To use one: --set leg.motor=NAME, --set leg.knee.gear=NAME, or"
    yield 'motor = "NAME" under [leg] or [leg.knee] in place of its table; masses change nothing there.'
    yield "--json lists all that is known of each, with its sources; docs/actuators.md has more."


def _cell(entry: Entry, part: str, key: str) -> str:
    stated = entry.stated[part]
    used = "module_mass" if key == "mass" and key not in stated else key
    if used not in stated:
        return "- "
    mark = "?" if entry.marks[part][used] == "U" else "m" if used != key else " "
    return f"{stated[used]:.4g}{mark}"


def _verified(entry: Entry, part: str) -> str:
    count = len(entry.stated[part])
    return f"{count - len(entry.unverified(part))}/{count}"


def _laws(laws: Mapping[str, Mapping[str, Any]]) -> Iterator[Shown]:
    """What the laws of mass against torque were fitted to, and what they say of it."""
    for part, law in laws.items():
        rows, unverified = dict[str, list[str]](), 0
        for name, row in law["fitted_to"].items():
            unsure = row["source"] == MARKS["U"]
            unverified += unsure
            rows[name] = [f"{row['torque']:.3g}", f"{row['mass']:.3g}{'?' if unsure else ' '}", f"{row['fitted']:.3g}"]
        yield _table(f"{part}s", FIT, rows, catalogue())
        yield (
            f"mass = {law['coefficient']:.3g} kg (torque / N m)^{law['exponent']:.3g}: {law['entries']} {part}s from "
            f"{law['lowest']:.3g} to {law['highest']:.3g} N m, typically off by a factor of {law['scatter']:.2g}; "
            f"exponent known to {law['exponent_error']:.2g}; {unverified} of the masses are unverified\n"
        )
    yield "To use one: --free leg.motor.max_torque=1:3 --free leg.body.mass=5:6.5"
    yield '--couple "catalogue: leg.body.mass by leg.motor.max_torque". docs/codesign.md has more.'


def _table(title: str, heads: Mapping[str, str], rows: Mapping[str, list[str]], listed: Entries) -> Table:
    """A row for each name; the last column, what an entry is called in full, only where the screen has room for it."""
    room = console().width >= WIDE_SCREEN
    columns = [named(title), *(Column(head, justify="right") for head in heads.values())]
    cells = [[name, *row, *([listed[name].title] if room else [])] for name, row in rows.items()]
    return table([*columns, *([""] if room else [])], cells)
