"""Solids for coal, the library of distances that comes with Pinocchio."""

from importlib import import_module
from typing import Any

import numpy as np
import pinocchio as pin

coal: Any = import_module("coal")  # its stubs name nothing
THIN = 3e-4  # of a flat solid's own size: the thickness it is given, as coal's hulls have a volume


def rounded(points: np.ndarray, radius: float) -> tuple[Any, pin.SE3]:
    """The hull of points (k, 3) [m], rounded outwards by a radius [m], and where coal's solid lies in the points' frame."""
    if len(points) == 1:
        return coal.Sphere(radius), pin.SE3(np.eye(3), points[0])
    if len(points) == 2:
        along = points[1] - points[0]
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along).toRotationMatrix()
        return coal.Capsule(radius, float(np.linalg.norm(along))), pin.SE3(turn, points.mean(axis=0))
    hull = _convex(points)
    hull.setSweptSphereRadius(radius)
    return hull, pin.SE3.Identity()


def distances(points: np.ndarray, radius: float, places: np.ndarray) -> np.ndarray:
    """How far places (m, 3) [m] are from the rounded hull of points (k, 3) [m], (m,); not above zero inside."""
    (shape, at), dot, asked = rounded(points, radius), coal.Sphere(0.0), coal.DistanceRequest()
    lies = coal.Transform3s(at.rotation, at.translation)
    there = (coal.Transform3s(np.eye(3), place) for place in places)
    return np.array([coal.distance(shape, lies, dot, place, asked, coal.DistanceResult()) for place in there])


def _convex(points: np.ndarray) -> Any:
    """The hull of points (k, 3) [m]; flat or straight ones get a thickness."""
    given = coal.StdVec_Vec3s()
    for point in _thick(points):
        given.append(point)
    return coal.Convex.convexHull(given, False, None)


def _thick(points: np.ndarray) -> np.ndarray:
    spread, axes = np.linalg.svd(points - points.mean(axis=0))[1:]
    thin = THIN * float(np.linalg.norm(np.ptp(points, axis=0)))
    for axis, size in zip(axes, [*spread, 0.0, 0.0][:3], strict=True):
        if size < thin:
            points = np.concatenate([points - 0.5 * thin * axis, points + 0.5 * thin * axis])
    return points
