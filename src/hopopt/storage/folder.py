"""Folders of results and the JSON in them: what every kind of result has in common."""

import json
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from hopopt.errors import ResultError
from hopopt.files import mark, remove_abandoned, write_whole
from hopopt.problem.render import printable


def prepare(results: Path) -> None:
    """Make sure that results can be written, before the work and without a trace; ResultError if not."""
    try:
        whole = results.absolute()
        there = next(path for path in (whole, *whole.parents) if path.exists() or path.is_symlink())
        with tempfile.TemporaryFile(dir=there):
            pass
    except OSError as error:
        raise ResultError(
            f"{results}: results cannot be written ({reason_of(error)}): choose another folder"
        ) from error


def reason_of(error: BaseException) -> str:
    """Why something failed, on one line of at most 200 characters."""
    words = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    words = "it was interrupted" if isinstance(error, KeyboardInterrupt) else words
    return printable(" ".join((words or type(error).__name__).split()))[:200]


def new_work_folder(results: Path) -> Path:
    """A folder below ``results`` to fill and then rename; what runs that were killed left of theirs is removed."""
    results.mkdir(parents=True, exist_ok=True)
    remove_abandoned(results)
    return Path(tempfile.mkdtemp(prefix=".writing-", suffix=mark(), dir=results))


def new_folder(wanted: Path) -> Path:
    """A new folder of the wanted name or, if that is taken, of the first of name-2, name-3, … that is not; of several
    processes each gets its own."""
    wanted.parent.mkdir(parents=True, exist_ok=True)
    while True:
        folder = _unused(wanted)
        with suppress(FileExistsError):  # another process may have taken the name meanwhile
            folder.mkdir()
            return folder


def published(work: Path, wanted: Path, named: Callable[[Path], object] = lambda folder: None) -> Path:
    """A filled work folder renamed to the wanted name or, if that is taken, to the first of name-2, name-3, … that is not.

    named: is told the name before, to note it in the work folder
    """
    os.chmod(work, 0o755)  # mkdtemp makes it private
    while True:
        folder = _unused(wanted)
        named(folder)
        try:
            return work.rename(folder)
        except OSError:
            if not os.path.lexists(folder):  # another process has not taken the name meanwhile
                raise


def _unused(folder: Path) -> Path:
    candidate, number = folder, 2
    while os.path.lexists(candidate):
        candidate, number = folder.with_name(f"{folder.name}-{number}"), number + 1
    return candidate


def write_json(data: Mapping[str, Any], path: Path) -> None:
    """Write a mapping as a JSON file (infinities become null)."""
    write_whole(path, (json.dumps(finite(data), indent=2) + "\n").encode())


def as_json(summary: Mapping[str, Any]) -> str:
    """A summary as one JSON object (infinities become null)."""
    return json.dumps(finite(summary))


def finite(value: Any) -> Any:
    """JSON data with null for infinities, which JSON does not know."""
    if isinstance(value, Mapping):
        return {k: finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(v) for v in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


@contextmanager
def writing(what: str, safe: str) -> Iterator[None]:
    """ResultError for whatever keeps ``what`` from being written: a full disk, a folder that became read-only, ...; ``safe``
    says what is not lost and how to go on."""
    try:
        yield
    except OSError as error:
        raise ResultError(f"{what} cannot be written ({reason_of(error)}); {safe}") from error


@contextmanager
def fitting(folder: Path | None) -> Iterator[None]:
    """ResultError in a sentence for whatever stored files that are incomplete or do not belong together lead to."""
    try:
        yield
    except (LookupError, ValueError, ArithmeticError, TypeError, AttributeError, StopIteration, RuntimeError) as error:
        raise ResultError(
            f"{folder}: the result is incomplete or its files do not fit together "
            f"({type(error).__name__}: {str(error)[:200]}): solve it again"
        ) from error
