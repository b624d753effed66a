"""Code of the user's own, named as ``module:name`` on the command line or in Python, never in a problem file."""

import importlib
import os
import sys
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
