"""What of a leg stays above the ground, and the points that stand for it."""

from collections.abc import Sequence

import numpy as np

from hopopt.design import Design, Leg
from hopopt.design.fields import TRUNK
from hopopt.leg.closed_chains import arm_point, chain_points, crank_point
from hopopt.leg.geometry.solids import counted_points
from hopopt.leg.kinematics import joint_frames, joint_positions, link_ends, start_angles


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
    beside = {of(joint): (of(joint),) for joint in leg.five_bars for of in (arm_point, crank_point)}
    return {name: (name,) for name in leg.chain[:-1]} | found | trunk | beside | {"foot": ("foot",)}


def height_rows(design: Design) -> list[tuple[str, str, float]]:
    """What a planner keeps above the ground: the name of what it is for, a point, and its least height [m]. The ends of a link
    stay higher by the radius of a capsule about it; a link whose capsule starts too low counts by its own points."""
    hop, leg, above = design.hop, design.leg, above_ground(design)
    rows = {point: (name, 0.0 if name == "foot" else hop.least_height) for name, own in above.items() for point in own}
    heights = dict(zip(leg.pivots, _joint_heights(design), strict=True))
    for k, link in enumerate(leg.links[:-1]):
        own, ends = above.get(link, ()), leg.pivots[k : k + 2]
        if leg.link_joints[k + 1].slides:  # the next link may slide along it: its own end is no point of the leg
            continue
        least = hop.least_height + capsule_radius(leg, own, k) if own else np.inf
        if all(heights[joint] > least for joint in ends):
            rows = {point: row for point, row in rows.items() if point not in own}
            for joint in ends:
                name, others = rows.get(joint, (link, 0.0))
                rows[joint] = name, max(others, least)
    return [(name, point, least) for point, (name, least) in rows.items()]


def capsule_radius(leg: Leg, points: Sequence[str], k: int) -> float:
    """Radius [m] of the capsule about the line of link ``k`` that holds these points of it."""
    along = link_ends(leg)[k, [0, 2]]
    places = np.array([place for name, _, place in counted_points(leg) if name in points])[:, [0, 2]]
    share = np.clip(places @ along / max(along @ along, 1e-12), 0.0, 1.0)
    return float(np.linalg.norm(places - share[:, None] * along, axis=1).max())


def _joint_heights(design: Design) -> list[float]:
    """Of each link's joint where the hop starts [m]."""
    heights = joint_positions(design.leg, start_angles(design))[:, 2]
    return [float(height - heights[-1]) for height in heights[:-1]]


def lowest_at_start(design: Design, name: str) -> float:
    """Height [m] over the ground, where the hop starts, of the lowest point of a link, the trunk or a five-bar."""
    q = start_angles(design)
    places, turns = joint_frames(design.leg, q)
    places, turns = [np.zeros(3), *places], [np.eye(3), *turns]  # the body's first
    own = points_of(design)[name]
    heights = [
        (places[joint + 1] + turns[joint + 1] @ place)[2]
        for point, joint, place in (*counted_points(design.leg), *chain_points(design.leg, q))
        if point in own
    ]
    return float(min(heights) - places[-1][2])
