"""What the ground can do to a foot, compiled: Coulomb's law for a point on level ground, in each of its modes.

All modes come from one linear map, the foot's acceleration c + G f, where f is the contact force and G the inverse of the
foot's inertia. It sticks while |f_x| <= mu f_z, and slips against f_x = -mu f_z sign(x').
"""

from typing import Any

import numpy as np

from hopopt.compiled.kernel import kernel
from hopopt.sim.ground.planar import solved

STICK, FORWARD, BACKWARD, FLIGHT = 0, 1, -1, 2  # modes; the foot slips in the direction of the number


@kernel
def of_foot(J: np.ndarray, v: np.ndarray, X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Velocity (2) [m/s] of the foot, and G (2, 2) [1/kg] by the accelerations X (n + 2, 2) from unit forces at it."""
    velocity, G = np.zeros(2), np.zeros((2, 2))
    for a in range(2):
        for k in range(len(v)):
            velocity[a] += J[a, k] * v[k]
            G[a, 0] += J[a, k] * X[k, 0]
            G[a, 1] += J[a, k] * X[k, 1]
    return velocity, G


@kernel
def response(
    M: np.ndarray, forces: np.ndarray, J: np.ndarray, drift: np.ndarray, v: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Accelerations under forces (n + 2) without contact, and by unit forces along x and z at the foot, (n + 2, 3); c (2) [m/s^2]
    and G (2, 2) [1/kg] of the foot; its velocity (2) [m/s]. drift: the foot's, by the turning alone (2) [m/s^2]."""
    n = len(forces)
    B, c = np.zeros((n, 3)), np.zeros(2)
    for k in range(n):
        B[k, 0], B[k, 1], B[k, 2] = forces[k], J[0, k], J[1, k]
    X = solved(M, B)
    velocity, G = of_foot(J, v, X[:, 1:])
    for i in range(2):
        c[i] = drift[i]
        for k in range(n):
            c[i] += J[i, k] * X[k, 0]
    return X, c, G, velocity


@kernel
def slipping(mode: int, mu: float, c: np.ndarray, G: np.ndarray) -> tuple[float, float]:
    """Vertical force [N] on a foot that slips in a mode's direction, and how much a unit of it with its friction
    accelerates the foot upwards [1/kg]: where that is not above zero, no force keeps the foot on the ground."""
    ease = G[1, 1] - mode * mu * G[1, 0]
    return -c[1] / ease, ease


@kernel
def contact_force(mode: int, mu: float, c: np.ndarray, G: np.ndarray) -> tuple[float, float]:
    """Force (x, z) [N] on the foot in a mode."""
    if mode == FLIGHT:
        return 0.0, 0.0
    if mode == STICK:
        det = G[0, 0] * G[1, 1] - G[0, 1] * G[1, 0]
        return (G[0, 1] * c[1] - G[1, 1] * c[0]) / det, (G[1, 0] * c[0] - G[0, 0] * c[1]) / det
    fz, _ = slipping(mode, mu, c, G)
    return -mode * mu * fz, fz


@kernel
def grips(mu: float, fx: float, fz: float, G: np.ndarray) -> float:
    """Below zero where a foot cannot stick under the force that this takes [N]. On ideal ground (mu infinite) it stays
    until it would rise if it were let go: its sideways grip may press it down."""
    if mu == np.inf:
        return fz if fz >= 0 else fz + max(0.0, G[1, 0] / G[1, 1] * fx)
    return mu * fz - abs(fx)


@kernel
def held(leg: Any, mode: int, c: np.ndarray, G: np.ndarray) -> float:
    """``holds`` by what ``loads`` says of the foot."""
    if mode == FLIGHT:
        return 1.0
    fx, fz = contact_force(mode, leg.mu, c, G)
    if mode == STICK:
        return grips(leg.mu, fx, fz, G)
    return fz if slipping(mode, leg.mu, c, G)[1] > 0 else -1.0


@kernel
def slip_direction(first: int, mu: float, c: np.ndarray, G: np.ndarray) -> tuple[int, float]:
    """The mode in which friction opposes the slip it allows, ``first`` tried first, and the vertical force [N] or impulse
    [N s] in it; FLIGHT where there is none."""
    for mode in (first, -first):
        force, ease = slipping(mode, mu, c, G)
        if ease > 0 and force >= 0 and mode * (c[0] + (G[0, 1] - mode * mu * G[0, 0]) * force) >= 0:
            return mode, force
    return FLIGHT, 0.0
