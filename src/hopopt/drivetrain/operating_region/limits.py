"""What bounds an operating region: its lines, and the entries of the problem file that draw each."""

from enum import StrEnum
from typing import Literal

Entry = tuple[Literal["motor", "gear"], str]


class Line(StrEnum):
    """What bounds an operating region; each is there forward and backward."""

    TORQUE_SPEED = "torque-speed line"
    BRAKING = "braking line"
    DRIVE_CAP = "drive torque cap"
    GEAR_CAP = "gear torque cap"
    SPEED_CAP = "gear speed cap"


SAGGING = (Line.TORQUE_SPEED, Line.BRAKING)  # lines that go with the voltage of the bus
FORWARD, BACKWARD = "forward", "backward"
CAPS: dict[str, tuple[Entry, ...]] = {  # lines that a cap draws -> its entry, then what carries it to the joint
    Line.DRIVE_CAP: (("motor", "torque_cap"), ("gear", "ratio")),
    Line.GEAR_CAP: (("gear", "torque_cap"),),
    Line.SPEED_CAP: (("gear", "speed_cap"), ("gear", "ratio")),
}
TORQUES: tuple[Entry, ...] = (("motor", "max_torque"), ("motor", "torque_cap"), ("gear", "torque_cap"))
SPEEDS: tuple[Entry, ...] = (("motor", "max_speed"), ("gear", "speed_cap"))  # entries of a drive that limit either
LINES: tuple[Entry, ...] = (("motor", "max_torque"), ("motor", "max_speed"), ("gear", "ratio"))  # behind the others
