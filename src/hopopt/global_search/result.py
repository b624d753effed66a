"""What a global search finds."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Rollout:
    """One stance from the start, a motion of its own: joint accelerations are constant over each step (a[k] from t[k]
    on), and drives and ground allow them at the middle of it.

    t: instants (m,) [s]
    q: joint angles (m, 2) [rad]
    v: joint speeds (m, 2) [rad/s]
    a: joint accelerations (m, 2) [rad/s^2], the last one repeated
    clearance: estimate from the centre of mass at lift-off and the best tuck [m]
    """

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    clearance: float


@dataclass(frozen=True)
class GlobalSearch:
    """An approximate global optimum of the stance. It is no bound: the grid's errors can go either way.

    method: in words
    grid: nodes on each axis
    steps: of time
    value: clearance that the grid promises at the start [m]
    rollouts: stances that differ, best first
    seconds: time taken [s]
    """

    method: str
    grid: tuple[int, ...]
    steps: int
    value: float
    rollouts: tuple[Rollout, ...]
    seconds: float
