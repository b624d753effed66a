"""Functions of the user's own that a problem is given by name: constraints, and the objective of a study."""

from collections.abc import Callable, Sequence
from typing import Any

from hopopt import extensions
from hopopt.design import Design
from hopopt.errors import UsageError, one_line
from hopopt.problem.load import changed
from hopopt.user_code import load as imported

Function = str | Callable[..., Any]


def name_of(given: Any) -> str:
    """What a function of the user's is called, so that it can be named from here on: its name, if it is given by that.

    given: a name of a registry, a name module:function, or a function
    """
    if isinstance(given, str) and ":" not in given:
        return given
    found = imported(given) if isinstance(given, str) else given
    if not callable(found):
        raise UsageError(f"{given!r:.80} is not a function: give one, or its name module:function")
    return extensions.hand_over(given if isinstance(given, str) else _called(found), found)


def _called(given: Any) -> str:
    """What a function is called, as module:function: by itself, if it has a name of that kind, else by Python."""
    if isinstance(own := getattr(given, "name", None), str) and ":" in own:
        return own
    return f"{getattr(given, '__module__', '?')}:{getattr(given, '__qualname__', type(given).__name__)}"


def with_constraints(design: Design, constraints: Sequence[Function]) -> Design:
    """The problem with more path constraints of the user's own; ProblemFileError for a name that is none."""
    if not constraints:
        return design
    _check_apart(constraints)
    names = dict.fromkeys([*(design.hop.constraints or ()), *map(name_of, constraints)])
    return changed(design, {"hop.constraints": list(names)})


def named_apart(design: Design, constraints: Sequence[Function]) -> tuple[Design, list[Function]]:
    """The problem with those of the constraints that are given by a name of the registry, and the others."""
    _check_apart(constraints)
    by_name = [c for c in constraints if isinstance(c, str) and ":" not in c]
    return with_constraints(design, by_name), [c for c in constraints if c not in by_name]


def _check_apart(constraints: Sequence[Function]) -> None:
    """UsageError for different functions of one name, of which only one could be found by it."""
    known = dict[str, Function]()
    for given in (c for c in constraints if callable(c)):
        if known.setdefault(name := _called(given), given) is not given:
            raise UsageError(f"two different constraints are called {name}: give each a name of its own, with def")


def check_can_be_sent(processes: int | None, *given: Any) -> None:
    """UsageError, with what to do, for a function that cannot go to worker processes where there are several."""
    for function in [] if processes == 1 else [f for f in given if callable(f)]:
        from joblib.externals.loky.backend.reduction import dumps  # takes a while

        try:
            dumps(function)
        except Exception as error:  # whatever it holds
            words = f"{name_of(function)} cannot go to worker processes ({one_line(error)[:60]})"
            raise UsageError(f"{words}: give processes=1, or put it in a module of its own") from None
