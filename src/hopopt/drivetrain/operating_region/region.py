"""The operating region of a joint's drive, from the entries of its motor and gear."""

from collections.abc import Mapping
from typing import Any

from hopopt.design import Leg
from hopopt.drivetrain.motor import electrical_time, motor_torque_and_speed
from hopopt.drivetrain.operating_region.half_planes import HalfPlane, OperatingRegion, pair
from hopopt.drivetrain.operating_region.laws import LAWS
from hopopt.drivetrain.operating_region.limits import Line


def operating_region(leg: Leg, joint: str, p: Mapping[str, Any]) -> OperatingRegion:
    """The AOR of one joint from the parameter values (or symbols) ``p``, paths as in the problem file."""

    def entry(part: Any, name: str) -> Any:
        return p.get(leg.drive(joint, part, name)[0])

    ratio, (tau_max, omega_max) = entry("gear", "ratio"), motor_torque_and_speed(leg, joint, p)
    torque, speed = 1 / (ratio * tau_max), ratio / omega_max  # 1/(stall torque), 1/(no-load speed) at the joint
    planes: list[HalfPlane] = []
    laws = leg.drive(joint, "motor", "laws")[1]
    for law in laws:
        planes += [plane for plane in LAWS[law](torque, speed) if plane.line not in {h.line for h in planes}]
    drive_cap, gear_cap, speed_cap = (
        entry("motor", "torque_cap"),
        entry("gear", "torque_cap"),
        entry("gear", "speed_cap"),
    )
    if drive_cap is not None:
        planes += pair(Line.DRIVE_CAP, 1 / (ratio * drive_cap), 0.0)
    if (current_cap := entry("motor", "current_cap")) is not None:
        planes += pair(Line.CURRENT_CAP, 1 / (ratio * entry("motor", "torque_constant") * current_cap), 0.0)
    if gear_cap is not None:
        planes += pair(Line.GEAR_CAP, 1 / gear_cap, 0.0)
    if speed_cap is not None:
        planes += pair(Line.SPEED_CAP, 0.0, ratio / speed_cap)
    return OperatingRegion(tuple(planes), entry("motor", "power_cap"), electrical_time(leg, joint, p))
