"""Linear interpolation on a grid of two axes, at places that stay."""

import numpy as np


class Bilinear:
    """Values at given places of a grid of rows and columns, linear in both.

    rows, columns: evenly spaced nodes; at_row, at_column: where values are wanted, alike in shape; nowhere: value off
    the grid.
    """

    def __init__(
        self, rows: np.ndarray, columns: np.ndarray, at_row: np.ndarray, at_column: np.ndarray, nowhere: float
    ):
        self.nowhere = nowhere
        i, j = ((at - grid[0]) / (grid[1] - grid[0]) for at, grid in ((at_row, rows), (at_column, columns)))
        last = len(rows) - 1, len(columns) - 1
        with np.errstate(invalid="ignore"):
            self.outside = ~((i >= -1e-9) & (i <= last[0] + 1e-9) & (j >= -1e-9) & (j <= last[1] + 1e-9))
        i, j = (np.where(self.outside, 0.0, np.clip(x, 0, n - 1e-9)) for x, n in zip((i, j), last, strict=True))
        self.i, self.j = i.astype(int), j.astype(int)
        self.s, self.t = i - self.i, j - self.j

    def __call__(self, values: np.ndarray) -> np.ndarray:
        i, j, s, t = self.i, self.j, self.s, self.t
        low = (1 - t) * values[i, j] + t * values[i, j + 1]
        high = (1 - t) * values[i + 1, j] + t * values[i + 1, j + 1]
        return np.where(self.outside, self.nowhere, (1 - s) * low + s * high)
