"""The encoders at the joints: what a controller knows of angles and speeds."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np


@dataclass
class Encoder:
    """Absolute encoders at the joints: angles in steps of 2 pi / 2^bits, speed from their differences.

    The speed is the slope over the last ``window`` control periods; bits = 0 means perfect sensors. speed_error [rad/s]
    is added to every measured speed. radians (n): what counts as a radian of each joint.
    """

    bits: int
    window: int
    period: float
    speed_error: float = 0.0
    radians: np.ndarray | float = 1.0

    def __post_init__(self) -> None:
        self.readings: list[np.ndarray] = []

    @cached_property
    def step(self) -> np.ndarray | float:
        """Resolution [rad]."""
        return 2 * np.pi / 2**self.bits * self.radians

    def read(self, q_j: np.ndarray, v_j: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Measured angles [rad] and speeds [rad/s], (n) each, at this control instant."""
        if not self.bits:
            return q_j, v_j + self.speed_error * self.radians
        self.readings.append(self.step * np.round(q_j / self.step))
        del self.readings[: -self.window - 1]
        spans = len(self.readings) - 1
        if not spans:
            return self.readings[-1], np.zeros_like(q_j) + self.speed_error * self.radians
        return self.readings[-1], (self.readings[-1] - self.readings[0]) / (
            spans * self.period
        ) + self.speed_error * self.radians
