"""The grid of states and what lies between its nodes, compiled: multilinear interpolation with a limited correction.

Angles are spaced evenly, rates more densely about zero, where hops begin and where a link lies still on the ground.
"""

from typing import NamedTuple

import numpy as np

from hopopt.compiled.kernel import kernel
from hopopt.global_search.constants import StanceConstants, room_at, to_link_angles

MANY = 25  # nodes of a rate from which the outer cells are narrow enough to be widened in favour of those about zero
BEND, BEND_OF_MANY = (
    1.0,
    0.3,
)  # by the fastest rate: 1 spaces nodes 4 times as densely at zero as at the end, 0.3 19 times
POSES_OF_JOINT = 201  # of each joint, to find which link angles occur
OFF_GRID_VALUE = -1e3  # value [m] of a state off the grid
OFF_GRID_TOLERANCE = 1e-6  # cells: by so much a state may lie off the grid


class Grid(NamedTuple):
    """Nodes of link angles and rates.

    n: how many on each axis (4,)
    low: first link angles (2,) [rad]
    per_rad: nodes for each radian (2,) [1/rad]
    zero: index of the node of no rate (2,)
    bend: rate r is at zero + stretch r / (bend + |r|) (2,) [rad/s]
    stretch: the same (2,) [1]
    """

    n: np.ndarray
    low: np.ndarray
    per_rad: np.ndarray
    zero: np.ndarray
    bend: np.ndarray
    stretch: np.ndarray

    @property
    def size(self) -> int:
        """Number of nodes."""
        return int(np.prod(self.n))

    def axes(self) -> list[np.ndarray]:
        """Angles [rad] and rates [rad/s] of the nodes on the four axes."""
        angles = [self.low[d] + np.arange(self.n[d]) / self.per_rad[d] for d in range(2)]
        steps = [np.arange(self.n[2 + d]) - self.zero[d] for d in range(2)]
        return [*angles, *(self.bend[d] * s / (self.stretch[d] - np.abs(s)) for d, s in enumerate(steps))]


def make_grid(counts: tuple[int, ...], angles: np.ndarray, rates: np.ndarray) -> Grid:
    """The grid over ranges of link angles (2, 2) [rad] and rates (2, 2) [rad/s], each row the least and the largest."""
    n = np.array(counts, dtype=np.int64)
    zero, bend, stretch = zip(*(_rate_axis(int(k), *row) for k, row in zip(n[2:], rates, strict=True)), strict=True)
    per_rad = (n[:2] - 1) / (angles[:, 1] - angles[:, 0])
    return Grid(n, angles[:, 0].copy(), per_rad, np.array(zero, dtype=np.int64), np.array(bend), np.array(stretch))


def _rate_axis(n: int, least: float, most: float) -> tuple[int, float, float]:
    """Index of zero, bend [rad/s] and stretch of an axis of n rates that reaches from ``least`` < 0 to ``most`` > 0."""
    bend = (BEND_OF_MANY if n >= MANY else BEND) * max(most, -least)
    back, ahead = -least / (bend - least), most / (bend + most)
    zero = min(max(round((n - 1) * back / (back + ahead)), 1), n - 2)
    return zero, bend, min(zero / back, (n - 1 - zero) / ahead)


def ranges(c: StanceConstants, fastest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Link angles that joint limits and ground allow (2, 2) [rad], and rates (2, 2) [rad/s] for joint speeds up to
    ``fastest`` (2,) [rad/s]."""
    share = np.linspace(0, 1, POSES_OF_JOINT)
    joints = np.meshgrid(c.lower1 + share * (c.upper1 - c.lower1), c.lower2 + share * (c.upper2 - c.lower2))
    phi = to_link_angles(c, np.stack(joints, axis=-1))
    knee, hip = joint_heights(c, phi[..., 0], phi[..., 1])
    free = room_at(c, np.stack(joints, axis=-1)) >= 0
    allowed = phi[(knee >= c.knee_least) & (hip >= c.hip_least) & free]
    speeds = np.array([fastest[0], max(fastest)])
    return np.stack([allowed.min(axis=0), allowed.max(axis=0)], axis=1), np.stack([-speeds, speeds], axis=1)


def joint_heights(c: StanceConstants, phi1: np.ndarray, phi2: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of knee and hip above the ground [m]."""
    knee = -(c.shank_x * np.sin(phi2) + c.shank_z * np.cos(phi2))
    return knee, knee - (c.thigh_x * np.sin(phi1) + c.thigh_z * np.cos(phi1))


@kernel
def place(grid, phi1, phi2, r1, r2):
    """Where a state is on the grid, in nodes from the first on each axis."""
    return (
        (phi1 - grid.low[0]) * grid.per_rad[0], (phi2 - grid.low[1]) * grid.per_rad[1],
        grid.zero[0] + grid.stretch[0] * r1 / (grid.bend[0] + abs(r1)),
        grid.zero[1] + grid.stretch[1] * r2 / (grid.bend[1] + abs(r2)),
    )  # fmt: skip


@kernel
def on_grid(grid, phi1, phi2, r1, r2):
    """Whether a state lies on the grid."""
    p0, p1, p2, p3 = place(grid, phi1, phi2, r1, r2)
    n = grid.n
    low = min(min(p0, p1), min(p2, p3)) >= -OFF_GRID_TOLERANCE
    return (
        low
        and p0 <= n[0] - 1 + OFF_GRID_TOLERANCE
        and p1 <= n[1] - 1 + OFF_GRID_TOLERANCE
        and p2 <= n[2] - 1 + OFF_GRID_TOLERANCE
        and p3 <= n[3] - 1 + OFF_GRID_TOLERANCE
    )


@kernel
def interpolate(grid, values, bends, phi1, phi2, r1, r2):
    """Value [m] at a state, OFF_GRID_VALUE off the grid; ``bends``: second differences (size, 4), or (0, 4) for none."""
    if not on_grid(grid, phi1, phi2, r1, r2):
        return OFF_GRID_VALUE
    return interpolate_at(grid, values, bends, *place(grid, phi1, phi2, r1, r2))


@kernel
def interpolate_at(grid, values, bends, p0, p1, p2, p3):
    """The same at a place on the grid (``place``), in nodes from the first on each axis."""
    n = grid.n
    i0, i1 = min(max(int(p0), 0), n[0] - 2), min(max(int(p1), 0), n[1] - 2)
    i2, i3 = min(max(int(p2), 0), n[2] - 2), min(max(int(p3), 0), n[3] - 2)
    a, b, c, d = p0 - i0, p1 - i1, p2 - i2, p3 - i3
    s2 = n[3]
    s1 = n[2] * s2
    s0 = n[1] * s1
    node = i0 * s0 + i1 * s1 + i2 * s2 + i3
    total, least, most = 0.0, 1e9, -1e9
    for j0 in range(2):
        for j1 in range(2):
            weight = (a if j0 else 1 - a) * (b if j1 else 1 - b)
            k = node + j0 * s0 + j1 * s1
            v00, v01, v10, v11 = values[k], values[k + 1], values[k + s2], values[k + s2 + 1]
            least, most = min(least, min(min(v00, v01), min(v10, v11))), max(most, max(max(v00, v01), max(v10, v11)))
            total += weight * ((1 - c) * ((1 - d) * v00 + d * v01) + c * ((1 - d) * v10 + d * v11))
    if bends.shape[0] == 0:
        return total
    k = node + (s0 if a > 0.5 else 0) + (s1 if b > 0.5 else 0) + (s2 if c > 0.5 else 0) + (1 if d > 0.5 else 0)
    total -= 0.5 * (a * (1 - a) * bends[k, 0] + b * (1 - b) * bends[k, 1])
    total -= 0.5 * (c * (1 - c) * bends[k, 2] + d * (1 - d) * bends[k, 3])
    return min(max(total, least), most)  # beyond the corners' values iterations would not be stable


@kernel
def second_differences(grid, values, active, bends, first, last):
    """Along each axis, of a node and its two neighbours the one nearest to zero, none where their signs differ:
    unlimited ones grow without bound from step to step."""
    n = grid.n
    steps = (n[1] * n[2] * n[3], n[2] * n[3], n[3], 1)
    for k in range(first, last):
        if not active[k]:
            continue
        rest = k
        for d in range(4):
            s = steps[d]
            i = rest // s
            rest -= i * s
            bends[k, d] = 0.0
            if i < 2 or i > n[d] - 3:
                continue
            low, mid, high = values[k - s], values[k], values[k + s]
            here = low - 2 * mid + high
            before, after = values[k - 2 * s] - 2 * low + mid, mid - 2 * high + values[k + 2 * s]
            if here > 0 and before > 0 and after > 0:
                bends[k, d] = min(here, min(before, after))
            elif here < 0 and before < 0 and after < 0:
                bends[k, d] = max(here, max(before, after))
