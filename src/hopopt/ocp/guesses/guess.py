"""Where a solver may start in one phase."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Guess:
    """Where the solver starts in one phase: interpolants over the fraction of the phase, and its duration [s].

    x (m, nx) and u (m, nu) at ``fraction`` (m,); or a trajectory of an earlier mesh.
    """

    duration: float
    fraction: np.ndarray
    x: np.ndarray
    u: np.ndarray

    def sample(self, fraction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States (k, nx) and controls (k, nu), linear between the points."""
        return tuple(
            np.stack([np.interp(fraction, self.fraction, column) for column in table.T], axis=1)
            if table.shape[1]
            else np.zeros((len(fraction), 0))
            for table in (self.x, self.u)
        )  # type: ignore[return-value]
