"""What modules of a user's own add by name: objectives, constraints, drive laws, schemes, strategies.

Each kind has one registry, which lies beside what it holds. A module enters its own there while it is imported, with a line
such as ``LAWS["derated"] = derated``. It is imported where it is asked for (``--with my_module``, or ``import`` in Python), or
because it is installed with an entry point of the group "hopopt". Problem files and results name; they never load.
"""

import hashlib
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from importlib.metadata import entry_points, packages_distributions, version
from inspect import signature
from itertools import count
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, TypeVar

from hopopt.errors import UsageError
from hopopt.record import Strict, adapter, stated
from hopopt.user_code import imported, last_line

T = TypeVar("T")
Name = tuple[str, str]  # kind and name of an entry, such as ("law", "derated")
GROUP = "hopopt"  # of entry points, each of which names a module
MODULE = re.compile(r"[A-Za-z_][A-Za-z0-9_.]{0,199}")
DIGITS = 16  # hexadecimal, of a digest

_registries: dict[str, "Registry[Any]"] = {}
_loading: list[str] = []  # modules that are being imported because they were asked for
_loaded: dict[str, ModuleType] = {}
_functions: dict[str, Callable[..., Any]] = {}  # the user's, by module:function, that were handed over
_needed: list[str] = []  # modules that files were found to need and that are not here
_broken: dict[str, str] = {}  # installed modules that cannot be imported, and why


class Registry(dict[str, T]):
    """What there is of one kind, by name: what is built in, and what modules of others have entered.

    An entry that is not there is looked for in installed extensions; UsageError, with what it needs, if there is none.
    """

    def __init__(self, kind: str, built_in: Mapping[str, T]):
        super().__init__(built_in)
        self.kind, self.built_in, self.origins = kind, tuple(built_in), dict[str, str]()
        _registries[kind] = self

    def __setitem__(self, name: str, value: T) -> None:
        if name in self.built_in:
            raise UsageError(f"the {self.kind} {name} is built in: choose another name")
        caller = str(sys._getframe(1).f_globals.get("__name__", "__main__"))
        self.enter(name, value, _loading[0] if _loading else caller)

    def __missing__(self, name: str) -> T:
        if not known(self.kind, name):
            raise missing(self.kind, name)
        return super().__getitem__(name)

    def enter(self, name: str, value: T, module: str) -> None:
        """Add an entry that comes from a module."""
        super().__setitem__(name, value)
        self.origins[name] = module

    @property
    def added(self) -> dict[str, T]:
        """The entries that are not built in."""
        return {name: value for name, value in self.items() if name not in self.built_in}


def known(kind: str, name: str) -> bool:
    """Whether there is an entry of that name, also in an installed extension; or a function that is called so."""
    if ":" in name:
        return _function(name) is not None
    return _has(kind, name) or (_with_installed() and _has(kind, name))


def names(kind: str) -> tuple[str, ...]:
    """Names of all entries of a kind, those of installed extensions only if one was looked for."""
    return tuple(_registries[kind]) if kind in _registries else ()


def _has(kind: str, name: str) -> bool:
    return name in _registries.get(kind, ())


# ---- modules ---------------------------------------------------------------------------------------------------


def load(module: str) -> None:
    """Import a module of the user's own with all that it enters; UsageError, in a sentence, if that cannot be."""
    if not MODULE.fullmatch(module):
        raise UsageError(f"--with {module!r:.60}: write the name of a module, such as my_module")
    _loading.append(module)
    try:
        _loaded[module] = imported(module, f"--with {module}")
    finally:
        _loading.pop()


@cache
def _with_installed() -> bool:
    """Import the modules of all entry points; those that fail are named where something is missing."""
    for point in entry_points(group=GROUP):
        _loading.append(point.module)
        try:
            _loaded[point.module] = point.load()
        except (Exception, SystemExit) as error:  # whatever a module raises
            _broken[point.module] = f"{type(error).__name__}: {last_line(error)}"
        finally:
            _loading.pop()
    return True


def note_needed(modules: Iterable[str]) -> None:
    """Modules that a file says it needs, so that what is missing can be asked for."""
    _needed.extend(m for m in modules if m not in _needed)


def absent(modules: Sequence[str]) -> list[str]:
    """Those of the modules that are not here."""
    origins = {origin for registry in _registries.values() for origin in registry.origins.values()}
    return [m for m in modules if m not in sys.modules and m not in origins]


def missing(kind: str, name: str) -> UsageError:
    """What to say where there is no entry of that name."""
    wanted = absent([name.partition(":")[0]] if ":" in name else _needed)
    if wanted:
        return UsageError(f"{kind} {name}: {needs(wanted)}")
    if name.startswith("__main__:"):
        words = "was defined in a notebook or script, where no other finds it: define it in a module of your own"
        return UsageError(f"{name.partition(':')[2]} {words}, which --with my_module or an import then gives")
    if ":" in name:
        again = f"give it again, or its module with --with {name.partition(':')[0]}"
        return UsageError(f"{name} is a user-defined function, which is only run where it is given: {again}")
    failed = "".join(f"; the installed {module} cannot be imported ({why})" for module, why in _broken.items())
    close = get_close_matches(name, names(kind), n=1)
    meant = f" (did you mean {close[0]}?)" if close else ""
    there = f"choose one of {', '.join(names(kind))}, or give" if names(kind) else "give"
    return UsageError(f"there is no {kind} {name!r}{meant}: {there} the module that has it, --with my_module{failed}")


def needs(modules: Sequence[str]) -> str:
    """That modules are needed, and how to give them."""
    options = " ".join(f"--with {module}" for module in modules)
    return f"needs {' and '.join(modules)}: add {options}, or import {', '.join(modules)} in Python"


# ---- functions by their full name ------------------------------------------------------------------------------


def hand_over(name: str, function: Callable[..., Any]) -> str:
    """Let a function of the user's be named as module:function in this process and in those that work for it; its name,
    numbered if it is made within a function, or a lambda, and another such one has that name already."""
    numbered = (f"{name}{'' if k == 1 else f'-{k}'}" for k in count(1))
    free = next(n for n in numbered if "<" not in n or n not in _functions or _alike(_functions[n], function))
    _functions[free] = function
    return free


def _alike(one: Callable[..., Any], other: Callable[..., Any]) -> bool:
    """Whether two functions are the same code with the same values."""
    return one is other or (_content(one) is not None and _content(one) == _content(other))


def _content(function: Callable[..., Any]) -> tuple[Any, ...] | None:
    """The code, and the numbers and words that it holds; None if it holds anything else."""
    if not isinstance(function, FunctionType):
        return None
    held = [*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).values()]
    try:
        held += [cell.cell_contents for cell in function.__closure__ or ()]
    except ValueError:  # a cell that nothing was put into yet
        return None
    plain = all(isinstance(value, bool | int | float | str | None) for value in held)
    return (function.__code__, held) if plain else None


def function(name: str) -> Callable[..., Any]:
    """The user's function called module:function, of those that were handed over or lie in a module that was asked for."""
    if (found := _function(name)) is None:
        raise missing("function", name)
    return found


def _function(name: str) -> Callable[..., Any] | None:
    module, _, attribute = name.partition(":")
    found = _functions.get(name) or getattr(_loaded.get(module), attribute, None)
    marked = getattr(
        sys.modules.get(module), attribute, None
    )  # of one that Python imported, what says that it is for this
    found = found or (marked if hasattr(marked, "hopopt_terms") else None)
    return found if callable(found) else None


def arguments(function: Callable[..., Any]) -> int:
    """How many arguments a function needs."""
    return sum(p.default is p.empty for p in signature(function).parameters.values())


# ---- other processes -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Carried:
    """A function that takes what was added here along to another process."""

    function: Callable[..., Any]
    modules: tuple[str, ...]
    entries: tuple[tuple[str, str, Any, str], ...]  # kind, name, value, module
    functions: Mapping[str, Callable[..., Any]]

    def __call__(self, *given: Any) -> Any:
        for module in self.modules:
            load(module)
        for kind, name, value, module in self.entries:
            _registries[kind].enter(name, value, module)
        _functions.update(self.functions)
        return self.function(*given)


def carried(function: Callable[..., T]) -> Callable[..., T]:
    """The function for another process, with all that was added to hopopt in this one."""
    entries = tuple(
        (k, n, x, r.origins[n]) for k, r in _registries.items() for n, x in r.added.items() if n in r.origins
    )
    return (
        Carried(function, tuple(_loaded), entries, dict(_functions)) if entries or _functions or _loaded else function
    )


# ---- what a result says of them --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Extension(Strict):
    """A module of the user's own that an answer was found with."""

    module: str = stated("its name")
    version: str = stated("its own, or that of the package it came in; empty if there is none")
    digest: str = stated("first 16 digits of the SHA-256 of its source; empty if it lies in no file")
    entries: tuple[str, ...] = stated("kind and name of each entry that was used, such as 'law derated'")


def used(wanted: Iterable[Name]) -> tuple[Extension, ...]:
    """The modules that these entries come from, each with those of them that it entered."""
    found: dict[str, list[str]] = {}
    for kind, name in dict.fromkeys(wanted):
        if (module := origin(kind, name)) is not None:
            found.setdefault(module, []).append(f"{kind} {name}")
    return tuple(Extension(module, version_of(module), digest_of(module), tuple(n)) for module, n in found.items())


def origin(kind: str, name: str) -> str | None:
    """The module that an entry comes from; None of one that is built in, or that is not there."""
    if ":" in name:
        return name.partition(":")[0]
    return _registries[kind].origins.get(name) if known(kind, name) else None


def version_of(module: str) -> str:
    """The version that a module states, or that of the distribution it came in."""
    stated = getattr(sys.modules.get(module), "__version__", None)
    packages = packages_distributions().get(module.partition(".")[0], ()) if stated is None else ()
    return str(stated)[:50] if stated is not None else version(packages[0]) if packages else ""


def digest_of(module: str) -> str:
    """Digest of a module's source: of a package all of its files, by name."""
    place = getattr(sys.modules.get(module), "__file__", None)
    if place is None or not Path(place).is_file():
        return ""
    folder = Path(place).parent
    files = sorted(folder.rglob("*.py")) if Path(place).name == "__init__.py" else [Path(place)]
    total = hashlib.sha256()
    for file in files:
        total.update(f"{file.relative_to(folder).as_posix()}\n".encode() + file.read_bytes())
    return total.hexdigest()[:DIGITS]


def doubts(recorded: Iterable[Extension]) -> list[str]:
    """A sentence for each module that an answer needs and that is not here, or not as it was."""
    found = []
    for e in recorded:
        if absent([e.module]) and _with_installed() and absent([e.module]):
            found.append(needs([e.module]))
        elif e.digest and (here := digest_of(e.module)) != e.digest:
            found.append(f"{e.module} is not as it was: its digest is {here or 'unknown'}, not {e.digest}")
    return found


def stored_doubts(data: Mapping[str, Any]) -> list[str]:
    """The same of what a stored study or comparison says of itself."""
    return doubts(adapter(Extension).validate_python(module) for module in data.get("extensions", ()))
