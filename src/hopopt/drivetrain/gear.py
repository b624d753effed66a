"""What a gear takes from the torque of its motor."""

from dataclasses import dataclass

import numpy as np

from hopopt.drivetrain import kernels

SLOW = 0.05  # joint speed [rad/s] over which friction changes its sign smoothly, on the paper's leg
LIGHTEST = 1e-3  # [kg m^2] least inertia that friction is taken to stop, on the paper's leg


@dataclass(frozen=True)
class Gear:
    """Losses at the joint: efficiency (0 to 1, or one for each joint), Coulomb friction [N m], viscous [N m s/rad].

    slow: joint speed [rad/s] over which friction changes its sign smoothly. lightest: least inertia [kg m^2] that friction is
    taken to stop.
    """

    efficiency: float | np.ndarray = 1.0
    friction: float = 0.0
    damping: float = 0.0
    slow: float = SLOW
    lightest: float = LIGHTEST

    @property
    def ideal(self) -> bool:
        """Whether nothing is lost."""
        return bool(np.all(self.efficiency == 1.0)) and self.friction == 0.0 and self.damping == 0.0

    def passed(self, w: np.ndarray, motor: np.ndarray) -> np.ndarray:
        """Torques (n) [N m] at the joints, of motors' torques ``motor`` (n) [N m] at joint speeds w (n) [rad/s]."""
        efficiency = np.broadcast_to(np.asarray(self.efficiency, dtype=float), len(w)).copy()
        return kernels.geared(w, motor, efficiency, float(self.friction), float(self.damping), self.slow)

    def needed(self, w: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Torques (n) [N m] of the motors that come to torques tau (n) [N m] at the joints: the inverse of ``passed``."""
        turning = np.tanh(w / self.slow)
        before = tau + self.friction * turning + self.damping * w
        return before / (1 - (1 - np.asarray(self.efficiency)) * turning * np.sign(before))
