"""A URDF as data: checked names, numbers and structure, and what matters to the motion as clean XML again."""

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from difflib import get_close_matches
from xml.parsers import expat

MAX_BYTES = 5_000_000  # the largest public robots have a tenth of it
MOST_ELEMENTS = 1000  # links and joints; a humanoid with hands has 200
URDF_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)  # float() takes more than URDF parsers do
BLANKS = re.compile(r"[ \t\r\n]+")
LARGEST_VALUES = {
    "origin": 1e3,
    "axis": 1e3,
    "mass": 1e6,
    "inertia": 1e6,
    "limit": math.inf,
    "mimic": 1e3,
}  # SI; squares stay far from overflow
KEPT_ATTRIBUTES = {  # of what matters to the motion: an element's attributes
    "parent": ("link",), "child": ("link",), "origin": ("xyz", "rpy"), "axis": ("xyz",), "mass": ("value",),
    "inertia": ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), "limit": ("lower", "upper", "effort", "velocity"),
}  # fmt: skip
MOVING = ("revolute", "continuous")
LOCKABLE = (*MOVING, "prismatic")  # joints of one coordinate
OTHER_KINDS = {"mujoco": "this is an MJCF: give it as leg.mjcf", "robot": "this is a URDF: give it as leg.urdf"}
TYPES = (*LOCKABLE, "floating", "fixed")


class UrdfError(ValueError):
    """What is wrong with a URDF or an MJCF, or with the names it was asked for, as a sentence that follows the file's name."""


def root_of(raw: bytes, tag: str = "robot", kind: str = "URDF") -> ET.Element:
    """The element called ``tag`` that a file of this ``kind`` begins with; entities, which can swell a file without end, are
    refused."""
    if len(raw) > MAX_BYTES:
        raise UrdfError(f"has more than {MAX_BYTES} bytes: this is not the {kind} of a robot")
    parser = expat.ParserCreate()

    def refuse(*_: object) -> None:
        raise UrdfError(f"declares a document type or entities, which no {kind} needs: remove the <!DOCTYPE ...>")

    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(raw, True)
        root = ET.fromstring(raw)
    except (expat.ExpatError, ET.ParseError, ValueError, LookupError, RecursionError) as error:
        if isinstance(error, UrdfError):
            raise
        raise UrdfError(f"is not XML: {error}") from None
    if root.tag != tag:
        other = OTHER_KINDS.get(root.tag, f"this is not a {kind}")
        raise UrdfError(f"is XML, but begins with <{root.tag[:40]}> instead of <{tag}>: {other}")
    return root


class Tree:
    """Links and joints of a URDF, checked: names, numbers, one root and no loops."""

    def __init__(self, root: ET.Element):
        self.links = _by_name(root, "link")
        self.joints = _by_name(root, "joint")
        if not self.links:
            raise UrdfError("has no links")
        if len(self.links) + len(self.joints) > MOST_ELEMENTS:
            raise UrdfError(
                f"has {len(self.links)} links and {len(self.joints)} joints: hopopt reads up to {MOST_ELEMENTS} in all"
            )
        self.above: dict[str, str] = {}  # link -> the joint that carries it
        for name, joint in self.joints.items():
            self._check_joint(name, joint)
        for name, link in self.links.items():
            _check_inertial(name, link)
        tops = [name for name in self.links if name not in self.above]
        if len(tops) != 1:
            what = f"has {len(tops)} links without a parent ({_some(tops)})" if tops else "has no link without a parent"
            raise UrdfError(f"{what}: a robot is one tree that begins with one link")
        for name in self.links:
            self._path(name)

    @property
    def movable(self) -> list[str]:
        """Names of the joints of one coordinate: a floating one only holds the robot in its world."""
        return [name for name, joint in self.joints.items() if joint.get("type") in LOCKABLE]

    def ends(self, joint: str) -> tuple[str, str]:
        """Parent and child link of a joint."""
        parent, child = (self.joints[joint].find(tag) for tag in ("parent", "child"))
        return ("" if parent is None else parent.get("link", "")), ("" if child is None else child.get("link", ""))

    def _check_joint(self, name: str, joint: ET.Element) -> None:
        kind = joint.get("type", "")
        if kind not in TYPES:
            raise UrdfError(f"joint {quoted(name)} is of type {quoted(kind)}: hopopt reads {', '.join(TYPES)}")
        if name == "universe":
            raise UrdfError('joint "universe" has the name that Pinocchio gives the world: give it another one')
        for end, link in zip(("parent", "child"), self.ends(name), strict=True):
            if link not in self.links:
                raise UrdfError(f"joint {quoted(name)} has the {end} link {quoted(link)}, which the file does not have")
        child = self.ends(name)[1]
        if child in self.above:
            raise UrdfError(f"link {quoted(child)} hangs on two joints, {self.above[child]} and {name}: not a tree")
        self.above[child] = name
        _check_origin(joint, f"joint {quoted(name)}")
        axis = numbers(joint, "axis", "xyz", 3, f"joint {quoted(name)}")
        if axis and math.hypot(*axis) < 1e-6 and kind != "fixed":
            raise UrdfError(f"joint {quoted(name)} has no axis: <axis xyz> is zero")
        for entry in KEPT_ATTRIBUTES["limit"]:
            numbers(joint, "limit", entry, 1, f"joint {quoted(name)}")

    def _path(self, link: str) -> list[str]:
        """Joints from the root down to ``link``."""
        path: list[str] = []
        while link in self.above:
            path.insert(0, self.above[link])
            link = self.ends(path[0])[0]
            if len(path) > len(self.joints):
                raise UrdfError(f"has a loop of links through joint {quoted(path[0])}: a robot is a tree")
        return path

    def known(self, name: str, what: str, names: Sequence[str]) -> None:
        """Refuse a name that is not among ``names``, with what there is."""
        if name not in names:
            close = get_close_matches(name, names, n=1)
            guess = f" (did you mean {close[0]}?)" if close else ""
            raise UrdfError(f"has no {quoted(name)} for leg.{what}{guess}: there is {_some(names)}")

    def chain_to(self, foot: str, joints: Sequence[str]) -> list[str]:
        """The joints of a leg, checked to lie on the way to the foot, in the order of the tree."""
        self.known(foot, "foot_frame", list(self.links))
        on_the_way = self.on_the_way(foot)
        for name in joints:
            if name in self.joints and name not in on_the_way:
                raise UrdfError(
                    f"joint {quoted(name)} is not on the way from the body to the foot {quoted(foot)}: "
                    f"there is {_some(on_the_way)}"
                )
            self.known(name, "joints", on_the_way)
        chain = [name for name in on_the_way if name in joints]
        if len(set(joints)) < len(joints):
            raise UrdfError(f"is asked for a joint twice: leg.joints names {_some(joints)}")
        if list(joints) != chain:
            raise UrdfError(f"has the joints in the order {', '.join(chain)}: write leg.joints so, from body to foot")
        return chain

    def on_the_way(self, foot: str) -> list[str]:
        """Joints that may move from the root down to a link."""
        return [name for name in self._path(foot) if name in self.movable]

    def xml(self) -> str:
        """What matters to the motion, as URDF: no meshes, no materials, nothing that belongs to other programs."""
        robot = ET.Element("robot", name="leg")
        for name, link in self.links.items():
            copy = ET.SubElement(robot, "link", name=link_in_xml(name))
            if (inertial := link.find("inertial")) is not None:
                _copy(inertial, ET.SubElement(copy, "inertial"), ("origin", "mass", "inertia"))
        for name, joint in self.joints.items():
            copy = ET.SubElement(robot, "joint", name=name, type=joint.get("type", ""))
            _copy(joint, copy, ("parent", "child", "origin", "axis"))
            if joint.get("type") in LOCKABLE:
                none = {"effort": "0", "velocity": "0"}
                ET.SubElement(copy, "limit", none | _attributes(joint.find("limit")))
        return ET.tostring(robot, encoding="unicode")


def link_in_xml(name: str) -> str:
    """What ``Tree.xml`` calls a link: unlike all joints, which Pinocchio wants, though a URDF may use a name for both."""
    return f"link {name}"


def _by_name(root: ET.Element, tag: str) -> dict[str, ET.Element]:
    found: dict[str, ET.Element] = {}
    for element in root.findall(tag):
        name = element.get("name", "")
        if not name:
            raise UrdfError(f"has a <{tag}> without a name")
        if name in found:
            raise UrdfError(f"has two {tag}s called {quoted(name)}")
        found[name] = element
    return found


def numbers(element: ET.Element, tag: str, entry: str, count: int, where: str) -> list[float]:
    """The numbers of an attribute, empty if it is not there; as finite decimal numbers between blanks, no larger than LARGEST."""
    child = element.find(tag)
    text = None if child is None else child.get(entry)
    if text is None:
        return []
    return decimals(text, count, f"{where} has <{tag} {entry}={quoted(text)}>", LARGEST_VALUES[tag])


def decimals(text: str, count: int, said: str, largest: float) -> list[float]:
    """So many finite decimal numbers between blanks, no larger than ``largest``; UrdfError, which begins with what is ``said``."""
    words = BLANKS.split(text.strip(" \t\r\n"))
    values = [float(word) for word in words if URDF_NUMBER.fullmatch(word)]
    if len(values) != len(words) or len(values) != count or not all(map(math.isfinite, values)):
        wanted = "a number such as 0.25 or 1e-3" if count == 1 else f"{count} numbers with blanks between"
        raise UrdfError(f"{said}: {wanted} is needed")
    if max(map(abs, values)) > largest:
        raise UrdfError(f"{said}: {largest:g} at most is allowed, in SI units")
    return values


def _copy(element: ET.Element, into: ET.Element, tags: Sequence[str]) -> None:
    """The first child of each tag, with what is kept of it."""
    for tag in tags:
        if (child := element.find(tag)) is not None:
            ET.SubElement(into, tag, _attributes(child))


def _attributes(child: ET.Element | None) -> dict[str, str]:
    """What is kept of a checked element, numbers as every parser reads them."""
    given = (
        {}
        if child is None
        else {name: child.get(name, "") for name in KEPT_ATTRIBUTES[child.tag] if name in child.attrib}
    )
    return {
        k: link_in_xml(v) if k == "link" else " ".join(repr(float(x)) for x in BLANKS.split(v.strip()))
        for k, v in given.items()
    }


def _check_origin(element: ET.Element, where: str) -> None:
    for entry in KEPT_ATTRIBUTES["origin"]:
        numbers(element, "origin", entry, 3, where)
    origin = element.find("origin")
    if origin is not None and (others := sorted(origin.attrib.keys() - set(KEPT_ATTRIBUTES["origin"]))):
        raise UrdfError(f"{where} has <origin {others[0][:40]}=...>: hopopt reads xyz and rpy")


def _check_inertial(name: str, link: ET.Element) -> None:
    inertial, where = link.find("inertial"), f"link {quoted(name)}"
    if inertial is None:
        return
    mass = numbers(inertial, "mass", "value", 1, where)
    if not mass or mass[0] < 0:
        raise UrdfError(f"{where} has an <inertial> {'with a negative' if mass else 'without a'} mass")
    _check_origin(inertial, where)
    moments = [numbers(inertial, "inertia", entry, 1, where) for entry in KEPT_ATTRIBUTES["inertia"]]
    if not all(moments):
        raise UrdfError(f"{where} has a mass but no complete <inertia>: ixx, iyy, izz, ixy, ixz and iyz are needed")


def quoted(text: str) -> str:
    return '"' + "".join(c if c.isprintable() else "?" for c in text[:60]) + '"'


def _some(names: Sequence[str]) -> str:
    """Names in a sentence, not too many of them."""
    shown = ", ".join(name[:60] for name in names[:24])
    return shown + (f" and {len(names) - 24} more" if len(names) > 24 else "") if names else "none"
