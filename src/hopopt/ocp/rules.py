"""The physical rules of a phase: which path constraints hold on the ground and which in the air, each stated at one instant.

A rule is a function of the leg and of the kind of phase, "stance" or "flight". What others add to ``RULES`` holds where a
problem names it. It is a user-defined limit: answers name it, and it is checked by its value.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from hopopt.design import Design
from hopopt.drivetrain.dynamics import added_states
from hopopt.drivetrain.operating_region.limits import BACKWARD, FORWARD
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.drivetrain.supply import power_limits
from hopopt.extensions import Registry, arguments
from hopopt.leg.geometry.above import height_rows
from hopopt.leg.limit_id import Kind, LimitId, motor_power, torque_rate
from hopopt.leg.scales import descent_range
from hopopt.ocp.drives import asked, bus_power, bus_voltage, changing
from hopopt.ocp.guesses.motion import FLIGHT, STANCE, MovingLeg
from hopopt.ocp.hops.collision import collision
from hopopt.ocp.problem import INF, Instant, PathConstraint

Rule = Callable[[MovingLeg, str], tuple[PathConstraint, ...]]
LEFT, RIGHT = "left", "right"
GROUND_FORCE = LimitId(Kind.GROUND_FORCE, key="contact.least_force", unit="N")
FORCE_RATE = LimitId(Kind.FORCE_RATE, key="contact.force_rate", unit="N/s")
FRICTION = LimitId(Kind.FRICTION, key="contact.friction", unit="N")
LEAST_HEIGHT = LimitId(Kind.HEIGHT, key="hop.least_height", unit="m")
NO_DESCENT = LimitId(Kind.DESCENT, key="hop.counter_movement", unit="m/s")


def drives(leg: MovingLeg, kind: str) -> tuple[PathConstraint, ...]:
    """Every drive within its operating region (paper, eq. 13): -1 <= a tau + b w <= 1 for every pair of its half-planes,
    tau being what the motor is asked for [N m]."""
    motion = leg.motion_in(kind)

    def region(k: int, joint: str) -> PathConstraint:
        torque, voltage = asked(leg, joint, motion), bus_voltage(leg, motion)

        def value(s: Instant) -> ca.SX:
            w = motion(s).drives.w[k]
            return ca.vertcat(
                *operating_region(leg.leg, joint, s.p).use(w, torque(s), voltage(s), leg.torque_rate(s, k))[::2]
            )

        planes = operating_region(leg.leg, joint, leg.robot.parameters).planes  # each followed by its mirror image
        labels = tuple(h.line for h in planes[::2])
        return PathConstraint(LimitId(Kind.REGION, joint), value, -1.0, 1.0, scale=2.0, labels=labels)

    return tuple(region(k, joint) for k, joint in enumerate(leg.leg.joints))


def mechanical_power(leg: MovingLeg, kind: str) -> tuple[PathConstraint, ...]:
    """No motor gives or takes more than its cap on mechanical power: -1 <= tau w / power_cap <= 1, tau being what the motor is
    asked for [N m]."""
    motion = leg.motion_in(kind)

    def limit(k: int, joint: str) -> PathConstraint:
        torque, name = asked(leg, joint, motion), motor_power(leg.leg, joint)
        return PathConstraint(name, lambda s: torque(s) * motion(s).drives.w[k] / s.p[name.key], -1.0, 1.0, scale=2.0)

    capped = (leg.leg.drive(joint, "motor", "power_cap")[1] is not None for joint in leg.leg.joints)
    return tuple(limit(k, joint) for k, (joint, has) in enumerate(zip(leg.leg.joints, capped, strict=True)) if has)


def torque_rates(leg: MovingLeg, kind: str) -> tuple[PathConstraint, ...]:
    """No motor's torque changes faster than its limit: -1 <= rate / torque_rate <= 1, the rate being a control."""

    def limit(joint: str) -> PathConstraint:
        k = leg.leg.joints.index(joint)

        def share(s: Instant) -> ca.SX:
            return leg.commands(s)[k] / added_states(leg.leg, s.p).of[joint].rate

        return PathConstraint(torque_rate(leg.leg, joint), share, -1.0, 1.0, scale=2.0)

    return tuple(limit(leg.leg.joints[k]) for k in leg.drive_states.limited)


def supply(leg: MovingLeg, kind: str) -> tuple[PathConstraint, ...]:
    """The motors together draw no more than the supply's caps, its least voltage and its internal resistance allow [W]."""
    motion = leg.motion_in(kind)

    def limit(entry: str, most: float) -> PathConstraint:
        def left(s: Instant) -> ca.SX:
            return power_limits(leg.leg, s.p)[entry] - bus_power(leg, motion)(s)

        name = LimitId(Kind.SUPPLY, entry.replace("_", " "), f"supply.{entry}", "W")
        return PathConstraint(name, left, lower=0.0, scale=most, unit="W")

    return tuple(limit(entry, float(most)) for entry, most in power_limits(leg.leg, leg.robot.parameters).items())


def ground(leg: MovingLeg, kind: str) -> tuple[PathConstraint, ...]:
    """The ground only pushes, f_z >= contact.least_force [N], and the foot does not slip.

    |f_x| <= mu f_z are two half-planes. Where the foot is held sideways too, a pyramid lies within the cone:
    |f_x|, |f_y| <= mu f_z / sqrt(2).
    """
    if kind != STANCE:
        return ()
    contact, motion, size, axes = leg.design.contact, leg.motion_in(kind), leg.force_range, leg.contact_axes
    pushes = PathConstraint(GROUND_FORCE, lambda s: motion(s).f[-1], contact.least_force, scale=size, unit="N")
    if (friction := contact.friction) is None:
        return (pushes,)

    def inside(s: Instant) -> ca.SX:
        f = motion(s).f
        most = f[-1] * friction * steepness(axes)
        return ca.vertcat(*[most + sign * f[k] for k in range(axes - 1) for sign in (-1, 1)])

    labels = (FORWARD, BACKWARD) if axes == 2 else (FORWARD, BACKWARD, LEFT, RIGHT)
    return pushes, PathConstraint(FRICTION, inside, lower=0.0, scale=size, unit="N", labels=labels)


def steepness(axes: int) -> float:
    """What each side of the friction cone (2 axes held), or of the pyramid within it (3), has of the friction coefficient."""
    return 1.0 if axes == 2 else 1 / np.sqrt(2)


def force_rates(leg: MovingLeg, kind: str) -> tuple[PathConstraint, ...]:
    """The vertical ground force changes no faster than its limit: -1 <= its rate / contact.force_rate <= 1."""
    most, motion = leg.design.contact.force_rate, leg.motion_in(kind)
    if kind != STANCE or most is None:
        return ()
    return (PathConstraint(FORCE_RATE, lambda s: changing(leg, s, motion(s).f[-1]) / most, -1.0, 1.0, scale=2.0),)


def heights(leg: MovingLeg, kind: str) -> tuple[PathConstraint, ...]:
    """Points of the leg at least hop.least_height above the ground [m]; the foot in flight alone, and at least 0."""
    motion = leg.motion_in(kind)
    rows = [row for row in height_rows(leg.design) if row[0] != "foot" or kind == FLIGHT]
    if not rows:
        return ()

    def value(s: Instant) -> ca.SX:
        points = leg.dynamics(s).points(motion(s).q)
        return ca.vertcat(*[points[point][1] for _, point, _ in rows])

    names, _, lower = zip(*rows, strict=True)
    rises = (
        not leg.drive_states.steady
    )  # a foot that comes off with the cube of time has no quadratic hull above the ground
    return (PathConstraint(LEAST_HEIGHT, value, lower, scale=leg.reach, unit="m", labels=names, smooth=rises),)


def counter_movement(leg: MovingLeg, kind: str) -> tuple[PathConstraint, ...]:
    """The body never descends in stance, z' >= 0 [m/s], unless it may."""
    if kind != STANCE or leg.design.hop.counter_movement:
        return ()
    motion = leg.motion_in(kind)
    return (PathConstraint(NO_DESCENT, lambda s: motion(s).v[1], 0.0, INF, descent_range(leg.leg), unit="m/s"),)


BUILT_IN: tuple[Rule, ...] = (
    drives, mechanical_power, torque_rates, supply, ground, force_rates, heights, counter_movement, collision,
)  # fmt: skip
RULES: Registry[Any] = Registry(
    "constraint", {}
)  # of the user's own: such rules, or functions of an instant (custom.py)


def rules_of(design: Design) -> tuple[Rule, ...]:
    """The rules that hold in a hop: those that are built in, and others that the problem names."""
    return (*BUILT_IN, *(RULES[name] for name in named_constraints(design) if is_rule(name)))


def named_constraints(design: Design) -> tuple[str, ...]:
    """Names of the user's own constraints that a problem has."""
    return design.hop.constraints or ()


def is_rule(name: str) -> bool:
    """Whether a constraint of the user's own is stated of the leg and the kind of phase; else it is of an instant (custom.py)."""
    return ":" not in name and arguments(RULES[name]) == 2


def path_constraints(leg: MovingLeg, kind: str) -> tuple[PathConstraint, ...]:
    """All path constraints of a phase of that kind; those of rules that are not built in are user-defined."""
    return tuple(
        c if rule in BUILT_IN else replace(c, name=LimitId(Kind.USER, str(c.name), unit=c.unit))
        for rule in leg.rules
        for c in rule(leg, kind)
    )
