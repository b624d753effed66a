"""The moment by which work is to have ended: a value, handed down to every loop and every solve."""

from dataclasses import dataclass
from math import inf
from time import monotonic


@dataclass(frozen=True)
class Deadline:
    """A moment, or never.

    at: that moment on the clock that all processes of a machine share [s]
    """

    at: float = inf

    @property
    def seconds_left(self) -> float:
        """Until that moment [s]; infinite if there is none, never below 0."""
        return max(0.0, self.at - monotonic())

    @property
    def passed(self) -> bool:
        """Whether nothing more may be begun."""
        return self.seconds_left == 0.0

    def within(self, seconds: float) -> "Deadline":
        """So many seconds from now, or this moment if it is sooner."""
        return Deadline(min(self.at, monotonic() + seconds))


NEVER = Deadline()
