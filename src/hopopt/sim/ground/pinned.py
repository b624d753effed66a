"""How a leg answers to joint torques without drives, compiled: its joints' accelerations, and the force that holds its foot.

What controllers linearise along a plan, thousands of times before a hop; ``Machine`` says the same by Pinocchio.
"""

from typing import Any

import numpy as np

from hopopt.compiled.kernel import argument, kernel
from hopopt.drivetrain.drives import Drive
from hopopt.drivetrain.operating_region.half_planes import OperatingRegion
from hopopt.leg.robot import Robot
from hopopt.sim.ground.coulomb import FLIGHT, STICK, contact_force, response
from hopopt.sim.ground.planar import bias, chain, foot_jacobian, mass_matrix, planar_leg
from hopopt.sim.ground.stops import Stops


def free_leg(robot: Robot) -> Any:
    """A leg without drives, as ``argument``; UsageError as ``planar_leg``."""
    return argument(
        planar_leg(robot, Drive([OperatingRegion(())] * len(robot.joints)), Stops.of(robot.leg), set(), np.inf)
    )


@kernel
def answer(leg: Any, mode: int, z: np.ndarray) -> np.ndarray:
    """Accelerations (n) [rad/s^2] of the joints, then the force (x, z) [N] on the foot, from z = (q, v, tau) of the joints
    (3 n), the foot held still or in flight."""
    n = len(z) // 3
    q, v, tau = np.zeros(n + 2), np.zeros(n + 2), np.zeros(n + 2)
    for k in range(n):
        q[2 + k], v[2 + k], tau[2 + k] = z[k], z[n + k], z[2 * n + k]
    joints, centres, drift = chain(leg, q, v)
    forces, M = tau - bias(leg, q, v, joints, centres, drift), mass_matrix(leg, q, joints, centres)
    X, c, G, _ = response(M, forces, foot_jacobian(leg, joints), drift[n], v)
    found = np.zeros(n + 2)
    found[n], found[n + 1] = contact_force(mode, leg.mu, c, G)
    for k in range(n):
        found[k] = X[2 + k, 0] + found[n] * X[2 + k, 1] + found[n + 1] * X[2 + k, 2]
    return found


@kernel
def answers(legs: Any, z: np.ndarray, contact: bool) -> np.ndarray:
    """``answer`` at k states z (k, 3 n), (k, n + 2)."""
    found = np.zeros((len(z), z.shape[1] // 3 + 2))
    for k in range(len(z)):
        found[k] = answer(legs[0], STICK if contact else FLIGHT, z[k])
    return found


@kernel
def slopes(legs: Any, z: np.ndarray, contact: bool, steps: np.ndarray) -> np.ndarray:
    """How ``answer`` changes with each entry of k states z (k, 3 n), by central differences of steps (3 n), (k, n + 2, 3 n)."""
    mode = STICK if contact else FLIGHT
    found = np.zeros((len(z), z.shape[1] // 3 + 2, z.shape[1]))
    for k in range(len(z)):
        for j in range(z.shape[1]):
            more, less = z[k].copy(), z[k].copy()
            more[j] += steps[j]
            less[j] -= steps[j]
            found[k, :, j] = (answer(legs[0], mode, more) - answer(legs[0], mode, less)) / (2 * steps[j])
    return found
