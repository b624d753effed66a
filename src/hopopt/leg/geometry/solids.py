"""The solids of a leg: each the hull of points, rounded by a radius, fixed to the body or to a link."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial import ConvexHull

from hopopt.design import Leg
from hopopt.design.fields import TRUNK
from hopopt.design.geometry.shape import Shape
from hopopt.leg.kinematics import joint_frames, link_ends, planar, reach

NEAR = 0.03  # of the leg's reach: the planner knows distances up to it precisely, and keeps no larger margin
MOST_JOINTS = 3  # of a leg whose distances it can know: they are kept on a grid of angles
BODY = -1  # the joint of what does not move with any
BESIDE = 2.0  # of the leg's reach: half the width of a polygon, which nothing passes beside
SIDES = 12  # of the polygon about a link
LINE = 1e-3  # of the leg's length: the radius of a link without a shape
ROUND = 24  # corners of a circle in an outline


@dataclass(frozen=True)
class Solid:
    """The hull of points, rounded by a radius.

    name: of the shape, which is that of a URDF's link, or of the leg's link
    joint: number of the joint that moves it, from the body down, or BODY
    points: (k, 3) [m] from that joint, of the body's from the first joint, axes the robot's when all angles are zero
    radius: by which the hull is rounded outwards [m]
    counts: whether its lowest point counts as the robot's
    """

    name: str
    joint: int
    points: np.ndarray
    radius: float
    counts: bool = True


def has_shape(leg: Leg) -> bool:
    """Whether the problem says what shape the body or a link of the leg has."""
    return bool(leg.body.shapes) or any(link.shapes or link.radius for link in leg.link.values())


def on_grid(leg: Leg) -> bool:
    """Whether distances between its solids are kept on a grid of angles, which a planner can know."""
    return len(leg.joints) <= MOST_JOINTS and not leg.follows and not leg.sliding


def solids(leg: Leg) -> tuple[Solid, ...]:
    """All solids of a leg: the body's, then those of each link."""
    return tuple(_solids(leg))


def colliding(leg: Leg) -> tuple[Solid, ...]:
    """All solids of a leg, and lines in place of links that have none, from the body to the foot."""
    found = solids(leg)
    ends, there = link_ends(leg), {solid.joint for solid in found}
    lines = (
        Solid(link, k, np.array([np.zeros(3), ends[k]]), LINE * leg.length)
        for k, link in enumerate(leg.links)
        if k not in there
    )
    return tuple(sorted((*found, *lines), key=lambda solid: solid.joint))


def _solids(leg: Leg) -> Iterator[Solid]:
    width = BESIDE * reach(leg)
    for name, shape in (leg.body.shapes or {}).items():
        yield Solid(name, BODY, corners(shape, width), shape.radius, shape.counts)
    ends = link_ends(leg)
    for k, link in enumerate(leg.links):
        entry = leg.link[link]
        if entry.radius:
            yield Solid(link, k, np.array([np.zeros(3), ends[k]]), entry.radius)
        for name, shape in (entry.shapes or {}).items():
            yield Solid(name, k, corners(shape, width), shape.radius, shape.counts)


def corners(shape: Shape, width: float) -> np.ndarray:
    """The points (k, 3) [m] of which a shape is the hull; ``width`` [m]: half that of a polygon."""
    if shape.box is not None:
        found = np.array(list(product((-0.5, 0.5), repeat=3))) * shape.box
    elif shape.polygon is not None:
        found = np.array([(x, y, z) for x, z in shape.polygon for y in (-width, width)])
    else:
        found = np.array(shape.points)
    return found + np.array(shape.at)


def counted_points(leg: Leg) -> list[tuple[str, int, tuple[float, ...]]]:
    """What may be lowest besides joints and foot: name, number of the joint that moves it, and place (3) [m] as of a solid's
    points. Of the body the lowest point of its shapes; of each link but the last the corners of a polygon about its shapes in
    the leg's plane. The foot alone stands for the last link, which meets the ground."""
    if leg.lowest == "joints" or not has_shape(leg):
        return []
    all_solids, found = [solid for solid in solids(leg) if solid.counts], list[tuple[str, int, tuple[float, ...]]]()
    if leg.has_trunk:
        low = min(_of(all_solids, BODY), key=lambda s: s.points[:, 2].min() - s.radius)
        x, _, z = low.points[low.points[:, 2].argmin()].tolist()
        found.append((TRUNK, BODY, (x, 0.0, z - low.radius)))
    for k, link in enumerate(leg.links[:-1]):
        if planar(leg) and (of_link := _of(all_solids, k)):
            found += [(f"{link} {m + 1}", k, (x, 0.0, z)) for m, (x, z) in enumerate(about(of_link).tolist())]
    return found


def _of(found: Sequence[Solid], joint: int) -> list[Solid]:
    """The solids that one joint moves."""
    return [solid for solid in found if solid.joint == joint]


def about(found: Sequence[Solid]) -> np.ndarray:
    """Corners (SIDES, 2) x, z [m] of a polygon about solids, whose sides face as many directions."""
    turn = 2 * np.pi * np.arange(SIDES) / SIDES
    faces = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    away = np.max([(s.points[:, [0, 2]] @ faces.T).max(axis=0) + s.radius for s in found], axis=0)
    return np.array([np.linalg.solve(faces[[m - 1, m]], away[[m - 1, m]]) for m in range(SIDES)])


def placed(leg: Leg, solid: Solid, q_j: np.ndarray) -> np.ndarray:
    """The points of a solid from the body, (..., k, 3) [m], for joint angles q_j (..., n) [rad]."""
    if solid.joint == BODY:
        return np.broadcast_to(solid.points, (*q_j.shape[:-1], *solid.points.shape))
    places, turns = joint_frames(leg, q_j)
    return places[solid.joint][..., None, :] + solid.points @ np.swapaxes(turns[solid.joint], -1, -2)


def outline(leg: Leg, solid: Solid, q_j: np.ndarray) -> np.ndarray:
    """What of a solid is seen from the side: corners (k, 2) x, z [m] of the convex outline from the first joint, at joint
    angles q_j (n) [rad]."""
    seen = placed(leg, solid, q_j)[:, [0, 2]]
    turn = 2 * np.pi * np.arange(ROUND) / ROUND
    circle = solid.radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    points = (seen[:, None] + circle).reshape(-1, 2)
    return points[ConvexHull(points, qhull_options="QJ").vertices]
