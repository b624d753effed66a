"""The end stops of the joints."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from hopopt.design import Leg
from hopopt.leg.scales import Scale, stall_torques

YIELDS = 0.01  # [rad] that a stop gives way to its drive's stall torque
LOSS = 0.3  # [s/rad] on the paper's leg


@dataclass(frozen=True)
class Stops:
    """End stops of the joints: springs with loss (Hunt and Crossley, 1975) beyond the limits lower, upper (n) [rad].

    stiffness (n) [N m/rad]; loss [s/rad] is how much harder they push against an entering joint.
    """

    lower: np.ndarray
    upper: np.ndarray
    stiffness: np.ndarray
    loss: float

    @classmethod
    def of(cls, leg: Leg) -> Self:
        """Of a leg's joints, as hard as its drives are strong."""
        joints = [leg.joint[name] for name in leg.joints]
        lower, upper = (np.array([getattr(j, side) for j in joints]) for side in ("lower", "upper"))
        return cls(lower, upper, stall_torques(leg) / YIELDS, LOSS * Scale.of(leg).time)

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
        return 0.5 * np.sum(self.stiffness * depth**2, axis=-1)
