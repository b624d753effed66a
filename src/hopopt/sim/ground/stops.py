"""The end stops of the joints."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from hopopt.compiled.kernel import kernel
from hopopt.design import Leg
from hopopt.leg.scales import Scale, radians, stall_torques

YIELDS = 0.01  # [rad] that a stop gives way to its drive's stall torque
LOSS = 0.3  # [s/rad] on the paper's leg


@kernel
def near(q: np.ndarray, w: np.ndarray, lower: np.ndarray, upper: np.ndarray, h: float) -> bool:
    """``Stops.near``, compiled."""
    for k in range(len(q)):
        ahead = q[k] + 1.5 * h * w[k]
        if max(q[k], ahead) > upper[k] or min(q[k], ahead) < lower[k]:
            return True
    return False


@kernel
def torque(
    q: np.ndarray, w: np.ndarray, lower: np.ndarray, upper: np.ndarray, stiffness: np.ndarray, loss: np.ndarray
) -> np.ndarray:
    """``Stops.torque``, compiled."""
    found = np.zeros(len(q))
    for k in range(len(q)):
        depth = max(q[k] - upper[k], 0.0) + min(q[k] - lower[k], 0.0)
        if depth != 0.0:
            found[k] = -stiffness[k] * depth * max(1 + loss[k] * np.sign(depth) * w[k], 0.0)
    return found


@dataclass(frozen=True)
class Stops:
    """End stops of the joints: springs with loss (Hunt and Crossley, 1975) beyond the limits lower, upper (n) [rad].

    stiffness (n) [N m/rad]; loss (n) [s/rad] is how much harder they push against an entering joint.
    """

    lower: np.ndarray
    upper: np.ndarray
    stiffness: np.ndarray
    loss: np.ndarray

    @classmethod
    def of(cls, leg: Leg) -> Self:
        """Of a leg's joints, as hard as its drives are strong."""
        joints = [leg.joint[name] for name in leg.joints]
        lower, upper = (np.array([getattr(j, side) for j in joints]) for side in ("lower", "upper"))
        return cls(lower, upper, stall_torques(leg) / (YIELDS * radians(leg)), LOSS * Scale.of(leg).time / radians(leg))

    def near(self, q: np.ndarray, w: np.ndarray, h: float) -> bool:
        """Whether a joint is beyond a limit, or will be within h [s] at about this speed."""
        return bool(near(q, w, self.lower, self.upper, h))

    def torque(self, q: np.ndarray, w: np.ndarray) -> np.ndarray:
        """Torque (n) [N m] of the stops on the joints; they push back and never pull."""
        return torque(q, w, self.lower, self.upper, self.stiffness, self.loss)

    def energy(self, q: np.ndarray) -> np.ndarray:
        """Energy [J] kept in the springs at joint angles q (..., n)."""
        depth = np.maximum(q - self.upper, 0.0) + np.minimum(q - self.lower, 0.0)
        return 0.5 * np.sum(self.stiffness * depth**2, axis=-1)
