"""Everything that can go wrong for a user: one base class, one class per cause, data attached."""

from collections.abc import Sequence


def one_line(error: Exception) -> str:
    """An error's sentences in one line, told apart by semicolons."""
    lines = [" ".join(line.split()) for line in str(error).splitlines() if line.strip()]
    return " ".join(line if line[-1] in ".:;" else f"{line};" for line in lines).removesuffix(";")


class HopoptError(Exception):
    """Base of all errors hopopt raises on purpose; ``exit_code`` is what the command line returns."""

    exit_code = 1


class UsageError(HopoptError):
    """A command or call that cannot be carried out as given."""

    exit_code = 2


class ProblemFileError(UsageError):
    """A problem file that cannot be used; ``problems`` holds one sentence for each fault found."""

    def __init__(self, source: str, problems: Sequence[str]):
        self.source, self.problems = source, list(problems)
        super().__init__("\n".join(self.problems))


class NotSolvedError(HopoptError):
    """No start led to a solution; ``diagnosis`` holds one sentence for each of the worst constraints."""

    def __init__(self, message: str, diagnosis: Sequence[str] = ()):
        self.diagnosis = list(diagnosis)
        super().__init__("\n".join([message, *self.diagnosis]))


class SolverError(NotSolvedError):
    """A solver that cannot work on a program: limits that cross, numbers that are none."""


class ResultError(UsageError):
    """A results folder that cannot be read."""


class MissingExtraError(UsageError):
    """A part of hopopt that needs a library of an optional extra, which is not installed."""

    def __init__(self, library: str, extra: str):
        self.library, self.extra = library, extra
        super().__init__(f"{library} is not installed: pip install 'hopopt[{extra}]'")
