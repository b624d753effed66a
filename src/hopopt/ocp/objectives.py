"""What a hop can be asked for: one short entry in a registry for each objective."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca

from hopopt.ocp.problem import INF, BoundaryConstraint, Ends, Parameter

if TYPE_CHECKING:
    from hopopt.ocp.hop import Hop


@dataclass(frozen=True)
class HopObjective:
    """value(hop, ends) [unit] is made as large as possible, with parameters and boundary constraints of its own."""

    name: str
    meaning: str
    unit: str
    value: Callable[["Hop", Ends], ca.SX]
    parameters: Callable[["Hop"], tuple[Parameter, ...]] = lambda hop: ()
    boundary: Callable[["Hop"], tuple[BoundaryConstraint, ...]] = lambda hop: ()


def _lowest_point(hop: "Hop") -> tuple[BoundaryConstraint, ...]:
    """Every point of the leg is at least ``clearance`` high when flight ends, the foot within its window."""

    def heights(e: Ends) -> ca.SX:
        points = hop.points_at_end(e)
        return ca.vertcat(*[points[name][1] - e.p["clearance"] for name in hop.point_names])

    def foot_offset(e: Ends) -> ca.SX:
        points = hop.points_at_end(e)
        return points["foot"][0] - points[hop.leg.joints[0]][0]

    window = hop.design.hop.foot_window
    return (
        BoundaryConstraint("clearance", heights, 0.0, INF, unit="m", labels=hop.point_names),
        BoundaryConstraint("foot window", foot_offset, -window, window, unit="m"),
    )


OBJECTIVES = {
    o.name: o
    for o in (
        HopObjective(
            "clearance",
            "height of the leg's lowest point at the apex, the foot within its window of the hip's plumb line",
            "m",
            lambda hop, e: e.p["clearance"],
            lambda hop: (Parameter("clearance", lower=-5.0, upper=20.0, unit="m", value=0.3, free=True),),
            _lowest_point,
        ),
        HopObjective(
            "apex",
            "greatest height of the body's centre of mass",
            "m",
            lambda hop, e: hop.points_at_end(e)[hop.leg.joints[0]][1],
        ),
    )
}
