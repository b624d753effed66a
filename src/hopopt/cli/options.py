"""What all commands of the command line share: options, notes, what keeps work that was done, and how each of them ends."""

import logging
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from hopopt.cli.screen.console import Shown, as_is, show
from hopopt.errors import UsageError
from hopopt.storage.folder import as_json, reason_of


def repeated(name: str, text: str) -> Parameter:
    """An option that may be given several times, one value each."""
    return Parameter(name=name, negative=(), consume_multiple=False, help=text)


def sizes(name: str, text: str) -> Parameter:
    """An option that takes several numbers at once, and shows its default so."""
    shown = " ".join
    return Parameter(
        name=name, negative=(), consume_multiple=True, help=text, show_default=lambda given: shown(map(str, given))
    )


Problem = Annotated[str, Parameter(help="A problem file, or the name of a built-in one.")]
Solved = Annotated[Path, Parameter(help="A folder that hopopt solve wrote.")]
Overrides = Annotated[list[str] | None, repeated("--set", "Override an entry: --set leg.gear.ratio=80 (repeat).")]
Constraints = Annotated[
    list[str] | None,
    repeated(
        "--constraint",
        "A path constraint of your own, a Python function as module:function (repeat; docs/objectives.md).",
    ),
]
Own = Annotated[
    str | None,
    Parameter(help="The function of your own that it was found with, if it was: module:function."),
]
Starts = Annotated[
    int | None,
    Parameter(help="How many different starting points to solve from (default: the problem's solver.starts)."),
]
Results = Annotated[Path, Parameter(help="Folder for the results; each run gets a new folder inside it.")]
Figure = Annotated[bool, Parameter(help="Draw the figure.")]
Figures = Annotated[bool, Parameter(help="Draw the figures.")]
Output = Annotated[Path, Parameter(name=["--output", "-o"], help="The file to write.")]
LogNames = Annotated[Path | None, Parameter(name="--map")]
Flag = Parameter(negative=())
AsJson = Annotated[
    bool, Parameter(name="--json", negative=(), help="Print one JSON object on standard output, nothing else.")
]


def ended(data: Mapping[str, Any], json_: bool, shown: Iterable[Shown], code: int = 0) -> int:
    """The end of a command: what it found, as one JSON object, or as a person is ``shown`` it; returns its exit code."""
    if json_:
        print(as_json(data))
    else:
        show(shown)
    return code


def note(words: str) -> None:
    """One line on standard error, beside what a command prints."""
    print(f"hopopt: {words}", file=sys.stderr)


def drawn(draw: Callable[[], Any], missing: str, safe: str) -> None:
    """Draw what is already saved: the data are what took the time, so figures that fail are only reported, with what is
    ``safe``."""
    try:
        draw()
    except (Exception, KeyboardInterrupt) as error:
        logging.getLogger(__name__).warning(f"{missing} ({reason_of(error)}); {safe}")


def some_results(results: Sequence[Path], command: str) -> Sequence[Path]:
    """The results that were given; UsageError, with an example, if none were."""
    if not results:
        example = f"hopopt {command} results/paper-0a1b2c3d"
        raise UsageError(f"give a folder that hopopt solve or hopopt compare wrote: {example}")
    return results


def written(paths: Sequence[Path], json_: bool, then: str = "", more: Mapping[str, Any] | None = None) -> int:
    """The end of a command that wrote files: which, and what to do then; ``more``: what JSON says besides."""
    data = {"written": [str(path) for path in paths], **(more or {}), "exit_code": 0}
    return ended(data, json_, (as_is(f"{path} written{then}") for path in paths))


def check_new(path: Path) -> None:
    """UsageError in a sentence for a file that is there already: told before work of minutes begins."""
    if os.path.lexists(path):
        raise UsageError(f"{path} exists already and is not overwritten: choose another name")


def write_new(path: Path, text: str, hint: str = "") -> None:
    """Write a file that must not exist yet, in a folder that may not; UsageError in a sentence, which ends with the ``hint``
    where another file is in the way, and no file, if that cannot be."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        if os.path.lexists(path) and isinstance(error, FileExistsError):
            raise UsageError(f"{path} exists already and is not overwritten: choose another name{hint}") from None
        with suppress(OSError):
            path.unlink(missing_ok=True)  # what was written of it
        raise UsageError(f"{path} cannot be written ({error.strerror}): choose another name or folder") from None
