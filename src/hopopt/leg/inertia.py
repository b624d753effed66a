"""Moments of inertia as problem files write them: xx, yy, zz and the products xy, xz, yz [kg m^2]."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hopopt.design import LEAST_INERTIA

PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # xx, yy, zz, xy, xz, yz
SLACK = 1e-3  # by which moments may miss what they have to be: figures in files are rounded


def tensor(inertia: Sequence[Any]) -> list[list[Any]]:
    """Rows of the 3 x 3 inertia matrix of moments xx, yy, zz and products xy, xz, yz [kg m^2]."""
    xx, yy, zz, xy, xz, yz = inertia
    return [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]


def principal_moments(inertia: Sequence[float]) -> np.ndarray:
    """The three principal moments [kg m^2], the smallest first."""
    return np.linalg.eigvalsh(np.array(tensor(inertia), dtype=float))


def obeys_triangle(low: float, middle: float, high: float) -> bool:
    """Whether the largest principal moment is at most the sum of the others, as for every body."""
    return bool(high <= (low + middle) * (1 + SLACK))


def of_other_mass(part: Mapping[str, Any], ratio: float) -> dict[str, Any]:
    """Entries of a link or the body that change with its material: mass [kg], and inertia where it is given [kg m^2].

    part: the entries it has. ratio: the new mass over the old; the shape stays.
    """
    found: dict[str, Any] = {"mass": part["mass"] * ratio}
    if (about := part.get("inertia")) is not None:
        found["inertia"] = max(about * ratio, LEAST_INERTIA)  # a point mass may be written as the least
    if (moments := part.get("inertia_tensor")) is not None:
        found["inertia_tensor"] = tuple(x * ratio for x in moments)
    return found
