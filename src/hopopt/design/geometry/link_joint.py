"""How a link moves on the one above it: by a joint with a drive, or by one that follows such a joint."""

from dataclasses import astuple, dataclass
from typing import Any


@dataclass(frozen=True)
class Units:
    """How a joint's motion and what drives it are called, with their units."""

    place: str
    gives: str
    q: str
    v: str
    a: str
    tau: str
    inertia: str

    @property
    def labels(self) -> tuple[str, str, str]:
        """Of an axis of a figure: place, speed, torque."""
        return f"{self.place} [{self.q}]", f"speed [{self.v}]", f"{self.gives} [{self.tau}]"


TURNING = Units("angle", "torque", "rad", "rad/s", "rad/s^2", "N m", "kg m^2")
SLIDING = Units("travel", "force", "m", "m/s", "m/s^2", "N", "kg")
ALONG = {  # unit of what turns -> of what slides
    **dict(zip(astuple(TURNING), astuple(SLIDING), strict=True)),
    "N m/s": "N/s", "N m/rad": "N/m", "N m s/rad": "N s/m",
}  # fmt: skip
AT_THE_MOTOR = ("motor.", "gear.speed_cap", "gear.inertia", "gear.efficiency_table.speed")  # of a joint's table


def unit_along(entry: str, unit: str, linear: bool) -> str:
    """The unit of an entry of a prismatic joint's table, such as gear.friction, by that which it has where the joint turns;
    linear: whether its motor is."""
    if entry.startswith(AT_THE_MOTOR) and not linear:
        return unit
    return "rad/m" if entry == "gear.ratio" and not linear else ALONG.get(unit, unit)


def follower(link: str) -> str:
    """Name of the joint of a link that follows another joint."""
    return f"{link}_joint"


@dataclass(frozen=True)
class LinkJoint:
    """The joint that carries one link.

    name: of its point on the leg; axis: unit vector (3), all joint angles zero; slides: whether it moves along its axis [m], else
    about it [rad]; coordinate: number of the joint of ``leg.joints`` by which it moves: ratio times that one's angle, plus
    offset [rad, m]; follows: whether it has no drive of its own
    """

    name: str
    axis: tuple[float, ...]
    slides: bool
    coordinate: int
    ratio: float = 1.0
    offset: float = 0.0
    follows: bool = False

    def place(self, q: Any) -> Any:
        """Its own angle [rad] or travel [m] at that of its coordinate."""
        return self.ratio * q + self.offset if self.follows else q
