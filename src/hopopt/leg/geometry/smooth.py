"""Distances of a leg's links as smooth functions of the joint angles, which a program can keep above a margin.

How far a link is from the body, or from another link, depends on the angles of the joints between them alone. coal computes
that on a grid once, and a spline of third degree runs through it. Far away it levels off, so that only what is near is told
precisely. By how much it errs there is measured on angles drawn at random.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import ceil

import casadi as ca
import numpy as np
from scipy.interpolate import make_interp_spline

from hopopt.design import Design, Leg
from hopopt.leg.geometry.distance import KEPT, MARGIN, Distances, distances_of, key_of
from hopopt.leg.geometry.solids import BODY, NEAR, has_shape, on_grid
from hopopt.leg.kinematics import reach, spread, start_angles

LEVEL = 0.12  # of the reach: distances level off towards it
COARSE = 9  # angles of each joint at which pairs are looked at that may never come near
STEPS = {1: 0.01, 2: 0.025, 3: 0.07}  # of the reach, by joints between: how far a link's end moves between grid angles
MOST = {1: 161, 2: 121, 3: 41}  # angles of each joint on the grid
DRAWN, MEASURED = (
    65_536,
    4096,
)  # angles that are drawn, and of the near ones among them those at which the spline is measured
SAFETY = 1.5  # how many times the largest error is stated
DEGREE = 3
BEYOND = 0.1  # rad: by how much the grid goes beyond the joints' limits, where a spline would be zero
FROM_START = 1e-6  # of the leg's reach: what the start pose has left


@dataclass(frozen=True)
class LinkClearance:
    """How far a link is from the body, or from a link above it.

    link: its name
    joint: number of the joint that moves it
    other: that of the joint that moves what it passes, or BODY
    function: of the angles [rad] of the joints between, those after ``other`` down to ``joint``: the levelled distance [m]
    error: by how much it errs where it is from 0 to NEAR, a multiple of the largest error found [m]
    """

    link: str
    joint: int
    other: int
    function: ca.Function
    error: float

    @property
    def angles(self) -> slice:
        """Which of the joints' angles the function takes."""
        return slice(self.other + 1, self.joint + 1)

    def at(self, q_j: np.ndarray) -> float:
        """The levelled distance [m] at joint angles q_j (n) [rad]."""
        return float(np.array(self.function(q_j[self.angles])).item())


@dataclass(frozen=True)
class Clearances:
    """All links of a leg that may come near something.

    links: one entry for each, and for each that it passes
    level: what distances level off towards [m]
    reach: of the leg [m]
    """

    links: tuple[LinkClearance, ...]
    level: float
    reach: float

    def levelled(self, distance: float) -> float:
        """A distance [m] as the functions have it."""
        return float(self.level * np.tanh(distance / self.level))

    def true(self, levelled: float) -> float:
        """What ``levelled`` makes of it [m]."""
        return float(self.level * np.arctanh(levelled / self.level))

    @property
    def error(self) -> float:
        """The largest of the links' errors [m]."""
        return max((link.error for link in self.links), default=0.0)


_kept: dict[str, Clearances] = {}


def clearances(design: Design) -> Clearances | None:
    """Of a problem's leg; None where it has no shape, may collide, or has more joints than a grid can hold."""
    leg = design.leg
    if not has_shape(leg) or design.hop.may_collide or not on_grid(leg):
        return None
    key = key_of(leg, start_angles(design))
    if key not in _kept:
        while len(_kept) >= KEPT:
            del _kept[next(iter(_kept))]
        _kept[key] = _clearances(leg, distances_of(design))
    return _kept[key]


def margin_of(design: Design) -> float:
    """What the problem keeps between solids [m]."""
    given = design.hop.collision_margin
    return MARGIN * reach(design.leg) if given is None else given


def least(design: Design, found: Clearances) -> list[float]:
    """What a planner keeps each link's smooth distance above [m]: the margin, and as much as it may err. Where the hop starts
    nearer, half of what its pose leaves beyond that error: what turns beside its own joint, at nearly one distance, stays free."""
    start, margin = start_angles(design), margin_of(design)

    def own(x: LinkClearance) -> float:
        there, wanted = x.at(start), found.levelled(margin + x.error)
        if there > wanted:
            return wanted
        return 0.5 * (there + x.error) if there > x.error else there - FROM_START * found.reach

    return [own(x) for x in found.links]


def kept(design: Design, found: Clearances) -> list[float]:
    """What that promises of each link's true distance [m]; at least that it meets nothing."""
    each = zip(found.links, least(design, found), strict=True)
    return [min(max(found.true(smooth) - link.error, 0.0), margin_of(design)) for link, smooth in each]


def _clearances(leg: Leg, found: Distances) -> Clearances:
    size = reach(leg)
    levelled, links = Clearances((), LEVEL * size, size), []
    for k, link in enumerate(leg.links):
        for other in range(BODY, k):
            pairs = _near_pairs(leg, found, other, k, 3 * levelled.level)
            near = _of_link(leg, found, other, k, link, pairs, levelled) if pairs else None
            links += [near] if near else []
    return Clearances(tuple(links), levelled.level, size)


def _limits(leg: Leg) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper angles [rad] of the joints."""
    joints = [leg.joint[name] for name in leg.joints]
    return np.array([j.lower for j in joints]), np.array([j.upper for j in joints])


def _levers(leg: Leg, found: Distances) -> np.ndarray:
    """How far from each joint anything that it moves can be [m]."""
    lengths = [leg.link[link].length for link in leg.links]
    sizes = [
        max((np.linalg.norm(s.points, axis=1).max() + s.radius for s in found.solids if s.joint == k), default=0.0)
        for k in range(len(lengths))
    ]
    ends = [
        [sum(lengths[j:k]) + max(sizes[k], lengths[k]) for k in range(j, len(lengths))] for j in range(len(lengths))
    ]
    return np.array([max(row) for row in ends])


def _whole(leg: Leg, angles: np.ndarray, first: int) -> np.ndarray:
    """Poses (m, n) [rad] with these angles (m, k) of the joints from ``first`` on, the others in their middle."""
    low, high = _limits(leg)
    poses = np.tile(0.5 * (low + high), (len(angles), 1))
    poses[:, first : first + angles.shape[1]] = angles
    return poses


def _grid(axes: Sequence[np.ndarray]) -> np.ndarray:
    """All combinations (m, k) of the angles of each axis, the last changing fastest."""
    return np.array(list(product(*axes)))


def _near_pairs(leg: Leg, found: Distances, other: int, k: int, far: float) -> list[tuple[int, int]]:
    """The pairs of link ``k`` with what joint ``other`` moves that can come nearer than ``far`` [m]: no distance changes faster
    than the levers allow."""
    pairs, between = found.between(k, other), slice(other + 1, k + 1)
    low, high = (limit[between] for limit in _limits(leg))
    axes = [np.linspace(a, b, COARSE) for a, b in zip(low, high, strict=True)]
    moves = float(((high - low) / (COARSE - 1) / 2) @ _levers(leg, found)[between])
    if not pairs:
        return []
    nearest = found.all(_whole(leg, _grid(axes), other + 1), pairs).min(axis=0)
    return [pair for pair, distance in zip(pairs, nearest, strict=True) if distance - moves < far]


def _of_link(
    leg: Leg, found: Distances, other: int, k: int, link: str, pairs: list[tuple[int, int]], levelled: Clearances
) -> LinkClearance | None:
    """The spline of a link through the least distance of its pairs; None if these never come near."""
    between, count = slice(other + 1, k + 1), k - other
    low, high = (limit[between] for limit in _limits(leg))
    steps = STEPS[count] * levelled.reach / _levers(leg, found)[between]
    counts = [
        min(MOST[count], max(COARSE, ceil(span / step) + 1)) for span, step in zip(high - low, steps, strict=True)
    ]
    axes = [np.linspace(a - BEYOND, b + BEYOND, count) for a, b, count in zip(low, high, counts, strict=True)]

    def level(angles: np.ndarray) -> np.ndarray:
        nearest = found.all(_whole(leg, angles, other + 1), pairs).min(axis=1)
        return levelled.level * np.tanh(nearest / levelled.level)

    values = level(_grid(axes))
    if values.min() > 2 * NEAR * levelled.reach:
        return None
    function = _spline(link, axes, values.reshape(counts))
    drawn = low + (high - low) * spread(DRAWN, count)
    smooth = np.array(function(drawn.T)).ravel()
    near = np.flatnonzero((smooth >= 0) & (smooth < NEAR * levelled.reach))[:MEASURED]
    wrong = np.abs(level(drawn[near]) - smooth[near]).max(initial=0.0) if len(near) else 0.0
    return LinkClearance(link, k, other, function, SAFETY * float(wrong))


def _spline(name: str, axes: Sequence[np.ndarray], values: np.ndarray) -> ca.Function:
    """The spline through values on a grid, as a function that graphs of scalars can call."""
    knots = []
    for axis, angles in enumerate(axes):
        through = make_interp_spline(angles, np.moveaxis(values, axis, 0), DEGREE)
        values = np.moveaxis(through.c, 0, axis)
        knots.append(through.t.tolist())
    inner = ca.Function.bspline("spline", knots, values.ravel(order="F").tolist(), [DEGREE] * len(axes), 1)
    angles = ca.MX.sym("angles", len(axes))
    return ca.Function("clearance", [angles], [inner(angles)], {"never_inline": True})
