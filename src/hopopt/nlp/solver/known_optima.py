"""Ends a solve that runs into an optimum which is known already."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hopopt.nlp.solver.casadi_solver import IterationCallback

NEAR_OPTIMUM = 0.2  # of the scaled states: closer than this throughout, an iterate is on its way to the known optimum
SAME_OBJECTIVE = 5e-4  # relative: as close as this in the objective; with 2e-3 other hops than the known one were lost
COMPARABLE_VIOLATION = 1e-2  # largest scaled violation of a row
LOOK_PERIOD = 2  # iterations between two looks


@dataclass(frozen=True)
class Known:
    """An optimum of the same program.

    z (nz,): scaled variables; f: the minimised objective [its unit]; origin: whatever its finder keeps of it.
    """

    z: np.ndarray
    f: float
    origin: Any = None


class KnownOptima(IterationCallback):
    """Stops where an iterate is close to one of the known optima.

    watched: indices of the scaled variables that are compared; found: index of the optimum that the last solve ran into,
    or None. The list ``known`` may grow between solves.
    """

    def __init__(self, nz: int, low_g: np.ndarray, high_g: np.ndarray, watched: np.ndarray):
        super().__init__(nz, len(low_g))
        self.low_g, self.high_g, self.watched = low_g, high_g, watched
        self.known: list[Known] = []
        self.found: int | None = None
        self._iteration = 0

    @property
    def met(self) -> Any:
        """What its finder keeps of the optimum that the last solve ran into, or None."""
        return None if self.found is None else self.known[self.found].origin

    def begin(self) -> None:
        """Forget what the last solve ran into."""
        self.found, self._iteration = None, 0

    def stops(self, values: Mapping[str, Any]) -> bool:
        """Whether this is an iteration to look at, and near a known optimum."""
        self._iteration += 1
        if self.known and not self._iteration % LOOK_PERIOD:
            self.found = self.near(np.array(values["x"]).ravel(), float(values["f"]), np.array(values["g"]).ravel())
        return self.found is not None

    def near(self, z: np.ndarray, f: float, g: np.ndarray) -> int | None:
        """Index of the known optimum that an iterate (scaled variables, objective, rows) is close to."""
        if np.maximum(self.low_g - g, g - self.high_g).max(initial=0.0) > COMPARABLE_VIOLATION:
            return None
        for k, other in enumerate(self.known):
            alike = abs(f - other.f) <= SAME_OBJECTIVE * max(abs(other.f), 1e-3)
            if alike and np.abs(z - other.z)[self.watched].max(initial=0.0) < NEAR_OPTIMUM:
                return k
        return None
