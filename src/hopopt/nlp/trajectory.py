"""A phase's solution as a function of time, by the scheme's own interpolant."""

from dataclasses import dataclass

import numpy as np

from hopopt.nlp.schemes import Scheme


@dataclass(frozen=True)
class PhaseTrajectory:
    """States and controls of one phase on N intervals with n abscissae each.

    edges (N + 1,) [s] since the phase began; x_start (N, nx); xdot (N, n, nx); u (N, n, nu); arc (N,).
    """

    scheme: Scheme
    edges: np.ndarray
    x_start: np.ndarray
    xdot: np.ndarray
    u: np.ndarray
    arc: np.ndarray

    @property
    def duration(self) -> float:
        return float(self.edges[-1])

    @property
    def lengths(self) -> np.ndarray:
        """Interval lengths [s], shape (N,)."""
        return np.diff(self.edges)

    @property
    def normalised_edges(self) -> np.ndarray:
        """The edges as shares of the phase, shape (N + 1,)."""
        return self.edges / self.duration

    def locate(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Interval index and place s in [0, 1] within it of every time; at an edge, the interval that begins."""
        i = np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, len(self.x_start) - 1)
        h = np.maximum(self.lengths[i], 1e-300)
        return i, np.clip((t - self.edges[i]) / h, 0.0, 1.0)

    def sample(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States (len(t), nx) and controls (len(t), nu) at times t [s], clipped to the phase."""
        i, s = self.locate(np.atleast_1d(np.asarray(t, dtype=float)))
        return self.at(i, s)

    def at(self, i: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States and controls at normalised times s in [0, 1] of intervals i; at s = 1 the interval that ends."""
        weights = self.scheme.state_weights(s)
        x = self.x_start[i] + self.lengths[i, None] * np.einsum("kj,kjx->kx", weights, self.xdot[i])
        return x, np.einsum("kj,kju->ku", self.scheme.control_weights(s), self.u[i])

    def everywhere(self, normalised_times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (N, k), states (N, k, nx) and controls (N, k, nu) at the same normalised times of every interval."""
        h = self.lengths[:, None]
        x = self.x_start[:, None, :] + h[..., None] * np.einsum(
            "kj,ijx->ikx", self.scheme.state_weights(normalised_times), self.xdot
        )
        u = np.einsum("kj,iju->iku", self.scheme.control_weights(normalised_times), self.u)
        return self.edges[:-1, None] + h * normalised_times, x, u

    @property
    def x_end(self) -> np.ndarray:
        """State at the end of the phase, shape (nx,)."""
        return self.at(np.array([len(self.x_start) - 1]), np.array([1.0]))[0][0]


@dataclass(frozen=True)
class FromTrajectory:
    """An earlier solution of a phase as a guess, sampled by its own interpolant."""

    trajectory: PhaseTrajectory

    @property
    def duration(self) -> float:
        return self.trajectory.duration

    def sample(self, fraction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States and controls at fractions of the phase."""
        return self.trajectory.sample(np.asarray(fraction) * self.trajectory.duration)
