"""What of a leg stays above the ground, and the points that stand for it."""

import numpy as np

from hopopt.design import Design
from hopopt.design.fields import TRUNK
from hopopt.leg.geometry.solids import counted_points
from hopopt.leg.kinematics import joint_frames, start_angles


def above_ground(design: Design) -> dict[str, tuple[str, ...]]:
    """What stays above the ground, by name the points of the leg that stand for it: what ``hop.above_ground`` names; else every
    joint, the trunk and links where their shapes count, and the foot. Of links that begin lower than ``hop.least_height`` nothing
    is asked unless they are named."""
    named, points = design.hop.above_ground, points_of(design)
    if named:
        return {name: points[name] for name in named if name in points}
    links = [name for name, own in points.items() if own != (name,)]
    low = {name for name in links if lowest_at_start(design, name) < design.hop.least_height}
    return {name: own for name, own in points.items() if name not in low}


def points_above_ground(design: Design) -> tuple[str, ...]:
    """The points of all that stays above the ground but the foot, which stands on it."""
    return tuple(point for name, points in above_ground(design).items() if name != "foot" for point in points)


def points_of(design: Design) -> dict[str, tuple[str, ...]]:
    """All that may be asked to stay above the ground, by name its points."""
    leg, found = design.leg, dict[str, tuple[str, ...]]()
    for point, _, _ in counted_points(leg):
        name = point.partition(" ")[0]
        found[name] = (*found.get(name, ()), point)
    trunk = {name: (name,) for name in (TRUNK,) if leg.has_trunk}
    return {name: (name,) for name in leg.joints} | found | trunk | {"foot": ("foot",)}


def lowest_at_start(design: Design, name: str) -> float:
    """Height [m] over the ground, where the hop starts, of the lowest point of a link or the trunk."""
    places, turns = joint_frames(design.leg, start_angles(design))
    places, turns = [np.zeros(3), *places], [np.eye(3), *turns]  # the body's first
    own = points_of(design)[name]
    heights = [
        (places[joint + 1] + turns[joint + 1] @ place)[2]
        for point, joint, place in counted_points(design.leg)
        if point in own
    ]
    return float(min(heights) - places[-1][2])
