"""What the plants ask of a leg's drives, compiled: torques after limits and losses, and how stiff gear friction is.

``drive`` is a record that has at least the names of ``Drive.numbers``.
"""

from typing import Any

import numpy as np

from hopopt.compiled.kernel import kernel
from hopopt.drivetrain import clamp

STIFF = 1.0  # step times the rate at which friction stops a joint; the Runge-Kutta scheme's limit is 2.8
MOST_PARTS = 64  # of a step where gears rub

within = kernel(clamp.within)


@kernel
def clamped(drive: Any, w: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Torques tau (n) [N m] within the operating regions at speeds w (n) [rad/s]."""
    out = np.zeros(len(tau))
    for k in range(len(tau)):
        out[k] = within(w[k], tau[k], drive.upper[k], drive.lower[k])
    return out


@kernel
def geared(drive: Any, w: np.ndarray, motor: np.ndarray) -> np.ndarray:
    """Torques (n) [N m] of the joints after the gears, which oppose the motion."""
    tau = np.zeros(len(w))
    for k in range(len(w)):
        rubbing = (1 - drive.efficiency[k]) * abs(motor[k]) + drive.friction
        tau[k] = motor[k] - (rubbing * np.tanh(w[k] / drive.slow) + drive.damping * w[k])
    return tau


@kernel
def driven(drive: Any, w: np.ndarray, command: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Torques (n) [N m] of the motors after their limits, and of the joints after the gears."""
    motor = np.zeros(len(w))
    for k in range(len(w)):
        gain = drive.gain[k]
        motor[k] = gain * within(
            gain * w[k], command[k], drive.upper[k], drive.lower[k]
        )  # back-EMF grows with the gain
    return motor, geared(drive, w, motor)


@kernel
def rubbing_parts(drive: Any, motor: np.ndarray, armature: np.ndarray, h: float) -> int:
    """Into how many parts a step of h [s] must be cut so that gear friction is no stiffer than the step can take.

    motor (n) [N m]: the motors' torques; armature (n) [kg m^2]: the rotors' inertia at the joints.
    """
    parts = 1
    for k in range(len(motor)):
        rubbing = (1 - drive.efficiency[k]) * abs(motor[k]) + drive.friction
        rate = rubbing / drive.slow / max(armature[k], drive.lightest)
        parts = max(parts, min(MOST_PARTS, int(np.ceil(h * rate / STIFF))))
    return parts
