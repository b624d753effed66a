"""What a hop can be asked for: one entry in a registry for each objective."""

from typing import Any

from hopopt.extensions import Registry, function
from hopopt.ocp.custom import as_objective, custom
from hopopt.ocp.hops.landing import IMPACT
from hopopt.ocp.hops.obstacle import OVER
from hopopt.ocp.objectives.effort import EFFORTS
from hopopt.ocp.objectives.objective import HopObjective, height, lowest_point
from hopopt.ocp.phases import length, points_at_apex

BEGUN_AT = 0.3  # [m] on the paper's leg: the clearance from which the search begins
OBJECTIVES: Registry[Any] = Registry(
    "objective",
    {
        o.name: o
        for o in (
            HopObjective(
                "clearance",
                "height of the leg's lowest point at the apex, the foot within its window of the hip's plumb line",
                "m",
                lambda hop, e: e.p["clearance"],
                "clearance_m",
                scale=length,
                parameters=lambda hop: (height(hop, "clearance", BEGUN_AT * length(hop)),),
                boundary=lambda hop: lowest_point(hop, "clearance"),
            ),
            HopObjective(
                "apex",
                "greatest height of the body",
                "m",
                lambda hop, e: points_at_apex(hop, e)[hop.leg.joints[0]][1],
                "apex_m",
                "free",
                scale=length,
            ),
            *EFFORTS,
            IMPACT,
            OVER,
        )
    },
)


def given(objective: Any) -> str | HopObjective:
    """What a user gives: the name of an objective, a user-defined function, or its name ``module:function``."""
    if isinstance(objective, HopObjective) or (isinstance(objective, str) and ":" not in objective):
        return objective
    return as_objective(objective)


def find(objective: str | HopObjective) -> HopObjective:
    """The objective of that name; UsageError, with what there is, if there is none."""
    if isinstance(objective, HopObjective):
        return objective
    found = function(objective) if ":" in objective else OBJECTIVES[objective]
    return found if isinstance(found, HopObjective) else as_objective(custom(found, objective))
