"""A chart's way from values to pixels of an SVG, with ticks at round numbers."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import ceil, floor, log10

import numpy as np

LEFT, RIGHT, TOP, BOTTOM = 68, 12, 12, 44  # pixels beside the axes
ROUND_STEPS = (1, 2, 5, 10)
ROOM = 48, 20  # pixels between two ticks of x and of y


@dataclass(frozen=True)
class Chart:
    """Axes in an SVG of width x height pixels: what they show of x and y, and their labels with units.

    x_at, y_at: where ticks are wanted; round numbers where these are none, or would stand too close to each other
    """

    x: tuple[float, float]
    y: tuple[float, float]
    width: int
    height: int
    x_label: str
    y_label: str
    x_at: tuple[float, ...] = ()
    y_at: tuple[float, ...] = ()

    @property
    def x_scale(self) -> float:
        """Pixels for a unit of x."""
        return (self.width - LEFT - RIGHT) / (self.x[1] - self.x[0])

    @property
    def y_scale(self) -> float:
        """Pixels for a unit of y; negative, for SVG counts downwards."""
        return -(self.height - TOP - BOTTOM) / (self.y[1] - self.y[0])

    @property
    def x_zero(self) -> float:
        """Pixel of x = 0."""
        return LEFT - self.x[0] * self.x_scale

    @property
    def y_zero(self) -> float:
        """Pixel of y = 0."""
        return self.height - BOTTOM - self.y[0] * self.y_scale

    @property
    def frame(self) -> tuple[int, int, int, int]:
        """Left, right, top and bottom of the axes in pixels."""
        return LEFT, self.width - RIGHT, TOP, self.height - BOTTOM

    def line(self, x: Iterable[float], y: Iterable[float]) -> str:
        """The points of an SVG polyline."""
        pairs = zip(x, y, strict=True)
        return " ".join(f"{self.x_zero + self.x_scale * a:.1f},{self.y_zero + self.y_scale * b:.1f}" for a, b in pairs)

    def ticks(self, axis: str) -> list[tuple[float, str]]:
        """Pixel and text of each tick of the axis "x" or "y"."""
        (low, high), zero, scale, wanted, room = (
            (self.x, self.x_zero, self.x_scale, self.x_at, ROOM[0])
            if axis == "x"
            else (self.y, self.y_zero, self.y_scale, self.y_at, ROOM[1])
        )
        apart = np.diff(np.sort(wanted)) * abs(scale)
        values = wanted if len(wanted) and apart.min(initial=room) >= room else round_numbers(low, high)
        return [(zero + scale * value, f"{value:.6g}") for value in values]


def round_numbers(low: float, high: float, most: int = 6) -> list[float]:
    """At most so many multiples of 1, 2 or 5 times a power of ten within a range."""
    power = 10.0 ** floor(log10((high - low) / most))
    step = next(power * digit for digit in (*ROUND_STEPS, 20, 50) if (high - low) / (power * digit) <= most - 1)
    return [round(k * step, 12) for k in range(ceil(low / step - 1e-9), floor(high / step + 1e-9) + 1)]


def span(*values: np.ndarray, margin: float = 0.05) -> tuple[float, float]:
    """From the least to the greatest of all values, and a share more at both ends."""
    low, high = min(float(v.min()) for v in values), max(float(v.max()) for v in values)
    room = margin * max(high - low, 1e-9)
    return low - room, high + room
