"""A two-joint leg on a vertical slider, foot on the ground: one degree of freedom, the height of the body."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from hopopt.design import Design
from hopopt.drivetrain.gear import Gear
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.leg.geometry.above import above_ground
from hopopt.leg.kinematics import TwoJoints, joint_positions, reach, start_angles, start_place, within_limits
from hopopt.leg.robot import BASE, build_robot
from hopopt.sim.machine import Machine

RANGE_STEPS = 50  # steps within the leg's reach in which the ends of the body's range are looked for
RANGE_HALVINGS = 24  # of these steps
POSE_TOLERANCE = 1e-9  # m, rad: by which a pose may pass a limit
ROUNDING = 1e-9  # relative: by which a corner of the polygon may pass the other lines


@dataclass(frozen=True)
class SliderLeg:
    """The leg at m heights of its body.

    Torques, and the vertical force, are [..., 0] + [..., 1] a + [..., 2] v^2 at the body's speed v [m/s] and
    acceleration a [m/s^2]; a horizontal force on the foot takes levers times itself from the torques.

    y: heights (m,) [m]
    q: joint angles (m, 2) [rad]
    dq: their change with height (m, 2) [rad/m]
    ddq: joint accelerations at v = 1 m/s that keep the body's speed (m, 2) [rad/s^2]
    com: centre of mass (m,) [m]
    dcom: its change with height (m,) [1]
    torque: (m, 2, 3) [N m]
    force: (m, 3) [N]
    levers: (m, 2) [m]
    """

    y: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    com: np.ndarray
    dcom: np.ndarray
    torque: np.ndarray
    force: np.ndarray
    levers: np.ndarray


def slider_leg(design: Design, size: int) -> SliderLeg:
    """The leg at ``size`` heights between the lowest and the highest that joint limits and ground allow."""
    geometry, machine = TwoJoints.of(design.leg), Machine(build_robot(design.leg))
    y = np.linspace(*_range(design, geometry), size)
    rows = [_at_height(machine, _pose(design, geometry, height)) for height in y]
    return SliderLeg(y, *(np.array(column) for column in zip(*rows, strict=True)))


def _pose(design: Design, geometry: TwoJoints, height: float) -> np.ndarray:
    """Joint angles with the body at ``height`` [m] over the foot, bent to the side of the start."""
    side = np.sign(geometry.bend(start_angles(design)[1]))
    solutions = geometry.angles(np.array([-start_place(design)[0], -height]))
    return next(q for q in solutions if geometry.bend(q[1]) * side >= 0)


def _range(design: Design, geometry: TwoJoints) -> tuple[float, float]:
    """Lowest and highest body about the start [m]."""
    x, start = (float(place) for place in start_place(design))
    above = above_ground(design)
    least = np.array([design.hop.least_height if j in above else -np.inf for j in design.leg.joints])

    def allowed(height: float) -> bool:
        if not geometry.angles(np.array([-x, -height])):
            return False
        q = _pose(design, geometry, height)
        places = joint_positions(design.leg, q)[:, 2]
        return within_limits(design.leg, q, POSE_TOLERANCE) and bool(
            np.all(places[:-1] - places[-1] >= least - POSE_TOLERANCE)
        )

    step = reach(design.leg) / RANGE_STEPS
    return _last_allowed(allowed, start, -step), _last_allowed(allowed, start, step)


def _last_allowed(allowed: Callable[[float], bool], height: float, step: float) -> float:
    """The last height [m] from ``height`` on before one is not allowed, in steps that are then halved."""
    for _ in range(RANGE_HALVINGS):
        while allowed(height + step):
            height += step
        step /= 2
    return height


def _at_height(machine: Machine, q_j: np.ndarray) -> tuple[Any, ...]:
    """One row of each array of ``SliderLeg`` after y."""
    s = machine.stance_terms(q_j, np.zeros(2))
    dq = -np.linalg.solve(s.jacobian, np.array([0.0, 1.0]))  # the foot stays: base' + J q' = 0
    ddq = -np.linalg.solve(s.jacobian, machine.stance_terms(q_j, dq).drift)
    v = np.concatenate([[0.0, 1.0], dq])
    dcom, com = machine.com_velocity(s.q, v)[1], machine.points(s.q)["com"][1]
    rest = machine.inverse_dynamics(s.q, np.zeros(4), np.zeros(4))
    ahead = machine.inverse_dynamics(s.q, np.zeros(4), v) - rest
    fast = machine.inverse_dynamics(s.q, v, np.concatenate([[0.0, 0.0], ddq])) - rest
    terms = np.stack([rest, ahead, fast], axis=-1)  # (4, 3)
    torque = terms[BASE:] - np.outer(s.jacobian[1], terms[1])  # less what the vertical force takes
    return q_j, dq, ddq, com, dcom, torque, terms[1], s.jacobian[0]


def accelerations(design: Design, leg: SliderLeg, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest acceleration [m/s^2] of the body at heights leg.y (m,) and speeds v (m, k) [m/s], nan where
    there is none: a linear program in it and the horizontal force, solved at the corners of its polygon."""
    G, r = _lines(design, leg, v)
    least, largest = np.full(v.shape, np.inf), np.full(v.shape, -np.inf)
    for i, j in combinations(range(G.shape[2]), 2):
        pair = G[:, :, [i, j]]
        sound = np.abs(np.linalg.det(pair)) > 1e-12 * np.abs(pair).max(axis=(2, 3)) ** 2
        inverse = np.linalg.inv(np.where(sound[..., None, None], pair, np.eye(2)))
        corner = np.einsum("mkij,mjk->mik", inverse, r[:, [i, j]])  # (m, 2, k)
        inside = np.all(np.einsum("mkci,mik->mck", G, corner) <= r + ROUNDING * (1 + np.abs(r)), axis=1)
        inside &= sound
        least = np.where(inside, np.minimum(least, corner[:, 0]), least)
        largest = np.where(inside, np.maximum(largest, corner[:, 0]), largest)
    none = least > largest
    return np.where(none, np.nan, least), np.where(none, np.nan, largest)


def _lines(design: Design, leg: SliderLeg, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """G (m, k, c, 2) and r (m, c, k) of G (a, f_x) <= r: drives with what their gears lose, least vertical force, friction."""
    robot, rows, right = build_robot(design.leg), [], []
    rotors = robot.model.armature[BASE:]
    for k, joint in enumerate(design.leg.joints):
        still = leg.torque[:, k, 0, None] + leg.torque[:, k, 2, None] * v**2
        w, gear = leg.dq[:, k, None] * v, Gear.of(design.leg, joint, robot.parameters).level
        turning = w / (w**4 + gear.slow**4) ** 0.25
        lost = gear.friction * turning + gear.damping * w
        for plane in operating_region(design.leg, joint, robot.parameters).planes:
            a, b = float(plane.a), float(plane.b)
            share = gear.efficiency ** (
                -np.sign(a) * turning
            )  # of the joint's torque, in the motor's; the rotor's part lacks nothing
            ahead = share * leg.torque[:, k, 1, None] + (1 - share) * rotors[k] * leg.dq[:, k, None]
            rows.append(np.stack([a * ahead, -a * share * leg.levers[:, k, None]], axis=-1))
            spun = (1 - share) * rotors[k] * leg.ddq[:, k, None] * v**2
            right.append(1.0 - a * (share * still + spun + lost) - b * w)
    force = leg.force[:, 0, None] + leg.force[:, 2, None] * v**2
    rows.append(_at_all(v, -leg.force[:, 1], np.zeros(len(leg.y))))
    right.append(force - design.contact.least_force)
    if (friction := design.contact.friction) is not None:
        for side in (-1.0, 1.0):
            rows.append(_at_all(v, -friction * leg.force[:, 1], np.full(len(leg.y), side)))
            right.append(friction * force)
    return np.stack(rows, axis=2), np.stack(right, axis=1)


def _at_all(v: np.ndarray, *columns: np.ndarray) -> np.ndarray:
    """Coefficients (m,) that are the same at all speeds v (m, k), as (m, k, 2)."""
    return np.stack([np.broadcast_to(column[:, None], v.shape) for column in columns], axis=-1)
