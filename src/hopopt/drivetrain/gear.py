"""What a gear takes from the torque of its motor."""

from dataclasses import dataclass

import numpy as np

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
