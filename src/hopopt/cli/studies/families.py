"""The command that tells which kinds of hop a leg has: families."""

import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

from rich.table import Column

from hopopt import amounts
from hopopt.cli.expected_time import ExpectedTime
from hopopt.cli.options import AsJson, Overrides, Problem, Results, drawn, ended, repeated
from hopopt.cli.screen.console import WIDE_SCREEN, NamedLines, Shown, console, figures, progress, table
from hopopt.errors import NotSolvedError
from hopopt.evidence.families import one_entry, open_folder, save
from hopopt.evidence.family_search import find_families
from hopopt.plots.studies.families import save as save_picture
from hopopt.problem.load import load
from hopopt.storage.folder import prepare
from hopopt.studies.faults import kept
from hopopt.studies.sweep.definition import Definition, define, parse

EVERY, FEW = 6, 3  # values that all have a column, where there is room and where there is not
FAMILY_ROWS = 8  # families; the rest is in the file
Cell = Callable[[Mapping[str, Any]], str]
Vary = Annotated[
    list[str] | None,
    repeated("--vary", "The entry to follow the families over: contact.friction=0.4:1.2:9, or =0.4,0.6,0.8."),
]


def families(
    problem: Problem = "paper",
    *,
    vary: Vary = None,
    set_: Overrides = None,
    starts: int | None = None,
    processes: int | None = None,
    verify: bool = True,
    results: Results = Path("results"),
    json_: AsJson = False,
) -> int:
    """Tell which kinds of hop a leg has, in words and a picture.

    And how their clearances cross over an entry. A family is a local optimum, followed from each value to the next. The best family at each value is refined and
    verified; the clearances of the others are those of the first mesh.

    Exit code: 0 fine, 1 no hop was found, 2 wrong usage, 3 the best at some value is not verified, or wider limits led
    to a lower hop; 130 stopped: what is known is kept.

    Parameters
    ----------
    starts
        Starting points at each value (default: the problem's solver.starts).
    processes
        How many values side by side (default: one for each core).
    verify
        Refine and verify the best family at each value.
    """
    amounts.check("starts", starts)
    amounts.check_processes(processes)
    definition = _definition(problem, vary, set_, starts)
    prepare(results)
    folder = open_folder(definition, results)
    try:
        parts = {"point of families": float(max(len(definition.points), 1))}
        with (
            progress(json_, ExpectedTime("families", definition.design, parts)) as say,
            kept(folder, "what is known is kept in families.json"),
        ):
            study = find_families(
                definition, processes or os.cpu_count() or 1, verify, say, lambda known: save(known, folder, False)
            )
            data = save(study, folder, True)
            say("drawing")
            safe = f"families.json in {folder} is complete"
            drawn(lambda: save_picture(study, folder), "the picture is missing", safe)
    except NotSolvedError:
        if not any(folder.glob("*.traceback.txt")):
            shutil.rmtree(folder)
        raise
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"interrupted; what is known is kept in {folder}") from None
    return ended(data, json_, shown(data), data["exit_code"])


def _definition(problem: str, vary: list[str] | None, set_: list[str] | None, starts: int | None) -> Definition:
    """What is asked for; without an entry, the problem alone."""
    design = load(problem, set_ or ())
    if not vary:
        return Definition(design, "clearance", (), starts=starts)
    return one_entry(define(design, parse(vary), starts=starts))


def shown(data: Mapping[str, Any]) -> Iterator[Shown]:
    """A row for each family, where the best changes, what is contradicted, where it all lies."""
    most, rows = EVERY if console().width >= WIDE_SCREEN else FEW, data["families"][:FAMILY_ROWS]
    columns = _every(data) if len(data["best"]) <= most else _three(data)
    over = f" over {data['entry']}" if data["entry"] else ""
    heads = ["", Column("what the leg does", max_width=60), *figures(*(head for head, _ in columns))]
    cells = [[f["name"], f["words"], *(cell(f) for _, cell in columns)] for f in rows]
    yield table(heads, cells, f"{data['problem']}: families of hops{over}")
    yield "clearance in m; * the best there; ~ of the first mesh, neither refined nor verified"
    if more := len(data["families"]) - len(rows):
        yield f"and {more} more in families.json, none of them the best anywhere"
    for f in rows:
        names = f["found_by"]
        others = f"; and {len(names) - 3} more" if len(names) > 3 else ""
        yield NamedLines(f"{f['name']} from", [f"{'; '.join(names[:3])}{others}"])
    yield NamedLines("best", [*_crossings(data), *_faults(data)])
    yield f"results {data['result_dir']}"


def _every(data: Mapping[str, Any]) -> list[tuple[str, Cell]]:
    """A column for each value: its head, and the cell of a family."""
    heads = [f"{v:g}" for v in data["values"]] or ["clearance"]
    return [(head, lambda f, k=k: _cell(data, f, k)) for k, head in enumerate(heads)]


def _three(data: Mapping[str, Any]) -> list[tuple[str, Cell]]:
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
