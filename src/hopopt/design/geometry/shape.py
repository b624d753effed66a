"""The shape of a body or a link: solids that collide, and whose lowest point counts."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from hopopt.design.fields import Number, Section, Vector, choice, quantity

FLAT = 1e-9  # share of its length to which corners on one line differ from it
Size = Annotated[float, Field(ge=1e-4, le=10, allow_inf_nan=False)]
Corner = tuple[Number, Number]


class Shape(Section):
    """A solid: a box, a polygon in the leg's plane, or the hull of points; two points with a radius are a capsule."""

    box: tuple[Size, Size, Size] | None = choice(
        "its lengths along x, y and z, about its origin", None, unit="m", listed=False
    )
    polygon: tuple[Corner, ...] | None = choice(
        "its corners (x, z), of a solid that the leg does not pass beside", None, unit="m", listed=False, min_length=3, max_length=64,
        allowed="a list of at least three corners [x, z], each number from -1000 to 1000,",
    )  # fmt: skip
    points: tuple[Vector, ...] | None = choice(
        "whose hull it is (x, y, z); two points with a radius are a capsule", None, unit="m", listed=False, min_length=1, max_length=200,
        allowed="a list of points [x, y, z], each number from -1000 to 1000,",
    )  # fmt: skip
    at: Vector = choice(
        "its origin: of a body's from the first joint, of a link's from its joint, all joint angles zero (x, y, z)",
        (0.0, 0.0, 0.0),
        unit="m",
    )
    radius: float = quantity("by which it is rounded outwards", "m", 0, 2, 0.0)
    counts: bool = choice("whether its lowest point counts as the robot's: not that of other limbs", True)

    def fault(self) -> str:
        """What is wrong with the shape, in words that follow its path; empty if nothing is."""
        given = [name for name in ("box", "polygon", "points") if getattr(self, name) is not None]
        if len(given) != 1:
            says = f"has {' and '.join(given)}" if given else "has neither box nor polygon nor points"
            return f"{says}: give one of box, polygon and points"
        if self.points is not None and len(self.points) < 4 and self.radius == 0:
            return f"has {len(self.points)} points and no radius: give a radius, or at least four points"
        if self.polygon is not None and _flat(self.polygon):
            return "has its corners on one line: a polygon has an area"
        return ""


def _flat(corners: Sequence[tuple[float, float]]) -> bool:
    """Whether corners (x, z) [m] lie on one line."""
    places = np.array(corners)
    spread = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
    return bool(spread[1] <= FLAT * spread[0])
