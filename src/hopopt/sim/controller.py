"""What passes between the plant and a strategy."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np


@dataclass(frozen=True)
class Measurement:
    """What a controller learns at one instant.

    t: since the run began [s]
    q: joint angles as the encoders give them (n) [rad]
    v: joint speeds as the encoders give them (n) [rad/s]
    contact: whether the foot is on the ground
    since: how long ago ``contact`` last changed [s]
    landings: how often the foot has landed
    """

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
