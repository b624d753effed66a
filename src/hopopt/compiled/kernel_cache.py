"""What numba keeps on disk, checked: numba loads what it finds, and a damaged or outdated file ends the process or lies.

numba's own ``cache=True`` looks at the file of the function alone, not at functions that it calls or numbers that it takes from
other files: here a function is kept for the sources of all packages that have compiled functions. And numba trusts its
files: of 20 that were damaged on purpose, 9 ended the process and 5 were run as they were. So every file ends with its
digest, which needs numba's private classes, as numba calls nobody between reading a file and using it. What does not fit is
compiled again.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any

from numba.core.caching import FunctionCache, IndexDataCacheFile

from hopopt.files import write_whole

LENGTH = 32  # bytes of a digest
PACKAGE, MARK = Path(__file__).parents[1], b"kernel"  # where compiled functions are, and what their modules name


class CheckedFiles(IndexDataCacheFile):
    """numba's index and data files, written whole, each with a digest at its end, where unpickling ignores it."""

    def save(self, key: Any, data: Any) -> None:
        """Keep a compiled function; where nothing can be written it serves this process alone."""
        with suppress(OSError):
            super().save(key, (key, data))  # a process may end between the index and the data: these say whose they are

    def load(self, key: Any) -> Any:
        """The compiled function of a key; None if there is none that is whole."""
        found = super().load(key)
        return found[1] if found is not None and found[0] == key else None

    def _load_index(self) -> dict[Any, str]:
        return super()._load_index() if _whole(Path(self._index_path)) else {}

    def _load_data(self, name: str) -> Any:
        return super()._load_data(name) if _whole(Path(self._data_path(name))) else None

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[Any]:
        content = BytesIO()
        yield content
        write_whole(Path(filepath), content.getvalue() + sha256(content.getvalue()).digest())


class CheckedCache(FunctionCache):
    """numba's cache of one function with checked files, which may have variants; RuntimeError where no folder can be written."""

    def __init__(self, function: Callable[..., Any], variant: str = ""):
        super().__init__(function)
        self._cache_file = CheckedFiles(self.cache_path, self._impl.filename_base + variant, _sources())

    def holds_any(self) -> bool:
        """Whether the function is kept for some signature, for the sources as they are."""
        return bool(self._cache_file._load_index())


@cache
def _sources() -> str:
    """Digest of all modules of packages that have something to do with compiled functions."""
    sources = {path: path.read_bytes() for path in sorted(PACKAGE.rglob("*.py"))}
    packages = {path.parent for path, source in sources.items() if MARK in source}
    return sha256(b"".join(source for path, source in sources.items() if path.parent in packages)).hexdigest()


def _whole(path: Path) -> bool:
    """Whether a file is there as it was written."""
    with suppress(OSError):
        content = path.read_bytes()
        return content[-LENGTH:] == sha256(content[:-LENGTH]).digest()
    return False
