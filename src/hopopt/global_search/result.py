"""What a global search finds."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

SAME_STANCE_ANGLE = 0.15  # rad: two stances of about the same duration whose angles never differ by more are one
SAME_TIME = 0.15  # relative difference of durations up to which stances may be alike
INSTANTS = np.linspace(0, 1, 41)  # shares of the durations at which stances are compared


@dataclass(frozen=True)
class Rollout:
    """One stance from the start, a motion of its own: joint accelerations are constant over each step (a[k] from t[k]
    on), and drives and ground allow them at the middle of it.

    t: instants (m,) [s]
    q: joint angles (m, 2) [rad]
    v: joint speeds (m, 2) [rad/s]
    a: joint accelerations (m, 2) [rad/s^2], the last one repeated
    clearance: estimate from the lift-off and what its flight makes of it [m]
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


def different(ranked: Sequence[Rollout]) -> list[Rollout]:
    """Of stances that are nearly the same the first, in order."""
    chosen: list[Rollout] = []
    for rollout in ranked:
        if not any(alike(rollout, other) for other in chosen):
            chosen.append(rollout)
    return chosen


def alike(one: Rollout, other: Rollout) -> bool:
    """Whether two stances are nearly the same motion, each in its own time."""
    if abs(one.t[-1] - other.t[-1]) > SAME_TIME * max(one.t[-1], other.t[-1]):
        return False
    paths = [np.stack([np.interp(INSTANTS * r.t[-1], r.t, column) for column in r.q.T]) for r in (one, other)]
    return bool(np.abs(paths[0] - paths[1]).max() < SAME_STANCE_ANGLE)
