"""The plan as verification sees it: a table for each phase, as it lies in the result file."""

from dataclasses import dataclass

import numpy as np

NORMALISED_TIMES = 0.5 - 0.5 * np.cos(np.pi * np.arange(9) / 8)  # Chebyshev points of an interval, both ends included
POWERS = np.arange(len(NORMALISED_TIMES))
TO_POWERS = np.linalg.inv(
    (2 * NORMALISED_TIMES[:, None] - 1) ** POWERS
)  # values at NORMALISED_TIMES to coefficients of (2 s - 1)^k
STANCE, FLIGHT, DESCENT, LANDING = "stance", "flight", "descent", "landing"  # the last two only of hops that land
ON_GROUND = (STANCE, LANDING)  # in both the foot is the origin


@dataclass(frozen=True)
class Table:
    """A phase of the plan at NORMALISED_TIMES of its N intervals, K = 9 each: t (N, K) [s], q, v, a (N, K, 2 + n), tau
    (N, K, n) [N m], f (N, K, 2) [N]."""

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    tau: np.ndarray
    f: np.ndarray
