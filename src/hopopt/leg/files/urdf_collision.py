"""What collides by a URDF: boxes, cylinders, spheres and meshes of the leg and of the body, as hulls of points.

A mesh counts by its convex hull, of which the points that matter most are kept; the hull of these is rounded by as much as
the others lie outside of it. So every solid holds the whole of what the URDF states, and little more.
"""

import re
from collections.abc import Mapping, Sequence
from itertools import product
from math import ceil, log10
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from hopopt.leg.files.urdf_visuals import BODY, Visual, visuals
from hopopt.leg.files.urdf_xml import UrdfError, quoted
from hopopt.leg.geometry.hulls import coal, distances

LARGEST_MESH = 100_000_000  # bytes
MOST_POINTS = 120  # of a mesh's hull that are kept
CLOSE = 1e-3  # of the leg's reach: a hull from which no point of the mesh lies farther is as good as the whole
SIDES = 32  # of the prism about a cylinder, at most 0.5 % of its radius wider
FINE = 3e-5  # of the leg's reach: to which places are rounded, to a decimal digit
AWAY = 1.5  # times the leg's reach from its first joint, beyond which none of its links comes

Found = dict[int, dict[str, dict[str, Any]]]  # by the number of the joint that moves them, by name: entries of a shape


def collision_shapes(
    raw: bytes,
    folder: Path,
    joints: Sequence[str],
    foot: str,
    locked: Mapping[str, float],
    reach: float,
    within: Path | None = None,
) -> Found:
    """The shapes of the body (BODY) and of the links, in the frames that ``Visual`` names.

    raw, folder, joints, foot, locked, within: as ``visuals`` takes them. reach: of the leg [m].
    Raises UrdfError if a mesh is not there, or is none, and of numbers and solids that cannot be read.
    """
    found: Found = {}
    digits = ceil(-log10(FINE * reach))
    for look in visuals(raw, folder, joints, foot, locked, "collision", within):
        points, radius = _hull(look, CLOSE * reach)
        points = points @ look.rotation.T + look.position
        if look.joint == BODY and distances(points, radius, np.zeros((1, 3)))[0] > AWAY * reach:
            continue
        shapes = found.setdefault(look.joint, {})
        rounding = np.sqrt(3) * 0.5 * 10.0**-digits if radius or len(points) > len(_BOX) else 0.0
        shapes[_name(look.link, shapes)] = {
            "points": tuple(tuple(float(x) + 0.0 for x in row) for row in points.round(digits)),
            "radius": round(float(radius + rounding), digits + 1),
            "counts": look.own or look.joint != BODY,
        }
    return found


def _name(link: str, taken: Mapping[str, Any]) -> str:
    """The link's name as a shape may have it; numbered where it has several."""
    name = re.sub(r"[^A-Za-z0-9_-]", "_", link)[:56].lstrip("-") or "link"
    numbered = (f"{name}_{k}" for k in range(2, len(taken) + 3))
    return next(candidate for candidate in (name, *numbered) if candidate not in taken)


_BOX = np.array(list(product((-0.5, 0.5), repeat=3)))


def _hull(look: Visual, close: float) -> tuple[np.ndarray, float]:
    """Points (k, 3) [m] in the solid's own frame, and the radius [m] that rounds their hull; close: as ``fewer`` takes it."""
    if look.shape == "sphere":
        return np.zeros((1, 3)), look.size[0]
    if look.shape == "box":
        return _BOX * look.size, 0.0
    if look.shape == "cylinder":
        radius, length = look.size
        turn = 2 * np.pi * np.arange(SIDES) / SIDES
        ring = radius / np.cos(np.pi / SIDES) * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        return np.array([(*place, z) for z in (-0.5 * length, 0.5 * length) for place in ring]), 0.0
    return fewer(_mesh(look), close)


def _mesh(look: Visual) -> np.ndarray:
    """Corners (k, 3) [m] of the hull of a mesh."""
    where = f"has the collision mesh {quoted(look.named)} of link {quoted(look.link)},"
    if look.file is None:
        raise UrdfError(f"{where} which is not in the folder of the problem: put it there, or leave out leg.geometry")
    try:
        if look.file.stat().st_size > LARGEST_MESH:
            raise UrdfError(f"{where} which has more than {LARGEST_MESH} bytes")
        mesh = coal.MeshLoader().load(str(look.file), np.array(look.size))
        corners = np.array(mesh.vertices(), dtype=float)
        return corners[ConvexHull(corners).vertices]
    except (ValueError, RuntimeError, OSError, QhullError) as error:
        if isinstance(error, UrdfError):
            raise
        raise UrdfError(f"{where} which cannot be read as a solid") from None


def fewer(corners: np.ndarray, close: float) -> tuple[np.ndarray, float]:
    """At most MOST_POINTS of the corners (k, 3) [m] of a hull, and how far the others lie outside their hull [m]; fewer if none
    lies farther than ``close`` [m]."""
    if len(corners) <= MOST_POINTS:
        return corners, 0.0
    axes = np.vstack([np.eye(3), -np.eye(3), np.array(list(product((-1, 1), repeat=3)))])
    chosen = sorted({int(k) for k in (corners @ axes.T).argmax(axis=0)})
    while len(chosen) < MOST_POINTS:
        planes = ConvexHull(corners[chosen], qhull_options="QJ").equations
        outside = corners @ planes[:, :3].T + planes[:, 3]
        worst = sorted({int(k) for k in outside.argmax(axis=0)} - set(chosen), key=lambda k: -outside[k].max())
        worst = [k for k in worst if outside[k].max() > close]
        if not worst:
            break
        chosen += worst[: min(MOST_POINTS - len(chosen), len(chosen))]
    return corners[chosen], max(0.0, float(distances(corners[chosen], 0.0, corners).max()))
