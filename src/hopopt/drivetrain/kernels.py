"""What the plants ask of a leg's drives, compiled: torques after limits and losses, and how stiff gear friction is.

``drive`` is a record that has at least the names of ``Drive.numbers``.
"""

from typing import Any

import numpy as np

from hopopt.compiled.kernel import kernel
from hopopt.drivetrain import clamp, gear

STIFF = 1.0  # step times the rate at which friction stops a joint; the Runge-Kutta scheme's limit is 2.8
MOST_PARTS = 64  # of a step where gears rub

within, passed_torque = kernel(clamp.within), kernel(gear.passed_torque)


@kernel
def clamped(drive: Any, w: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Torques tau (n) [N m] within the operating regions at speeds w (n) [rad/s]."""
    out = np.zeros(len(tau))
    for k in range(len(tau)):
        out[k] = within(w[k], tau[k], drive.upper[k], drive.lower[k])
    return out


@kernel
def driven(drive: Any, w: np.ndarray, command: np.ndarray) -> np.ndarray:
    """Torques (n) [N m] of the motors after their limits; back-EMF grows with their gain."""
    motor = np.zeros(len(w))
    for k in range(len(w)):
        gain = drive.gain[k]
        motor[k] = gain * within(gain * w[k], command[k], drive.upper[k], drive.lower[k])
    return motor


@kernel
def passed(drive: Any, k: int, torque: float, w: float) -> tuple[float, float]:
    """``gear.passed_torque`` of joint k: what of a torque [N m] at the teeth the leg feels at speed w [rad/s]; its slope."""
    return passed_torque(
        torque, w, drive.efficiency[k], drive.friction[k], drive.damping[k], drive.slow[k], drive.sharp[k]
    )


@kernel
def rubbing_parts(drive: Any, motor: np.ndarray, armature: np.ndarray, h: float) -> int:
    """Into how many parts a step of h [s] must be cut so that gear friction is no stiffer than the step can take.

    motor (n) [N m]: the motors' torques; armature (n) [kg m^2]: the rotors' inertia at the joints.
    """
    parts = 1
    for k in range(len(motor)):
        rubbing = (1 - drive.efficiency[k]) * abs(motor[k]) + drive.friction[k]
        rate = rubbing / drive.slow[k] / max(armature[k], drive.lightest)
        parts = max(parts, min(MOST_PARTS, int(np.ceil(h * rate / STIFF))))
    return parts
