"""How a motor's torque falls with its speed: one function for each law, and the registry that problem files name.

R is the gear ratio, tau_max and omega_max belong to the motor, w is the joint speed [rad/s].
"""

from collections.abc import Callable
from typing import Any

from hopopt.drivetrain.operating_region.half_planes import HalfPlane, pair
from hopopt.drivetrain.operating_region.limits import Line
from hopopt.extensions import Registry


def paper_law(torque: Any, speed: Any) -> list[HalfPlane]:
    """The paper's eq. 13 without absolute values: +-tau/(R tau_max) +- R w/omega_max <= 1."""
    return [*pair(Line.TORQUE_SPEED, torque, speed), *pair(Line.BRAKING, torque, -speed)]


def four_quadrant_law(torque: Any, speed: Any) -> list[HalfPlane]:
    """+-(tau/(R tau_max) + R w/omega_max) <= 1: braking is not weakened by speed."""
    return pair(Line.TORQUE_SPEED, torque, speed)


Law = Callable[[Any, Any], list[HalfPlane]]  # of 1 / stall torque [1/(N m)] and 1 / no-load speed [s/rad]
LAWS: Registry[Law] = Registry("law", {"paper": paper_law, "four-quadrant": four_quadrant_law})
