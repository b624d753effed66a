"""Solids for coal, the library of distances that comes with Pinocchio."""

from importlib import import_module
from typing import Any

import numpy as np

coal: Any = import_module("coal")  # its stubs name nothing
THIN = 1e-4  # m: what is given to a flat solid, as coal's hulls have a volume


def convex(points: np.ndarray) -> Any:
    """The hull of points (k, 3) [m]; flat or straight ones get a thickness of THIN."""
    given = coal.StdVec_Vec3s()
    for point in _thick(points):
        given.append(point)
    return coal.Convex.convexHull(given, False, None)


def _thick(points: np.ndarray) -> np.ndarray:
    spread, axes = np.linalg.svd(points - points.mean(axis=0))[1:]
    for axis, size in zip(axes, [*spread, 0.0, 0.0][:3], strict=True):
        if size < THIN:
            points = np.concatenate([points - 0.5 * THIN * axis, points + 0.5 * THIN * axis])
    return points
