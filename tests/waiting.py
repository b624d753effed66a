"""Processes: waiting for what one does, no longer than a limit, and those below one."""

import subprocess
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
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


def descendants(parent: int) -> list[int]:
    """Processes below a process, by Linux's /proc."""
    children: dict[int, list[int]] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            pid, rest = int(stat.parent.name), stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        children.setdefault(int(rest[1]), []).append(pid)
    found, todo = [], [parent]
    while todo:
        below = children.get(todo.pop(), [])
        todo += below
        found += below
    return found


def beside_progress(words: str) -> list[str]:
    """Lines on standard error that are none of progress."""
    return [line for line in words.splitlines() if not line.startswith(("hopopt: about ", "hopopt: after "))]
