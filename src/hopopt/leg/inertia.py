"""Moments of inertia as problem files write them: xx, yy, zz and the products xy, xz, yz [kg m^2]."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hopopt.design import LEAST_INERTIA

PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # xx, yy, zz, xy, xz, yz
MOMENTS_SLACK = 1e-3  # by which moments may miss what they have to be: figures in files are rounded


def tensor(inertia: Sequence[Any]) -> list[list[Any]]:
    """Rows of the 3 x 3 inertia matrix of moments xx, yy, zz and products xy, xz, yz [kg m^2]."""
    xx, yy, zz, xy, xz, yz = inertia
    return [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]


def principal_moments(inertia: Sequence[float]) -> np.ndarray:
    """The three principal moments [kg m^2], the smallest first."""
    return np.linalg.eigvalsh(np.array(tensor(inertia), dtype=float))


def obeys_triangle(low: float, middle: float, high: float) -> bool:
    """Whether the largest principal moment is at most the sum of the others, as for every body."""
    return bool(high <= (low + middle) * (1 + MOMENTS_SLACK))


def scaled(part: Mapping[str, Any], mass: float = 1.0, length: float = 1.0) -> dict[str, Any]:
    """Entries of a link or the body that change with its mass and length: of what is given, all that a rod's would.

    part: the entries it has. mass, length: the new over the old; what the link is like stays.
    """
    powers = {
        "mass": (1, 0),
        "length": (0, 1),
        "com": (0, 1),
        "com_position": (0, 1),
        "inertia": (1, 2),
        "inertia_tensor": (1, 2),
    }
    found: dict[str, Any] = {}
    for entry, (by_mass, by_length) in powers.items():
        given, factor = part.get(entry), mass**by_mass * length**by_length
        if given is not None and factor != 1.0:
            found[entry] = tuple(x * factor for x in given) if isinstance(given, Sequence) else given * factor
    if "inertia" in found:
        found["inertia"] = max(found["inertia"], LEAST_INERTIA)  # a point mass may be written as the least
    return found
