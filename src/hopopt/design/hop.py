"""What the leg is to do: the ground under it, where it starts, and the hop that is asked for."""

from math import cos, sin, sqrt
from typing import Annotated, Any, Literal

from pydantic import Field

from hopopt.design.fields import EntryName, Section, choice, named, quantity

# Of the paper's leg, for which problems without these entries are completed: times [s] and a length [m]
DURATIONS = {"stance_duration": (0.03, 0.4), "flight_duration": (0.03, 1.0), "landing_duration": (0.03, 1.0)}
TOUCHDOWN_TIME, FOOT_WINDOW = 0.01, 0.1
GRAVITY = 9.81  # [m/s^2], on earth


class Contact(Section):
    friction: float | None = quantity("friction coefficient (none: the foot never slips)", "1", 0, 10, None)
    least_force: float = quantity("vertical ground force that stance keeps at least", "N", 0, 1e4, 0.0)
    force_rate: float | None = quantity(
        "how fast the vertical ground force changes at most in stance, up or down (none: no limit)",
        "N/s",
        1e-2,
        1e9,
        None,
    )


Angle = Annotated[float, Field(ge=-7, le=7, allow_inf_nan=False)]  # rad
Duration = Annotated[float, Field(ge=1e-3, le=10, allow_inf_nan=False)]  # s


class StartPose(Section):
    """At rest. Either the hip's height with the foot below it (two-joint legs), or all joint angles."""

    hip_height: float | None = quantity("height of the hip above the ground", "m", 0, 10, None)
    foot_x: float = quantity("foot in front of the hip's plumb line", "m", -3, 3, 0.0)
    joint_angles: tuple[Angle, ...] | None = choice("angle of every joint, in chain order", None, unit="rad")


class Obstacle(Section):
    """What the leg is to clear, for the objective obstacle."""

    width: float | None = quantity("width of the obstacle, along x", "m", 0, 20, None)


class Environment(Section):
    """What surrounds the leg."""

    temperature: float = quantity("of the air, with which motors begin", "degC", -60, 100, 25.0)
    gravity: float = quantity("acceleration of free fall", "m/s^2", 0.1, 100, GRAVITY)
    slope: float = quantity("by how much the ground rises along +x", "rad", -1.2, 1.2, 0.0)

    @property
    def fall(self) -> tuple[float, float, float]:
        """Acceleration of free fall [m/s^2] along the ground (x), across (y) and away from it (z)."""
        return (0.0 - self.gravity * sin(self.slope), 0.0, -self.gravity * cos(self.slope))


class HopSettings(Section):
    kind: Literal["single", "landing", "periodic"] = choice(
        "one hop from rest to the apex, the same hop landed and brought to rest, or a hop that ends as it began and goes "
        "on for ever", "single",
    )  # fmt: skip
    speed: float = quantity("mean forward speed of a periodic hop; 0: in place", "m/s", -20, 20, 0.0)
    touchdown_impulse: float | None = quantity(
        "periodic hop and landing: largest impulse of the ground on the foot at touchdown", "N s", 1e-3, 1e4, None
    )
    touchdown_loss: float | None = quantity(
        "periodic hop and landing: largest kinetic energy that the impact at touchdown takes", "J", 1e-3, 1e4, None
    )
    touchdown_speed: float | None = quantity(
        "periodic hop and landing: largest speed of the foot just before touchdown", "m/s", 1e-3, 100, None
    )
    touchdown_gear_torque: float | None = quantity(
        "periodic hop and landing: largest torque in a gear while its rotor is stopped or started by the impact",
        "N m",
        1e-2,
        1e5,
        None,
    )
    touchdown_time: float = quantity(
        "periodic hop and landing: how long the impact lasts, which makes a mean torque of a gear's impulse (default: scaled)",
        "s",
        1e-4,
        0.1,
        None,
    )
    stance_duration: tuple[Duration, Duration] = choice("shortest and longest stance (default: scaled)", None, unit="s")
    flight_duration: tuple[Duration, Duration] = choice(
        "shortest and longest time from lift-off to the apex (default: scaled)", None, unit="s"
    )
    landing_duration: tuple[Duration, Duration] = choice(
        "landing: shortest and longest time from touchdown to rest (default: scaled)", None, unit="s"
    )
    clearance: float | None = quantity(
        "clearance that the hop must reach, for objectives that ask how (energy, time, saturation, ...)",
        "m", 0, 20, None,
    )  # fmt: skip
    obstacle: Obstacle = Obstacle()
    foot_window: float = quantity(
        "half width of the window about the hip's plumb line that the foot passes at the apex (default: scaled)",
        "m", 1e-3, 3, None,
    )  # fmt: skip
    above_ground: tuple[str, ...] = choice(
        "what stays above the ground: any joint (at the top of its link), 'trunk', a link with a shape, 'foot'; default, and []: all there are",
        (),
    )
    least_height: float = quantity("height above the ground that joints keep at least", "m", 0, 1, 0.0)
    collision_margin: float | None = quantity(
        "least distance of the leg from the body and from itself, by their shapes (default: 0.005 of the leg's length)",
        "m", 0, 1, None,
    )  # fmt: skip
    may_collide: bool | None = choice(
        "whether a hop in which the leg meets the body, or itself, may be an answer, by their shapes (default: it may not)",
        None,
    )
    pause: float | None = quantity(
        "without current before the next hop: motors then are as hot as hopping on for ever makes them (default: the hop is "
        "one from cold)", "s", 0, 1e5, None,
    )  # fmt: skip
    counter_movement: bool = choice("may the body descend in stance", True)
    constraints: tuple[EntryName, ...] | None = named(
        "path constraints of your own that hold too, by their names (docs/extending.md)", None, "constraint"
    )

    def with_defaults(self, length: float, gravity: float) -> "HopSettings":
        """The same with all that is left out, of a leg so many times as long as the paper's where gravity [m/s^2] is this."""
        time = sqrt(length / (gravity / GRAVITY))
        found: dict[str, Any] = {name: tuple(time * end for end in ends) for name, ends in DURATIONS.items()}
        found |= {"touchdown_time": time * TOUCHDOWN_TIME, "foot_window": length * FOOT_WINDOW}
        return self.model_copy(update={name: value for name, value in found.items() if getattr(self, name) is None})

    @property
    def between(self) -> float | None:
        """Time without current between hops that go on for ever [s]; None for one hop alone."""
        return 0.0 if self.pause is None and self.periodic else self.pause

    @property
    def periodic(self) -> bool:
        """Whether the hop ends as it began."""
        return self.kind == "periodic"

    @property
    def lands(self) -> bool:
        """Whether the leg goes on after a touchdown."""
        return self.kind != "single"

    @property
    def descent_duration(self) -> tuple[float, float]:
        """Shortest and longest time from the apex to touchdown [s]: as for flight."""
        return self.flight_duration
