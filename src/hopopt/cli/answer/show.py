"""The command that prints a stored answer, or a problem: show."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rich.table import Column

from hopopt.cli.options import AsJson, Overrides, ended
from hopopt.cli.screen.console import Shown, table
from hopopt.cli.screen.details import answer
from hopopt.design import Design
from hopopt.errors import UsageError
from hopopt.problem.load import as_json, load, rows
from hopopt.storage.folder import fitting
from hopopt.storage.solution import read, stated


def show(what: str = "paper", *, set_: Overrides = None, json_: AsJson = False) -> int:
    """Print a stored answer whole, or a problem with all its entries.

    Of an answer all that is known; of a problem every entry with its value, unit and meaning.

    Parameters
    ----------
    what
        A folder that hopopt solve wrote; or a problem file, or the name of a built-in problem.
    """
    if not Path(what).is_dir():
        design = load(what, set_ or ())
        return ended(as_json(design), json_, _problem(design))
    if set_:
        raise UsageError("--set changes an entry of a problem: a stored answer is shown as it is")
    with fitting(Path(what)):
        solution = read(what)
        return ended(stated(solution.shown), json_, answer(solution, all_of_it=True))


def _problem(design: Design) -> Iterator[Shown]:
    """Every entry with value, unit and meaning."""
    cells = []
    for row in rows(design):
        unset = "by default" if "(default" in row.meaning else "not set"
        cells.append([row.path, unset if row.value is None else _plain(row.value), row.unit, row.meaning])
    styles = {"entry": "bold", "value": "", "unit": "dim", "meaning": ""}
    columns = [Column(head, style=style, overflow="fold") for head, style in styles.items()]
    yield table(columns, cells, design.title or design.name)


def _plain(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"  # as a file has it
    return ", ".join(map(_plain, value)) or "none" if isinstance(value, (list, tuple)) else str(value)
