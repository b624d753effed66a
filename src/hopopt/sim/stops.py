"""The end stops of the joints."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Stops:
    """End stops of the joints: springs with loss (Hunt and Crossley, 1975) beyond the limits lower, upper (n) [rad].

    stiffness [N m/rad]; loss [s/rad] is how much harder they push against an entering joint.
    """

    lower: np.ndarray
    upper: np.ndarray
    stiffness: float = 2e4
    loss: float = 0.3

    def near(self, q: np.ndarray, w: np.ndarray, h: float) -> bool:
        """Whether a joint is beyond a limit, or will be within h [s] at about this speed."""
        ahead = q + 1.5 * h * w
        return bool(np.any((np.maximum(q, ahead) > self.upper) | (np.minimum(q, ahead) < self.lower)))

    def torque(self, q: np.ndarray, w: np.ndarray) -> np.ndarray:
        """Torque (n) [N m] of the stops on the joints; they push back and never pull."""
        depth = np.maximum(q - self.upper, 0.0) + np.minimum(q - self.lower, 0.0)
        return -self.stiffness * depth * np.maximum(1 + self.loss * np.sign(depth) * w, 0.0)

    def energy(self, q: np.ndarray) -> np.ndarray:
        """Energy [J] kept in the springs at joint angles q (..., n)."""
        depth = np.maximum(q - self.upper, 0.0) + np.minimum(q - self.lower, 0.0)
        return 0.5 * self.stiffness * np.sum(depth**2, axis=-1)
