"""A planned hop as a controller follows it: joint angles, speeds and torques at any time of either phase."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hopopt.leg.robot import BASE

STANCE, FLIGHT, DESCENT = "stance", "flight", "descent"
EDGE = 1e-9  # [s] as events are located: an edge this near has been reached


@dataclass(frozen=True)
class PhaseReference:
    """One phase at the same places (0 to 1, both ends included) of its N intervals: t (N, K) [s] since the phase
    began, q, v (N, K, n) of the joints, tau (N, K, n) [N m]."""

    places: np.ndarray
    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    tau: np.ndarray

    @property
    def duration(self) -> float:
        """[s]"""
        return float(self.t[-1, -1])

    @property
    def edges(self) -> np.ndarray:
        """Ends of the intervals [s], (N + 1,); torques may jump there."""
        return np.append(self.t[:, 0], self.t[-1, -1])

    def at(self, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, v, tau (n) at t [s] since the phase began, clipped to it; at an edge (to EDGE), what follows."""
        t = min(max(t, 0.0), self.duration)
        k = min(max(int(np.searchsorted(self.t[:, 0], t + EDGE, side="right")) - 1, 0), len(self.t) - 1)
        weights = self._weights((t - self.t[k, 0]) / (self.t[k, -1] - self.t[k, 0]))
        return weights @ self.q[k], weights @ self.v[k], weights @ self.tau[k]

    def mean_torque(self, begin: float, end: float) -> np.ndarray:
        """Mean of tau (n) over a span [s] within the phase (clipped): holding it gives the same impulse."""
        begin, end = (min(max(t, 0.0), self.duration) for t in (begin, end))
        if end - begin < 1e-9:
            return self.at(begin)[2]
        return (self._impulse(end) - self._impulse(begin)) / (end - begin)

    def _impulse(self, t: float) -> np.ndarray:
        """Integral of tau from the phase's beginning to t."""
        times, impulses = self.impulses
        return np.array([np.interp(t, times, column) for column in impulses.T])

    @cached_property
    def impulses(self) -> tuple[np.ndarray, np.ndarray]:
        """Times (N K) [s] and integrals of tau until then (N K, n) [N m s] at all places, by the trapezoidal rule."""
        t, tau = self.t.ravel(), self.tau.reshape(-1, self.tau.shape[-1])
        pieces = 0.5 * (tau[1:] + tau[:-1]) * np.diff(t)[:, None]
        return t, np.vstack([np.zeros(tau.shape[1]), np.cumsum(pieces, axis=0)])

    def _weights(self, place: float) -> np.ndarray:
        """Lagrange's polynomials at a place, in barycentric form."""
        away = place - self.places
        if not away.all():
            return (away == 0).astype(float)
        parts = self.barycentric / away
        return parts / parts.sum()

    @cached_property
    def barycentric(self) -> np.ndarray:
        """Weights of the barycentric form at these places (Berrut and Trefethen, 2004), the largest 1."""
        gaps = self.places[:, None] - self.places
        np.fill_diagonal(gaps, 1.0)
        weights = 1 / gaps.prod(axis=1)
        return weights / np.abs(weights).max()


@dataclass(frozen=True)
class PlanReference:
    """A planned hop: both phases, the clearance [m] it promises, when in flight that is reached (``apex`` [s]), and
    whether the flight ends in a touchdown from which the hop ``repeats``; ``feedback`` K (n, 2 n) [N m/rad, N m s/rad], if it
    was planned with it."""

    stance: PhaseReference
    flight: PhaseReference
    clearance: float
    apex: float
    repeats: bool = False
    feedback: np.ndarray | None = None

    @classmethod
    def from_tables(cls, places: np.ndarray, tables: Mapping[str, Any], clearance: float) -> "PlanReference":
        """From tables of t, q, v, tau at ``places`` of every interval, whole-leg q and v; a descent belongs to the flight."""

        def phase(*names: str) -> PhaseReference:
            parts = [tables[name] for name in names]
            t, q, v, tau = (np.concatenate([getattr(part, key) for part in parts]) for key in ("t", "q", "v", "tau"))
            return PhaseReference(places, t - t[0, 0], q[..., BASE:], v[..., BASE:], tau)

        repeats = DESCENT in tables
        flight = phase(FLIGHT, DESCENT) if repeats else phase(FLIGHT)
        return cls(phase(STANCE), flight, clearance, phase(FLIGHT).duration, repeats)
