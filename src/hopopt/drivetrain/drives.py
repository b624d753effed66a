"""The drives of a leg as a plant has them: between a controller's command and the joints."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self

import numpy as np

from hopopt.compiled.kernel import argument, packed
from hopopt.design import MOST_POINTS, Leg
from hopopt.drivetrain import kernels
from hopopt.drivetrain.dynamics import AddedStates
from hopopt.drivetrain.gear import ENTRIES, PIECE, Gear, driven_joints, joint_torque, motor_torque, response_to
from hopopt.drivetrain.operating_region.half_planes import UNBOUNDED, OperatingRegion, filled_up, torque_lines
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.drivetrain.supply import stiff, supply_numbers
from hopopt.drivetrain.transmission import Turning

LAW = (*ENTRIES, "slow", "sharp")
Accelerate = Callable[[np.ndarray], np.ndarray]


class Drive:
    """The motors of a leg as a controller meets them: commands are clamped to the operating regions (paper's eq. 14).

    torque_gain is each motor's true torque constant over the believed one: so much more torque for the same current, and
    as much more back-EMF; less heat for the same torque. states: what the drives add of their own, if they do. rotor: reflected inertias of what spins in
    front of the gears (n) [kg m^2]; none by default. turning: how the joints turn the drives, None where they turn together; speeds
    and torques are the drives' own, and ``at`` a pose the joints'. supply: what ``supply_numbers`` says of it. numbers: what the compiled functions read,
    by name: the lines of the clamp, the gains, the gears as in ``Gear``, and the caps on mechanical power [W].
    """

    numbers: Mapping[str, Any]

    def __init__(
        self,
        regions: Sequence[OperatingRegion],
        gear: Gear | None = None,
        torque_gain: np.ndarray | None = None,
        states: AddedStates | None = None,
        rotor: np.ndarray | None = None,
        supply: Mapping[str, Any] | None = None,
        turning: Turning | None = None,
    ):
        self.turning = turning
        gear, n, feeds = gear or Gear(), len(regions), supply or stiff(len(regions))
        self.lossless = gear.ideal
        self.upper, self.lower = torque_lines(regions)
        gain = np.ones(n) if torque_gain is None else np.asarray(torque_gain, dtype=float)
        self.numbers = {
            "upper": filled_up(self.upper, UNBOUNDED),
            "lower": filled_up(self.lower, -UNBOUNDED),
            "gain": gain,
            **{
                name: np.broadcast_to(np.asarray(value, dtype=float), n).copy()
                for name, value in zip(LAW, gear.entries, strict=True)
            },
            "lightest": float(gear.lightest),
            "by_speed": int(bool(gear.knots)),
            "knots": _of_joints(gear.knots, n),
            "bends": _of_joints(gear.bends, n),
            "by_torque": int(bool(gear.factor)),
            "factor": np.stack([_of_joints([piece[i] for piece in gear.factor], n) for i in range(PIECE)], axis=-1),
            "lossless": int(gear.ideal),
            "power": np.array([np.inf if r.power is None else float(r.power) for r in regions]),
            **feeds,
            "heat": feeds["heat"] / gain**2,
        }
        self.gear, self.rotor = gear, np.zeros(n) if rotor is None else np.asarray(rotor, dtype=float)
        self._record = packed(self.numbers)
        believed = {**self.numbers, "gain": np.ones(n), "heat": feeds["heat"]}
        self._true, self._believed = argument(self._record), argument(packed(believed))
        self.states = states if states and states.size else None

    @classmethod
    def of(cls, leg: Leg, p: Mapping[str, float], rotor: np.ndarray, gear: Gear, **more: Any) -> Self:
        """The drives of a leg by its numbers p: regions and supply as the problem has them; more: torque_gain, states."""
        regions = [operating_region(leg, joint, p) for joint in leg.joints]
        return cls(regions, gear, rotor=rotor, supply=supply_numbers(leg, p), **more)

    def at(self, q: np.ndarray) -> "Drive | TurnedDrive":
        """The drives as the joints meet them at joint angles q (n) [rad]."""
        return self if self.turning is None else TurnedDrive(self, self.turning, q)

    def clamp(self, w: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Joint torques tau (n) [N m] brought into the regions at speeds w (n), as far as the supply feeds them."""
        return kernels.driven_by(self._believed, np.asarray(w, dtype=float), np.asarray(tau, dtype=float))

    def parts(self, w: np.ndarray, command: np.ndarray, h: float, x: np.ndarray | None = None) -> int:
        """Into how many parts a step of h [s] must be cut so that gear friction is no stiffer than the step can take.

        w (n) [rad/s], command (n) [N m]; x as in ``torque``.
        """
        return kernels.rubbing_parts(self._record, self._limited(w, command, x), self.rotor, h)

    def torque(
        self, w: np.ndarray, command: np.ndarray, x: np.ndarray | None = None, accelerate: Accelerate | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Motor torque after the limits, and joint torque after the gear's losses, (n) each [N m].

        x: the drives' states, if they have any. accelerate: what joint torques (n) [N m] make of the joints (n) [rad/s^2],
        an affine function; without it the rotors count as at a steady speed.
        """
        motor = self._limited(w, command, x)
        if self.lossless:
            return motor, motor.copy()
        n = len(motor)
        still, response = response_to(accelerate, n) if accelerate else (np.zeros(n), np.zeros((n, n)))
        rotor = self.rotor if accelerate else np.zeros(n)
        return motor, driven_joints(self.gear, motor, np.asarray(w, dtype=float), still, response, rotor)

    def passed(self, w: np.ndarray, motor: np.ndarray, a: np.ndarray | None = None) -> np.ndarray:
        """Torques (n) [N m] at the joints, of motors' torques ``motor`` (n) [N m] at joint speeds w (n) [rad/s] and
        accelerations a (n) [rad/s^2], none by default."""
        return motor if self.lossless else joint_torque(self.gear, motor, w, *self._spun(a))

    def needed(self, w: np.ndarray, tau: np.ndarray, a: np.ndarray | None = None) -> np.ndarray:
        """Torques (n) [N m] of the motors that come to torques tau (n) [N m] at the joints: the inverse of ``passed``."""
        return tau if self.lossless else motor_torque(self.gear, tau, w, *self._spun(a))

    def _spun(self, a: np.ndarray | None) -> tuple[Any, Any]:
        return (0.0 if a is None else a), self.rotor

    def rates(self, w: np.ndarray, command: np.ndarray, x: np.ndarray, lag: float) -> np.ndarray:
        """Derivatives of the drives' states x under a command, (m); a torque of limited rate is late by ``lag`` [s]."""
        if self.states is None:
            return np.zeros(0)
        given = self._driven(w, command)
        at_once = self.clamp(w, command) if self.states.limited else given
        found = self.states.followed(x, at_once, w, lag)
        return np.array(
            self.states.rates(x, [found[k] if k in self.states.limited else given[k] for k in range(len(w))], w)
        )

    def _limited(self, w: np.ndarray, command: np.ndarray, x: np.ndarray | None) -> np.ndarray:
        if self.states is None:
            return self._driven(w, command)
        motor = self._driven(w, np.array(self.states.asked(x, command), dtype=float))
        motor[self.states.at] = self.states.torques(x, motor, w)
        return motor

    def _driven(self, w: np.ndarray, command: np.ndarray) -> np.ndarray:
        """What motors have of a command at once."""
        return kernels.driven_by(self._true, np.asarray(w, dtype=float), np.asarray(command, dtype=float))


class TurnedDrive:
    """What ``Drive`` answers, asked in the joints' speeds and torques at joint angles q (n) [rad]."""

    def __init__(self, drive: Drive, turning: Turning, q: np.ndarray):
        self.drive, self.turning, self.q = drive, turning, q
        self.jacobian = turning.jacobian(q)

    def clamp(self, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Joint torques (n) [N m] of drives within their limits at joint speeds v (n) [rad/s], for joint torques asked for."""
        return self.jacobian.T @ self.drive.clamp(self.jacobian @ v, self.asked(tau))

    def parts(self, v: np.ndarray, command: np.ndarray, h: float, x: np.ndarray | None = None) -> int:
        """As of ``Drive``, of a command (n) [N m] at the joints."""
        return self.drive.parts(self.jacobian @ v, self.asked(command), h, x)

    def torque(
        self,
        v: np.ndarray,
        command: np.ndarray,
        x: np.ndarray | None = None,
        accelerate: Callable[[np.ndarray], np.ndarray] | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Torques (n) [N m] of the drives after their limits, and of the joints after the gears' losses."""
        J, S, drift = self.jacobian, self.turning.spin(self.q), self.turning.drift(self.q, v)
        turned = accelerate and (lambda tau: S @ accelerate(J.T @ tau) + drift)
        motor, tau = self.drive.torque(J @ v, self.asked(command), x, turned)
        return motor, J.T @ tau

    def passed(self, v: np.ndarray, motor: np.ndarray, a: np.ndarray | None = None) -> np.ndarray:
        """As of ``Drive``, of torques (n) [N m] and accelerations a (n) [rad/s^2] at the joints."""
        return self.jacobian.T @ self.drive.passed(self.jacobian @ v, self.asked(motor), self._spun(v, a))

    def needed(self, v: np.ndarray, tau: np.ndarray, a: np.ndarray | None = None) -> np.ndarray:
        """The inverse of ``passed``."""
        return self.jacobian.T @ self.drive.needed(self.jacobian @ v, self.asked(tau), self._spun(v, a))

    def asked(self, tau: np.ndarray) -> np.ndarray:
        """Torques (n) [N m] of the drives behind their gears that come to tau (n) [N m] at the joints."""
        return np.linalg.solve(self.jacobian.T, tau)

    def _spun(self, v: np.ndarray, a: np.ndarray | None) -> np.ndarray | None:
        return None if a is None else self.turning.spin(self.q) @ a + self.turning.drift(self.q, v)


def _of_joints(values: Sequence[Any], n: int) -> np.ndarray:
    """Numbers or arrays (n,) as rows of joints (n, MOST_POINTS), zero where there is none: other shapes are compiled anew."""
    filled = np.zeros((n, MOST_POINTS))
    for i, value in enumerate(values):
        filled[:, i] = value
    return filled
