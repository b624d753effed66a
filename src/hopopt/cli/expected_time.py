"""About how long a command takes here: said when it begins, counted down, and kept for the next time.

The same question takes what it took the last time. Another one takes the sum of its parts, as they were measured on one
computer, times how much longer or shorter commands have taken on this one. Both are kept in the user's cache folder.
"""

import hashlib
import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from hopopt.design import Design
from hopopt.files import read_regular, write_whole
from hopopt.nlp.solver.compiled import cache_folder
from hopopt.planner.stopwatch import duration
from hopopt.problem.render import design_hash

FILE = "seconds.json"
PARTS = {  # s of processor time, all processes together: AMD EPYC, 27 November 2026 (benchmarks/times.py)
    "solve": 19.0,
    "start alone": 3.0,
    "co-design": 30.0,
    "cross-check": 40.0,
    "free switches": 10.0,
    "controllers": 17.0,
    "simulated hop": 1.0,
    "rung of the ladder": 10.0,
    "least reserve": 60.0,
    "hops of a strategy": 20.0,
    "basin": 90.0,
    "plan for drawn legs": 25.0,
    "point": 14.0,
    "point from neighbours": 3.5,
    "design of a map": 0.08,
    "point of a front": 6.0,
    "point of families": 20.0,
    "first-mesh start": 1.5,
    "grid": 15.0,
    "transition": 12.0,
    "difference": 4.0,
    "verification": 5.0,
}
SHORTEST = 20.0  # s: of less, nothing is said
LONGEST_FILE = 100_000  # bytes of what is kept
MOST_KEPT = 200  # questions
TRUSTED = 0.5  # weight of the last command in how much longer commands take here


@dataclass(frozen=True)
class ExpectedTime:
    """What a command is going to do.

    command: its name
    design: the problem
    parts: how many of each of PARTS; those of 0 do not count
    within: a time limit of its own [s], if there is one
    """

    command: str
    design: Design
    parts: Mapping[str, float]
    within: float | None = None

    @cached_property
    def seconds(self) -> float:
        """About how long it takes [s]."""
        kept = _read()
        expected = kept["last"].get(self._question, self._measured * kept["pace"])
        return expected if self.within is None else min(expected, self.within)

    @property
    def first(self) -> str:
        """What is said as it begins; nothing of what is short."""
        if self.seconds < SHORTEST:
            return ""
        known = self._question in _read()["last"]
        return f"about {duration(self.seconds)}{', as the last time' if known else ''}"

    def left(self, elapsed: float) -> str:
        """How long the rest takes, after so many seconds."""
        if self.seconds < SHORTEST:
            return ""
        rest = self.seconds - elapsed
        return f"about {duration(rest)} left in all: " if rest > 0 else "longer than expected: "

    def keep(self, took: float) -> None:
        """Remember how long it took [s], where there is a cache folder; of what ended at its own limit, nothing."""
        if self.within is not None and took >= self.within:
            return
        kept, folder = _read(), None
        pace = took / self._measured if self._measured >= SHORTEST else kept["pace"]  # what is short tells little
        last = {name: seconds for name, seconds in kept["last"].items() if name != self._question}
        last = dict(list({**last, self._question: round(took, 1)}.items())[-MOST_KEPT:])
        with suppress(OSError):  # no reason to lose the answer
            if (folder := cache_folder(make=True)) is not None:
                pace = kept["pace"] ** (1 - TRUSTED) * min(max(pace, 0.05), 50.0) ** TRUSTED
                write_whole(folder / FILE, json.dumps({"pace": round(pace, 3), "last": last}).encode())

    @property
    def _measured(self) -> float:
        return sum(PARTS[name] * count for name, count in self.parts.items())

    @cached_property
    def _question(self) -> str:
        asked = json.dumps([self.command, design_hash(self.design), sorted(self.parts.items())])
        return f"{self.command} {hashlib.sha256(asked.encode()).hexdigest()[:16]}"


def _read() -> dict[str, Any]:
    """What is kept: how much longer commands take here, and seconds by question; nothing of a file that is not that."""
    with suppress(OSError, ValueError, TypeError, KeyError, AttributeError):
        if (folder := cache_folder()) is not None:
            data = json.loads(read_regular(folder / FILE, LONGEST_FILE))
            last = {str(name): float(seconds) for name, seconds in data["last"].items() if 0 <= seconds < 1e7}
            if 0.01 <= (pace := float(data["pace"])) <= 100.0:
                return {"pace": pace, "last": last}
    return {"pace": 1.0, "last": {}}
