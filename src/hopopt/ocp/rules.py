"""The physical rules of a phase: which path constraints hold on the ground and which in the air.

A rule is a function of the leg and of the kind of phase, "stance" or "flight"; ``RULES`` lists them all. What others add to
it is a user-defined limit: answers name it, and it is checked by its value.
"""

from collections.abc import Callable
from dataclasses import replace

from hopopt.leg.limit_id import Kind, LimitId
from hopopt.ocp.constraints import (
    above_ground,
    friction_cone,
    no_counter_movement,
    operating_region_constraint,
    unilateral_contact,
)
from hopopt.ocp.drives import asked
from hopopt.ocp.guesses.motion import FLIGHT, STANCE, MovingLeg
from hopopt.ocp.problem import PathConstraint

Rule = Callable[[MovingLeg, str], tuple[PathConstraint, ...]]


def drives(leg: MovingLeg, kind: str) -> tuple[PathConstraint, ...]:
    """Every drive within its operating region."""
    motion = leg.motion_in(kind)
    return tuple(
        operating_region_constraint(leg.leg, joint, motion, asked(leg, joint, motion)) for joint in leg.leg.joints
    )


def ground(leg: MovingLeg, kind: str) -> tuple[PathConstraint, ...]:
    """The ground pushes, and the foot does not slip."""
    if kind != STANCE:
        return ()
    contact, motion = leg.design.contact, leg.motion_in(kind)
    pushes = unilateral_contact(motion, leg.force_range, contact.least_force)
    if contact.friction is None:
        return (pushes,)
    return pushes, friction_cone(motion, contact.friction, leg.force_range, leg.contact_axes)


def heights(leg: MovingLeg, kind: str) -> tuple[PathConstraint, ...]:
    """Points of the leg above the ground; the foot in flight alone."""
    hop = leg.design.hop
    names = tuple(name for name in hop.above_ground if name != "foot" or kind == FLIGHT)
    if not names:
        return ()
    return (above_ground(names, leg.motion_in(kind), leg.dynamics, leg.reach, hop.least_height),)


def counter_movement(leg: MovingLeg, kind: str) -> tuple[PathConstraint, ...]:
    """The body does not descend before it rises, unless it may."""
    if kind != STANCE or leg.design.hop.counter_movement:
        return ()
    return (no_counter_movement(leg.motion_in(kind)),)


RULES: list[Rule] = [drives, ground, heights, counter_movement]
BUILT_IN = tuple(RULES)


def added_rules() -> tuple[str, ...]:
    """Names of the rules that were added to RULES, as module:function."""
    return tuple(f"{rule.__module__}:{rule.__qualname__}" for rule in RULES if rule not in BUILT_IN)


def path_constraints(leg: MovingLeg, kind: str) -> tuple[PathConstraint, ...]:
    """All path constraints of a phase of that kind; those of rules that were added are user-defined."""
    return tuple(c if rule in BUILT_IN else _user_defined(c) for rule in leg.rules for c in rule(leg, kind))


def _user_defined(c: PathConstraint) -> PathConstraint:
    return replace(c, name=LimitId(Kind.USER, str(c.name), unit=c.unit))
