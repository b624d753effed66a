"""A planned hop as a controller follows it: joint angles, speeds and torques at any time of either phase."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hopopt.compiled.kernel import kernel
from hopopt.leg.robot import BASE

STANCE, FLIGHT, DESCENT = "stance", "flight", "descent"
EVENT_RESOLUTION = 1e-9  # [s] as events are located: an edge this near has been reached


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
    def edges(self) -> np.ndarray:
        """Ends of the intervals [s], (N + 1,); torques may jump there."""
        return np.append(self.t[:, 0], self.t[-1, -1])

    def at(self, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, v, tau (n) at t [s] since the phase began, clipped to it; at an edge (to EVENT_RESOLUTION), what follows."""
        found: np.ndarray = _interpolated(t, self.places, self.barycentric, self.t, self._stacked)
        return found[0], found[1], found[2]

    def mean_torque(self, begin: float, end: float) -> np.ndarray:
        """Mean of tau (n) over a span [s] within the phase (clipped): holding it gives the same impulse."""
        begin, end = min(max(begin, 0.0), self.duration), min(max(end, 0.0), self.duration)
        if end - begin < 1e-9:
            return self.at(begin)[2]
        mean: np.ndarray = mean_between(begin, end, *self.impulses)
        return mean

    @cached_property
    def duration(self) -> float:
        """[s]"""
        return float(self.t[-1, -1])

    @cached_property
    def _stacked(self) -> np.ndarray:
        """q, v, tau (3, N, K, n)."""
        return np.ascontiguousarray([self.q, self.v, self.tau])

    @cached_property
    def impulses(self) -> tuple[np.ndarray, np.ndarray]:
        """Times (N K) [s] and integrals of tau until then (N K, n) [N m s] at all places, by the trapezoidal rule."""
        t, tau = self.t.ravel(), self.tau.reshape(-1, self.tau.shape[-1])
        pieces = 0.5 * (tau[1:] + tau[:-1]) * np.diff(t)[:, None]
        return t, np.vstack([np.zeros(tau.shape[1]), np.cumsum(pieces, axis=0)])

    @cached_property
    def barycentric(self) -> np.ndarray:
        """Weights of the barycentric form at these places (Berrut and Trefethen, 2004), the largest 1."""
        gaps = self.places[:, None] - self.places
        np.fill_diagonal(gaps, 1.0)
        weights = 1 / gaps.prod(axis=1)
        return weights / np.abs(weights).max()


@kernel
def _interpolated(
    t: float, places: np.ndarray, barycentric: np.ndarray, times: np.ndarray, values: np.ndarray
) -> np.ndarray:
    """values (m, N, K, n) at t [s], by Lagrange's polynomials in barycentric form, (m, n).

    Compiled, as a controller asks at every instant: one call of SciPy's BarycentricInterpolator takes as long as ten of it.
    """
    m, N, K, n = values.shape
    t, k = min(max(t, 0.0), float(times[N - 1, K - 1])), 0
    while k < N - 1 and times[k + 1, 0] <= t + EVENT_RESOLUTION:
        k += 1
    place, weights, total = (t - times[k, 0]) / (times[k, K - 1] - times[k, 0]), np.zeros(K), 0.0
    for j in range(K):
        if place == places[j]:
            weights[:] = 0.0
            weights[j] = total = 1.0
            break
        weights[j] = barycentric[j] / (place - places[j])
        total += weights[j]
    found = np.zeros((m, n))
    for i in range(m):
        for j in range(K):
            for c in range(n):
                found[i, c] += weights[j] / total * values[i, k, j, c]
    return found


@kernel
def mean_between(begin: float, end: float, times: np.ndarray, integrals: np.ndarray) -> np.ndarray:
    """Mean from begin to end of what has these integrals (k, n) until these times (k), linear in between, (n)."""
    n, found = integrals.shape[1], np.zeros(integrals.shape[1])
    for sign, t in ((1.0, end), (-1.0, begin)):
        k = min(max(np.searchsorted(times, t, side="right") - 1, 0), len(times) - 2)
        span = times[k + 1] - times[k]
        part = (t - times[k]) / span if span > 0 else 0.0
        for c in range(n):
            found[c] += sign * (integrals[k, c] + part * (integrals[k + 1, c] - integrals[k, c]))
    return found / (end - begin)


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
