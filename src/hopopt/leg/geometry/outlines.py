"""What of a leg with shapes is seen from the side: what an obstacle must not meet."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.spatial import ConvexHull

from hopopt.design import Leg
from hopopt.design.fields import TRUNK
from hopopt.leg.geometry.solids import BODY, Solid, about, has_shape, placed, solids
from hopopt.leg.kinematics import link_ends, planar
from hopopt.leg.robot import BASE

ALIKE = 1e-6  # of the leg's length: corners of a polygon that are nearer are one
CIRCLE = 48  # sides of the polygon about a circle, at most 0.3 % of its radius wider
STEP = 1e-6  # of a link's length, for derivatives by it
UPRIGHT = 1e-9  # of a unit vector: a face that points down by less does not


@dataclass(frozen=True)
class Outline:
    """A convex polygon about what the body or a link has: all its solids that count and, of a link, its line.

    name: of the link, or "trunk"
    joint: number of the joint that moves it, from the body down, or BODY
    corners: (k, 2) x, z [m] from that joint, all joint angles zero, anticlockwise seen with x to the right
    by_length: (k, 2) derivatives of the corners by the length of the link [1]: its line and radius end where it does
    """

    name: str
    joint: int
    corners: np.ndarray
    by_length: np.ndarray

    @property
    def faces(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Of each side a point, and the direction outwards, (2,) each."""
        sides = pairwise([*self.corners, self.corners[0]])
        return [(a, np.array([(b - a)[1], -(b - a)[0]]) / np.linalg.norm(b - a)) for a, b in sides]

    @property
    def faces_down(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Those of the sides that face down where it does not turn."""
        return [(a, away) for a, away in self.faces if away[1] < -UPRIGHT]

    @property
    def extremes(self) -> tuple[int, int, int]:
        """Numbers of the foremost, the hindmost and the lowest corner where it does not turn."""
        x, z = self.corners.T
        return int(x.argmax()), int(x.argmin()), int(z.argmin())


def outlines(leg: Leg) -> dict[str, Outline]:
    """Outlines of the trunk and of links that have shapes, by name; none where shapes do not count."""
    if leg.lowest == "joints" or not has_shape(leg) or not planar(leg):
        return {}
    counted, ends, found = [solid for solid in solids(leg) if solid.counts], link_ends(leg), dict[str, Outline]()
    for joint, name in enumerate((TRUNK, *leg.links), BODY):
        own = [solid for solid in counted if solid.joint == joint]
        if own and joint == BODY:
            found[name] = Outline(name, joint, *_corners(own, own, ALIKE * leg.length))
        elif own:
            line = Solid(name, joint, np.array([np.zeros(3), ends[joint]]), 0.0)
            round_ends = 1 if leg.link[name].radius else 0
            along, shapes = [*own[:round_ends], line], own[round_ends:]  # shapes stay where they are
            longer = [replace(solid, points=solid.points * (1 + STEP)) for solid in along]
            step = STEP * float(np.linalg.norm(ends[joint]))
            found[name] = Outline(
                name, joint, *_corners([*along, *shapes], [*longer, *shapes], ALIKE * leg.length, step)
            )
    return found


def _corners(
    found: Sequence[Solid], longer: Sequence[Solid], alike: float, step: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Corners (k, 2) of the polygon about solids (``about``), each once, anticlockwise; and their derivatives (k, 2) by a length
    of which the ``longer`` ones have ``step`` [m] more: the sides face as they do, so corners are linear in it."""
    corners = about(found)
    far = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1) > alike
    return corners[far], (about(longer) - corners)[far] / step


def seen(leg: Leg, q: np.ndarray) -> list[np.ndarray]:
    """Corners (k, m, 2) x, z [m], in order, of each solid that counts as it is seen at poses q (k, 2 + n) of body and joints
    [m, rad]; its rounding by a polygon of ``CIRCLE`` sides about it. None where shapes do not count."""
    own = [solid for solid in solids(leg) if solid.counts] if outlines(leg) else []
    return [placed(leg, _flat(solid), q[:, BASE:])[..., [0, 2]] + q[:, None, :BASE] for solid in own]


def _flat(solid: Solid) -> Solid:
    """The corners of a solid's outline, in order, in place of its points."""
    turn = 2 * np.pi * (np.arange(CIRCLE) + 0.5) / CIRCLE
    circle = solid.radius / np.cos(np.pi / CIRCLE) * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    points = (solid.points[:, None, [0, 2]] + circle[: None if solid.radius else 1]).reshape(-1, 2)
    corners = points[ConvexHull(points, qhull_options="QJ").vertices]
    return replace(solid, points=np.stack([corners[:, 0], np.zeros(len(corners)), corners[:, 1]], axis=1))
