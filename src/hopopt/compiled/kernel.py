"""Functions of arrays compiled by numba, kept on disk for the next process where a folder can be written."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import numba
import numpy as np

from hopopt.compiled.kernel_cache import CheckedCache


def kernel(function: Callable[..., Any]) -> Any:
    """``function`` compiled at its first call; it does not hold the interpreter's lock, so that threads run side by side."""
    made: Any = numba.njit(nogil=True, error_model="numpy")(function)
    with suppress(RuntimeError):  # neither the package's folder nor the user's cache can be written
        made._cache = CheckedCache(function)
    return made


def kept(function: Any) -> bool:
    """Whether a kernel is compiled already, here or on disk."""
    return bool(function.signatures) or (isinstance(function._cache, CheckedCache) and function._cache.holds_any())


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
