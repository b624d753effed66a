"""A log as identification takes it: speeds that are slopes of its angles, and short windows to integrate over.

Windows lie within one phase, clear of its ends. Speeds are slopes of the angles, for logged speeds lag behind.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import sparse

from hopopt.robot_data.robot_log import RobotLog
from hopopt.sim.state import BOUNCE

WINDOW_LENGTH = 0.03  # [s] of a window: long beside the encoders' noise, short beside a push
SPACING = 0.0075  # [s] between windows
SHORTEST_STRETCH = 0.02  # [s] of a stretch that still holds a window
CONTACT_CHANGE_MARGIN = 0.003  # [s] next to a change of contact that no window touches
MOVING = 0.5  # [rad/s] above which the sign of a speed is known
SPEED_HALF_WIDTH = 0.002  # [s] on either side within which angles give a speed
FEWEST_NEAR = 5  # angles that give one


@dataclass(frozen=True)
class LogSamples:
    """A log as the rows take it: t (k,), q and v = D q (k, n) [SI], D (k, k), tau and command (k, n), sign (k, n) of the speeds
    or 0, force (k, 2), contact (k,), phase (k,): a number for each stretch in one phase, -1 next to its ends."""

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    D: sparse.csr_array
    tau: np.ndarray
    command: np.ndarray
    sign: np.ndarray
    force: np.ndarray
    contact: np.ndarray
    phase: np.ndarray


def samples_of(log: RobotLog) -> LogSamples:
    """A log with speeds that are slopes of its angles within each phase."""
    t, k = log.t, len(log.t)
    phase, blocks = np.full(k, -1), []
    for number, (a, b) in enumerate(pairwise([0, *(np.flatnonzero(np.diff(log.contact)) + 1), k])):
        blocks.append(slopes(t[a:b]))
        settled = BOUNCE if log.contact[a] else CONTACT_CHANGE_MARGIN  # a foot that has landed may bounce
        inside = (t[a:b] >= t[a] + settled * bool(number)) & (t[a:b] <= t[b - 1] - CONTACT_CHANGE_MARGIN * (b < k))
        phase[a:b][inside] = number
    D = sparse.csr_array(sparse.block_diag(blocks))
    v = D @ log.q
    sign = np.where(np.abs(v) > MOVING, np.sign(v), 0.0)
    command = np.full(log.tau.shape, np.nan) if log.command is None else log.command
    return LogSamples(t, log.q, v, D, log.tau, command, sign, log.force, log.contact, phase)


def slopes(t: np.ndarray) -> sparse.csr_array:
    """The matrix that differentiates a signal at times t (k,) [s], (k, k) [1/s]: slopes of cubics through neighbours within
    SPEED_HALF_WIDTH, at least five samples (Savitzky and Golay, 1964); nothing for fewer."""
    k = len(t)
    if k < FEWEST_NEAR:
        return sparse.csr_array((k, k))
    reach = min(max(2, round(SPEED_HALF_WIDTH / float(np.median(np.diff(t))))), (k - 1) // 2)
    columns = np.clip(np.arange(k) - reach, 0, k - 2 * reach - 1)[:, None] + np.arange(2 * reach + 1)
    x = (t[columns] - t[:, None]) / SPEED_HALF_WIDTH
    slope = np.linalg.pinv(np.stack([x**p for p in range(4)], axis=2))[:, 1] / SPEED_HALF_WIDTH
    rows = np.repeat(np.arange(k), 2 * reach + 1)
    return sparse.csr_array((slope.ravel(), (rows, columns.ravel())), shape=(k, k))


@dataclass(frozen=True)
class Windows:
    """Windows on the samples: weights of int phi x dt, int phi' x dt and int phi'' x dt, (windows, samples) each."""

    phi: sparse.csr_array
    rate: sparse.csr_array
    curve: sparse.csr_array

    def shifted(self, lag: float) -> sparse.csr_array:
        """Weights of int phi(t) x(t + lag) dt, to second order in lag [s]."""
        return self.phi - lag * self.rate + 0.5 * lag**2 * self.curve

    def by_lag(self, lag: float) -> sparse.csr_array:
        """Derivative of ``shifted`` by the lag."""
        return lag * self.curve - self.rate

    @property
    def count(self) -> int:
        """How many windows."""
        return len(self.phi.indptr) - 1


def windows(t: np.ndarray, stretch: np.ndarray) -> Windows:
    """Windows on samples at t (k,) [s] within stretches that are each of one number (k,), -1 for none."""
    rows, columns = [np.zeros(0, int)], [np.zeros(0, int)]
    weights = [np.zeros((3, 0))]
    steps, count = np.gradient(t), 0
    for a, b in pairwise([0, *(np.flatnonzero(np.diff(stretch)) + 1), len(t)]):
        span = t[b - 1] - t[a]
        if stretch[a] < 0 or span < SHORTEST_STRETCH:
            continue
        half = 0.5 * min(WINDOW_LENGTH, span)
        for middle in np.linspace(t[a] + half, t[b - 1] - half, 1 + int((span - 2 * half) / SPACING)):
            at = np.flatnonzero(np.abs(t[a:b] - middle) < half) + a
            x = (t[at] - middle) / half
            rows.append(np.full(len(at), count))
            columns.append(at)
            inside = 1 - x**2
            shapes = [inside**3, -6 * x * inside**2 / half, (24 * x**2 - 6 * inside) * inside / half**2]
            weights.append(np.stack(shapes) * steps[at])
            count += 1
    where = (np.concatenate(rows), np.concatenate(columns))
    return Windows(*(sparse.csr_array((w, where), shape=(count, len(t))) for w in np.concatenate(weights, axis=1)))
