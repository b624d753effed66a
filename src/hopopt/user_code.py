"""Code of the user's own, named as ``module:name`` on the command line or in Python, never in a problem file."""

import importlib
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from types import ModuleType
from typing import Any

from hopopt.errors import UsageError


def load(name: str) -> Any:
    """What ``module:name`` names, the module looked for in the current folder first; UsageError if not found."""
    module, colon, attribute = name.partition(":")
    if not colon or not module or not attribute:
        raise UsageError(f"{name}: write module:name")
    try:
        return getattr(imported(module, name), attribute)
    except AttributeError as error:
        raise _not_imported(name, error) from None


def imported(module: str, named: str) -> ModuleType:
    """A module, looked for in the current folder first; UsageError, which says how it was ``named``, if not found."""
    if os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    try:
        return importlib.import_module(module)
    except (Exception, SystemExit) as error:  # whatever the module raises
        raise _not_imported(named, error) from None


def _not_imported(named: str, error: BaseException) -> UsageError:
    where = ": is it in the current folder or on PYTHONPATH?" if isinstance(error, ImportError) else ""
    return UsageError(f"{named} cannot be imported: {type(error).__name__}: {last_line(error)}{where}")


def last_line(error: BaseException) -> str:
    """The last line of an error's message, of at most 200 characters."""
    return (str(error).strip().splitlines() or ["no message"])[-1][:200]


# ---- what its functions are given, and give ----------------------------------------------------------------------

TRIED = (
    200  # random instants; sizes of what they consist of span SIZES, so that roots and logarithms are defined at some
)
SIZES = 1e-2, 1e4  # [SI units]


def fault_of(value: Any, given: Sequence[Any]) -> str:
    """Why an optimiser cannot use an expression, to follow a function's name; empty if it can.

    value: column of CasADi expressions; given: the symbols of which it may be made
    """
    import casadi as ca  # takes a while
    import numpy as np

    x = ca.vertcat(*map(ca.vec, given))
    made = ca.Function("made", [x], [value], {"allow_free": True})
    if made.has_free():
        return f"depends on {', '.join(map(str, made.free_sx()))}, which is no part of the moment that it is given"
    slopes = ca.jacobian(value, x)
    if any(slopes[row, :].is_zero() for row in range(value.numel())):
        return "has no slope: return a difference such as 500 - now.f[-1], not a comparison, a step or a constant"
    random, (least, most) = np.random.default_rng(0), np.log10(SIZES)
    sizes = 10 ** random.uniform(least, most, (x.numel(), TRIED))
    values = np.array(made(sizes * random.choice([-1, 1], sizes.shape)))
    return "" if np.isfinite(values).any(axis=1).all() else "is no finite number (NaN or infinite) at any instant"


def expressions(given: Any) -> Iterator[Any]:
    """All CasADi expressions in a dataclass and in the mappings and dataclasses that it holds."""
    if hasattr(given, "numel"):
        yield given
    else:
        for part in (
            given.values() if isinstance(given, Mapping) else vars(given).values() if is_dataclass(given) else ()
        ):
            yield from expressions(part)


def copied(given: Any) -> Any:
    """The same, each expression and mapping a copy: who writes into it changes nothing for others."""
    if hasattr(given, "numel"):
        return type(given)(given)
    if isinstance(given, Mapping):
        return {name: copied(part) for name, part in given.items()}
    if is_dataclass(given) and not isinstance(given, type):
        return replace(given, **{f.name: copied(getattr(given, f.name)) for f in fields(given)})
    return given
