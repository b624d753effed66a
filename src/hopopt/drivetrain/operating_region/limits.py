"""What bounds an operating region: its lines, and the entries of the problem file that draw each."""

from enum import StrEnum
from typing import Literal

Entry = tuple[Literal["motor", "gear"], str]


class Line(StrEnum):
    """What bounds an operating region; each is there forward and backward."""

    TORQUE_SPEED = "torque-speed line"
    BRAKING = "braking line"
    DRIVE_CAP = "drive torque cap"
    CURRENT_CAP = "motor current cap"
    GEAR_CAP = "gear torque cap"
    SPEED_CAP = "gear speed cap"


SAGGING = (Line.TORQUE_SPEED, Line.BRAKING)  # lines that go with the voltage of the bus
FORWARD, BACKWARD = "forward", "backward"
CAPS: dict[str, tuple[Entry, ...]] = {  # lines that a cap draws -> its entry, then what carries it to the joint
    Line.DRIVE_CAP: (("motor", "torque_cap"), ("gear", "ratio")),
    Line.CURRENT_CAP: (("motor", "current_cap"), ("motor", "torque_constant"), ("gear", "ratio")),
    Line.GEAR_CAP: (("gear", "torque_cap"),),
    Line.SPEED_CAP: (("gear", "speed_cap"), ("gear", "ratio")),
}
TORQUES: tuple[Entry, ...] = (  # entries of a drive that limit its torque at a speed
    ("motor", "max_torque"), ("motor", "torque_cap"), ("motor", "current_cap"), ("motor", "power_cap"), ("gear", "torque_cap"),
)  # fmt: skip
SPEEDS: tuple[Entry, ...] = (("motor", "max_speed"), ("gear", "speed_cap"))  # that limit its speed
