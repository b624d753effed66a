"""Functions of arrays compiled by numba, kept on disk for the next process where a folder can be written."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cached_property
from typing import Any

import numpy as np

LEVEL = 1  # of LLVM's passes over compiled functions, of 3; a caller's own are compiled at theirs


class Kernel:
    """A function that is compiled at its first call; it does not hold the interpreter's lock, so that threads run side by side.

    numba is loaded then and not before: it takes a fifth of a command's imports, and most commands compile nothing.
    """

    def __init__(self, function: Callable[..., Any]):
        self.function = function

    def __call__(self, *arguments: Any) -> Any:
        """What the function gives."""
        return self.compiled(*arguments)

    @cached_property
    def compiled(self) -> Any:
        """numba's own object, for Python."""
        return self._compiled()

    @cached_property
    def called(self) -> Any:
        """numba's own object for compiled functions that call it: without what Python calls, which takes a third of the time,
        and compiled for numbers, not once more for a constant that it is given."""
        import numba

        made = self._compiled(no_cpython_wrapper=True, no_cfunc_wrapper=True)
        for_types = made.get_call_template
        made.get_call_template = lambda types, named: for_types(tuple(map(numba.types.unliteral, types)), named)
        return made

    def _compiled(self, **without: Any) -> Any:
        import numba

        from hopopt.compiled.kernel_cache import CheckedCache

        made: Any = numba.njit(nogil=True, error_model="numpy", **without)(self.function)
        made.compile = _with_few_passes(made.compile)
        with suppress(RuntimeError):  # neither the package's folder nor the user's cache can be written
            made._cache = CheckedCache(self.function, "-called" if without else "")
        return made

    @property
    def _numba_type_(self) -> Any:
        """numba asks for this where a compiled function calls another."""
        import numba

        return numba.typeof(self.called)

    @property
    def kept(self) -> bool:
        """Whether it is compiled already, here or on disk."""
        cache = self.compiled._cache
        return bool(self.compiled.signatures) or (hasattr(cache, "holds_any") and cache.holds_any())


def _with_few_passes(compiled: Callable[..., Any]) -> Callable[..., Any]:
    """A function that compiles, at LLVM's first level: a quarter less to wait than at the third, for code as fast and the same digits."""
    from numba.core import config as numba_config
    from numba.core.compiler_lock import global_compiler_lock

    config: Any = numba_config

    def quickly(*arguments: Any) -> Any:
        with global_compiler_lock:  # of all threads: a level that one has set is not another's
            asked = config.OPT
            config.OPT = type(asked)(LEVEL)
            try:
                return compiled(*arguments)
            finally:
                config.OPT = asked

    return quickly


def kernel(function: Callable[..., Any]) -> Any:
    """``function`` as a kernel."""
    return Kernel(function)


def packed(values: Any) -> Any:
    """A named tuple or a mapping of numbers and arrays as one record with the same names, which compiled functions read and write
    without counting references: counters shared by two threads made them several times slower."""
    named = values if isinstance(values, Mapping) else values._asdict()
    arrays = {name: np.asarray(value) for name, value in named.items()}
    record = np.zeros(1, dtype=[(name, a.dtype, a.shape) for name, a in arrays.items()])
    for name, array in arrays.items():
        record[name][0] = array
    return record[0]


def argument(record: Any) -> Any:
    """A record as an array of one, which Python hands to a compiled function in 1 us; a record alone takes 20."""
    return np.array([record], dtype=record.dtype)
