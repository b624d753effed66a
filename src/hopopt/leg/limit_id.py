"""Which limit: an identity that is made with the constraint and turned into words only where it is shown."""

from dataclasses import dataclass
from enum import Enum

from hopopt.design import Leg
from hopopt.drivetrain.dynamics import TORQUE_RATE
from hopopt.drivetrain.heat import LIMIT
from hopopt.drivetrain.motor import entries_behind
from hopopt.drivetrain.operating_region.limits import CAPS


class Kind(Enum):
    """What is limited; the value is what a limit of that kind is called."""

    REGION = "operating region"
    SUPPLY = "of the supply"
    MOTOR_POWER = "motor power cap"
    TORQUE_RATE = "torque rate"
    TEMPERATURE = "winding temperature"
    ANGLE = "angle"
    TRAVEL = "travel"
    HEIGHT = "height above ground"
    GROUND_FORCE = "ground force"
    FORCE_RATE = "ground force rate"
    FRICTION = "friction cone"
    DESCENT = "body never descends"
    CLEARANCE = "clearance"
    WINDOW = "foot window"
    LANDING_WINDOW = "landing foot window"
    POWER = "power drawn"
    SHARE = "share used by the"
    PEAK_TORQUE = "peak torque"
    PEAK_FORCE = "peak ground force"
    SLIDER = "body on its slider"
    FOOT = "foot at rest"
    IMPACT_PUSH = "ground pushes in the impact"
    IMPACT_FRICTION = "friction cone of the impact"
    IMPULSE = "impulse at touchdown"
    IMPACT_LOSS = "energy lost at touchdown"
    FOOT_SPEED = "foot speed at touchdown"
    GEAR_IMPACT = "gear torque at touchdown"
    OBSTACLE = "obstacle"
    COLLISION = "collision margin"
    USER = "user-defined"


@dataclass(frozen=True)
class LimitId:
    """A limit of a leg.

    kind: what is limited.
    joint: of which joint or point; of a user-defined limit, the function's name.
    key: the entry of the problem file that sets it, if one does.
    unit: of what is limited.
    """

    kind: Kind
    joint: str = ""
    key: str = ""
    unit: str = ""

    def keys(self, leg: Leg, part: object) -> tuple[str, ...]:
        """Entries of the problem file that set one component of it, such as a line of an operating region."""
        if self.kind is Kind.REGION:
            return entries_behind(leg, self.joint, CAPS.get(str(part), ()))
        if self.kind is Kind.HEIGHT and part == "foot":
            return ("hop.above_ground",)
        return (self.key,) if self.key else ()

    def __str__(self) -> str:
        if self.kind is Kind.USER:
            return self.joint
        if self.kind is Kind.SHARE:
            return f"{self.kind.value} {self.joint}"
        if self.kind is Kind.HEIGHT and self.joint:
            return f"{self.joint} above ground"
        return f"{self.joint} {self.kind.value}".lstrip()


def place_limit(leg: Leg, joint: str) -> LimitId:
    """The limits of a joint's angle, or of its travel where it slides."""
    return LimitId(Kind.TRAVEL if joint in leg.sliding else Kind.ANGLE, joint)


def motor_power(leg: Leg, joint: str) -> LimitId:
    """The cap on the mechanical power of a joint's motor."""
    return LimitId(Kind.MOTOR_POWER, joint, leg.drive(joint, "motor", "power_cap")[0])


def torque_rate(leg: Leg, joint: str) -> LimitId:
    """How fast the torque of a joint's motor changes."""
    path, given = leg.drive(joint, "motor", TORQUE_RATE)
    return LimitId(Kind.TORQUE_RATE, joint, "" if given is None else path, "N m/s")


def winding_temperature(leg: Leg, joint: str) -> LimitId:
    """How hot the winding of a joint's motor gets."""
    return LimitId(Kind.TEMPERATURE, joint, leg.drive(joint, "motor", LIMIT)[0], "K")


@dataclass(frozen=True)
class JointWay:
    """A joint and a direction, "forward" or "backward"."""

    joint: str
    way: str

    def __str__(self) -> str:
        return f"{self.joint} {self.way}"


def kind_of(limit: object) -> Kind | None:
    """The kind of a leg's limit; None for any other name of a constraint or variable."""
    return limit.kind if isinstance(limit, LimitId) else None
