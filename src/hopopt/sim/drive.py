"""What lies between a controller and the leg: the drive's torque limits, the gear's losses, the encoder."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hopopt.leg.actuator import OperatingRegion
from hopopt.sim.compiled import kernel

SLOW = 0.05  # joint speed [rad/s] over which friction changes its sign smoothly
STIFF = 1.0  # step times the rate at which friction stops a joint; the Runge-Kutta scheme's limit is 2.8
LIGHTEST = 1e-3  # [kg m^2] least inertia that friction is taken to stop
UNBOUNDED = 1e12  # [N m] of a torque line that is not there
MOST_PARTS = 64  # of a step where gears rub


@dataclass(frozen=True)
class Gear:
    """Losses at the joint: efficiency (0 to 1, or one for each joint), Coulomb friction [N m], viscous [N m s/rad]."""

    efficiency: float | np.ndarray = 1.0
    friction: float = 0.0
    damping: float = 0.0

    @property
    def ideal(self) -> bool:
        """Whether nothing is lost."""
        return bool(np.all(self.efficiency == 1.0)) and self.friction == 0.0 and self.damping == 0.0

    def loss(self, w: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Torque [N m] taken from the motors' tau (n) at joint speeds w (n) [rad/s]; it always opposes the motion."""
        return ((1 - self.efficiency) * np.abs(tau) + self.friction) * np.tanh(w / SLOW) + self.damping * w


@dataclass(frozen=True)
class Stops:
    """End stops of the joints: springs with loss (Hunt and Crossley, 1975) beyond the limits lower, upper (n) [rad].

    stiffness [N m/rad]; loss [s/rad] is how much harder they push against an entering joint.
    """

    lower: np.ndarray
    upper: np.ndarray
    stiffness: float = 2e4
    loss: float = 0.3

    def near(self, q: np.ndarray, w: np.ndarray, h: float) -> bool:
        """Whether a joint is beyond a limit, or will be within h [s] at about this speed."""
        ahead = q + 1.5 * h * w
        return bool(np.any((np.maximum(q, ahead) > self.upper) | (np.minimum(q, ahead) < self.lower)))

    def torque(self, q: np.ndarray, w: np.ndarray) -> np.ndarray:
        """Torque (n) [N m] of the stops on the joints; they push back and never pull."""
        depth = np.maximum(q - self.upper, 0.0) + np.minimum(q - self.lower, 0.0)
        return -self.stiffness * depth * np.maximum(1 + self.loss * np.sign(depth) * w, 0.0)

    def energy(self, q: np.ndarray) -> np.ndarray:
        """Energy [J] kept in the springs at joint angles q (..., n)."""
        depth = np.maximum(q - self.upper, 0.0) + np.minimum(q - self.lower, 0.0)
        return 0.5 * self.stiffness * np.sum(depth**2, axis=-1)


class Drive:
    """The motors of a leg as a controller meets them: commands are clamped to the operating regions (eq. con_tdes).

    torque_gain is each motor's true torque constant over the believed one: so much more torque for the same current, and
    as much more back-EMF.
    """

    def __init__(
        self, regions: Sequence[OperatingRegion], gear: Gear | None = None, torque_gain: np.ndarray | None = None
    ):
        self.gear = gear or Gear()
        self.lossless = self.gear.ideal
        self.torque_gain = np.ones(len(regions)) if torque_gain is None else np.asarray(torque_gain, dtype=float)
        bounding = [[(float(h.a), float(h.b)) for h in region.planes if h.a != 0] for region in regions]
        self.upper = lines([[(1 / a, b / a) for a, b in planes if a > 0] for planes in bounding], UNBOUNDED)
        self.lower = lines([[(1 / a, b / a) for a, b in planes if a < 0] for planes in bounding], -UNBOUNDED)

    def clamp(self, w: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Joint torques tau (n) [N m] brought into the regions at speeds w (n): OperatingRegion.clamp, but quick."""
        return _clamped(np.asarray(w, dtype=float), np.asarray(tau, dtype=float), self.upper, self.lower)

    def parts(self, w: np.ndarray, command: np.ndarray, armature: np.ndarray, h: float) -> int:
        """Into how many parts a step of h [s] must be cut so that gear friction is no stiffer than the step can take.

        w (n) [rad/s], command (n) [N m], armature (n): the rotors' inertia at the joints [kg m^2].
        """
        rubbing = (1 - self.gear.efficiency) * np.abs(self.torque(w, command)[0]) + self.gear.friction
        return min(
            MOST_PARTS, max(1, int(np.ceil(np.max(h * rubbing / SLOW / np.maximum(armature, LIGHTEST)) / STIFF)))
        )

    def torque(self, w: np.ndarray, command: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Motor torque after the limits, and joint torque after the gear's losses, (n) each [N m]."""
        motor = self.torque_gain * self.clamp(self.torque_gain * w, command)  # its back-EMF grows with it
        return motor, motor if self.lossless else motor - self.gear.loss(w, motor)


def lines(of_joints: list[list[tuple[float, float]]], none: float) -> np.ndarray:
    """Lines (c, d) of every joint, as many for each, (n, k, 2)."""
    most = max(len(each) for each in of_joints)
    full = [[*each, *[(none, 0.0)] * (most - len(each))] for each in of_joints]
    return np.array(full, dtype=float).reshape(len(of_joints), most, 2)


@kernel
def _clamped(w: np.ndarray, tau: np.ndarray, upper: np.ndarray, lower: np.ndarray) -> np.ndarray:
    """tau (n) within torques c - d w of the lines (c, d) above and below, (n, k, 2); 0 where there are none."""
    out = np.zeros(len(tau))
    for i in range(len(tau)):
        high, low = np.inf, -np.inf
        for k in range(upper.shape[1]):
            high = min(high, upper[i, k, 0] - upper[i, k, 1] * w[i])
        for k in range(lower.shape[1]):
            low = max(low, lower[i, k, 0] - lower[i, k, 1] * w[i])
        if low <= high:
            out[i] = min(max(tau[i], low), high)
    return out


@dataclass
class Encoder:
    """Absolute encoders at the joints: angles in steps of 2 pi / 2^bits, speed from their differences.

    The speed is the slope over the last ``window`` control periods; bits = 0 means perfect sensors. speed_error [rad/s]
    is added to every measured speed.
    """

    bits: int
    window: int
    period: float
    speed_error: float = 0.0

    def __post_init__(self) -> None:
        self.readings: list[np.ndarray] = []

    @property
    def step(self) -> float:
        """Resolution [rad]."""
        return 2 * np.pi / 2**self.bits

    def read(self, q_j: np.ndarray, v_j: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Measured angles [rad] and speeds [rad/s], (n) each, at this control instant."""
        if not self.bits:
            return q_j, v_j + self.speed_error
        self.readings.append(self.step * np.round(q_j / self.step))
        del self.readings[: -self.window - 1]
        spans = len(self.readings) - 1
        if not spans:
            return self.readings[-1], np.full_like(q_j, self.speed_error)
        return self.readings[-1], (self.readings[-1] - self.readings[0]) / (spans * self.period) + self.speed_error
