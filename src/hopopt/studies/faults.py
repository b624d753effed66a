"""What a study does where its own program is at fault: the part ends with its traceback kept, and the study goes on."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from traceback import format_exception
from typing import Any

from hopopt.errors import HopoptError, SolverError, one_line
from hopopt.extensions import carried
from hopopt.files import write_whole

TRACEBACK_KEPT = "its traceback lies in the folder, in *.traceback.txt: please report it"


@dataclass(frozen=True)
class Fault:
    """An error that is none of the problem's: what is said of it in a sentence, and its traceback."""

    sentence: str
    traceback: str

    def keep(self, folder: Path, name: str) -> None:
        """Write the traceback; OSError if that cannot be."""
        write_whole(folder / f"{name}.traceback.txt", self.traceback.encode())


def guarded(job: Callable[..., Any], *given: Any, **named: Any) -> Any:
    """What a job returns, or the Fault that ended it; raises the errors that are sentences already (HopoptError)."""
    try:
        return job(*given, **named)
    except HopoptError:
        raise
    except Exception as error:
        return _fault(error)


def side_by_side(
    job: Callable[..., Any], given: Mapping[Any, tuple[Any, ...]], processes: int
) -> Iterator[tuple[Any, Any]]:
    """The key of each job with what it returned, or with the Fault that ended it, as they end.

    job: what is done, a function of a module
    given: its arguments by key
    processes: how many jobs at a time; 1: in this process, in order
    """
    if processes == 1 or len(given) < 2:
        yield from (_keyed(key, job, arguments) for key, arguments in given.items())
        return
    from joblib import Parallel, delayed

    tasks = (delayed(carried(_keyed))(key, job, arguments) for key, arguments in given.items())
    yield from Parallel(n_jobs=processes, backend="loky", return_as="generator_unordered")(tasks)  # type: ignore[misc]


def _keyed(key: Any, job: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[Any, Any]:
    """A program that no solver can work on is a Fault too: it does not end the others' study."""
    try:
        return key, guarded(job, *arguments)
    except SolverError as error:
        return key, Fault(one_line(error), "".join(format_exception(error)))


@contextmanager
def kept(folder: Path | None, finished: str) -> Iterator[None]:
    """HopoptError, in a sentence that ends with what is ``finished``, for a fault of hopopt between the parts of a study, whose
    traceback is kept in the study's folder. Without a folder the fault passes as it is."""
    try:
        yield
    except (HopoptError, OSError):
        raise
    except Exception as error:
        if folder is None:
            raise
        fault = _fault(error)
        fault.keep(folder, "study")
        raise HopoptError(f"{folder}: {fault.sentence}; {finished}") from error


def _fault(error: Exception) -> Fault:
    words = f"{type(error).__name__}: {one_line(error)}" if str(error).strip() else type(error).__name__
    return Fault(f"a fault of hopopt ended it ({words}); {TRACEBACK_KEPT}", "".join(format_exception(error)))
