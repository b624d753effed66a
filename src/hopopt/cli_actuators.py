"""The command that lists the catalogue of motors and gears."""

import json
from typing import Any

from hopopt.cli_app import AsJson

FIGURES = {  # columns of the two tables: entry -> heading
    "motor": {
        "max_torque": "at standstill\nN m",
        "torque_cap": "drive's cap\nN m",
        "max_speed": "no-load speed\nrad/s",
        "rotor_inertia": "rotor inertia\nkg m^2",
    },
    "gear": {
        "ratio": "ratio\n1",
        "torque_cap": "repeated peak\nN m",
        "speed_cap": "input speed\nrad/s",
        "inertia": "input inertia\nkg m^2",
        "efficiency": "efficiency\n1",
    },
}


def actuators(*, json_: AsJson = False) -> int:
    """List the motors and gears that a problem can name: hopopt solve --set leg.gear=csg-20-100.

    A question mark stands behind what is unverified. The files say where every value is from: problems/actuators.
    """
    if json_:
        print(json.dumps({f"{part}s": _as_json(part) for part in FIGURES}))
        return 0
    from hopopt.screen import wide_console

    out = wide_console()
    for part in FIGURES:
        out.print(_table(part))
        out.print()
    out.print("? unverified. To use one: --set leg.motor=NAME, --set leg.knee.gear=NAME, or in a problem file")
    out.print('motor = "NAME" under [leg] or [leg.knee] in place of its table. docs/actuators.md has more.')
    return 0


def _as_json(part: str) -> dict[str, Any]:
    """{name: {"title", entry: {"value", "unit", "source"}}} of all motors or gears."""
    from hopopt.actuators import MARKS, catalogue, names
    from hopopt.leg.design import Gear, Motor
    from hopopt.problem_words import unit_of

    fields, found = {"motor": Motor, "gear": Gear}[part].model_fields, {}
    for name in names(part):
        entry = catalogue()[name]
        found[name] = {"title": entry.title} | {
            key: {"value": value, "unit": unit_of(fields[key]) or "1", "source": MARKS[entry.marks[part][key]]}
            for key, value in entry.parts[part].items()
        }
    return found


def _table(part: str) -> Any:
    from rich.table import Table

    from hopopt.actuators import catalogue, names

    table = Table(box=None, pad_edge=False)
    table.add_column(f"{part}s", style="bold")
    for heading in FIGURES[part].values():
        table.add_column(heading, justify="right")
    table.add_column("")
    for name in names(part):
        entry = catalogue()[name]
        values, marks = entry.parts[part], entry.marks[part]
        figures = [f"{values[key]:.4g}{'?' if marks[key] == 'U' else ' '}" for key in FIGURES[part]]
        table.add_row(name, *figures, entry.title)
    return table
