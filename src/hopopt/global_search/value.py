"""The best clearance, counted from the tuck, that is left at every state of a grid: semi-Lagrangian dynamic programming.

From each node the extreme motions are followed for one step of time, once for all layers, and in each the value is read where
they end. The best of these and of lifting off at once is kept (Bellman 1957; Falcone and Ferretti, Semi-Lagrangian
Approximation Schemes, 2013).
Interpolation smears the value in every step, so few long steps with motions of some accuracy do better than many.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hopopt.compiled.kernel import kernel, packed
from hopopt.global_search.constants import StanceConstants
from hopopt.global_search.equations.accelerations import VERTICES
from hopopt.global_search.equations.dynamics import apex_height
from hopopt.global_search.equations.flight import Flight, losses
from hopopt.global_search.grid import (
    OFF_GRID_VALUE,
    Grid,
    interpolate,
    interpolate_at,
    joint_heights,
    on_grid,
    place,
    second_differences,
)
from hopopt.global_search.motions import KEEPS, PASSES, between, extreme_motions, last_kept, leaving, workspace
from hopopt.nlp.deadline import NEVER, Deadline

CHUNKS = 16  # pieces of the grid for each thread: some hold few states that matter
Progress = Callable[[str], None]


@dataclass(frozen=True)
class ValueFunction:
    """What can be reached from each state in the time that is left.

    grid: its nodes
    step: time between layers [s]
    layers: greatest clearance and tuck, by the number of steps left, (grid.size,) each [m]
    substeps: of a motion in one step
    loss: ``fold_loss`` at the nodes (grid.size,) [m]
    """

    grid: Grid
    step: float
    layers: tuple[np.ndarray, ...]
    substeps: int
    loss: np.ndarray

    def at(self, state: np.ndarray, left: int) -> float:
        """Value [m] at a state (4,) with ``left`` steps left."""
        return float(interpolate(packed(self.grid), self.layers[left], np.zeros((0, 4), dtype=np.float32), *state))


@kernel
def _successors(c, w, grid, axes, loss, apex, bends, active, dt, substeps, first, last, count, ends, leave):
    """What follows in one step from nodes ``first`` to ``last``, which is the same in every layer.

    Ends of the extreme motions that keep the state limits, and between each two neighbours the state halfway, or the last
    one that keeps them: into ``ends`` (m, 4), ``count`` (last - first,) for each node; their number is returned.
    ``leave``: greatest value [m] where a motion that meets a limit within the step ends in lift-off before it.
    """
    n, total = grid.n, 0
    angles1, angles2, rates1, rates2 = axes
    none = np.zeros((0, 4), dtype=np.float32)
    for k in range(first, last):
        if not active[k]:
            continue
        s2 = n[3]
        s1 = n[2] * s2
        s0 = n[1] * s1
        i0, i1, i2, i3 = k // s0, (k % s0) // s1, (k % s1) // s2, k % s2
        phi1, phi2, r1, r2 = angles1[i0], angles2[i1], rates1[i2], rates2[i3]
        motions, before = extreme_motions(c, w, phi1, phi2, r1, r2, dt, substeps), total
        for i in range(motions):
            if w.kind[i] == KEEPS and not on_grid(grid, w.end[i, 0], w.end[i, 1], w.end[i, 2], w.end[i, 3]):
                w.kind[i] = PASSES
            if w.kind[i] == KEEPS:
                ends[total] = place(grid, w.end[i, 0], w.end[i, 1], w.end[i, 2], w.end[i, 3])
                total += 1
        for i in range(motions):
            j = i + 1 if i + 1 < motions else 0
            if w.kind[i] != KEEPS and w.kind[j] != KEEPS:
                continue
            one, other, share = i, j, 0.5  # both kept: as if one control followed the other within the step
            if w.kind[i] != w.kind[j]:
                one, other = (i, j) if w.kind[i] == KEEPS else (j, i)
                share = last_kept(c, w, grid, one, other, phi1, phi2, r1, r2, dt)
            ends[total] = place(grid, *between(w, one, other, share))
            total += 1
        count[k - first], top = total - before, OFF_GRID_VALUE
        for i in range(before, total):
            top = max(top, interpolate_at(grid, apex, bends, ends[i, 0], ends[i, 1], ends[i, 2], ends[i, 3]))
        for i in range(motions):  # last, for it moves their ends
            if w.kind[i] != KEEPS and apex_height(c, w.end[i, 0], w.end[i, 1], w.end[i, 2], w.end[i, 3]) > top:
                leave[k] = max(leave[k], leaving(c, w, grid, loss, none, i, phi1, phi2, r1, r2, dt))
    return total


@kernel
def _improve(grid, values, bends, apex, leave, active, lift_off, new, first, last, count, ends):
    """One step back in time at nodes first to last: the best of what follows and, where the stance may end, of lift-off."""
    at = 0
    for k in range(first, last):
        if active[k]:
            top = max(apex[k], leave[k]) if lift_off else 0.0
            for i in range(at, at + count[k - first]):
                top = max(top, interpolate_at(grid, values, bends, ends[i, 0], ends[i, 1], ends[i, 2], ends[i, 3]))
            at += count[k - first]
            new[k] = top


@kernel
def _apexes(c, grid, axes, active, out):
    n, k = grid.n, 0
    angles1, angles2, rates1, rates2 = axes
    for i0 in range(n[0]):
        for i1 in range(n[1]):
            for i2 in range(n[2]):
                for i3 in range(n[3]):
                    if active[k]:
                        out[k] = apex_height(c, angles1[i0], angles2[i1], rates1[i2], rates2[i3])
                    k += 1


def is_compiled() -> bool:
    """Whether the loops need not be compiled first."""
    return _improve.kept


def states_within_limits(c: StanceConstants, grid: Grid) -> np.ndarray:
    """Nodes within the joint limits and above the ground, and those next to them, (size,)."""
    axes = grid.axes()
    phi1, phi2 = np.meshgrid(axes[0], axes[1], indexing="ij")
    bend = c.turn2 * (phi2 - phi1)
    cell = float(np.sum(1 / grid.per_rad))
    knee, hip = joint_heights(c, phi1, phi2)
    reach = abs(complex(c.thigh_x, c.thigh_z)) + abs(complex(c.shank_x, c.shank_z))
    within = (bend > c.lower2 - cell) & (bend < c.upper2 + cell)
    within &= (hip > c.hip_least - reach * cell) & (knee > c.knee_least - reach * cell)
    return np.repeat(within.ravel(), int(grid.n[2] * grid.n[3]))


def value_function(
    c: StanceConstants, flight: Flight, grid: Grid, duration: tuple[float, float], steps: int, substeps: int, threads: int,
    progress: Progress | None = None, active: np.ndarray | None = None, until: Deadline = NEVER,
) -> ValueFunction:  # fmt: skip
    """The value for a stance of at least and at most ``duration`` [s]; ``active``: the nodes that matter, (size,).
    TimeoutError if it has not ended by ``until``."""
    active = states_within_limits(c, grid) if active is None else active
    axes, dt = tuple(grid.axes()), duration[1] / steps
    apex, leave = np.zeros(grid.size, dtype=np.float32), np.zeros(grid.size, dtype=np.float32)
    packed_c, packed_grid = packed(c), packed(grid)
    loss = losses(c, flight, grid, active)
    _apexes(packed_c, packed_grid, axes, active, apex)
    apex -= loss
    bends, layers = np.zeros((grid.size, 4), dtype=np.float32), [apex]
    bounds = np.linspace(0, grid.size, CHUNKS * threads + 1).astype(int)
    pieces = list(pairwise(bounds))

    def follow(piece: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
        if until.passed:
            raise TimeoutError
        count = np.zeros(piece[1] - piece[0], dtype=np.uint8)
        ends = np.empty((int(np.sum(active[slice(*piece)])) * 2 * VERTICES, 4), dtype=np.float32)
        fixed = packed_c, workspace(), packed_grid, axes, loss, apex, bends, active, dt, substeps
        return count, ends[: _successors(*fixed, *piece, count, ends, leave)].copy()

    second_differences(packed_grid, apex, active, bends, 0, grid.size)
    with ThreadPoolExecutor(threads) as pool:
        followed = list(pool.map(follow, pieces))
        for k in range(1, steps + 1):
            old, new = layers[-1], apex.copy()
            lift_off = duration[1] - k * dt >= duration[0] - 1e-9

            def differences(piece: tuple[int, int], old: np.ndarray = old) -> None:
                second_differences(packed_grid, old, active, bends, *piece)

            def improve(
                piece: tuple[int, int],
                after: tuple[np.ndarray, np.ndarray],
                old: np.ndarray = old,
                new: np.ndarray = new,
                lift_off: bool = lift_off,
            ) -> None:
                if until.passed:
                    raise TimeoutError
                _improve(packed_grid, old, bends, apex, leave, active, lift_off, new, *piece, *after)

            list(pool.map(differences, pieces))
            list(pool.map(improve, pieces, followed))
            layers.append(new)
            if progress:
                progress(f"global search: {k} of {steps} steps")
    return ValueFunction(grid, dt, tuple(layers), substeps, loss)
