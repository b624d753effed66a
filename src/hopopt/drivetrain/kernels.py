"""What the plants ask of a leg's drives, compiled: torques after limits and losses, and how stiff gear friction is."""

import numpy as np

from hopopt.compiled.kernel import kernel
from hopopt.drivetrain import clamp

STIFF = 1.0  # step times the rate at which friction stops a joint; the Runge-Kutta scheme's limit is 2.8
MOST_PARTS = 64  # of a step where gears rub

within = kernel(clamp.within)


@kernel
def clamped(w: np.ndarray, tau: np.ndarray, upper: np.ndarray, lower: np.ndarray) -> np.ndarray:
    """Torques tau (n) [N m] within the lines (n, k, 2) at speeds w (n) [rad/s]."""
    out = np.zeros(len(tau))
    for k in range(len(tau)):
        out[k] = within(w[k], tau[k], upper[k], lower[k])
    return out


@kernel
def geared(
    w: np.ndarray, motor: np.ndarray, efficiency: np.ndarray, friction: float, damping: float, slow: float
) -> np.ndarray:
    """Torques (n) [N m] of the joints after the gears, which oppose the motion; arguments as in ``Gear``."""
    tau = np.zeros(len(w))
    for k in range(len(w)):
        lost = ((1 - efficiency[k]) * abs(motor[k]) + friction) * np.tanh(w[k] / slow) + damping * w[k]
        tau[k] = motor[k] - lost
    return tau


@kernel
def driven(
    w: np.ndarray, command: np.ndarray, gain: np.ndarray, upper: np.ndarray, lower: np.ndarray,
    efficiency: np.ndarray, friction: float, damping: float, slow: float,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Torques (n) [N m] of the motors after their limits, and of the joints after the gears; arguments as in ``Drive``."""
    motor = np.zeros(len(w))
    for k in range(len(w)):
        motor[k] = gain[k] * within(gain[k] * w[k], command[k], upper[k], lower[k])  # back-EMF grows with the gain
    return motor, geared(w, motor, efficiency, friction, damping, slow)


@kernel
def rubbing_parts(
    motor: np.ndarray, efficiency: np.ndarray, friction: float, armature: np.ndarray, h: float, slow: float,
    lightest: float,
) -> int:  # fmt: skip
    """Into how many parts a step of h [s] must be cut so that gear friction is no stiffer than the step can take.

    motor (n) [N m]: the motors' torques; armature (n) [kg m^2]: the rotors' inertia at the joints; slow, lightest: as in ``Gear``.
    """
    parts = 1
    for k in range(len(motor)):
        rate = ((1 - efficiency[k]) * abs(motor[k]) + friction) / slow / max(armature[k], lightest)
        parts = max(parts, min(MOST_PARTS, int(np.ceil(h * rate / STIFF))))
    return parts
