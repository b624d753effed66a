"""The command that tells which kinds of hop a leg has: families."""

import logging
import os
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from hopopt import amounts
from hopopt.cli.options import AsJson, Overrides, progress, repeated
from hopopt.errors import NotSolvedError

if TYPE_CHECKING:
    from hopopt.evidence.families import FamilyStudy
    from hopopt.studies.sweep.definition import Definition

Vary = Annotated[
    list[str] | None,
    repeated("--vary", "The entry to follow the families over: contact.friction=0.4:1.2:9, or =0.4,0.6,0.8."),
]


def families(
    problem: str = "paper",
    *,
    vary: Vary = None,
    set_: Overrides = None,
    starts: int | None = None,
    processes: int | None = None,
    verify: bool = True,
    results: Path = Path("results"),
    json_: AsJson = False,
) -> int:
    """Tell which kinds of hop a leg has, in words and a picture.

    And how their clearances cross over an entry. A family is a local optimum, followed from each value to the next. The best family at each value is refined and
    verified; the clearances of the others are those of the first mesh.

    Exit code: 0 fine, 1 no hop was found, 2 wrong usage, 3 the best at some value is not verified, or wider limits led
    to a lower hop; 130 stopped: what is known is kept.

    Parameters
    ----------
    problem
        A problem file, or the name of a built-in one.
    starts
        Starting points at each value (default: the problem's solver.starts).
    processes
        How many values side by side (default: one for each core).
    verify
        Refine and verify the best family at each value.
    results
        Folder for the results; each run gets a new folder inside it.
    """
    amounts.check("starts", starts)
    amounts.check_processes(processes)
    definition = _definition(problem, vary, set_, starts)
    from hopopt.evidence.families import open_folder, save
    from hopopt.evidence.family_search import find_families
    from hopopt.storage.folder import as_json, prepare
    from hopopt.studies.faults import kept

    prepare(results)
    folder = open_folder(definition, results)
    try:
        with progress(quiet=json_) as say, kept(folder, "what is known is kept in families.json"):
            study = find_families(
                definition, processes or os.cpu_count() or 1, verify, say, lambda known: save(known, folder, False)
            )
            data = save(study, folder, True)
            say("drawing")
            _draw(study, folder)
    except NotSolvedError:
        if not any(folder.glob("*.traceback.txt")):
            shutil.rmtree(folder)
        raise
    except KeyboardInterrupt:
        print(f"hopopt: interrupted; what is known is kept in {folder}", file=sys.stderr)
        return 130
    _answer(data, as_json(data) if json_ else None)
    return int(data["exit_code"])


def _definition(problem: str, vary: list[str] | None, set_: list[str] | None, starts: int | None) -> "Definition":
    """What is asked for; without an entry, the problem alone."""
    from hopopt.evidence.families import one_entry
    from hopopt.problem.load import load
    from hopopt.studies.sweep.definition import Definition, define, parse

    design = load(problem, set_ or ())
    if not vary:
        return Definition(design, "clearance", (), starts=starts)
    return one_entry(define(design, parse(vary), starts=starts))


def _draw(study: "FamilyStudy", folder: Path) -> None:
    from hopopt.plots.studies.families import save
    from hopopt.storage.folder import reason_of

    try:
        save(study, folder)
    except Exception as error:  # the families are what took the time
        words = f"the picture is missing ({reason_of(error)}); families.json in {folder} is complete"
        logging.getLogger(__name__).warning(words)


def _answer(data: dict[str, Any], as_object: str | None) -> None:
    if as_object is not None:
        print(as_object)
        return
    from hopopt.cli.screen.families import print_families

    print_families(data)
