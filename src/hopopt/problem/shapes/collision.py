"""``leg.geometry``: the shapes of a leg from the collision geometry of its URDF, as numbers of the problem."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hopopt.leg.files.urdf_collision import collision_shapes
from hopopt.leg.geometry.solids import BODY

GEOMETRY = "geometry"  # the entry of [leg]


def with_shapes(
    tables: Mapping[str, Any],
    raw: bytes,
    folder: Path,
    joints: tuple[str, ...],
    given: Mapping[str, Any],
    within: Path,
) -> dict[str, Any]:
    """The tables of a leg with its URDF's shapes, where ``given`` entries ask for them; UrdfError if they cannot be read.

    raw: the URDF. folder: where it lies. joints: that move, from the body to the foot. within: the folder that its meshes must
    not leave.
    """
    if not given.get(GEOMETRY):
        return dict(tables)
    reach = sum(tables[link]["length"] for link in tables["links"])
    found = collision_shapes(raw, folder, joints, given["foot_frame"], given.get("locked", {}), reach, within)
    owners = {BODY: "body", **dict(enumerate(tables["links"]))}
    return dict(tables) | {owners[k]: tables[owners[k]] | {"shapes": shapes} for k, shapes in found.items()}
