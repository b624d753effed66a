"""The drives of a leg as its joints meet them at one pose, where drives do not turn as joints do."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from hopopt.drivetrain.transmission import Turning

if TYPE_CHECKING:
    from hopopt.drivetrain.drives import Drive


class TurnedDrive:
    """What ``Drive`` answers, asked in the joints' speeds and torques at joint angles q (n) [rad]."""

    def __init__(self, drive: "Drive", turning: Turning, q: np.ndarray):
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
        J, drift = self.jacobian, self.turning.drift(self.q, v)
        turned = accelerate and (lambda tau: J @ accelerate(J.T @ tau) + drift)
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
        return None if a is None else self.jacobian @ a + self.turning.drift(self.q, v)
