"""The best clearance, counted from the tuck, that is left at every state of a grid: semi-Lagrangian dynamic programming.

From each node the extreme motions are followed for one step of time, and the value is read where they end. The best of
these and of lifting off at once is kept (Bellman 1957; Falcone and Ferretti, Semi-Lagrangian Approximation Schemes, 2013).
Interpolation smears the value in every step, so few long steps with motions of some accuracy do better than many.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hopopt.compiled.kernel import kept, kernel, packed
from hopopt.global_search.constants import StanceConstants
from hopopt.global_search.equations.dynamics import apex_height
from hopopt.global_search.equations.flight import Flight, losses
from hopopt.global_search.grid import OFF_GRID_VALUE, Grid, interpolate, joint_heights, second_differences
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
def best_successor(c, w, grid, values, bends, loss, phi1, phi2, r1, r2, dt, substeps, lift_off):
    """Greatest value [m] one step ahead, OFF_GRID_VALUE if there is none: over the extreme motions, the ones halfway between two
    neighbours or the last one before a state limit, and lift-off where a motion meets a limit within the step."""
    count = extreme_motions(c, w, phi1, phi2, r1, r2, dt, substeps)
    top = OFF_GRID_VALUE
    for i in range(count):
        if w.kind[i] == KEEPS:
            value = interpolate(grid, values, bends, w.end[i, 0], w.end[i, 1], w.end[i, 2], w.end[i, 3])
            w.kind[i] = KEEPS if value > OFF_GRID_VALUE else PASSES
            top = max(top, value)
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
        if (w.kind[i] == KEEPS) != (w.kind[j] == KEEPS):
            kept, other = (i, j) if w.kind[i] == KEEPS else (j, i)
            share = last_kept(c, w, grid, kept, other, phi1, phi2, r1, r2, dt)
            f1, f2, u1, u2 = between(w, kept, other, share)
            top = max(top, interpolate(grid, values, bends, f1, f2, u1, u2))
        elif w.kind[i] == KEEPS:  # both: as if one control followed the other within the step
            f1, f2, u1, u2 = between(w, i, j, 0.5)
            top = max(top, interpolate(grid, values, bends, f1, f2, u1, u2))
    if lift_off:
        for i in range(count):
            if w.kind[i] != KEEPS and apex_height(c, w.end[i, 0], w.end[i, 1], w.end[i, 2], w.end[i, 3]) > top:
                top = max(top, leaving(c, w, grid, loss, bends[:0], i, phi1, phi2, r1, r2, dt))
    return top


@kernel
def _improve(c, w, grid, axes, values, bends, loss, apex, active, lift_off, dt, substeps, new, first, last):
    """One step back in time at nodes first to last."""
    n = grid.n
    angles1, angles2, rates1, rates2 = axes
    s2 = n[3]
    s1 = n[2] * s2
    s0 = n[1] * s1
    for k in range(first, last):
        if active[k]:
            i0, i1, i2, i3 = k // s0, (k % s0) // s1, (k % s1) // s2, k % s2
            phi1, phi2, r1, r2 = angles1[i0], angles2[i1], rates1[i2], rates2[i3]
            value = best_successor(c, w, grid, values, bends, loss, phi1, phi2, r1, r2, dt, substeps, lift_off)
            new[k] = max(value, apex[k]) if lift_off else max(value, 0.0)


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
    return kept(_improve)


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
    apex = np.zeros(grid.size, dtype=np.float32)
    packed_c, packed_grid = packed(c), packed(grid)
    loss = losses(c, flight, grid, active)
    _apexes(packed_c, packed_grid, axes, active, apex)
    apex -= loss
    bends, layers = np.zeros((grid.size, 4), dtype=np.float32), [apex]
    bounds = np.linspace(0, grid.size, CHUNKS * threads + 1).astype(int)
    pieces = list(pairwise(bounds))
    with ThreadPoolExecutor(threads) as pool:
        for k in range(1, steps + 1):
            old, new = layers[-1], apex.copy()
            lift_off = duration[1] - k * dt >= duration[0] - 1e-9

            def differences(piece: tuple[int, int], old: np.ndarray = old) -> None:
                second_differences(packed_grid, old, active, bends, *piece)

            def improve(
                piece: tuple[int, int], old: np.ndarray = old, new: np.ndarray = new, lift_off: bool = lift_off
            ) -> None:
                if until.passed:
                    raise TimeoutError
                _improve(
                    packed_c,
                    workspace(),
                    packed_grid,
                    axes,
                    old,
                    bends,
                    loss,
                    apex,
                    active,
                    lift_off,
                    dt,
                    substeps,
                    new,
                    *piece,
                )

            list(pool.map(differences, pieces))
            list(pool.map(improve, pieces))
            layers.append(new)
            if progress:
                progress(f"global search: {k} of {steps} steps")
    return ValueFunction(grid, dt, tuple(layers), substeps, loss)
