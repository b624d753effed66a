"""Waiting for what a process does, no longer than a limit."""

import subprocess
from collections.abc import Callable
from contextlib import suppress
from time import monotonic
from typing import Any, TypeVar

T = TypeVar("T")
BETWEEN = 0.02  # s, from one look to the next


def wait_for(look: Callable[[], T], running: subprocess.Popen[Any], limit: float = 600.0) -> T:
    """What ``look`` gives as soon as it is true; AssertionError if the process ends first or the limit [s] is over."""
    until = monotonic() + limit
    while not (found := look()):
        assert running.poll() is None, "it ended too early"
        assert monotonic() < until, f"not within {limit:g} s"
        with suppress(subprocess.TimeoutExpired):
            running.wait(BETWEEN)
    return found
