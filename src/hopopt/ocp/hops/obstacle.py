"""The highest obstacle of a given width that the whole leg clears: a box on the ground, which no link ever enters.

A link and the box are convex, so they do not meet if and only if a line separates them; in the plane one of four does
(separating axes: Ericson, Real-Time Collision Detection, 5.2). The box is ahead of the link, behind it, below the link's lower
end, or below the line through the link. The distance along the best of these is the greatest of four, made smooth so that
it is never too large: greatest values are averages with Boltzmann weights, least ones and those of two ends soft minima.
That keeps the leg away from the box by less than CORNER_ROUNDING of its length where two of these are equal.
"""

from collections.abc import Iterable, Sequence
from functools import reduce
from itertools import pairwise
from typing import Any

import casadi as ca

from hopopt.design import Design
from hopopt.design.fields import TRUNK
from hopopt.leg.geometry.outlines import Outline, outlines
from hopopt.leg.geometry.solids import BODY
from hopopt.leg.limit_id import Kind, LimitId
from hopopt.ocp.guesses.motion import MovingLeg
from hopopt.ocp.objectives.objective import HopObjective, height, tie_break_of
from hopopt.ocp.phases import DESCENT, FLIGHT, LANDING, LegPhase, body_speed, length
from hopopt.ocp.problem import INF, BoundaryConstraint, Ends, Instant, Parameter, PathConstraint, linkage

BOX_HEIGHT, BOX_AT = "obstacle", "obstacle at"  # height and near side of the box [m]
OBSTACLE_STEP = "obstacle step"  # how far ahead the foot lands [m]
BELOW_APEX = "obstacle below the apex"
BOX_WIDTH = "hop.obstacle.width"
CORNER_ROUNDING = 2e-3  # of the leg's length
STILL = 1e-6  # derivative of a corner's place by a length, below which it does not move
Box = tuple[Any, Any, Any]  # near side, width and height [m]
OBSTACLE = LimitId(Kind.OBSTACLE, key=BOX_WIDTH, unit="m")


def _links(leg: MovingLeg) -> list[tuple[str, str]]:
    """The ends of every link, by the names of the points."""
    return list(pairwise(leg.leg.chain))


def _link_names(leg: MovingLeg) -> tuple[str, ...]:
    """What moves between two points of the chain; the guide of a first joint that slides has no shape."""
    return ("",) * (len(leg.leg.chain) - 1 - len(leg.leg.links)) + leg.leg.links


def _clear(leg: MovingLeg, phase: LegPhase) -> tuple[PathConstraint, ...]:
    """No link within the box ahead, or behind where the foot has landed beyond it; a hop that goes on and on has both. Links with
    shapes count by their outlines, and so does the trunk."""
    landed, smooth, shapes = phase.phase.name == LANDING, CORNER_ROUNDING * leg.reach, outlines(leg.leg)
    links = [ends for name, ends in zip(_link_names(leg), _links(leg), strict=True) if name not in shapes]

    def value(s: Instant) -> ca.SX:
        q = phase.motion(s).q
        points = leg.dynamics(s).points(q)
        ahead, behind = s.p[BOX_AT], s.p[BOX_AT] - s.p[OBSTACLE_STEP]
        begins = [behind] * landed or [ahead, *[behind] * leg.design.hop.periodic]
        boxes = [(begin, s.p[BOX_WIDTH], s.p[BOX_HEIGHT]) for begin in begins]
        return ca.vertcat(
            *[distance(points[top], points[end], *box, smooth) for box in boxes for top, end in links],
            *[_of_outline(leg, s, q, shape, box) for box in boxes for shape in shapes.values()],
        )

    beside = ("", " (behind)")[: 1 + leg.design.hop.periodic]
    labels = tuple(f"{top} to {end}{after}" for after in beside for top, end in links)
    labels += tuple(f"{name}{after}" for after in beside for name in shapes)
    return (PathConstraint(OBSTACLE, value, 0.0, INF, scale=leg.reach, unit="m", labels=labels, smooth=False),)


def distance(a: ca.SX, b: ca.SX, begin: Any, width: Any, height: Any, smooth: float) -> ca.SX:
    """How far the link from a to b, (x, z) each, is from a box [m]; never more than it is, less by about ``smooth`` [m] at
    most, negative within."""
    (xa, za), (xb, zb) = (ca.vertsplit(end) for end in (a, b))
    along, up = xb - xa, zb - za
    steep = ca.sqrt(along**2 + (smooth / 10) ** 2) * ca.sqrt(along**2 + up**2)

    def over(x: Any) -> ca.SX:
        """Of a corner from the line through the link, 0 for an upright one."""
        return along * ((za - height) * along + up * (x - xa)) / steep

    ahead = least([begin - xa, begin - xb], smooth)
    behind = least([xa - begin - width, xb - begin - width], smooth)
    above = least([za - height, zb - height], smooth)
    return greatest([ahead, behind, above, least([over(begin), over(begin + width)], smooth)], smooth)


def _of_outline(leg: MovingLeg, s: Instant, q: ca.SX, shape: Outline, box: Box) -> ca.SX:
    """How far an outline is from a box [m] at a pose q (2 + n), as ``distance``."""
    dynamics, corners = leg.dynamics(s), _corners(leg, s, shape)
    faces = shape.faces_down if shape.joint == BODY else shape.faces

    def placed(points: Iterable[Sequence[Any]]) -> list[ca.SX]:
        return dynamics.places(q, [(shape.joint, (x, z)) for x, z in points])

    begins = [a.tolist() for a, _ in faces] if shape.joint == BODY else corners
    starts = placed(begins)
    ends = placed([[x + away[0], z + away[1]] for (x, z), (_, away) in zip(begins, faces, strict=True)])
    sides = [(a, end - a) for a, end in zip(starts, ends, strict=True)]
    counted = [corners] * 3 if shape.joint != BODY else [[corners[k]] for k in shape.extremes]
    return distance_of_polygon([placed(each) for each in counted], sides, box, CORNER_ROUNDING * leg.reach)


def _corners(leg: MovingLeg, s: Instant, shape: Outline) -> list[Sequence[Any]]:
    """Corners x, z [m] of an outline; those that the link's length moves are symbols, for derivatives by it."""
    if shape.joint == BODY:
        return shape.corners.tolist()
    longer = s.p[f"leg.{shape.name}.length"] - leg.design.leg.link[shape.name].length
    return [
        [x + dx * longer, z + dz * longer] if abs(dx) + abs(dz) > STILL else [x, z]
        for (x, z), (dx, dz) in zip(shape.corners.tolist(), shape.by_length.tolist(), strict=True)
    ]


def distance_of_polygon(
    corners: Sequence[Sequence[ca.SX]], sides: Sequence[tuple[ca.SX, ca.SX]], box: Box, smooth: float
) -> ca.SX:
    """As ``distance``, of a convex polygon.

    corners: those that may be foremost, hindmost and lowest, (x, z) [m]
    sides: a point of each that may face down, and the unit vector outwards
    """
    (begin, width, height), (front, back, low) = box, corners

    def over(a: ca.SX, away: ca.SX) -> ca.SX:
        """Of both corners of the box from the line through a side, no more than 0 for one that faces up."""
        heights = [away[0] * (x - a[0]) + away[1] * (height - a[1]) for x in (begin, begin + width)]
        return least([*heights, -away[1] * smooth / CORNER_ROUNDING], smooth)

    ahead = least([begin - c[0] for c in front], smooth)
    behind = least([c[0] - begin - width for c in back], smooth)
    above = least([c[1] - height for c in low], smooth)
    return greatest([ahead, behind, above, *[over(*side) for side in sides]], smooth)


def least(values: Sequence[ca.SX], smooth: float) -> ca.SX:
    """Soft minimum, not above the least."""
    lowest = reduce(ca.fmin, values)
    return lowest - smooth * ca.log(sum(ca.exp((lowest - value) / smooth) for value in values))


def greatest(values: Sequence[ca.SX], smooth: float) -> ca.SX:
    """Average with Boltzmann weights, not above the greatest."""
    highest = reduce(ca.fmax, values)
    weights = [ca.exp((value - highest) / smooth) for value in values]
    return sum(w * value for w, value in zip(weights, values, strict=True)) / sum(weights)


def _numbers(leg: MovingLeg) -> tuple[Parameter, ...]:
    """Height and place of the box, both free, and its width."""
    size = leg.reach
    return (
        height(leg, BOX_HEIGHT, 0.2 * size),
        Parameter(BOX_AT, lower=0.0, upper=100 * size, scale=size, unit="m", value=0.3 * size, free=True),
        Parameter(BOX_WIDTH, value=leg.design.hop.obstacle.width or 0.0, unit="m"),
        Parameter(OBSTACLE_STEP, lower=0.0, upper=100 * size, scale=size, unit="m", value=size, free=True),
    )


def _beyond(leg: MovingLeg) -> tuple[BoundaryConstraint, ...]:
    """The foot lands beyond the box; flight ends at the apex."""

    def foot(e: Ends) -> ca.SX:
        return leg.flight_points(e.final[DESCENT])["foot"][0]

    def body(e: Ends) -> ca.SX:
        return leg.flight_pose(e.final[FLIGHT])[0][0]

    beyond = BoundaryConstraint(
        "foot beyond the obstacle", lambda e: foot(e) - e.p[BOX_AT] - e.p[BOX_WIDTH], 0.0, INF, leg.reach, "m"
    )
    return (
        beyond,
        linkage("obstacle behind", lambda e: foot(e) - e.p[OBSTACLE_STEP], length(leg), unit="m"),
        linkage("apex", lambda e: e.final[FLIGHT].com_v[-1], body_speed(leg), unit="m/s"),
        BoundaryConstraint(
            BELOW_APEX, lambda e: e.p[BOX_AT] + e.p[BOX_WIDTH] / 2 - body(e), *_below(leg), length(leg), "m"
        ),
    )


def _below(leg: MovingLeg) -> tuple[float, float]:
    """From where to where the middle of the box may stand below the body at the apex [m]: between the ends of a trunk, else
    below the first joint."""
    trunk = outlines(leg.leg).get(TRUNK)
    return (0.0, 0.0) if trunk is None else (float(trunk.corners[:, 0].min()), float(trunk.corners[:, 0].max()))


def _no_width(design: Design) -> str | None:
    """What to say if the problem does not say how wide the obstacle is, or the leg cannot travel."""
    if design.hop.obstacle.width is None:
        return "it needs the obstacle's width: give hop.obstacle.width [m], such as --set hop.obstacle.width=0.2"
    if "x" not in design.leg.guides:
        return "it needs a leg whose body moves along x and z in a plane (leg.guides)"
    return None


OVER = HopObjective(
    "obstacle", "height of the highest box of the given width that the whole leg clears on its way forwards", "m",
    lambda leg, e: e.p[BOX_HEIGHT], "obstacle_m", "free", scale=length, parameters=_numbers, boundary=_beyond, path=_clear,
    kind="landing", fault=_no_width, tie_break=lambda leg: 100.0 * tie_break_of(leg),
)  # fmt: skip
