"""What verbs and methods of the Python interface share: progress, arguments that had another name, figures by name."""

import sys
import warnings
from collections.abc import Callable, Mapping
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from hopopt.api.notebook.bar import Bar, shell_of_a_notebook
from hopopt.design import Design
from hopopt.errors import UsageError
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.ocp.custom import Custom, Moment
from hopopt.ocp.objectives.objective import HopObjective

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Problem = Design | str | Path
Objective = str | Callable[[Moment], Any] | HopObjective
Constraint = str | Callable[[Moment], Any] | Custom
Progress = Callable[[str], None] | bool | None  # a function, True: lines on standard error, None: a bar in a notebook
P = ParamSpec("P")
R = TypeVar("R")
Found = TypeVar("Found")


def told(progress: Progress) -> Callable[[str], None]:
    """The function that is told how the work goes on: what was given, lines on standard error, or a bar in a notebook."""
    if callable(progress):
        return progress
    if progress is None and (shell := shell_of_a_notebook()) is not None:
        return Bar(shell)
    return _on_standard_error if progress else lambda text: None


def within(seconds: float | None) -> Deadline:
    """The moment by which work is to have ended; never without a limit. UsageError for what is no time."""
    if seconds is None:
        return NEVER
    if not seconds > 0:
        raise UsageError(f"time_limit = {seconds:g}: seconds above 0 are needed, or None for no limit")
    return NEVER.within(seconds)


def _on_standard_error(text: str) -> None:
    """A notebook shows it below the cell."""
    print(text, file=sys.stderr, flush=True)


def renamed(**names: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Let a function take arguments by their old names too, with a warning: old name = new name."""

    def wrap(function: Callable[P, R]) -> Callable[P, R]:
        @wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> R:
            given: dict[str, Any] = dict(kwargs)
            for old in names.keys() & given.keys():
                words = f"{function.__name__}({old}=...) is now {function.__name__}({names[old]}=...)"
                warnings.warn(words, DeprecationWarning, stacklevel=2)
                given[names[old]] = given.pop(old)
            return function(*args, **given)

        return call

    return wrap


def as_class(kind: type[Found], value: object, **parts: object) -> Found:
    """A value of hopopt's own as the class that users get, which adds methods alone; what was derived of it is kept.

    parts: fields in which other values lie, as the classes that users get
    """
    made = object.__new__(kind)
    vars(made).update(vars(value) | parts)
    return made


def figures(
    found: Found, known: "Mapping[str, Callable[[Found], Figure]]", name: str | None
) -> "dict[str, Figure] | Figure":
    """The figure called ``name``, or all by name; UsageError for another name."""
    check_figure(name, *known)
    return {key: draw(found) for key, draw in known.items()} if name is None else known[name](found)


def check_figure(name: str | None, *known: str) -> None:
    """UsageError for a figure that is none of these."""
    if name is not None and name not in known:
        raise UsageError(f"there is no figure {name!r}; there {'are' if len(known) > 1 else 'is'} {', '.join(known)}")
