"""How long a search may still take: known to every solve of it, without being handed through all that lies between."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from math import inf
from time import monotonic

_until: ContextVar[float] = ContextVar("until", default=inf)


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Within it no Ipopt solve goes on for longer than so many seconds from now, or than an outer limit allows."""
    token = _until.set(min(_until.get(), monotonic() + seconds))
    try:
        yield
    finally:
        _until.reset(token)


def seconds_left() -> float:
    """Until the limit [s]; infinite if there is none, never below 0."""
    return max(0.0, _until.get() - monotonic())


def time_is_up() -> bool:
    """Whether nothing more may be begun."""
    return seconds_left() == 0.0
