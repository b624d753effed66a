"""Forces on a leg in a mode of contact, and how it moves by them, compiled: of motors, gears, end stops and the ground.

Gears take their share of what the rotors leave, so that what they pass on and how the leg moves are solved together.
"""

from typing import Any

import numpy as np

from hopopt.compiled.kernel import kernel
from hopopt.drivetrain import kernels as drives
from hopopt.sim.ground import stops
from hopopt.sim.ground.coulomb import BACKWARD, FORWARD, contact_force, of_foot, response
from hopopt.sim.ground.planar import bias, chain, foot_jacobian, mass_matrix, solved


@kernel
def given(leg: Any, T: np.ndarray, w: np.ndarray, command: np.ndarray) -> np.ndarray:
    """Torques (n) [N m] of the motors within their limits, behind their gears, for a command (n) [N m] at the joints; T: d theta / d q
    (n, n), looked at where drives do not turn as joints do; w (n) [rad/s]: their speeds."""
    return drives.driven(leg, w, np.linalg.solve(T.T.copy(), command) if leg.turned else command)


@kernel
def turned_by(
    leg: Any, mode: int, T: np.ndarray, late: np.ndarray, w: np.ndarray, motor: np.ndarray, others: np.ndarray,
    M: np.ndarray, J: np.ndarray, drift: np.ndarray, v: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Accelerations (n) [rad/s^2] of the drives in a mode, in which they are affine in the torques that gears pass on.

    others (n + 2): all forces but these; drift (2): as of ``response``; the rest as in ``loads``.
    """
    n = len(w)
    B = np.zeros((n + 2, n + 3))  # without torques, with a unit of each, and by unit forces at the foot
    for k in range(n + 2):
        B[k, 0], B[k, n + 1], B[k, n + 2] = others[k], J[0, k], J[1, k]
    for i in range(n):
        if leg.turned:
            for k in range(n):
                B[2 + k, 1 + i] = T[i, k]
        else:
            B[2 + i, 1 + i] = 1.0
    X = solved(M.copy(), B)
    X_foot, c, still, by_unit = np.zeros((n + 2, 2)), np.zeros(2), np.zeros(n), np.zeros((n, n))
    for k in range(n + 2):  # by loops: slices and sums of arrays take numba seconds
        X_foot[k, 0], X_foot[k, 1] = X[k, n + 1], X[k, n + 2]
    _, G = of_foot(J, v, X_foot)
    for i in range(n + 1):
        for j in range(2):
            c[j] = drift[j] if i == 0 else 0.0
            for k in range(n + 2):
                c[j] += J[j, k] * X[k, i]
        fx, fz = contact_force(mode, leg.mu, c, G)
        for k in range(n):
            moved = 0.0
            if leg.turned:
                moved = late[k] if i == 0 else 0.0
                for j in range(n):
                    moved += T[k, j] * (X[2 + j, i] + fx * X_foot[2 + j, 0] + fz * X_foot[2 + j, 1])
            else:
                moved = X[2 + k, i] + fx * X_foot[2 + k, 0] + fz * X_foot[2 + k, 1]
            if i == 0:
                still[k] = moved
            else:
                by_unit[k, i - 1] = moved
    tau = drives.driven_through_gears(leg, motor, w, still, by_unit, leg.armature)
    for k in range(n):
        for i in range(n):
            still[k] += by_unit[k, i] * tau[i]
    return still


@kernel
def loads(leg: Any, mode: int, q: np.ndarray, v: np.ndarray, command: np.ndarray) -> tuple[Any, ...]:
    """Accelerations without contact, and by unit forces along x and z at the foot, (n + 2, 3); c (2) [m/s^2] and
    G (2, 2) [1/kg] of the foot; its velocity (2) [m/s]; power of the motors, lost in the gears, into the stops [W];
    torques (n) [N m] of the motors, behind their gears, and of the joints.

    Gears take their share of what the rotors leave, which depends on how the leg moves in a mode.
    """
    joints, centres, drift = chain(leg, q, v)
    n = len(q) - 2
    J, w = foot_jacobian(leg, joints), v[2:]
    T, late = J, w
    if leg.turned:
        T, late = drives.drive_jacobian(leg, q[2:]), drives.drive_drift(leg, q[2:], v[2:])
        w = drives.drive_speeds(T, v[2:])
    motor = given(leg, T, w, command)
    stop = stops.torque(q[2:], v[2:], leg.stop_lower, leg.stop_upper, leg.stiffness, leg.loss)
    M, forces = mass_matrix(leg, q, joints, centres), -bias(leg, q, v, joints, centres, drift)
    for k in range(n):
        forces[2 + k] += stop[k]
    tau, ahead = motor.copy(), motor.copy()
    if not leg.lossless:
        a = turned_by(leg, mode, T, late, w, motor, forces, M, J, drift[n], v)
        for k in range(n):  # M and forces of gears that are linear about there
            rotor = leg.armature[k]
            out, slope = drives.passed(leg, k, motor[k] - rotor * a[k], w[k])
            ahead[k] = out + slope * rotor * a[k]
            tau[k] = out + rotor * a[k]
            if leg.turned:
                ahead[k] += (1 - slope) * rotor * late[k]
                for i in range(n):
                    for j in range(n):
                        M[2 + i, 2 + j] -= (1 - slope) * rotor * T[k, i] * T[k, j]
            else:
                M[2 + k, 2 + k] -= (1 - slope) * rotor
    at_joints = drives.joint_torques(T, ahead) if leg.turned else ahead
    for k in range(n):
        forces[2 + k] += at_joints[k]
    X, c, G, velocity = response(M, forces, J, drift[n], v)
    power = np.zeros(3)
    for k in range(n):
        power[0] += motor[k] * w[k]
        power[1] += (motor[k] - tau[k]) * w[k]
        power[2] -= stop[k] * v[2 + k]
    return X, c, G, velocity, power, motor, drives.joint_torques(T, tau) if leg.turned else tau


@kernel
def rates(leg: Any, mode: int, q: np.ndarray, v: np.ndarray, command: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Accelerations (n + 2), and powers (4) [W]: of motors, lost in gears, into stops, lost in friction at the foot."""
    X, c, G, velocity, power, _, _ = loads(leg, mode, q, v, command)
    fx, fz = contact_force(mode, leg.mu, c, G)
    a = X[:, 0] + fx * X[:, 1] + fz * X[:, 2]
    work = np.zeros(4)
    for k in range(3):  # a slice would take numba two seconds, for its words on shapes
        work[k] = power[k]
    if mode in (FORWARD, BACKWARD):
        work[3] = -fx * velocity[0]
    return a, work
