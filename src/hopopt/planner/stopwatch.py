"""Wall time by stage, and how long a stage may still take."""

import time
from collections.abc import Callable


class Stopwatch:
    """Wall time by stage [s]."""

    def __init__(self) -> None:
        self.begin = self.last = time.perf_counter()
        self.stages: dict[str, float] = {}

    def mark(self, stage: str) -> None:
        """Add the time since the last mark to ``stage``."""
        now = time.perf_counter()
        self.stages[stage] = self.stages.get(stage, 0.0) + now - self.last
        self.last = now


class Countdown:
    """Says how many of several like things are done, and about how long the rest takes.

    say: told a line of text after each
    what: what they are, in words
    total: how many there are
    """

    def __init__(self, say: Callable[[str], None], what: str, total: int):
        self.say, self.what, self.total, self.done, self.began = say, what, total, 0, time.perf_counter()

    def more(self, count: int = 1, so_far: str = "") -> None:
        """So many more are done; ``so_far``: what came of them."""
        self.done += count
        each = (time.perf_counter() - self.began) / self.done
        left = f", about {duration(each * (self.total - self.done))} left" if self.done < self.total else ""
        self.say(f"{self.what}: {self.done} of {self.total} done{left}{so_far and '; ' + so_far}")


def duration(seconds: float) -> str:
    """A time in words: 45 s, 12 min, 3.5 h."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
