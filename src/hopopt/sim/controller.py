"""What passes between the plant and a strategy."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np


@dataclass(frozen=True)
class Measurement:
    """What a controller learns at time t [s]: joint angles q (n) [rad] and speeds v (n) [rad/s] as the encoders
    give them, whether the foot is on the ground, since how long [s], and how often it has landed."""

    t: float
    q: np.ndarray
    v: np.ndarray
    contact: bool
    since: float
    landings: int


class Controller(Protocol):
    """A strategy: torque commands (n) [N m] from measurements, asked for at every control instant."""

    def torque(self, now: Measurement) -> np.ndarray:
        """Joint torques to ask of the drives; what they cannot give is clamped."""
        ...
