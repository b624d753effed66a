"""The drives of a leg as a plant has them: between a controller's command and the joints."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hopopt.compiled.kernel import packed
from hopopt.drivetrain import kernels
from hopopt.drivetrain.clamp import UNBOUNDED, filled_up, torque_lines
from hopopt.drivetrain.dynamics import AddedStates
from hopopt.drivetrain.gear import Gear
from hopopt.drivetrain.half_planes import OperatingRegion


class Drive:
    """The motors of a leg as a controller meets them: commands are clamped to the operating regions (paper's eq. 14).

    torque_gain is each motor's true torque constant over the believed one: so much more torque for the same current, and
    as much more back-EMF. states: what the drives add of their own, if they do. numbers: what the compiled functions read,
    by name: the lines of the clamp, the gains, and the gears as in ``Gear``.
    """

    numbers: Mapping[str, Any]

    def __init__(
        self,
        regions: Sequence[OperatingRegion],
        gear: Gear | None = None,
        torque_gain: np.ndarray | None = None,
        states: AddedStates | None = None,
    ):
        gear, n = gear or Gear(), len(regions)
        self.lossless = gear.ideal
        self.upper, self.lower = torque_lines(regions)
        self.numbers = {
            "upper": filled_up(self.upper, UNBOUNDED),
            "lower": filled_up(self.lower, -UNBOUNDED),
            "gain": np.ones(n) if torque_gain is None else np.asarray(torque_gain, dtype=float),
            "efficiency": np.broadcast_to(np.asarray(gear.efficiency, dtype=float), n),
            **{name: float(getattr(gear, name)) for name in ("friction", "damping", "slow", "lightest")},
        }
        self._record = packed(self.numbers)
        self.states = states if states and states.size else None

    def clamp(self, w: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Joint torques tau (n) [N m] brought into the regions at speeds w (n): OperatingRegion.clamp, but quick."""
        return kernels.clamped(self._record, np.asarray(w, dtype=float), np.asarray(tau, dtype=float))

    def parts(
        self, w: np.ndarray, command: np.ndarray, armature: np.ndarray, h: float, x: np.ndarray | None = None
    ) -> int:
        """Into how many parts a step of h [s] must be cut so that gear friction is no stiffer than the step can take.

        w (n) [rad/s], command (n) [N m], armature (n): the rotors' inertia at the joints [kg m^2]; x as in ``torque``.
        """
        return kernels.rubbing_parts(self._record, self.torque(w, command, x)[0], np.asarray(armature), h)

    def torque(self, w: np.ndarray, command: np.ndarray, x: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Motor torque after the limits, and joint torque after the gear's losses, (n) each [N m]; x: the drives' states, if
        they have any."""
        motor, tau = self._driven(w, command)
        if self.states is None:
            return motor, tau
        motor[self.states.at] = self.states.torques(x, motor, w)
        return motor, kernels.geared(self._record, w, motor)

    def passed(self, w: np.ndarray, motor: np.ndarray) -> np.ndarray:
        """Torques (n) [N m] at the joints, of motors' torques ``motor`` (n) [N m] at joint speeds w (n) [rad/s]."""
        return kernels.geared(self._record, w, motor)

    def needed(self, w: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Torques (n) [N m] of the motors that come to torques tau (n) [N m] at the joints: the inverse of ``passed``."""
        turning = np.tanh(w / self.numbers["slow"])
        before = tau + self.numbers["friction"] * turning + self.numbers["damping"] * w
        return before / (1 - (1 - self.numbers["efficiency"]) * turning * np.sign(before))

    def rates(self, w: np.ndarray, command: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Derivatives of the drives' states x under a command, (m)."""
        return np.array(self.states.rates(x, self._driven(w, command)[0], w) if self.states else ())

    def _driven(self, w: np.ndarray, command: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What motors and joints have of a command at once."""
        return kernels.driven(self._record, np.asarray(w, dtype=float), np.asarray(command, dtype=float))
