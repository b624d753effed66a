"""Shapes of a leg that no solid has."""

import re
from collections.abc import Iterator

from hopopt.design import Design, HopSettings, Leg
from hopopt.design.geometry.shape import Shape
from hopopt.leg.geometry.above import above_ground, lowest_at_start, points_of
from hopopt.leg.geometry.solids import NEAR, has_shape, on_grid
from hopopt.problem.checking.faults import Report
from hopopt.problem.render import shown

ROUNDING = 1e-9  # m: a pose given in decimals is not refused for its last digit
NAME = re.compile(r"[A-Za-z0-9_-]{1,64}")


def shape_rules(leg: Leg, report: Report) -> None:
    """Report shapes that are stated twice, or not at all."""
    for path, name, shape in _shapes(leg):
        if not NAME.fullmatch(name):
            report.add(path, "is no name of a shape: 1 to 64 letters, digits, _ or - are needed")
        elif words := shape.fault():
            report.add(path, words)


def ground_rules(design: Design, report: Report) -> None:
    """Report a trunk or a link that the hop wants above the ground and that starts below it, or whose shape does not count."""
    known, above, hop = points_of(design), above_ground(design), design.hop
    for name in sorted(set(hop.above_ground) - set(known)):
        report.add("hop.above_ground", f"has {shown(name)}, no shape of which counts: leave it out (docs/body.md)")
    for name in [name for name in above if name not in design.leg.chain]:
        low = lowest_at_start(design, name)
        if low < hop.least_height - ROUNDING:
            entry = "hip_height" if design.start.joint_angles is None else "joint_angles"
            words = f"puts the {name} {hop.least_height - low:.3f} m too low, below the ground or hop.least_height"
            report.add(f"start.{entry}", f"{words}: move the shape, or start higher")


def margin_rules(leg: Leg, hop: HopSettings, report: Report) -> None:
    """Report a margin that the planner cannot keep: beyond what its distances tell precisely, or on a leg that no grid holds."""
    margin, most = hop.collision_margin, NEAR * leg.length
    if margin is None or not has_shape(leg) or hop.may_collide:
        return
    if not on_grid(leg):
        which = "whose joints slide or follow others" if leg.follows or leg.sliding else f"of {len(leg.joints)} joints"
        words = f"a leg {which} is measured, and not kept away: leave it out"
        report.add("hop.collision_margin", f"= {margin:g} m cannot be kept: {words}")
    elif margin > most:
        words = f"more than {NEAR:g} of the leg's length: at most {most:.4g} m, or a larger radius of the shapes"
        report.add("hop.collision_margin", f"= {margin:g} m is {words}")


def _shapes(leg: Leg) -> Iterator[tuple[str, str, Shape]]:
    """Every shape of a leg: its path in the problem file, its name, and itself."""
    for owner, table in (("body", leg.body), *leg.link.items()):
        for name, shape in (table.shapes or {}).items():
            yield f"leg.{owner}.shapes.{name}", name, shape
