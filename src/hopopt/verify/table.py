"""The plan as verification sees it: a table for each phase, as it lies in the result file."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import pairwise

import numpy as np
from scipy.interpolate import BarycentricInterpolator

NORMALISED_TIMES = 0.5 - 0.5 * np.cos(np.pi * np.arange(9) / 8)  # Chebyshev points of an interval, both ends included
POWERS = np.arange(len(NORMALISED_TIMES))
# Values at NORMALISED_TIMES to coefficients of (2 s - 1)^k:
TO_POWERS = np.linalg.inv((2 * NORMALISED_TIMES[:, None] - 1) ** POWERS)
# to derivatives by normalised time:
TO_RATES = (2 * POWERS * (2 * NORMALISED_TIMES[:, None] - 1) ** np.maximum(POWERS - 1, 0)) @ TO_POWERS
STANCE, FLIGHT, DESCENT, LANDING = "stance", "flight", "descent", "landing"  # the last two only of hops that land
STANDING = (STANCE, LANDING)  # in both the foot is the origin


@dataclass(frozen=True)
class Table:
    """A phase of the plan at NORMALISED_TIMES of its N intervals, K = 9 each: t (N, K) [s], q, v, a (N, K, 2 + n), tau
    (N, K, n) [N m], f (N, K, 2) [N]. Where gears lose or drives have states of their own: command (N, K, n) [N m], what the
    motors are asked for. drive (N, K, m): these states."""

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    tau: np.ndarray
    f: np.ndarray
    command: np.ndarray | None = None
    drive: np.ndarray | None = None

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the arrays that it has."""
        return tuple(f.name for f in fields(self) if getattr(self, f.name) is not None)

    @property
    def asked(self) -> np.ndarray:
        """What the motors are asked for (N, K, n) [N m]: the joints' torques where drives have no states."""
        return self.tau if self.command is None else self.command

    @property
    def asked_rate(self) -> np.ndarray:
        """How fast what the motors are asked for changes (N, K, n) [N m/s], of its polynomial in each interval."""
        return self.rate(self.asked)

    def rate(self, values: np.ndarray) -> np.ndarray:
        """How fast values (N, K, m) at its instants change (N, K, m) [their unit/s], of their polynomial in each interval."""
        return (TO_RATES @ values) / (self.t[:, -1] - self.t[:, 0])[:, None, None]

    @property
    def force_rate(self) -> np.ndarray:
        """How fast the contact force changes (N, K, 2) [N/s]."""
        return self.rate(self.f)

    def flat(self, *names: str) -> list[np.ndarray]:
        """Arrays by name, the instants of all intervals one after the other, (N K, ...) each."""
        return [(x := getattr(self, name)).reshape(-1, *x.shape[2:]) for name in names]


def dense(normalised_times: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Values (N, K, ...) at ``normalised_times`` (K,) of every interval, interpolated at ``at`` (k,): (N, k, ...)."""
    weights = BarycentricInterpolator(normalised_times, np.eye(len(normalised_times)), rng=0)(at)  # no order by chance
    return np.einsum("kp,ip...->ik...", weights, values)


def cut(table: Table, at: Sequence[np.ndarray]) -> Table:
    """The table with its N intervals cut, each at some normalised times of its own, in order; itself where there are none."""
    if not any(len(own) for own in at):
        return table
    pieces: dict[str, list[np.ndarray]] = {name: [] for name in table.parts}
    for k, own in enumerate(at):
        ends = np.r_[0.0, own, 1.0]
        for start, end in pairwise(ends.tolist()):
            for name, found in pieces.items():
                whole = getattr(table, name)[k : k + 1]
                within = start + (end - start) * NORMALISED_TIMES
                found.append(dense(NORMALISED_TIMES, whole, within) if len(own) else whole)
    return Table(**{name: np.concatenate(found) for name, found in pieces.items()})


def quadrature() -> np.ndarray:
    """Clenshaw-Curtis weights of NORMALISED_TIMES on [0, 1], shape (K,)."""
    moments = 1.0 / np.arange(1, len(NORMALISED_TIMES) + 1)
    return np.linalg.solve(np.vander(NORMALISED_TIMES, increasing=True).T, moments)


def over_time(table: Table, rate: np.ndarray) -> float:
    """Over time, of values (N, K) at the table's instants, by Clenshaw and Curtis in every interval."""
    return float((table.t[:, -1] - table.t[:, 0]) @ (rate @ quadrature()))


def jumps(before: Table, after: Table) -> list[np.ndarray]:
    """By how much time, place and speed differ where a phase follows another."""
    return [getattr(before, s)[-1, -1] - getattr(after, s)[0, 0] for s in ("t", "q", "v")]
