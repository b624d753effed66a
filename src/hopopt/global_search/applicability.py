"""For which problems the global search is made."""

from hopopt.design import Design
from hopopt.design.fields import TRUNK
from hopopt.drivetrain.heat import LIMIT
from hopopt.leg.geometry.above import height_rows
from hopopt.leg.geometry.solids import counted_points, has_shape
from hopopt.leg.kinematics import planar, two_joints

UNKNOWN = ("power_cap", LIMIT)  # entries of motors that its grid does not see


def left_out(design: Design) -> str | None:
    """What of a problem the global search leaves out, in a clause, so that its motions may do more than the leg; else None."""
    clauses = [] if design.leg.supply is None else ["that the supply sags or has caps"]
    clauses += [] if "x" in design.leg.guides else ["how long the leg takes to fold on a vertical slider"]
    thick = {point for _, point, _ in height_rows(design)} - {*design.leg.pivots, TRUNK, "foot"}
    clauses += ["how thick links are that come near the ground"] if has_shape(design.leg) and thick else []
    return " and ".join(clauses) or None


def applies(design: Design) -> str | None:
    """None, or in one clause why the global search does not apply to a problem."""
    leg = design.leg
    if len(leg.joints) != 2:
        return f"the leg has {len(leg.joints)} joint{'s' if len(leg.joints) > 1 else ''}, and the grid needs two"
    if leg.follows or leg.sliding:
        return "a joint slides" if leg.sliding else "a joint follows another one"
    if not planar(leg):
        return "the leg leaves the x-z plane"
    if not two_joints(leg):
        return "a link points across the x-z plane, so that it does not move in it"
    if design.surroundings.slope:
        return "the ground slopes"
    if "z" not in leg.guides:
        return "no guide lets the body rise"
    if has_shape(leg) and "x" not in leg.guides and (not design.hop.may_collide or counted_points(leg)):
        return "on a vertical slider it does not know what shape body and links have"
    if not leg.direct or leg.elastic:
        return "it knows no drives that turn otherwise than their joints"
    if any(leg.drive(joint, "motor", entry)[1] is not None for joint in leg.joints for entry in UNKNOWN):
        return "it knows neither caps on motors' power nor how hot motors get"
    return None
