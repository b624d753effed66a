"""What all commands of the command line share."""

import os
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from hopopt.errors import UsageError

if TYPE_CHECKING:
    from hopopt.report.page import Content


def repeated(name: str, text: str) -> Parameter:
    """An option that may be given several times, one value each."""
    return Parameter(name=name, negative=(), consume_multiple=False, help=text)


Overrides = Annotated[
    list[str] | None,
    repeated("--set", "Override an entry: --set leg.gear.ratio=80 (repeat)."),
]
Constraints = Annotated[
    list[str] | None,
    repeated(
        "--constraint",
        "A path constraint of your own, a Python function as module:function (repeat; docs/objectives.md).",
    ),
]
Free = Annotated[
    list[str] | None,
    repeated(
        "--free", "Let the optimum choose a number of the leg: --free leg.gear.ratio=50:200 (repeat; docs/codesign.md)."
    ),
]
Couple = Annotated[
    list[str] | None,
    repeated(
        "--couple",
        'A relation of free numbers, "leg.thigh.length + leg.shank.length = 0.741", powers too, or "catalogue: MASS by TORQUE" (repeat).',
    ),
]
CrossChecked = Annotated[bool, Parameter(alias="--second-opinion", negative="--no-cross-check")]
AsJson = Annotated[
    bool, Parameter(name="--json", negative=(), help="Print one JSON object on standard output, nothing else.")
]


def progress(quiet: bool) -> AbstractContextManager[Callable[[str], None]]:
    """A function that shows progress on standard error, now and then when piped; silent if ``quiet``."""
    from hopopt.cli.screen import console as screen

    return screen.progress(quiet)


def content_of_results(results: Sequence[Path], command: str) -> "Content":
    """What stored results hold, for the command that shows it; UsageError without any."""
    from hopopt.report.content import content_of
    from hopopt.storage.folder import fitting

    with fitting(some_results(results, command)[0]):
        return content_of(results)


def some_results(results: Sequence[Path], command: str) -> Sequence[Path]:
    """The results that were given; UsageError, with an example, if none were."""
    if not results:
        example = f"hopopt {command} results/paper-0a1b2c3d"
        raise UsageError(f"give a folder that hopopt solve or hopopt compare wrote: {example}")
    return results


def say_written(paths: Sequence[Path], json_: bool, then: str = "") -> None:
    """Print which files were written, and what to do then."""
    from hopopt.storage.folder import as_json

    if json_:
        print(as_json({"written": [str(path) for path in paths], "exit_code": 0}))
    for path in () if json_ else paths:
        print(f"{path} written{then}")


def write_new(path: Path, text: str) -> None:
    """Write a file that must not exist yet, in a folder that may not; UsageError in a sentence, and no file, if that cannot
    be."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        if os.path.lexists(path) and isinstance(error, FileExistsError):
            raise UsageError(f"{path} exists already and is not overwritten: choose another name") from None
        with suppress(OSError):
            path.unlink(missing_ok=True)  # what was written of it
        raise UsageError(f"{path} cannot be written ({error.strerror}): choose another name or folder") from None
