"""The command that prints a stored answer, or a problem: show."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, astuple
from itertools import groupby
from pathlib import Path
from typing import Any

from rich.table import Column

from hopopt.cli.options import AsJson, Overrides, ended
from hopopt.cli.screen.console import Shown, figures, named, table
from hopopt.design import Design, Leg
from hopopt.errors import UsageError
from hopopt.leg.derived import LegFigures, derived
from hopopt.problem.checking.doubts import doubts
from hopopt.problem.load import as_json, load, rows
from hopopt.storage.folder import fitting

CORNERS = {"points": "points", "polygon": "corners of a polygon"}  # entries of a shape, in words
USUAL = {"at": (0.0, 0.0, 0.0), "radius": 0.0, "counts": True}  # entries of a shape that say nothing
SHAPE = re.compile(r".*\.shapes\.[^.]+")


def show(what: str = "paper", *, set_: Overrides = None, json_: AsJson = False) -> int:
    """Print a stored answer whole, or a problem with all its entries.

    Of an answer all that is known; of a sweep, a front or a comparison its table; of a problem every entry with its value,
    unit and meaning, and what follows from them.

    Parameters
    ----------
    what
        A folder that hopopt solve, sweep, pareto or compare wrote; or a problem file, or the name of a built-in problem.
    """
    if not Path(what).is_dir():
        design = load(what, set_ or ())
        found, far = derived(design), doubts(design)
        data = as_json(design) | {"derived": asdict(found), "doubts": far}
        return ended(data, json_, [*_problem(design), *_derived(design.leg, found, far)])
    if set_:
        raise UsageError("--set changes an entry of a problem: a stored answer is shown as it is")
    from hopopt.cli.answer.stored import stored

    with fitting(Path(what)):
        data, words = stored(Path(what))
        return ended(data, json_, words)


def _problem(design: Design) -> Iterator[Shown]:
    """Every entry with value, unit and meaning; a shape in one row, as a robot's file has thousands of its points."""
    cells = []
    for shape, group in groupby(rows(design), lambda row: "".join(SHAPE.findall(row.path))):
        if shape:
            entries = {row.path.rpartition(".")[2]: row.value for row in group}
            cells.append([shape, _shape(entries), "m", "a shape; all of it: --json"])
            continue
        for row in group:
            unset = "by default" if "(default" in row.meaning else "not set"
            cells.append([row.path, unset if row.value is None else _plain(row.value), row.unit, row.meaning])
    styles = {"entry": "bold", "value": "", "unit": "dim", "meaning": ""}
    columns = [Column(head, style=style, overflow="fold") for head, style in styles.items()]
    yield table(columns, cells, design.title or design.name)


def _derived(leg: Leg, found: LegFigures, far: Sequence[str]) -> Iterator[Shown]:
    """What follows from the entries, a row for each joint, and what is far outside what legs have."""
    push = "no joint lifts the foot" if found.push is None else f"{found.push:.2f} weights"
    yield "\nWhat follows from them"
    yield (
        f"mass {found.mass:.4g} kg, weight {found.weight:.4g} N, leg stretched {found.reach:.3g} m; push at the start, drives at "
        f"standstill: {push}"
    )
    of = {
        key: " or ".join(dict.fromkeys(getattr(leg.units(j), key) for j in leg.joints))
        for key in ("tau", "v", "inertia")
    }
    heads = (
        f"stall\n{of['tau']}", f"no load\n{of['v']}", "power\nW", f"rotor\n{of['inertia']}", f"links\n{of['inertia']}",
        f"hold\n{of['tau']}",
    )  # fmt: skip
    cells = [[j.name, *(f"{x:.3g}" for x in astuple(j)[1:])] for j in found.joints]
    yield table([named("joint"), *figures(*heads)], cells)
    yield (
        "stall and no load: torque at standstill and speed without torque, at the joint; rotor and links: inertia about the "
        "joint, reflected through the gear and in the start pose; hold: torque that keeps the start pose"
    )
    without = [j.name for j in found.joints if not (j.rotor_inertia or leg.linear(j.name))]
    if without:
        yield f"no rotor inertia at the {' and '.join(without)}: hops come out too high; look at leg.motor.rotor_inertia"
    yield from (f"doubt: {words}" for words in far)


def _shape(entries: Mapping[str, Any]) -> str:
    """A shape in words, from its entries by name."""
    given = {name: value for name, value in entries.items() if value != USUAL.get(name)}
    parts = [f"{len(given.pop(name))} {words}" for name, words in CORNERS.items() if name in given]
    return "; ".join([*parts, *(f"{name} {_plain(value)}" for name, value in given.items())])


def _plain(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"  # as a file has it
    return ", ".join(map(_plain, value)) or "none" if isinstance(value, (list, tuple)) else str(value)
