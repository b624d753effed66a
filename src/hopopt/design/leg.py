"""The leg: its body, links, joints and drives. Values marked ``physical`` enter the planner as symbols."""

import math
from collections.abc import Iterator, Sequence
from copy import copy as copy_of
from typing import Annotated, Any, Literal

from pydantic import BaseModel, PrivateAttr, create_model, model_serializer, model_validator

from hopopt.design.drives.gear import Gear
from hopopt.design.drives.motor import LINEAR, Motor, with_linear_motors
from hopopt.design.drives.series_spring import SeriesSpring
from hopopt.design.drives.supply import Supply
from hopopt.design.drives.transmission import Transmission
from hopopt.design.fields import (
    FORWARD,
    RESERVED,
    Section,
    Vector,
    choice,
    quantity,
)
from hopopt.design.geometry.link_joint import SLIDING, TURNING, LinkJoint, Units, follower
from hopopt.design.geometry.parts import MOST_SPRINGS, Body, Link, Spring
from hopopt.design.hop import GRAVITY

PAPERS_LENGTH = 0.38 + 0.361  # [m] of the paper's leg


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
            return with_linear_motors(data)
        data = dict(data)
        for key, names in (("joint", data.get("joints")), ("link", data.get("links"))):
            names = names if isinstance(names, (list, tuple)) else ()
            data[key] = {n: data.pop(n, {}) for n in names if isinstance(n, str) and n not in RESERVED}
        return with_linear_motors(data)

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
    def riding(self) -> tuple[str, ...]:
        """Joints whose motor sits on a link."""
        return tuple(name for name in self.joints if (t := self.joint[name].transmission) and t.motor_on in self.links)

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


def unit(vector: Sequence[float]) -> tuple[float, ...]:
    """A vector of length 1 in the same direction, exact where it has that length already."""
    length = math.sqrt(math.fsum(x * x for x in vector))
    return tuple(float(x) if length == 1 else x / length for x in vector)


def physical_parameters(leg: Leg) -> dict[str, float]:
    """Every design parameter of the leg that has a value: {"leg.thigh.length": 0.38 [m], ...} (SI); of a list each number by its
    place, as in "leg.knee.transmission.table.ratio[1]"."""
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
            if isinstance(value, tuple):
                yield from ((f"{path}.{name}[{k}]", float(x)) for k, x in enumerate(value))
            else:
                yield f"{path}.{name}", float(value)
