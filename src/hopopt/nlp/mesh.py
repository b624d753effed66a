"""Where the intervals of a phase begin and end, and which of those edges may move."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np


@dataclass(frozen=True)
class PhaseMesh:
    """Interval edges as fractions of the phase, shape (N + 1,), 0 to 1, and free interior edges.

    Between the free edges (by index) lie arcs. An arc's intervals keep their proportions; its duration is a
    decision, so that a switch of the controls can fall exactly on an edge. zeros: where not empty, which component of
    the states is zero at each free edge.
    """

    edges: tuple[float, ...]
    free: tuple[int, ...] = ()
    zeros: tuple[int, ...] = ()

    @property
    def intervals(self) -> int:
        return len(self.edges) - 1

    @cached_property
    def arc(self) -> np.ndarray:
        """Arc index of every interval, shape (N,)."""
        return np.searchsorted(np.array(self.free, dtype=int), np.arange(self.intervals), side="right")

    @property
    def arcs(self) -> int:
        return len(self.free) + 1

    @cached_property
    def spans(self) -> np.ndarray:
        """Each arc's share of the phase, shape (arcs,)."""
        return np.diff(np.array(self.edges)[[0, *self.free, self.intervals]])

    @cached_property
    def shares(self) -> np.ndarray:
        """Each interval's share of its arc, shape (N,)."""
        return np.diff(self.edges) / self.spans[self.arc]


def uniform(intervals: int) -> PhaseMesh:
    """Intervals of equal length, none free."""
    return PhaseMesh(tuple(float(x) for x in np.linspace(0, 1, intervals + 1)))


def mesh_of_arcs(breaks: Sequence[float], counts: Sequence[int]) -> PhaseMesh:
    """Arcs between ``breaks`` (fractions 0 .. 1, ends included), each cut into equal intervals, inner breaks free."""
    pieces = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(breaks[:-1], breaks[1:], counts, strict=True)]
    edges = (*np.concatenate(pieces).tolist(), float(breaks[-1]))
    return PhaseMesh(edges, tuple(int(i) for i in np.cumsum(counts)[:-1]))
