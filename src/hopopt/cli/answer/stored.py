"""A folder of results as the command show prints it."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from hopopt import extensions
from hopopt.cli.options import note
from hopopt.cli.screen import hops, runs
from hopopt.cli.screen.console import Shown
from hopopt.cli.screen.details import answer
from hopopt.cli.screen.studies import of_front, of_sweep
from hopopt.storage.runs import read_data
from hopopt.storage.solution import read, stated
from hopopt.studies.pareto.front import read_front
from hopopt.studies.sweep.run import is_study, study_in


def stored(folder: Path) -> tuple[Mapping[str, Any], Iterable[Shown]]:
    """What a folder holds, as data and in words: an answer whole, of a study its table; ResultError if it holds none."""
    if (study := _study(folder)) is not None:
        for words in extensions.stored_doubts(study[0]):
            note(words)
        return study
    solution = read(folder)
    return stated(solution.shown), answer(solution, all_of_it=True)


def _study(folder: Path) -> tuple[Mapping[str, Any], Iterable[Shown]] | None:
    """A sweep, a front or a comparison as it was stored, and its table; None of a folder that holds none."""
    if is_study(folder):
        found = study_in(folder)
        return found.as_dict(), of_sweep(found)
    if (folder / "front.json").is_file():
        front = read_front(folder)
        return front.as_dict(), of_front(front)
    for what, table_of in (("comparison", runs.comparison), ("hops", hops.hops)):
        if (folder / f"{what}.json").is_file():
            data = {**read_data(folder, what)[1], "result_dir": str(folder)}
            return data, table_of(data)
    return None
