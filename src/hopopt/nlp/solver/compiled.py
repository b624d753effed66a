"""Small functions as machine code: written in C by CasADi, compiled once, kept in the user's cache.

A library has the name of what it was made from, so it serves every problem of the same form, whatever its numbers. Its
name holds the digest of its content too: one that is damaged would end the process, so it is not loaded but made again.
Within ``compiling()`` libraries that are missing are made, which takes seconds; everywhere those that exist are used.
What was missing elsewhere is kept in mind (``missing``), for a process that has nothing else to do.
Digits do not depend on it: the operations and their order are CasADi's own, and none are contracted. Without a
compiler, or where anything fails, functions stay as they are. The folder holds no more than MOST_BYTES bytes: what was not
used for longest is removed.
"""

import hashlib
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import casadi as ca

from hopopt.files import mark, remove_abandoned, write_whole

FOLDER = "HOPOPT_CACHE"  # environment variable: a folder in place of the user's cache, or "off"
FLAGS = ("-O1", "-fPIC", "-shared", "-ffp-contract=off")
MOST_MISSING = 32  # functions that were missing; a program has about 10
MOST_BYTES = 100_000_000  # bytes of all libraries; those of a problem have about 200_000
COMPILER_TIME_LIMIT = 120  # s of the compiler; the largest leg takes 10
WORTH_IT = 400  # steps of a function, below which calling it costs as much as computing it
_making = False  # by this process; whoever makes libraries solves one problem at a time (studies/sweep/point.py)
_failed: set[str] = set()  # what this process could not make
_missing: dict[str, str] = {}  # what this process would have used, serialized, by key


@contextmanager
def compiling() -> Iterator[None]:
    """Make libraries that are missing: for studies that solve many problems of one form."""
    global _making
    before, _making = _making, True
    try:
        yield
    finally:
        _making = before


def compiled(function: ca.Function) -> ca.Function:
    """The function from its library, if there is one or it may be made; else itself."""
    if function.n_instructions() < WORTH_IT:
        return function
    try:
        folder = cache_folder()
        library = folder and (_kept(folder, _key(function)) or (_made(function, folder) if _making else None))
        if library:
            return ca.external(function.name(), str(library))
        if os.environ.get(FOLDER) != "off" and len(_missing) < MOST_MISSING:
            _missing[_key(function)] = function.serialize()
    except (OSError, RuntimeError, subprocess.SubprocessError):  # no reason to lose the answer
        pass
    return function


def missing() -> list[str]:
    """Functions, serialized, that this process would have had from libraries since this was last asked, the longest first;
    none where there is no compiler."""
    found = sorted(_missing.values(), key=len, reverse=True)
    _missing.clear()
    return found if shutil.which("cc") else []


def make_library(serialized: str) -> None:
    """Make the library of a function that was ``missing``, for later processes."""
    with compiling():
        compiled(ca.Function.deserialize(serialized))


def _key(function: ca.Function) -> str:
    """A name for all that a library depends on, but the compiler."""
    parts = (function.serialize(), ca.__version__, sys.platform, platform.machine(), *FLAGS)
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:32]


def cache_folder(make: bool = False) -> Path | None:
    """Where libraries are kept, a folder that nobody else may write to; None if there is none.

    make: make it where it is not there yet
    """
    asked = os.environ.get(FOLDER, "")
    if asked == "off" or os.name != "posix":
        return None
    caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = Path(asked) if asked else caches / "hopopt"
    if make or _making:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    elif not folder.is_dir():
        return None
    return folder.resolve() if _ours(folder) else None


def _ours(path: Path) -> bool:
    """Whether nobody else may write to it."""
    state = path.stat()
    return state.st_uid == os.getuid() and not state.st_mode & 0o022


def _kept(folder: Path, key: str) -> Path | None:
    """The library of that key, if it is as it was written; what is damaged is removed where libraries are made."""
    for library in folder.glob(f"{key}-*.so"):
        if library.is_file() and _ours(library) and library.name == _name(key, library.read_bytes()):
            with suppress(OSError):  # a folder that may only be read
                os.utime(library)  # used: the last to be removed
            return library
        if _making:
            library.unlink()
    return None


def _name(key: str, content: bytes) -> str:
    return f"{key}-{hashlib.sha256(content).hexdigest()[:32]}.so"


def _made(function: ca.Function, folder: Path) -> Path | None:
    """Compile elsewhere, then write whole or not at all; what fails is not tried again."""
    compiler, key = shutil.which("cc"), _key(function)
    if compiler is None or key in _failed:
        return None
    _failed.add(key)
    remove_abandoned(folder)
    with tempfile.TemporaryDirectory(prefix=".", suffix=mark(), dir=folder) as place:
        generator = ca.CodeGenerator("f.c")
        generator.add(function)
        generator.generate(f"{place}{os.sep}")
        command = [compiler, *FLAGS, "f.c", "-o", "f.so", "-lm"]
        subprocess.run(command, cwd=place, check=True, capture_output=True, timeout=COMPILER_TIME_LIMIT)
        content = (Path(place) / "f.so").read_bytes()
    library = folder / _name(key, content)
    write_whole(library, content)
    library.chmod(0o700)
    with suppress(OSError):  # another process makes room too
        _make_room(folder)
    _failed.discard(key)
    return library


def _make_room(folder: Path) -> None:
    """Remove the libraries that were not used for longest, so that the others have MOST_BYTES bytes; whoever has loaded one keeps
    it."""
    states, held = {library: library.stat() for library in folder.glob("*.so")}, 0
    for library, state in sorted(states.items(), key=lambda each: -each[1].st_mtime_ns):
        held += state.st_size
        if held > MOST_BYTES:
            library.unlink(missing_ok=True)
