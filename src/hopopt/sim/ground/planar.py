"""The leg's equations of motion in the plane, compiled: what a plant with slipping needs, fast.

q = (x, z, joint angles), as Pinocchio has it (``Machine``, which the tests hold against it). Each link turns by the sum of
the angles above it; the mass matrix and the bias are sums over the links of their centres of mass (Featherstone, Rigid
Body Dynamics Algorithms, 2008, chapter 6, in coordinates of the plane).
"""

from collections.abc import Collection
from typing import Any

import numpy as np

from hopopt.compiled.kernel import kernel, packed
from hopopt.drivetrain import transmission
from hopopt.drivetrain.drives import Drive
from hopopt.drivetrain.kernels import add_spring_torques, drive_drift, drive_jacobian
from hopopt.errors import UsageError
from hopopt.leg.geometry.solids import BODY, SIDES
from hopopt.leg.kinematics import can_slip
from hopopt.leg.robot import BASE, Robot
from hopopt.sim.ground.stops import Stops


def planar_leg(robot: Robot, drive: Drive, stops: Stops, watched: Collection[str], mu: float, finer: int = 1) -> Any:
    """What the compiled functions need of a leg and its drives, as one record; UsageError for a leg that leaves the plane or
    stands on a vertical slider.

    watched: points that must not come to the ground; mu: friction coefficient; finer: parts into which every step is cut.
    The record has these, watched as ``watched_points`` orders them, and what follows.
    watching: how many are watched; watched_joint, watched_at: the joint that moves each, or BODY, and its place there (2) [m]
    sign (n,): +1 where a joint turns about +y
    tip, com (n, 2): next joint, or foot, and centre of mass in the link's frame [m]
    mass, inertia, armature (n,): [kg, kg m^2]; body: mass of the body [kg]
    gravity (2,): along x and z [m/s^2]
    the names of ``Drive.numbers``, ``Springs.numbers`` and ``transmission.numbers``, as there
    stop_upper, stop_lower, stiffness, loss: as in ``Stops``
    """
    if not can_slip(robot.leg):
        raise UsageError(
            "ground with friction is simulated for legs on x and z guides that move in the x-z plane, without five-bars and with "
            "motors on the body, only"
        )
    n, model = len(robot.joints), robot.model
    inertias, axes = list(model.inertias)[BASE + 1 :], [robot.leg.joint[name].axis[1] for name in robot.joints]
    ends = [model.jointPlacements[k].translation for k in range(BASE + 2, BASE + 1 + n)]
    return packed(
        {
            "sign": np.sign(axes).astype(float),
            "tip": np.array([*ends, np.array(robot.points["foot"][1], dtype=float)])[:, [0, 2]],
            "com": np.array([i.lever for i in inertias])[:, [0, 2]],
            "mass": np.array([i.mass for i in inertias]),
            "inertia": np.array([i.inertia[1, 1] for i in inertias]),
            "armature": robot.rotors,
            "body": float(model.inertias[BASE].mass),
            "gravity": np.array(model.gravity.linear)[[0, 2]],
            **drive.numbers,
            **robot.springs.numbers(n),
            **transmission.numbers(robot.leg, robot.parameters),
            **{"stop_upper": stops.upper, "stop_lower": stops.lower, "stiffness": stops.stiffness, "loss": stops.loss},
            **_watched(robot, watched),
            **{"mu": mu, "finer": finer},
        }
    )


def watched_points(robot: Robot, names: Collection[str]) -> list[str]:
    """Points that are watched, those of the body first, then in the order of the joints that move them."""
    return sorted((name for name in robot.points if name in names), key=lambda name: robot.points[name][0])


def _watched(robot: Robot, names: Collection[str]) -> dict[str, Any]:
    """The record's entries of points that are watched, with room for as many as a leg of so many joints may have."""
    n, points = len(robot.joints), [robot.points[name] for name in watched_points(robot, names)]
    room = n + 1 + SIDES * (n - 1)
    joints, places = np.full(room, BODY), np.zeros((room, 2))
    for i, (index, place) in enumerate(points):
        joints[i], places[i] = index - BASE - 1, np.array(place, dtype=float)[[0, 2]]
    return {"watching": len(points), "watched_joint": joints, "watched_at": places}


@kernel
def chain(leg: Any, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places of joints and foot (n + 1, 2) [m]; centres of mass (n, 2) [m]; accelerations that the turning alone
    gives them, joints and foot first, then the centres, (2 n + 1, 2) [m/s^2]."""
    n = len(q) - 2
    joints, centres, drift = np.zeros((n + 1, 2)), np.zeros((n, 2)), np.zeros((2 * n + 1, 2))
    joints[0, 0], joints[0, 1] = q[0], q[1]
    angle = speed = 0.0
    for i in range(n):
        angle += leg.sign[i] * q[2 + i]
        speed += leg.sign[i] * v[2 + i]
        c, s, w2 = np.cos(angle), np.sin(angle), speed * speed
        x, z = c * leg.com[i, 0] + s * leg.com[i, 1], -s * leg.com[i, 0] + c * leg.com[i, 1]
        centres[i, 0], centres[i, 1] = joints[i, 0] + x, joints[i, 1] + z
        drift[n + 1 + i, 0], drift[n + 1 + i, 1] = drift[i, 0] - w2 * x, drift[i, 1] - w2 * z
        x, z = c * leg.tip[i, 0] + s * leg.tip[i, 1], -s * leg.tip[i, 0] + c * leg.tip[i, 1]
        joints[i + 1, 0], joints[i + 1, 1] = joints[i, 0] + x, joints[i, 1] + z
        drift[i + 1, 0], drift[i + 1, 1] = drift[i, 0] - w2 * x, drift[i, 1] - w2 * z
    return joints, centres, drift


@kernel
def lowest_watched(leg: Any, q: np.ndarray, joints: np.ndarray) -> tuple[float, int]:
    """Height [m] of the lowest point that is watched, and its number; infinite and -1 if none is. joints: as ``chain`` has them."""
    found, which, angle, turned = np.inf, -1, 0.0, 0
    for i in range(leg.watching):
        joint, x, z = leg.watched_joint[i], leg.watched_at[i, 0], leg.watched_at[i, 1]
        height = joints[max(joint, 0), 1]
        while turned <= joint:
            angle += leg.sign[turned] * q[2 + turned]
            turned += 1
        if x != 0.0 or z != 0.0:
            height += -np.sin(angle) * x + np.cos(angle) * z
        if height < found:
            found, which = height, i
    return found, which


@kernel
def lowest(legs: Any, q: np.ndarray) -> tuple[float, int]:
    """``lowest_watched`` of a leg as ``argument``."""
    return lowest_watched(legs[0], q, chain(legs[0], q, np.zeros(len(q)))[0])


@kernel
def foot_jacobian(leg: Any, joints: np.ndarray) -> np.ndarray:
    """Velocity of the foot by the coordinates' speeds, (2, n + 2)."""
    n = len(joints) - 1
    J = np.zeros((2, n + 2))
    J[0, 0] = J[1, 1] = 1.0
    for j in range(n):
        J[0, 2 + j] = leg.sign[j] * (joints[n, 1] - joints[j, 1])
        J[1, 2 + j] = -leg.sign[j] * (joints[n, 0] - joints[j, 0])
    return J


@kernel
def mass_matrix(leg: Any, q: np.ndarray, joints: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """(n + 2 square) [kg, kg m, kg m^2]."""
    n = len(centres)
    M = np.zeros((n + 2, n + 2))
    M[0, 0] = M[1, 1] = leg.body
    for i in range(n):
        m = leg.mass[i]
        M[0, 0] += m
        M[1, 1] += m
        for j in range(i + 1):
            xj, zj = leg.sign[j] * (centres[i, 1] - joints[j, 1]), -leg.sign[j] * (centres[i, 0] - joints[j, 0])
            M[0, 2 + j] += m * xj
            M[1, 2 + j] += m * zj
            for k in range(j + 1):
                xk, zk = leg.sign[k] * (centres[i, 1] - joints[k, 1]), -leg.sign[k] * (centres[i, 0] - joints[k, 0])
                M[2 + k, 2 + j] += m * (xj * xk + zj * zk) + leg.inertia[i] * leg.sign[j] * leg.sign[k]
    for j in range(n + 2):
        if j >= 2 and not leg.turned:
            M[j, j] += leg.armature[j - 2]
        for k in range(j):
            M[j, k] = M[k, j]
    if leg.turned:
        J = drive_jacobian(leg, q[2:])
        for i in range(n):
            for j in range(n):
                for k in range(n):
                    M[2 + i, 2 + j] += J[k, i] * leg.armature[k] * J[k, j]
    return M


@kernel
def bias(
    leg: Any, q: np.ndarray, v: np.ndarray, joints: np.ndarray, centres: np.ndarray, drift: np.ndarray
) -> np.ndarray:
    """Generalised forces (n + 2) of gravity, centrifugal and Coriolis forces, of springs, and of rotors that ratios speed up
    [N, N m]: M a + bias = forces."""
    n = len(centres)
    given = np.zeros(n)
    add_spring_torques(leg, q[2:], given)
    h = np.zeros(n + 2)
    for k in range(n):
        h[2 + k] = -given[k]
    h[0], h[1] = -leg.body * leg.gravity[0], -leg.body * leg.gravity[1]
    for i in range(n):
        fx = leg.mass[i] * (drift[n + 1 + i, 0] - leg.gravity[0])
        fz = leg.mass[i] * (drift[n + 1 + i, 1] - leg.gravity[1])
        h[0] += fx
        h[1] += fz
        for j in range(i + 1):
            h[2 + j] += leg.sign[j] * ((centres[i, 1] - joints[j, 1]) * fx - (centres[i, 0] - joints[j, 0]) * fz)
    if leg.turned:
        J, late = drive_jacobian(leg, q[2:]), drive_drift(leg, q[2:], v[2:])
        for i in range(n):
            for k in range(n):
                h[2 + i] += J[k, i] * leg.armature[k] * late[k]
    return h


@kernel
def solved(M: np.ndarray, B: np.ndarray) -> np.ndarray:
    """X with M X = B for a positive definite M, which is overwritten by its Cholesky factor."""
    m, columns = B.shape
    for j in range(m):
        for k in range(j):
            M[j, j] -= M[j, k] * M[j, k]
        M[j, j] = np.sqrt(M[j, j])
        for i in range(j + 1, m):
            for k in range(j):
                M[i, j] -= M[i, k] * M[j, k]
            M[i, j] /= M[j, j]
    X = B.copy()
    for c in range(columns):
        for i in range(m):
            for k in range(i):
                X[i, c] -= M[i, k] * X[k, c]
            X[i, c] /= M[i, i]
        for i in range(m - 1, -1, -1):
            for k in range(i + 1, m):
                X[i, c] -= M[k, i] * X[k, c]
            X[i, c] /= M[i, i]
    return X
