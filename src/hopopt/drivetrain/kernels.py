"""What the plants ask of a leg's drives, compiled: torques after limits and losses, and how stiff gear friction is.

``drive`` is a record that has at least the names of ``Drive.numbers``.
"""

from typing import Any

import numpy as np

from hopopt.compiled.kernel import kernel
from hopopt.drivetrain import springs, supply
from hopopt.drivetrain.operating_region import half_planes
from hopopt.drivetrain.supply import BURNS, STIFF_SUPPLY
from hopopt.drivetrain.teeth import law

HIGHEST, HALVINGS = 1.5, 48  # bus voltage over what it is without load, where motors feed back; of the search for it
STIFF = 1.0  # step times the rate at which friction stops a joint; the Runge-Kutta scheme's limit is 2.8
MOST_PARTS = 64  # of a step where gears rub

within, capped = kernel(half_planes.within), kernel(half_planes.capped)
passed_torque, share_at = kernel(law.passed_torque), kernel(supply.share_at)
efficiency_at, spring_torque = kernel(law.efficiency_at), kernel(springs.torque_at)
factor_of, passed_by_torque, each_driven = law.factor_of, law.passed_by_torque, law.each_driven


@kernel
def limited(drive: Any, w: np.ndarray, command: np.ndarray, voltage: float) -> np.ndarray:
    """Torques (n) [N m] of the motors within their regions at a bus voltage, over what it is without load."""
    motor = np.zeros(len(w))
    for k in range(len(w)):
        gain, upper, lower = drive.gain[k], drive.upper[k].copy(), drive.lower[k].copy()
        for i in range(len(upper)):
            if upper[i, 1] != 0:  # caps on torque have no slope, and stay
                upper[i, 0] *= voltage
            if lower[i, 1] != 0:
                lower[i, 0] *= voltage
        motor[k] = gain * within(gain * w[k], capped(w[k], command[k], drive.power[k]), upper, lower)
    return motor


@kernel
def fed(drive: Any, w: np.ndarray, motor: np.ndarray, voltage: float) -> bool:
    """Whether the bus keeps at least this voltage while the motors' torques (n) [N m] are drawn, within the supply's caps."""
    power = 0.0
    for k in range(len(w)):
        power += motor[k] * w[k] + drive.heat[k] * motor[k] ** 2
    if drive.supplied == BURNS:
        power = (power + (power * power + drive.even * drive.even) ** 0.5) / 2
    return power <= drive.most_power and share_at(drive.sag, power) >= voltage


@kernel
def driven(drive: Any, w: np.ndarray, command: np.ndarray) -> np.ndarray:
    """Torques (n) [N m] of the motors after their limits; back-EMF grows with their gain.

    On a supply that sags, what they get at the highest voltage that the bus has while they draw it (``supply.share_at``) and
    at which no cap of the supply is passed: a higher voltage gives more torque, which draws more and leaves less.
    """
    motor = np.zeros(len(w))
    if drive.supplied == STIFF_SUPPLY:
        for k in range(len(w)):
            gain = drive.gain[k]
            asked = capped(w[k], command[k], drive.power[k])
            motor[k] = gain * within(gain * w[k], asked, drive.upper[k], drive.lower[k])
        return motor
    high = 1.0 if drive.supplied == BURNS else HIGHEST
    if fed(drive, w, limited(drive, w, command, high), high):
        return limited(drive, w, command, high)
    low = 0.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        motor = limited(drive, w, command, middle)
        if fed(drive, w, motor, middle):
            low = middle
        else:
            high = middle
    return limited(drive, w, command, low)


@kernel
def driven_by(drives: Any, w: np.ndarray, command: np.ndarray) -> np.ndarray:
    """``driven``, for Python: a drive as ``argument``."""
    return driven(drives[0], w, command)


@kernel
def passed(drive: Any, k: int, torque: float, w: float) -> tuple[float, float]:
    """``Gear.passed`` of joint k: what of a torque [N m] at the teeth the leg feels at speed w [rad/s]; its slope."""
    eta = drive.efficiency[k]
    if drive.by_speed:
        eta = efficiency_at(w, eta, drive.knots[k], drive.bends[k], drive.slow[k])
    friction, damping, slow, sharp = drive.friction[k], drive.damping[k], drive.slow[k], drive.sharp[k]
    if drive.by_torque:
        return passed_by_torque(torque, w, eta, friction, damping, slow, sharp, drive.factor[k])
    return passed_torque(torque, w, eta, friction, damping, slow, sharp)


@kernel
def driven_through_gears(
    drive: Any, motor: np.ndarray, w: np.ndarray, a: np.ndarray, response: np.ndarray, rotor: np.ndarray
) -> np.ndarray:
    """``gear.driven_joints``: the torques (n) [N m] that gears pass on as the leg moves by them."""
    eta = drive.efficiency.copy()
    if drive.by_speed:
        for k in range(len(w)):
            eta[k] = efficiency_at(w[k], eta[k], drive.knots[k], drive.bends[k], drive.slow[k])
    return each_driven(
        motor, w, a, response, rotor, eta, drive.friction, drive.damping, drive.slow, drive.sharp, drive.factor
    )


@kernel
def own_ratio(drive: Any, k: int, q: float) -> tuple[float, float]:
    """Ratio of joint k's own law at an angle q [rad], and its slope [1/rad]: a cubic between the places of ``transmission.numbers``,
    straight on beyond them."""
    step = drive.turn_step[k]
    place = (q - drive.turn_from[k]) / step
    last = drive.turn_ratio.shape[1] - 1
    if place <= 0 or place >= last:
        end = 0 if place <= 0 else last
        slope = drive.turn_slope[k, end]
        return drive.turn_ratio[k, end] + slope * (place - end) * step, slope
    i = int(place)
    s = place - i
    r0, r1, d0, d1 = drive.turn_ratio[k, i], drive.turn_ratio[k, i + 1], drive.turn_slope[k, i] * step, drive.turn_slope[k, i + 1] * step  # fmt: skip
    curve, twist = 3 * (r1 - r0) - 2 * d0 - d1, 2 * (r0 - r1) + d0 + d1
    return r0 + s * (d0 + s * (curve + s * twist)), (d0 + s * (2 * curve + 3 * s * twist)) / step


@kernel
def drive_jacobian(drive: Any, q: np.ndarray) -> np.ndarray:
    """d theta / d q (n, n) of the drives behind their gears at joint angles q (n) [rad]."""
    found = drive.coupling.copy()
    for k in range(len(q)):
        found[k, k] += own_ratio(drive, k, q[k])[0]
    return found


@kernel
def drive_drift(drive: Any, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """How the drives speed up (n) [rad/s^2] at joint angles q and speeds v (n) [rad, rad/s] where no joint does."""
    found = np.zeros(len(q))
    for k in range(len(q)):
        found[k] = own_ratio(drive, k, q[k])[1] * v[k] * v[k]
    return found


@kernel
def drive_speeds(T: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Speeds (n) [rad/s] of the drives behind their gears by those of the joints v (n) [rad/s]; T: ``drive_jacobian``."""
    found = np.zeros(len(v))  # by loops: a product of matrices takes a second to compile
    for i in range(len(v)):
        for k in range(len(v)):
            found[i] += T[i, k] * v[k]
    return found


@kernel
def joint_torques(T: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """Torques (n) [N m] at the joints by those of the drives behind their gears (n) [N m]; T: ``drive_jacobian``."""
    found = np.zeros(len(torque))
    for i in range(len(torque)):
        for k in range(len(torque)):
            found[i] += T[k, i] * torque[k]
    return found


@kernel
def rubbing_parts(drive: Any, motor: np.ndarray, armature: np.ndarray, h: float) -> int:
    """Into how many parts a step of h [s] must be cut so that gear friction is no stiffer than the step can take.

    motor (n) [N m]: the motors' torques; armature (n) [kg m^2]: the rotors' inertia at the joints.
    """
    parts = 1
    for k in range(len(motor)):
        eta = drive.efficiency[k]
        if drive.by_torque:
            eta *= factor_of(motor[k], drive.factor[k], drive.sharp[k])[0]
        rubbing = (1 - eta) * abs(motor[k]) + drive.friction[k]
        rate = rubbing / drive.slow[k] / max(armature[k], drive.lightest)
        parts = max(parts, min(MOST_PARTS, int(np.ceil(h * rate / STIFF))))
    return parts


@kernel
def add_spring_torques(record: Any, q: np.ndarray, given: np.ndarray) -> None:
    """Add what springs give the joints (n) [N m] at their angles q (n) [rad]; ``record`` has the names of ``Springs.numbers``."""
    for i in range(record.springs):
        angle = 0.0
        for k in range(len(q)):
            angle += record.spring_coefficients[i, k] * q[k]
        torque = spring_torque(
            angle, record.spring_level[i], record.spring_slope[i], record.spring_knots[i], record.spring_bends[i],
            record.spring_width[i],
        )  # fmt: skip
        for k in range(len(q)):
            given[k] += record.spring_coefficients[i, k] * torque
