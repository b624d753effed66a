"""The leg: its body, links, joints and drives. Values marked ``physical`` enter the planner as symbols."""

import math
from collections.abc import Iterator, Sequence
from copy import copy as copy_of
from typing import Annotated, Any, Literal

from pydantic import BaseModel, PrivateAttr, create_model, model_serializer, model_validator

from hopopt.design.drives.series_spring import SeriesSpring
from hopopt.design.drives.transmission import Transmission
from hopopt.design.fields import (
    CATALOGUE,
    CATALOGUE_NAME,
    DOWN,
    FORWARD,
    LEAST_EFFICIENCY,
    MOST_POINTS,
    RESERVED,
    EntryName,
    Section,
    Share,
    Speed,
    Torque,
    Vector,
    choice,
    named,
    points_fault,
    quantity,
)
from hopopt.design.geometry.link_joint import SLIDING, TURNING, LinkJoint, Units, follower
from hopopt.design.geometry.parts import MOST_SPRINGS, Body, Link, Spring
from hopopt.design.hop import GRAVITY

PAPERS_LENGTH = 0.38 + 0.361  # [m] of the paper's leg


class Motor(Section):
    max_torque: float | None = quantity(
        "tau_max: motor torque at standstill (default: torque_constant voltage / winding_resistance)",
        "N m", 1e-6, 1000, None, physical=True,
    )  # fmt: skip
    max_force: float | None = quantity(
        "of a linear motor at standstill, for a prismatic joint in place of max_torque",
        "N", 1e-3, 1e6, None, physical=True, listed=False,
    )  # fmt: skip
    max_velocity: float | None = quantity(
        "of a linear motor at no force, in place of max_speed", "m/s", 1e-3, 100, None, physical=True, listed=False
    )
    force_cap: float | None = quantity(
        "of a linear motor's drive, in place of torque_cap", "N", 1e-3, 1e6, None, physical=True, listed=False
    )
    rotor_mass: float | None = quantity(
        "of a linear motor: what resists besides the link's own mass, in place of rotor_inertia (default: none)",
        "kg", 0.0, 1e3, None, physical=True, listed=False,
    )  # fmt: skip
    max_speed: float | None = quantity(
        "omega_max: motor speed at no torque (default: voltage / torque_constant)",
        "rad/s", 1.0, 6000, None, physical=True,
    )  # fmt: skip
    rotor_inertia: float = quantity("rotor inertia, motor side", "kg m^2", 0.0, 0.05, 0.0, physical=True)
    laws: tuple[EntryName, ...] = named(
        "torque-speed laws, all of which hold: the paper's |tau| <= tau_max (1 - |w| / omega_max), "
        "or the four-quadrant line in which braking is not weakened by speed; [] leaves the caps on torque and speed",
        ("paper",), "law", "paper", "four-quadrant",
    )  # fmt: skip
    torque_cap: float | None = quantity("drive's torque limit, motor side", "N m", 1e-6, 1000, None, physical=True)
    voltage: float | None = quantity(
        "at which its torque and speed are meant (default: the supply's)", "V", 0.1, 1000, None, physical=True
    )
    winding_resistance: float | None = quantity("electrical resistance", "ohm", 1e-4, 1e3, None, physical=True)
    winding_inductance: float | None = quantity(
        "L: the voltage bears R i + k omega + L di/dt (default: current rises at once)", "H", 1e-8, 10, None, physical=True,
    )  # fmt: skip
    torque_constant: float | None = quantity("k: motor torque for each ampere", "N m/A", 1e-4, 100, None, physical=True)
    no_load_current: float | None = quantity(
        "i_0: current that turns the motor alone, whose torque k i_0 its own friction takes",
        "A",
        0,
        1e3,
        None,
        physical=True,
    )
    current_cap: float | None = quantity(
        "greatest current, |torque| <= k times it", "A", 1e-3, 1e4, None, physical=True
    )
    continuous_torque: float | None = quantity(
        "that it gives for ever, to compare with: limits nothing", "N m", 1e-6, 1000, None, physical=True
    )
    winding_to_housing: float | None = quantity("thermal resistance", "K/W", 1e-3, 1e3, None, physical=True)
    housing_to_ambient: float | None = quantity("thermal resistance", "K/W", 1e-3, 1e3, None, physical=True)
    winding_time_constant: float | None = quantity("thermal, of the winding", "s", 0.1, 1e4, None, physical=True)
    housing_time_constant: float | None = quantity("thermal, of the housing", "s", 0.1, 1e6, None, physical=True)
    winding_limit: float | None = quantity("highest temperature of the winding", "degC", -50, 400, None, physical=True)
    torque_rate: float | None = quantity(
        "how fast its torque changes at most, up or down", "N m/s", 1e-3, 1e7, None, physical=True
    )
    power_cap: float | None = quantity("greatest mechanical power, |torque speed|", "W", 1e-3, 1e6, None, physical=True)
    catalogue: str | None = choice(CATALOGUE, None, pattern=CATALOGUE_NAME, allowed="the name of a catalogue entry")


class EfficiencyTable(Section):
    """Efficiency of a gear by the speed of its motor and the torque at its joint, straight between points and level beyond them."""

    speed: tuple[Speed, ...] = choice("of the motor, rising", unit="rad/s", min_length=2, max_length=MOST_POINTS)
    efficiency: tuple[Share, ...] = choice(
        "at these speeds, falling or rising throughout", unit="1", min_length=2, max_length=MOST_POINTS
    )

    torque: tuple[Torque, ...] | None = choice(
        "at the joint, rising: with ``factor``", None, unit="N m", min_length=2, max_length=MOST_POINTS
    )
    factor: tuple[Share, ...] | None = choice(
        "of the efficiency at these torques, at most 1 (default: the torque changes nothing)",
        None, unit="1", min_length=2, max_length=MOST_POINTS,
    )  # fmt: skip

    def fault(self) -> str:
        """What is wrong with the table, in words that follow its path; empty if nothing is."""
        words = "speeds", "efficiencies", "efficiency for each speed", "speed"
        return points_fault(self.speed, self.efficiency, *words) or self._factor_fault()

    def _factor_fault(self) -> str:
        if self.torque is None or self.factor is None:
            missing = "torque" if self.torque is None else "factor"
            return "" if self.torque == self.factor else f"has no {missing}: torque and factor go together"
        if words := points_fault(self.torque, self.factor, "torques", "factors", "factor for each torque"):
            return words
        if min(self.factor) * min(self.efficiency) < LEAST_EFFICIENCY:
            return f"has efficiencies times factors below {LEAST_EFFICIENCY:g}: give larger ones"
        return ""


class Gear(Section):
    ratio: float = quantity("R: motor turns for one turn of the joint", "1", 1.0, 1000, physical=True)
    torque_cap: float | None = quantity("repeated peak torque, joint side", "N m", 1e-4, 1e4, None, physical=True)
    speed_cap: float | None = quantity("input speed limit, motor side", "rad/s", 1.0, 6000, None, physical=True)
    inertia: float | None = quantity(
        "moment of inertia of what turns with the rotor, motor side (default: none)",
        "kg m^2", 0.0, 0.05, None, physical=True,
    )  # fmt: skip
    efficiency: float | None = quantity(
        "eta: share of the torque at its teeth that it passes on, driving or braking (default: none is lost)",
        "1", 0.05, 1, None, physical=True,
    )  # fmt: skip
    efficiency_table: EfficiencyTable | None = choice(
        "efficiency by the motor's speed and the joint's torque, in place of one number: {speed = [...], efficiency = [...]}",
        None,
    )
    friction: float | None = quantity(
        "Coulomb friction, joint side (default: none)", "N m", 0, 1e3, None, physical=True
    )
    damping: float | None = quantity(
        "viscous friction, joint side (default: none)", "N m s/rad", 0, 1e3, None, physical=True
    )
    catalogue: str | None = choice(CATALOGUE, None, pattern=CATALOGUE_NAME, allowed="the name of a catalogue entry")


class Supply(Section):
    """What the motors of a leg are fed from; also written as the table [supply] of the file."""

    voltage: float = quantity("open-circuit voltage", "V", 1.0, 1000, physical=True)
    internal_resistance: float = quantity("of battery and wires", "ohm", 0.0, 100, 0.0, physical=True)
    count: float = quantity("equal supplies side by side", "1", 0.1, 100, 1.0, physical=True)
    legs: float = quantity(
        "equal legs that push together from it (default: as many as carry the body)", "1", 1, 100, 1.0, physical=True
    )
    least_voltage: float | None = quantity(
        "at its terminals, below which boards reset", "V", 0.5, 1000, None, physical=True
    )
    current_cap: float | None = quantity("greatest current of each supply", "A", 0.01, 1e4, None, physical=True)
    power_cap: float | None = quantity("greatest power of each supply", "W", 0.1, 1e6, None, physical=True)
    recuperation: bool = choice("whether it takes back what the motors together feed back", False)


def _overrides(section: type[Section]) -> type[Section]:
    """The same table with every entry optional: a joint's own values over the leg's."""
    fields: dict[str, Any] = {}
    for name, info in section.model_fields.items():
        copy = copy_of(info)
        copy.default = None
        copy.json_schema_extra = {**(info.json_schema_extra or {}), "listed": False}  # type: ignore[dict-item]
        fields[name] = (Annotated[info.annotation | None, copy], None)  # type: ignore[operator]
    return create_model(f"{section.__name__}Overrides", __base__=Section, **fields)


MotorOverrides, GearOverrides = _overrides(Motor), _overrides(Gear)


class Joint(Section):
    type: Literal["revolute", "prismatic"] | None = choice(
        "whether it turns, or slides along its axis: then angles are travel [m], torques forces [N] (default: revolute)",
        None,
        listed=False,
    )
    lower: float = quantity("smallest angle", "rad", -7, 7)
    upper: float = quantity("largest angle", "rad", -7, 7)
    axis: Vector = choice(
        "axis of the joint, all joint angles zero (x, y, z); default: positive swings forward", FORWARD
    )
    motor: MotorOverrides | None = choice("this joint's own motor values, over [leg.motor]", None, listed=False)  # type: ignore[valid-type]
    gear: GearOverrides | None = choice("this joint's own gear values, over [leg.gear]", None, listed=False)  # type: ignore[valid-type]
    transmission: Transmission | None = choice(
        "what lies between the joint and its drive (default: they turn together)", None, listed=False
    )
    series_spring: SeriesSpring | None = choice(
        "a spring between the drive and its joint (default: none)", None, listed=False
    )


# Entries of a linear motor in place of those of one that turns.
LINEAR = {
    "max_torque": "max_force",
    "max_speed": "max_velocity",
    "torque_cap": "force_cap",
    "rotor_inertia": "rotor_mass",
}


class Leg(Section):
    """A body on x and z guides, or on a vertical slider, and a serial chain of joints and links.

    Angles, unless axes and directions say otherwise: the first link from straight down, each further link relative
    to the one before it; positive swings the link forward (+x). ``joint`` and ``link`` are the tables [leg.<name>]
    of the file.
    """

    joints: tuple[str, ...] = choice("joint names from the body to the foot", min_length=1, max_length=8)
    links: tuple[str, ...] = choice("link names from the body to the foot", min_length=1, max_length=8)
    guides: tuple[Literal["x", "z"], ...] = choice(
        "directions in which the body may move", ("x", "z"), allowed='["x", "z"], or ["z"] for a vertical slider,'
    )
    lowest: Literal["shapes", "joints"] | None = choice(
        "whose lowest point is the leg's: of all shapes, joints and the foot, or of joints and foot alone (default: shapes)",
        None,
    )
    body: Body
    motor: Motor
    gear: Gear
    supply: Supply | None = choice("what feeds the motors (default: a stiff supply)", None, listed=False)
    spring: dict[str, Spring] | None = choice(
        "springs beside the drives by name: [leg.spring.knee] (docs/springs.md)",
        None,
        listed=False,
        max_length=MOST_SPRINGS,
    )
    joint: dict[str, Joint]
    link: dict[str, Link]
    _fall: Vector = PrivateAttr((0.0, 0.0, -GRAVITY))

    @model_validator(mode="before")
    @classmethod
    def _gather(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        data = _legs_on_supply(data)
        if "joint" in data or "link" in data:
            return _with_linear_motors(data)
        data = dict(data)
        for key, names in (("joint", data.get("joints")), ("link", data.get("links"))):
            names = names if isinstance(names, (list, tuple)) else ()
            data[key] = {n: data.pop(n, {}) for n in names if isinstance(n, str) and n not in RESERVED}
        return _with_linear_motors(data)

    @model_serializer(mode="wrap")
    def _spread(self, handler: Any) -> dict[str, Any]:
        data = handler(self)
        joint, link = data.pop("joint"), data.pop("link")
        return {**data, **joint, **link}

    @property
    def fall(self) -> Vector:
        """Acceleration of free fall [m/s^2] where the leg stands: along the ground, across, and away from it."""
        return self._fall

    def falling(self, fall: Vector) -> "Leg":
        """The leg where things fall so [m/s^2], which its problem says (``Environment.fall``)."""
        there = self.model_copy()
        there._fall = fall
        return there

    @property
    def direct(self) -> bool:
        """Whether every drive turns as its joint does."""
        return all(joint.transmission is None for joint in self.joint.values())

    @property
    def elastic(self) -> tuple[str, ...]:
        """Joints with a spring between them and their drives."""
        return tuple(name for name in self.joints if self.joint[name].series_spring is not None)

    @property
    def link_joints(self) -> tuple[LinkJoint, ...]:
        """The joint of each link, from the body to the foot."""
        own, found = iter(self.joints), list[LinkJoint]()
        for name in self.links:
            if (follows := self.link[name].follows) is not None:
                number, axis = self.joints.index(follows.joint), unit(follows.axis)
                ratio = follows.ratio, follows.offset
                found.append(LinkJoint(follower(name), axis, False, number, *ratio, follows=True))
                continue
            joint = next(own)
            axis, slides = unit(self.joint[joint].axis), joint in self.sliding
            found.append(LinkJoint(joint, axis, slides, self.joints.index(joint)))
        return tuple(found)

    @property
    def sliding(self) -> tuple[str, ...]:
        """Joints that slide along their axes."""
        return tuple(name for name in self.joints if self.joint[name].type == "prismatic")

    def units(self, joint: str) -> Units:
        """Words and units of a joint."""
        return SLIDING if joint in self.sliding else TURNING

    def linear(self, joint: str) -> bool:
        """Whether a joint has a linear motor."""
        motor = self.joint[joint].motor
        return joint in self.sliding and motor is not None and motor.max_force is not None

    @property
    def pivots(self) -> tuple[str, ...]:
        """Names of the points where links begin, from the body to the foot."""
        return tuple(at.name for at in self.link_joints)

    @property
    def chain(self) -> tuple[str, ...]:
        """Names of the points between which the leg is drawn, from the body to the foot; the body's own where it slides on it."""
        return (*(["body"] if self.link_joints[0].slides else []), *self.pivots, "foot")

    @property
    def follows(self) -> bool:
        """Whether the joint of any link follows another one."""
        return any(link.follows is not None for link in self.link.values())

    @property
    def five_bars(self) -> tuple[str, ...]:
        """Joints whose drive turns a crank beside the link before them."""
        return tuple(name for name in self.joints if (t := self.joint[name].transmission) and t.five_bar)

    @property
    def has_trunk(self) -> bool:
        """Whether the lowest point of the body's shapes counts."""
        return self.lowest != "joints" and any(shape.counts for shape in (self.body.shapes or {}).values())

    @property
    def length(self) -> float:
        """Of all links [m]: the leg's own unit of length."""
        return sum(link.length for link in self.link.values())

    def drive(self, joint: str, part: Literal["motor", "gear"], entry: str) -> tuple[str, Any]:
        """Path and value of a joint's motor or gear entry: its own if the file gives one, else the leg's.

        A motor or gear of the catalogue is whole, and so is a linear motor: what it leaves open is None, not what the leg's has.
        """
        own, common = getattr(self.joint[joint], part), getattr(self, part)
        linear, optional = self.linear(joint), type(common).model_fields[entry].default is None
        entry = LINEAR.get(entry, entry) if linear and part == "motor" else entry
        value = getattr(own, entry) if own is not None else None
        whole = own is not None and optional and (linear or own.catalogue is not None)
        if value is not None or whole:
            return f"leg.{joint}.{part}.{entry}", value
        return f"leg.{part}.{entry}", getattr(common, entry)


def _legs_on_supply(leg: dict[str, Any]) -> dict[str, Any]:
    """The leg's table whose supply feeds as many legs as carry the body, if it says nothing else."""
    body, supply = leg.get("body"), leg.get("supply")
    if not isinstance(body, dict) or not isinstance(supply, dict) or body.get("legs") is None or "legs" in supply:
        return leg
    return {**leg, "supply": {**supply, "legs": body["legs"]}}


def _with_linear_motors(leg: dict[str, Any]) -> dict[str, Any]:
    """The leg's table in which linear motors turn nothing, and prismatic joints without an axis make the leg longer; where all
    motors are linear the leg needs no common one."""
    joints = leg.get("joint")
    if not isinstance(joints, dict):
        return leg
    found, linear = dict[str, Any](), 0
    for name, joint in joints.items():
        found[name] = joint
        if not isinstance(joint, dict) or joint.get("type") != "prismatic":
            continue
        found[name] = {"axis": DOWN, **joint}
        motor, gear = joint.get("motor"), joint.get("gear", {})
        if isinstance(motor, dict) and "max_force" in motor and isinstance(gear, dict):
            linear += 1
            found[name] |= {"motor": {"rotor_mass": 0.0, **motor}, "gear": {"ratio": 1.0, **gear}}
    common = {"motor": {}, "gear": {"ratio": 1.0}} if found and linear == len(found) else {}
    return common | leg | {"joint": found}


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
            for key, item in value.items():  # tables of joints and links sit in [leg] itself
                yield from _physical(f"{path}.{key}" if name in ("joint", "link") else f"{path}.{name}.{key}", item)
        elif value is not None and isinstance(extra, dict) and extra.get("physical"):
            yield f"{path}.{name}", float(value)
