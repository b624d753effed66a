"""What a hop can be asked for: one entry in a registry for each objective."""

from difflib import get_close_matches
from typing import Any

from hopopt.errors import UsageError
from hopopt.ocp.custom import as_objective
from hopopt.ocp.hops.landing import IMPACT
from hopopt.ocp.hops.obstacle import OVER
from hopopt.ocp.objectives.effort import EFFORTS
from hopopt.ocp.objectives.objective import HopObjective, height, lowest_point
from hopopt.ocp.phases import length, points_at_apex

BEGUN_AT = 0.3  # [m] on the paper's leg: the clearance from which the search begins
OBJECTIVES = {
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
}


def given(objective: Any) -> str | HopObjective:
    """What a user gives: the name of an objective, a user-defined function, or its name ``module:function``."""
    if isinstance(objective, HopObjective) or (isinstance(objective, str) and ":" not in objective):
        return objective
    return as_objective(objective)


def find(objective: str | HopObjective) -> HopObjective:
    """The objective of that name; UsageError, with what there is, if there is none."""
    if isinstance(objective, HopObjective):
        return objective
    if ":" in objective:
        raise UsageError(f"{objective} is a user-defined function, which is only run where it is given: give it again")
    check_known(objective)
    return OBJECTIVES[objective]


def check_known(objective: str) -> None:
    """UsageError, with the nearest name and with all, if there is no objective of that name."""
    if objective not in OBJECTIVES:
        close = get_close_matches(objective, OBJECTIVES, n=1)
        meant = f" (did you mean {close[0]}?)" if close else ""
        raise UsageError(f"there is no objective {objective!r}{meant}: choose one of {', '.join(OBJECTIVES)}")
