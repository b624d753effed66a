"""What passes the teeth of a gear (drivetrain/gear.py): of numbers, arrays or CasADi symbols, and compiled as it is."""

from typing import Any

import numpy as np

from hopopt.compiled.kernel import kernel
from hopopt.design import LEAST_EFFICIENCY

MOST_STEPS, EXACT = 100, 1e-13  # of Newton's method; relative
ROUND = (
    0.1  # share of the speed over which losses change their sign, over which a table of efficiencies has its corners
)
MOST_HALVINGS, ROUNDED = (
    60,
    1e-15,
)  # of a step of it; of the greatest torque through a gear whose efficiency depends on it


def teeth_torque(tau: Any, w: Any, eta: Any, friction: Any, damping: Any, slow: Any, sharp: Any) -> Any:
    """tau_g [N m] that gives the leg tau [N m] at joint speed w [rad/s]; the others as in ``Gear``."""
    turning = w / (w**4 + slow**4) ** 0.25
    up = eta**-turning
    c1, c2 = (up + 1 / up) / 2, (up - 1 / up) / 2
    return c1 * tau + c2 * (tau * tau + sharp * sharp) ** 0.5 + friction * turning + damping * w


def passed_torque(tau: Any, w: Any, eta: Any, friction: Any, damping: Any, slow: Any, sharp: Any) -> tuple[Any, Any]:
    """tau_out [N m] for a torque tau_g = tau [N m] at the teeth, the inverse of ``teeth_torque``, and its slope."""
    turning = w / (w**4 + slow**4) ** 0.25
    up = eta**-turning
    c1, c2 = (up + 1 / up) / 2, (up - 1 / up) / 2
    y = tau - friction * turning - damping * w
    size = (y * y + sharp * sharp) ** 0.5
    return c1 * y - c2 * size, c1 - c2 * y / size


def efficiency_at(w: Any, eta: Any, knots: Any, bends: Any, slow: Any) -> Any:
    """Efficiency at joint speed w [rad/s]: eta at rest, with a change of slope by bends [s/rad] at every speed of knots [rad/s].

    The broken line averaged over a speed of ROUND slow [rad/s], so that it stays monotone and within the values of its table;
    at a corner it is off by at most ROUND slow / 2 of the change of slope.
    """
    width = ROUND * slow
    size = (w * w + width * width) ** 0.5
    for knot, bend in zip(knots, bends):  # noqa: B905 - compiled too, where zip knows no strict
        ahead = size - knot
        eta = eta + bend * (ahead + (ahead * ahead + width * width) ** 0.5) / 2
    return eta


def factor_at(tau: Any, pieces: Any, sharp: Any) -> tuple[Any, Any]:
    """What a torque tau [N m] at the joint makes of the efficiency, 1 without any, and its slope [1/(N m)].

    pieces: of the curve, each the torque at which it begins, how far it goes [N m], and what it adds by its powers 1 to 3
    """
    size = (tau * tau + sharp * sharp) ** 0.5
    factor, slope = 1.0, 0.0
    for piece in pieces:
        ahead, span = size - piece[0], piece[1]
        x = (abs(ahead) - abs(ahead - span) + span) / 2
        factor = factor + x * (piece[2] + x * (piece[3] + x * piece[4]))
        inside = (ahead > 0) * (ahead < span)
        slope = slope + inside * (piece[2] + x * (2 * piece[3] + 3 * x * piece[4])) * tau / size
    return factor, slope


factor_of = kernel(factor_at)


@kernel
def passed_by_torque(
    tau: float, w: float, eta: float, friction: float, damping: float, slow: float, sharp: float,
    pieces: np.ndarray,
) -> tuple[float, float]:  # fmt: skip
    """``passed_torque`` where the efficiency is eta times ``factor_at`` tau_out: Newton's method between bounds, halved where it
    would leave them."""
    turning = w / (w**4 + slow**4) ** 0.25
    y = tau - friction * turning - damping * w
    most = (abs(y) + sharp) / LEAST_EFFICIENCY
    out, slope, low, high = y, 1.0, -most, most
    for _ in range(MOST_HALVINGS):
        factor, rise = factor_of(out, pieces, sharp)
        up = (eta * factor) ** -turning
        c1, c2 = (up + 1 / up) / 2, (up - 1 / up) / 2
        size, steeper = (out * out + sharp * sharp) ** 0.5, -turning * rise / factor
        missing = c1 * out + c2 * size - y
        slope = c1 + c2 * out / size + steeper * (c2 * out + c1 * size)
        if abs(missing) <= ROUNDED * most:
            break
        if missing > 0:
            high = out
        else:
            low = out
        out -= missing / slope
        if not low < out < high:
            out = (low + high) / 2
    return out, 1 / slope


@kernel
def each_passed(
    tau: np.ndarray, w: np.ndarray, eta: np.ndarray, friction: np.ndarray, damping: np.ndarray, slow: np.ndarray,
    sharp: np.ndarray, pieces: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """``passed_by_torque`` of every joint, (n) each; pieces (n, k, 5)."""
    out, slope = np.empty(len(tau)), np.empty(len(tau))
    for i in range(len(tau)):
        out[i], slope[i] = passed_by_torque(tau[i], w[i], eta[i], friction[i], damping[i], slow[i], sharp[i], pieces[i])
    return out, slope


@kernel
def each_missing(
    tau: np.ndarray, motor: np.ndarray, w: np.ndarray, a: np.ndarray, response: np.ndarray, rotor: np.ndarray,
    eta: np.ndarray, friction: np.ndarray, damping: np.ndarray, slow: np.ndarray, sharp: np.ndarray,
    pieces: np.ndarray, missing: np.ndarray, slope: np.ndarray,
) -> float:  # fmt: skip
    """Writes by how much torques tau (n) [N m] miss what gears pass on, and these gears' slopes, (n) each; the sum of the
    misses' squares."""
    n, squares = len(tau), 0.0
    at_teeth = np.empty(n)
    for i in range(n):
        turned = a[i]
        for j in range(n):
            turned += response[i, j] * tau[j]
        at_teeth[i] = motor[i] - rotor[i] * turned
    passed, slopes = each_passed(at_teeth, w, eta, friction, damping, slow, sharp, pieces)
    for i in range(n):
        missing[i], slope[i] = tau[i] - (motor[i] - at_teeth[i]) - passed[i], slopes[i]
        squares += missing[i] * missing[i]
    return squares


@kernel
def each_driven(
    motor: np.ndarray, w: np.ndarray, a: np.ndarray, response: np.ndarray, rotor: np.ndarray, eta: np.ndarray,
    friction: np.ndarray, damping: np.ndarray, slow: np.ndarray, sharp: np.ndarray, pieces: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """``driven_joints`` of gear.py, by Newton's method: compiled, as simulations ask for it at every step.

    Steps are halved until they miss by less: whole ones go to and fro where a gear turns from driving to braking.
    """
    n = len(motor)
    tau, missing, slope, slopes = motor.copy(), np.empty(n), np.empty(n), np.empty((n, n))
    law = (motor, w, a, response, rotor, eta, friction, damping, slow, sharp, pieces)
    squares = each_missing(tau, *law, missing, slope)
    for _ in range(MOST_STEPS):
        most, greatest = 0.0, 0.0
        for i in range(n):
            most, greatest = max(most, abs(missing[i])), max(greatest, abs(tau[i]))
            for j in range(n):
                slopes[i, j] = (i == j) - rotor[i] * (1 - slope[i]) * response[i, j]
        if most <= EXACT * (1.0 + greatest):
            break
        step, before, share, begun = np.linalg.solve(slopes, missing), squares, 1.0, tau.copy()
        for _ in range(MOST_HALVINGS):
            for i in range(n):
                tau[i] = begun[i] - share * step[i]
            squares = each_missing(tau, *law, missing, slope)
            if squares < before:
                break
            share /= 2
        if squares >= before:  # as near as numbers come
            return begun
    return tau
