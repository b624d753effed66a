"""The command that prints a stored answer, or a problem: show."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

from hopopt.cli.options import AsJson, Overrides
from hopopt.errors import UsageError

if TYPE_CHECKING:
    from hopopt.planner.solution import Solution


def show(what: str = "paper", *, set_: Overrides = None, json_: AsJson = False) -> int:
    """Print a stored answer whole, or a problem with all its entries.

    Of an answer all that is known; of a problem every entry with its value, unit and meaning.

    Parameters
    ----------
    what
        A folder that hopopt solve wrote; or a problem file, or the name of a built-in problem.
    """
    if Path(what).is_dir():
        from hopopt.storage.folder import fitting
        from hopopt.storage.solution import read

        if set_:
            raise UsageError("--set changes an entry of a problem: a stored answer is shown as it is")
        with fitting(Path(what)):
            print_solution(read(what), json_, whole=True)
        return 0
    from hopopt.problem.load import as_json, load, rows

    design = load(what, set_ or ())
    if json_:
        print(json.dumps(as_json(design)))
        return 0
    from hopopt.cli.screen.console import print_rows

    print_rows(design.title or design.name, rows(design))
    return 0


def print_solution(solution: "Solution", as_object: bool, whole: bool = False) -> None:
    """Print an answer: as one object, or for a person short or ``whole``; one that is not verified is never short, but
    where the time was up."""
    if as_object:
        from hopopt.storage.folder import as_json
        from hopopt.storage.solution import stated

        print(as_json(stated(solution.shown)))
        return
    from hopopt.cli.screen.answer import print_answer, print_late
    from hopopt.cli.screen.details import print_details

    s = solution.summary
    unverified = print_late if s.late else print_details
    show_it = print_details if whole else print_answer if s.verified else unverified
    show_it(solution)
    if solution.summary.codesign:
        from hopopt.cli.screen.codesign import print_codesign

        print_codesign(solution.summary.codesign)
    if solution.summary.second_opinions:
        from hopopt.cli.screen.cross_check import print_cross_checks

        print_cross_checks(solution.summary)
