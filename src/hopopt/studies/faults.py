"""What a study does where its own program is at fault: the part ends with its traceback kept, and the study goes on."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from traceback import format_exception
from typing import Any

from hopopt.errors import HopoptError, one_line
from hopopt.files import write_whole

KEPT = "its traceback lies in the folder, in *.traceback.txt: please report it"


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
        words = f"{type(error).__name__}: {one_line(error)}" if str(error).strip() else type(error).__name__
        return Fault(f"a fault of hopopt ended it ({words}); {KEPT}", "".join(format_exception(error)))
