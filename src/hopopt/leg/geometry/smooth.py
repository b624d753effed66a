"""Distances of a leg's links as smooth functions of the joint angles, which a program can keep above a margin.

How far a link is from all that does not move with it depends on the joint angles alone. coal computes that on a grid once,
and a spline of third degree runs through it. Far away it levels off, so that only what is near is told precisely. By how
much it errs there is measured on angles drawn at random.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import ceil

import casadi as ca
import numpy as np
from scipy.interpolate import make_interp_spline

from hopopt.design import Design, Leg
from hopopt.leg.geometry.distance import Distances
from hopopt.leg.geometry.solids import MOST_JOINTS, NEAR, colliding, has_shape
from hopopt.leg.kinematics import joint_positions, reach, spread, start_angles

MARGIN = 0.005  # of the leg's reach: what is kept between solids
LEVEL = 0.12  # of the reach: distances level off towards it
COARSE = 9  # angles of each joint at which pairs are looked at that may never come near
STEPS = {1: 0.01, 2: 0.025, 3: 0.07}  # of the reach, by joints above a link: how far its end moves between grid angles
MOST = {1: 161, 2: 121, 3: 41}  # angles of each joint on the grid
DRAWN, MEASURED = (
    65_536,
    4096,
)  # angles that are drawn, and of the near ones among them those at which the spline is measured
SAFETY = 1.5  # how many times the largest error is stated
DEGREE = 3
BEYOND = 0.1  # rad: by how much the grid goes beyond the joints' limits, where a spline would be zero
KEPT = 4  # tables of this process


@dataclass(frozen=True)
class LinkClearance:
    """How far a link is from what it moves against.

    link: its name
    function: of the angles (k + 1) [rad] of the joints down to its own: the levelled distance [m]
    error: by how much it errs where it is from 0 to NEAR, a multiple of the largest error found [m]
    """

    link: str
    function: ca.Function
    error: float


@dataclass(frozen=True)
class Clearances:
    """All links of a leg that may come near something.

    links: one entry each
    level: what distances level off towards [m]
    reach: of the leg [m]
    """

    links: tuple[LinkClearance, ...]
    level: float
    reach: float

    def levelled(self, distance: float) -> float:
        """A distance [m] as the functions have it."""
        return float(self.level * np.tanh(distance / self.level))

    @property
    def error(self) -> float:
        """The largest of the links' errors [m]."""
        return max((link.error for link in self.links), default=0.0)


_kept: dict[str, Clearances] = {}


def clearances(design: Design) -> Clearances | None:
    """Of a problem's leg; None where it has no shape, may collide, or has more joints than a grid can hold."""
    leg = design.leg
    if not has_shape(leg) or design.hop.may_collide or len(leg.joints) > MOST_JOINTS:
        return None
    start = start_angles(design)
    key = _key(leg, start)
    if key not in _kept:
        while len(_kept) >= KEPT:
            del _kept[next(iter(_kept))]
        _kept[key] = _clearances(leg, Distances(leg, start))
    return _kept[key]


def _key(leg: Leg, start: np.ndarray) -> str:
    """All that the distances of a leg depend on, and where its hop starts (n) [rad]."""
    joints = [(joint.axis, joint.lower, joint.upper) for joint in leg.joint.values()]
    ends = joint_positions(leg, np.zeros(len(leg.joints)))
    shapes = [(s.name, s.joint, s.radius, s.points.tobytes()) for s in colliding(leg)]
    return repr((joints, ends.tobytes(), start.tobytes(), shapes))


def margin_of(design: Design) -> float:
    """What the problem keeps between solids [m]."""
    given = design.hop.collision_margin
    return MARGIN * reach(design.leg) if given is None else given


def kept(design: Design, links: Clearances, found: Distances) -> float:
    """What a plan keeps [m]: the margin, or less where the hop starts nearer, by as much as smooth distances may err."""
    start, margin, least = start_angles(design)[None], margin_of(design), [margin_of(design)]
    for link in links.links:
        k = design.leg.links.index(link.link)
        at_start = float(found.all(start, [pair for pair in found.pairs if found.solids[pair[1]].joint == k]).min())
        least += [max(at_start - 2 * link.error, 0.0)] if at_start < margin + 2 * link.error else []
    return min(least)


def _clearances(leg: Leg, found: Distances) -> Clearances:
    size = reach(leg)
    levelled, links = Clearances((), LEVEL * size, size), []
    for k, link in enumerate(leg.links):
        pairs = _near_pairs(leg, found, k, 3 * levelled.level)
        near = _of_link(leg, found, k, link, pairs, levelled) if pairs else None
        links += [near] if near else []
    return Clearances(tuple(links), levelled.level, size)


def _limits(leg: Leg, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper angles [rad] of the first joints."""
    joints = [leg.joint[name] for name in leg.joints[:count]]
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


def _whole(leg: Leg, angles: np.ndarray) -> np.ndarray:
    """Poses (m, n) [rad] with these angles (m, k) of the first joints, the others in their middle."""
    low, high = _limits(leg, len(leg.joints))
    rest = np.broadcast_to(0.5 * (low + high)[angles.shape[1] :], (len(angles), len(low) - angles.shape[1]))
    return np.hstack([angles, rest])


def _grid(axes: Sequence[np.ndarray]) -> np.ndarray:
    """All combinations (m, k) of the angles of each axis, the last changing fastest."""
    return np.array(list(product(*axes)))


def _near_pairs(leg: Leg, found: Distances, k: int, far: float) -> list[tuple[int, int]]:
    """The pairs of link ``k`` that can come nearer than ``far`` [m]: no distance changes faster than the levers allow."""
    pairs = [pair for pair in found.pairs if found.solids[pair[1]].joint == k]
    low, high = _limits(leg, k + 1)
    axes = [np.linspace(a, b, COARSE) for a, b in zip(low, high, strict=True)]
    between = float(((high - low) / (COARSE - 1) / 2) @ _levers(leg, found)[: k + 1])
    if not pairs:
        return []
    least = found.all(_whole(leg, _grid(axes)), pairs).min(axis=0)
    return [pair for pair, distance in zip(pairs, least, strict=True) if distance - between < far]


def _of_link(
    leg: Leg, found: Distances, k: int, link: str, pairs: list[tuple[int, int]], levelled: Clearances
) -> LinkClearance | None:
    """The spline of a link through the least distance of its pairs; None if these never come near."""
    low, high = _limits(leg, k + 1)
    steps = STEPS[k + 1] * levelled.reach / _levers(leg, found)[: k + 1]
    counts = [
        min(MOST[k + 1], max(COARSE, ceil(span / step) + 1)) for span, step in zip(high - low, steps, strict=True)
    ]
    axes = [np.linspace(a - BEYOND, b + BEYOND, count) for a, b, count in zip(low, high, counts, strict=True)]

    def level(angles: np.ndarray) -> np.ndarray:
        least = found.all(_whole(leg, angles), pairs).min(axis=1)
        return levelled.level * np.tanh(least / levelled.level)

    values = level(_grid(axes))
    if values.min() > 2 * NEAR * levelled.reach:
        return None
    function = _spline(link, axes, values.reshape(counts))
    drawn = low + (high - low) * spread(DRAWN, k + 1)
    smooth = np.array(function(drawn.T)).ravel()
    near = np.flatnonzero((smooth >= 0) & (smooth < NEAR * levelled.reach))[:MEASURED]
    wrong = np.abs(level(drawn[near]) - smooth[near]).max(initial=0.0) if len(near) else 0.0
    return LinkClearance(link, function, SAFETY * float(wrong))


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
