"""The problem file's model: every entry with its unit, its meaning and the magnitudes it may have.

A problem is data. These classes say what a file may contain and nothing about how it is solved; SI units
throughout. Values marked ``physical`` are the leg's design parameters and enter the planner as symbols.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from copy import copy as copy_of
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, ValidationError, create_model, model_serializer, model_validator

from hopopt.errors import UsageError
from hopopt.fields import (
    CATALOGUE,
    CATALOGUE_NAME,
    DOWN,
    FORWARD,
    RESERVED,
    Number,
    Section,
    Vector,
    choice,
    quantity,
)

LEAST_INERTIA = 1e-8  # [kg m^2] of a link: what a point mass is given


class Body(Section):
    mass: float = quantity("mass of the body with both motors", "kg", 1e-3, 1000, physical=True)


class Link(Section):
    length: float = quantity("from its joint to the next joint, or to the foot", "m", 0.01, 3, physical=True)
    mass: float = quantity("mass of the link", "kg", 1e-4, 200, physical=True)
    com: float | None = quantity(
        "centre of mass from its joint, along the link (default: half the length)", "m", 0.0, 3, None, physical=True
    )
    inertia: float | None = quantity(
        "moment of inertia about its centre of mass (default: slender rod, mass length^2 / 12)",
        "kg m^2", LEAST_INERTIA, 50, None, physical=True,
    )  # fmt: skip
    direction: Vector = choice("which way the link points from its joint, all joint angles zero (x, y, z)", DOWN)
    com_position: Vector | None = choice(
        "centre of mass from its joint, all joint angles zero (x, y, z), in place of com", None, unit="m"
    )
    inertia_tensor: tuple[Number, Number, Number, Number, Number, Number] | None = choice(
        "moments xx, yy, zz and products xy, xz, yz of inertia about the centre of mass, all joint angles zero, "
        "in place of inertia", None, unit="kg m^2",
    )  # fmt: skip


class Motor(Section):
    max_torque: float = quantity("tau_max: motor torque at standstill", "N m", 1e-6, 1000, physical=True)
    max_speed: float = quantity("omega_max: motor speed at no torque", "rad/s", 1.0, 6000, physical=True)
    rotor_inertia: float = quantity("rotor inertia, motor side", "kg m^2", 0.0, 0.05, 0.0, physical=True)
    laws: tuple[Literal["paper", "four-quadrant"], ...] = choice(
        "torque-speed laws, all of which hold: the paper's |tau| <= tau_max (1 - |w| / omega_max), "
        "or the four-quadrant line in which braking is not weakened by speed; [] leaves the caps on torque and speed",
        ("paper",),
    )
    torque_cap: float | None = quantity("drive's torque limit, motor side", "N m", 1e-6, 1000, None, physical=True)
    winding_resistance: float | None = quantity("electrical resistance", "ohm", 1e-4, 1e3, None, physical=True)
    torque_constant: float | None = quantity("k: motor torque for each ampere", "N m/A", 1e-4, 100, None, physical=True)
    catalogue: str | None = choice(CATALOGUE, None, pattern=CATALOGUE_NAME, allowed="the name of a catalogue entry")


class Gear(Section):
    ratio: float = quantity("R: motor turns for one turn of the joint", "1", 1.0, 1000, physical=True)
    torque_cap: float | None = quantity("repeated peak torque, joint side", "N m", 1e-4, 1e4, None, physical=True)
    speed_cap: float | None = quantity("input speed limit, motor side", "rad/s", 1.0, 6000, None, physical=True)
    inertia: float | None = quantity(
        "moment of inertia of what turns with the rotor, motor side (default: none)",
        "kg m^2", 0.0, 0.05, None, physical=True,
    )  # fmt: skip
    efficiency: float | None = quantity(
        "share of the motor's torque that it passes on, in simulation only: the planner's gears lose nothing "
        "(default: simulation.gear_efficiency)", "1", 0.05, 1, None,
    )  # fmt: skip
    catalogue: str | None = choice(CATALOGUE, None, pattern=CATALOGUE_NAME, allowed="the name of a catalogue entry")


def _overrides(section: type[Section]) -> type[Section]:
    """The same table with every entry optional: a joint's own values over the leg's."""
    fields: dict[str, Any] = {}
    for name, info in section.model_fields.items():
        copy = copy_of(info)
        copy.default = None
        fields[name] = (Annotated[info.annotation | None, copy], None)  # type: ignore[operator]
    return create_model(f"{section.__name__}Overrides", __base__=Section, **fields)


MotorOverrides, GearOverrides = _overrides(Motor), _overrides(Gear)


class Joint(Section):
    lower: float = quantity("smallest angle", "rad", -7, 7)
    upper: float = quantity("largest angle", "rad", -7, 7)
    axis: Vector = choice(
        "axis of the joint, all joint angles zero (x, y, z); default: positive swings forward", FORWARD
    )
    motor: MotorOverrides | None = choice("this joint's own motor values, over [leg.motor]", None)  # type: ignore[valid-type]
    gear: GearOverrides | None = choice("this joint's own gear values, over [leg.gear]", None)  # type: ignore[valid-type]


class Leg(Section):
    """A body on x and z guides, or on a vertical slider, and a serial chain of revolute joints and links.

    Angles, unless axes and directions say otherwise: the first link from straight down, each further link relative
    to the one before it; positive swings the link forward (+x). ``joint`` and ``link`` are the tables [leg.<name>]
    of the file.
    """

    joints: tuple[str, ...] = choice("joint names from the body to the foot", min_length=1, max_length=8)
    links: tuple[str, ...] = choice("link names from the body to the foot", min_length=1, max_length=8)
    guides: tuple[Literal["x", "z"], ...] = choice(
        "directions in which the body may move", ("x", "z"), allowed='["x", "z"], or ["z"] for a vertical slider,'
    )
    body: Body
    motor: Motor
    gear: Gear
    joint: dict[str, Joint]
    link: dict[str, Link]

    @model_validator(mode="before")
    @classmethod
    def _gather(cls, data: Any) -> Any:
        if not isinstance(data, dict) or "joint" in data or "link" in data:
            return data
        data = dict(data)
        for key, names in (("joint", data.get("joints")), ("link", data.get("links"))):
            names = names if isinstance(names, (list, tuple)) else ()
            data[key] = {n: data.pop(n, {}) for n in names if isinstance(n, str) and n not in RESERVED}
        return data

    @model_serializer(mode="wrap")
    def _spread(self, handler: Any) -> dict[str, Any]:
        data = handler(self)
        joint, link = data.pop("joint"), data.pop("link")
        return {**data, **joint, **link}

    def drive(self, joint: str, part: Literal["motor", "gear"], entry: str) -> tuple[str, Any]:
        """Path and value of a joint's motor or gear entry: its own if the file gives one, else the leg's."""
        own = getattr(self.joint[joint], part)
        value = getattr(own, entry) if own is not None else None
        if value is not None:
            return f"leg.{joint}.{part}.{entry}", value
        return f"leg.{part}.{entry}", getattr(getattr(self, part), entry)


class Contact(Section):
    friction: float | None = quantity("friction coefficient (none: the foot never slips)", "1", 0, 10, None)
    least_force: float = quantity("vertical ground force that stance keeps at least", "N", 0, 1e4, 0.0)


Angle = Annotated[float, Field(ge=-7, le=7, allow_inf_nan=False)]  # rad
Duration = Annotated[float, Field(ge=1e-3, le=10, allow_inf_nan=False)]  # s


class Start(Section):
    """At rest. Either the hip's height with the foot below it (two-joint legs), or all joint angles."""

    hip_height: float | None = quantity("height of the hip above the ground", "m", 0, 10, None)
    foot_x: float = quantity("foot in front of the hip's plumb line", "m", -3, 3, 0.0)
    joint_angles: tuple[Angle, ...] | None = choice("angle of every joint, in chain order", None, unit="rad")


class Obstacle(Section):
    """What the leg is to clear, for the objective obstacle."""

    width: float | None = quantity("width of the obstacle, along x", "m", 0, 20, None)


class Hop(Section):
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
        "periodic hop and landing: how long the impact lasts, which makes a mean torque of a gear's impulse",
        "s",
        1e-4,
        0.1,
        0.01,
    )
    stance_duration: tuple[Duration, Duration] = choice("shortest and longest stance", (0.03, 0.4), unit="s")
    flight_duration: tuple[Duration, Duration] = choice(
        "shortest and longest time from lift-off to the apex", (0.03, 1.0), unit="s"
    )
    landing_duration: tuple[Duration, Duration] = choice(
        "landing: shortest and longest time from touchdown to rest", (0.03, 1.0), unit="s"
    )
    clearance: float | None = quantity(
        "clearance that the hop must reach, for objectives that ask how (energy, time, saturation, ...)",
        "m", 0, 20, None,
    )  # fmt: skip
    obstacle: Obstacle = Obstacle()
    foot_window: float = quantity(
        "half width of the window about the hip's plumb line that the foot passes at the apex",
        "m", 1e-3, 3, 0.1,
    )  # fmt: skip
    above_ground: tuple[str, ...] = choice(
        "what stays above the ground: any joint (at the top of its link), 'foot'; default, and []: all of them", ()
    )
    least_height: float = quantity("height above the ground that joints keep at least", "m", 0, 1, 0.0)
    counter_movement: bool = choice("may the body descend in stance", True)

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


class Solver(Section):
    scheme: Literal["radau", "hermite-simpson", "trapezoidal"] = choice("transcription", "radau")
    degree: int = choice("collocation points an interval (radau only)", 3, ge=1, le=9)
    stance_intervals: int = choice("intervals of the first mesh, stance", 40, ge=1, le=2000)
    flight_intervals: int = choice("intervals of the first mesh, flight", 10, ge=1, le=2000)
    refine: bool = choice("refine the mesh until the tolerances are met", True)
    tolerance: float = quantity("local error allowed in every interval", "1", 1e-12, 1e-2, 1e-5)
    objective_tolerance: float = quantity(
        "relative change of the objective at which refinement has settled", "1", 1e-9, 1e-1, 1e-4
    )
    price_tolerance: float = quantity(
        "allowed tightening cost: what enforcing limits between the nodes may cost the objective, relatively",
        "1",
        1e-8,
        1e-2,
        5e-5,
    )
    max_refinements: int = choice("mesh refinements at most", 20, ge=0, le=40)
    max_iterations: int = choice("Ipopt iterations at most, each mesh", 600, ge=1, le=100000)
    tie_break: float = quantity(
        "weight of the integral of (tau / tau_max)^2 that decides between equal optima; its bias is reported",
        "m/s", 0, 1e-3, 1e-6,
    )  # fmt: skip
    starts: int = choice("different starting points", 6, ge=1, le=1000)
    seed: int = choice("seed of the starting points beyond the named ones", 0, ge=0, le=2**32 - 1)


class Simulation(Section):
    """The machine that a controller meets, beyond the leg and its motors."""

    control_rate: float = quantity("calls of the controller, the torque held in between", "Hz", 10, 1e6, 4000.0)
    encoder_bits: int = choice(
        "resolution of the joint encoders, one turn in 2^bits steps; 0: perfect", 14, ge=0, le=32
    )
    speed_window: int = choice("control periods over which encoder angles are differenced for speed", 8, ge=1, le=1000)
    speed_error: float = quantity("by which every joint's speed is measured too high", "rad/s", -10, 10, 0.0)
    torque_delay: float = quantity("from a measurement to the torque it leads to", "s", 0, 0.1, 0.0)
    gear_efficiency: float = quantity(
        "share of the motor's torque that a gear passes on, where leg.gear.efficiency does not say", "1", 0.05, 1, 1.0
    )
    gear_friction: float = quantity("Coulomb friction of a gear, at the joint", "N m", 0, 1e3, 0.0)
    gear_damping: float = quantity("viscous friction of a gear, at the joint", "N m s/rad", 0, 1e3, 0.0)


class Reserve(Section):
    """What a plan that is to be tracked holds back from the limits, so that feedback has room.

    What is left out is as large a share of the leg's weight and length as on the paper's leg.
    """

    torque: float = quantity("share of the motors' torque", "1", 0, 0.9, 0.02)
    speed: float = quantity("share of the motors' speed", "1", 0, 0.9, 0.0)
    ground_force: float | None = quantity("vertical ground force (default: scaled)", "N", 0, 1e4, None)
    height: float | None = quantity("height of the joints above the ground (default: scaled)", "m", 0, 0.5, None)
    angle: float = quantity("distance from the joint limits", "rad", 0, 1, 0.02)


class Control(Section):
    """Gains of the paper's strategies; what is left out is scaled from the paper's leg."""

    k_p: float | None = quantity("stiffness of the joints' PD law (default: scaled)", "N m/rad", 1e-6, 1e7, None)
    k_d: float | None = quantity("damping of the joints' PD law in stance (default: scaled)", "N m s/rad", 0, 1e6, None)
    k_s: float | None = quantity("stiffness of the reference's spring (default: scaled)", "N/m", 0, 1e7, None)
    y_neu: float | None = quantity("rest length of the reference's spring (default: scaled)", "m", 0, 10, None)
    C_amp: float | None = quantity(
        "amplitude of the reference beyond its rest length (default: scaled)", "m", 0, 10, None
    )
    C_max: float | None = quantity("largest shortening of the reference (default 0.11)", "1", 0, 0.99, None)
    plumb_k: float | None = quantity(
        "how stiffly the body is kept on the plumb line (default: scaled)", "1/s^2", 0, 1e6, None
    )
    plumb_d: float | None = quantity("damping of that (default: scaled)", "1/s", 0, 1e5, None)


class Uncertainty(Section):
    """How far a true leg may be from the one that is planned for: what ``hopopt robust`` draws, uniformly.

    The defaults of mass and torque constant are unverified; the others are taken as known until a spread is given.
    """

    mass: float = quantity("share of each mass, either way (default unverified)", "1", 0, 0.5, 0.05)
    torque_constant: float = quantity(
        "share of each motor's torque constant, either way (default unverified)", "1", 0, 0.5, 0.1
    )
    length: float = quantity("share of each link's length, either way", "1", 0, 0.2, 0.0)
    friction: float = quantity("share of contact.friction, either way", "1", 0, 0.9, 0.0)
    start_angle: float = quantity("of each joint at the start, either way", "rad", 0, 0.2, 0.0)
    speed_error: float = quantity("of every joint's measured speed, either way", "rad/s", 0, 10, 0.0)
    torque_delay: float = quantity("more delay than simulation.torque_delay, at most", "s", 0, 0.02, 0.0)
    gear_loss: float = quantity(
        "share of its torque that each gear loses beyond what is known, at most", "1", 0, 0.5, 0.0
    )

    @property
    def known(self) -> bool:
        """Whether nothing is uncertain."""
        return not any(getattr(self, name) for name in type(self).model_fields)


class Design(Section):
    """A whole problem: the leg, the ground, where the hop starts, what it may do and how it is solved."""

    name: str = choice(
        "short name, used for the results folder",
        pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$",
        allowed="text of 1 to 64 letters, digits, _ or -, the first a letter or digit,",
    )
    title: str = choice(
        "one line for tables and figures",
        "",
        pattern=r"^[^\x00-\x1f\x7f]{0,200}$",
        allowed="one line of text of at most 200 characters",
    )
    leg: Leg
    contact: Contact = Contact()
    start: Start
    hop: Hop = Hop()
    solver: Solver = Solver()
    simulation: Simulation = Simulation()
    reserve: Reserve = Reserve()
    control: Control = Control()
    uncertainty: Uncertainty = Uncertainty()

    def __hash__(self) -> int:
        """Of every entry, so that what is made of a problem can be kept for it."""
        return hash(repr(self))

    def of_kind(self, kind: str) -> "Design":
        """The same problem of another kind of hop (``hop.kind``)."""
        return self.model_copy(update={"hop": self.hop.model_copy(update={"kind": kind})})

    @model_validator(mode="after")
    def _all_above_ground(self) -> "Design":
        if not self.hop.above_ground:
            everything = self.hop.model_copy(update={"above_ground": (*self.leg.joints, "foot")})
            object.__setattr__(self, "hop", everything)  # frozen, but not yet anyone's
        return self


def as_changed(data: Mapping[str, Any], cause: str, remedy: str) -> Design:
    """The problem that changed data describe; UsageError that names the ``cause``, the first entry that no problem may have,
    and the ``remedy``."""
    try:
        return Design.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        named = (str(part) for part in first["loc"] if part not in ("joint", "link"))  # as problem files name it
        entry = ".".join(named)
        sentence = f"{cause} {entry} = {first['input']!r}, which no problem may have: {remedy}"
        raise UsageError(f"{data['name']}: {sentence}") from None


def refuse_landed(design: Design, what: str) -> None:
    """UsageError for ``what`` knows the hop from rest to the apex alone, if the problem asks for another."""
    if design.hop.lands:
        which = {"periodic": "the periodic hop", "landing": "the hop that lands"}[design.hop.kind]
        raise UsageError(f'{what} does not know {which} yet: set hop.kind = "single"')


def unit(vector: Sequence[float]) -> tuple[float, ...]:
    """A vector of length 1 in the same direction, exact where it has that length already."""
    length = math.sqrt(math.fsum(x * x for x in vector))
    return tuple(float(x) if length == 1 else x / length for x in vector)


def physical_parameters(leg: Leg) -> dict[str, float]:
    """Every design parameter of the leg that has a value: {"leg.thigh.length": 0.38 [m], ...} (SI)."""
    return dict(_physical("leg", leg))


def _physical(path: str, section: BaseModel) -> Iterator[tuple[str, float]]:
    for name, info in type(section).model_fields.items():
        value, extra = getattr(section, name), info.json_schema_extra
        if isinstance(value, BaseModel):
            yield from _physical(f"{path}.{name}", value)
        elif isinstance(value, dict):
            for key, item in value.items():
                yield from _physical(f"{path}.{key}", item)
        elif value is not None and isinstance(extra, dict) and extra.get("physical"):
            yield f"{path}.{name}", float(value)
