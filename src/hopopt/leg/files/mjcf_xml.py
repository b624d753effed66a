"""How an MJCF says things: attributes by default classes, angles in its unit, orientations in five ways, ranges that limit."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf

import numpy as np
import pinocchio as pin

from hopopt.leg.files.urdf_xml import UrdfError, decimals, quoted

LARGEST = 1e6  # SI, of any number
MOST_CLASSES = 1000  # of defaults; the largest public robots have a tenth of it
ACTUATORS = (
    "general",
    "motor",
    "position",
    "velocity",
    "intvelocity",
    "damper",
    "cylinder",
    "muscle",
    "adhesion",
    "dcmotor",
)
FLAT = "hopopt reads what MuJoCo writes of the whole model (mujoco.mj_saveLastXML)"
Placement = pin.SE3


@dataclass
class Defaults:
    """Attributes by class and element: what an element has where it says nothing. Each class has its own, and the name of the
    class that it lies in."""

    own: dict[str, dict[str, dict[str, str]]] = field(default_factory=lambda: {"main": {}})
    above: dict[str, str] = field(default_factory=lambda: {"main": ""})

    @classmethod
    def of(cls, root: ET.Element) -> "Defaults":
        found, todo = cls(), list[tuple[ET.Element, str]]()
        for top in root.findall("default"):  # whatever its name is, it is every element's
            found.own[top.get("class", "main")] = found.own["main"]
            found.above.setdefault(top.get("class", "main"), "")
            todo.append((top, ""))
        while todo:
            element, above = todo.pop(0)
            name = element.get("class", above or "main")
            own, _ = found.own.setdefault(name, {}), found.above.setdefault(name, above)
            if len(found.own) > MOST_CLASSES:
                raise UrdfError(f"has more than {MOST_CLASSES} default classes: this is not the MJCF of a robot")
            todo += [(child, name) for child in element if child.tag == "default"]
            for child in element:
                if child.tag != "default":
                    own.setdefault(kind_of(child.tag), {}).update(child.attrib)
        return found

    def attributes(self, element: ET.Element, inherited: str) -> dict[str, str]:
        """All attributes of an element, its class' behind its own; inherited: class of the bodies it lies in."""
        name, tag, given = element.get("class") or inherited, kind_of(element.tag), element.attrib
        if name not in self.own:
            raise UrdfError(f"has no default class {quoted(name)}, which a <{element.tag[:40]}> names")
        while name:
            given, name = self.own[name].get(tag, {}) | given, self.above[name]
        return given


@dataclass(frozen=True)
class Compiler:
    """How a file writes angles: radians in one of its units, the order of Euler angles; whether a range alone is a limit."""

    unit: float
    order: str
    auto: bool

    @classmethod
    def of(cls, root: ET.Element) -> "Compiler":
        said = {key: value for element in root.findall("compiler") for key, value in element.attrib.items()}
        if said.get("coordinate", "local") != "local" or said.get("inertiafromgeom", "auto") == "true":
            raise UrdfError(f"has a <compiler> with global coordinates or inertias from geoms: {FLAT}")
        if next(iter(numbers(said, "settotalmass", "<compiler>")), 0.0) > 0:
            raise UrdfError(f"has a <compiler> that sets the total mass: {FLAT}")
        order = said.get("eulerseq", "xyz")
        if len(order) != 3 or set(order.lower()) - set("xyz") or not (order.islower() or order.isupper()):
            raise UrdfError(
                f"has <compiler eulerseq={quoted(order)}>: three letters of x, y and z are needed, all small or all large"
            )
        return cls(1.0 if said.get("angle") == "radian" else np.pi / 180, order, said.get("autolimits") != "false")

    def limits(self, given: Mapping[str, str], name: str, where: str, said: str) -> tuple[float, float]:
        """The two numbers of a range as far as it limits: else none."""
        limited = given.get(said, "auto")
        if name not in given or limited == "false" or (limited == "auto" and not self.auto):
            return -inf, inf
        low, high = numbers(given, name, where, 2)
        return (-inf, inf) if limited == "auto" and low == high == 0 else (low, high)

    def placement(self, given: Mapping[str, str], where: str) -> Placement:
        """Where an element sits in its body, by position and one of the ways to say how it is turned."""
        return Placement(self._turn(given, where), np.array(numbers(given, "pos", where, 3) or [0.0] * 3))

    def _turn(self, given: Mapping[str, str], where: str) -> np.ndarray:
        if quat := numbers(given, "quat", where, 4):
            return pin.Quaternion(*_direction(quat, where)).toRotationMatrix()
        if turned := numbers(given, "axisangle", where, 4):
            return pin.AngleAxis(self.unit * turned[3], _direction(turned[:3], where)).toRotationMatrix()
        if angles := numbers(given, "euler", where, 3):
            matrices = [_about(axis, self.unit * x) for axis, x in zip(self.order.lower(), angles, strict=True)]
            return np.linalg.multi_dot(matrices if self.order.islower() else matrices[::-1])
        if axes := numbers(given, "xyaxes", where, 6):
            x = _direction(axes[:3], where)
            y = _direction(np.array(axes[3:]) - x @ axes[3:] * x, where)
            return np.column_stack([x, y, np.cross(x, y)])
        if z := numbers(given, "zaxis", where, 3):
            return pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), _direction(z, where)).toRotationMatrix()
        return np.eye(3)


def kind_of(tag: str) -> str:
    """Actuators of every kind share their defaults."""
    return "actuator" if tag in ACTUATORS else tag


def numbers(given: Mapping[str, str], name: str, where: str, count: int = 1) -> list[float]:
    """The numbers of an attribute, empty if it is not there."""
    return decimals(given[name], count, f"{where} has {name}={quoted(given[name])}", LARGEST) if name in given else []


def _direction(values: list[float] | np.ndarray, where: str) -> np.ndarray:
    length = float(np.linalg.norm(values))
    if length < 1e-9:
        raise UrdfError(f"{where} has a direction that is zero")
    return np.array(values) / length


def _about(axis: str, angle: float) -> np.ndarray:
    return pin.AngleAxis(angle, np.eye(3)["xyz".index(axis)]).toRotationMatrix()
