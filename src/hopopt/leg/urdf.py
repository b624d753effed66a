"""A leg out of a URDF: the file checked as data, then reduced with Pinocchio to the joints that move.

Everything between the body and the first joint that moves, and all other limbs, becomes the body: on guides it only
translates, so nothing but its mass enters the motion. What is locked below a joint becomes part of that joint's link.
"""

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from xml.parsers import expat

import numpy as np
import pinocchio as pin

from hopopt.leg.robot import PAIRS

MAX_BYTES = 5_000_000  # the largest public robots have a tenth of it
MOVING = ("revolute", "continuous")
TYPES = (*MOVING, "prismatic", "fixed")
ROUND = 1e-10  # what rotations by a rounded half turn leave of a zero
SLACK = 1e-3  # by which the triangle inequality of moments may be missed: figures in files are rounded


class UrdfError(ValueError):
    """What is wrong with a URDF, or with the names it was asked for, as a sentence that follows the file's name."""


@dataclass(frozen=True)
class MovingLink:
    """What moves with one joint, all joint angles zero, axes parallel to the robot's: unit axis of the joint (3),
    vector (3) [m] to the next joint or the foot, mass [kg], com (3) [m] from the joint, inertia (xx, yy, zz, xy, xz,
    yz) [kg m^2] about it; limits lower, upper [rad], effort [N m], velocity [rad/s] (nan: not given)."""

    joint: str
    link: str
    axis: tuple[float, ...]
    vector: tuple[float, ...]
    mass: float
    com: tuple[float, ...]
    inertia: tuple[float, ...]
    lower: float
    upper: float
    effort: float
    velocity: float


@dataclass(frozen=True)
class UrdfLeg:
    """A chain of moving links from the body, of mass body_mass [kg], to the foot."""

    body_mass: float
    links: tuple[MovingLink, ...]


def read_leg(raw: bytes, joints: Sequence[str], foot: str, locked: Mapping[str, float]) -> UrdfLeg:
    """The chain of ``joints`` down to the link ``foot``; every other joint is locked at ``locked`` [rad, m], or at
    zero or its limit nearest to zero. Raises UrdfError."""
    tree = _Tree(_root(raw))
    chain = tree.chain_to(foot, joints)
    for name in locked:
        tree.known(name, "locked", [j for j in tree.movable if j not in joints])
    return _reduced(tree, chain, foot, locked)


# ---- the file as data ----------------------------------------------------------------------------------------


def _root(raw: bytes) -> ET.Element:
    """The <robot> element; entities, which can swell a file without end, are refused."""
    if len(raw) > MAX_BYTES:
        raise UrdfError(f"has more than {MAX_BYTES} bytes: this is not the URDF of a robot")
    parser = expat.ParserCreate()

    def refuse(*_: object) -> None:
        raise UrdfError("declares a document type or entities, which no URDF needs: remove the <!DOCTYPE ...>")

    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(raw, True)
        root = ET.fromstring(raw)
    except (expat.ExpatError, ET.ParseError, ValueError, LookupError, RecursionError) as error:
        if isinstance(error, UrdfError):
            raise
        raise UrdfError(f"is not XML: {error}") from None
    if root.tag != "robot":
        raise UrdfError(f"is XML, but begins with <{root.tag[:40]}> instead of <robot>: this is not a URDF")
    return root


class _Tree:
    """Links and joints of a URDF, checked: names, numbers, one root and no loops."""

    def __init__(self, root: ET.Element):
        self.links = _by_name(root, "link")
        self.joints = _by_name(root, "joint")
        if not self.links:
            raise UrdfError("has no links")
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
        """Names of the joints that are not fixed."""
        return [name for name, joint in self.joints.items() if joint.get("type") != "fixed"]

    def ends(self, joint: str) -> tuple[str, str]:
        """Parent and child link of a joint."""
        parent, child = (self.joints[joint].find(tag) for tag in ("parent", "child"))
        return ("" if parent is None else parent.get("link", "")), ("" if child is None else child.get("link", ""))

    def _check_joint(self, name: str, joint: ET.Element) -> None:
        kind = joint.get("type", "")
        if kind not in TYPES:
            raise UrdfError(f"joint {_quoted(name)} is of type {_quoted(kind)}: hopopt reads {', '.join(TYPES)}")
        if joint.find("mimic") is not None:
            raise UrdfError(f"joint {_quoted(name)} mimics another one, which a leg of independent drives cannot")
        for end, link in zip(("parent", "child"), self.ends(name), strict=True):
            if link not in self.links:
                raise UrdfError(
                    f"joint {_quoted(name)} has the {end} link {_quoted(link)}, which the file does not have"
                )
        child = self.ends(name)[1]
        if child in self.above:
            raise UrdfError(f"link {_quoted(child)} hangs on two joints, {self.above[child]} and {name}: not a tree")
        self.above[child] = name
        _numbers(joint, "origin", "xyz", 3, f"joint {_quoted(name)}")
        _numbers(joint, "origin", "rpy", 3, f"joint {_quoted(name)}")
        axis = _numbers(joint, "axis", "xyz", 3, f"joint {_quoted(name)}")
        if axis and math.hypot(*axis) < 1e-6 and kind != "fixed":
            raise UrdfError(f"joint {_quoted(name)} has no axis: <axis xyz> is zero")
        for entry in ("lower", "upper", "effort", "velocity"):
            _numbers(joint, "limit", entry, 1, f"joint {_quoted(name)}")

    def _path(self, link: str) -> list[str]:
        """Joints from the root down to ``link``."""
        path: list[str] = []
        while link in self.above:
            path.insert(0, self.above[link])
            link = self.ends(path[0])[0]
            if len(path) > len(self.joints):
                raise UrdfError(f"has a loop of links through joint {_quoted(path[0])}: a robot is a tree")
        return path

    def known(self, name: str, what: str, names: Sequence[str]) -> None:
        """Refuse a name that is not among ``names``, with what there is."""
        if name not in names:
            close = get_close_matches(name, names, n=1)
            guess = f" (did you mean {close[0]}?)" if close else ""
            raise UrdfError(f"has no {_quoted(name)} for leg.{what}{guess}: there is {_some(names)}")

    def chain_to(self, foot: str, joints: Sequence[str]) -> list[str]:
        """The joints that move, checked to lie on the way to the foot, in the order of the tree."""
        self.known(foot, "foot_frame", list(self.links))
        on_the_way = [name for name in self._path(foot) if name in self.movable]
        for name in joints:
            if name in self.joints and name not in on_the_way:
                raise UrdfError(
                    f"joint {_quoted(name)} is not on the way from the body to the foot {_quoted(foot)}: "
                    f"there is {_some(on_the_way)}"
                )
            self.known(name, "joints", on_the_way)
            if (kind := self.joints[name].get("type")) not in MOVING:
                raise UrdfError(f"joint {_quoted(name)} is {kind}: the joints of a leg are {' or '.join(MOVING)}")
        chain = [name for name in on_the_way if name in joints]
        if list(joints) != chain:
            raise UrdfError(f"has the joints in the order {', '.join(chain)}: write leg.joints so, from body to foot")
        return chain

    def xml(self) -> str:
        """What matters to the motion, as URDF: no meshes, no materials, nothing that belongs to other programs."""
        robot = ET.Element("robot", name="leg")
        for name, link in self.links.items():
            copy = ET.SubElement(robot, "link", name=name)
            copy.extend(link.findall("inertial")[:1])
        for name, joint in self.joints.items():
            copy = ET.SubElement(robot, "joint", name=name, type=joint.get("type", ""))
            for tag in ("parent", "child", "origin", "axis"):
                copy.extend(joint.findall(tag)[:1])
            if joint.get("type") != "fixed":
                given = joint.find("limit")
                ET.SubElement(copy, "limit", {"effort": "0", "velocity": "0"} | ({} if given is None else given.attrib))
        return ET.tostring(robot, encoding="unicode")


def _by_name(root: ET.Element, tag: str) -> dict[str, ET.Element]:
    found: dict[str, ET.Element] = {}
    for element in root.findall(tag):
        name = element.get("name", "")
        if not name:
            raise UrdfError(f"has a <{tag}> without a name")
        if name in found:
            raise UrdfError(f"has two {tag}s called {_quoted(name)}")
        found[name] = element
    return found


def _numbers(element: ET.Element, tag: str, entry: str, count: int, where: str) -> list[float]:
    """The numbers of an attribute, empty if it is not there."""
    child = element.find(tag)
    text = None if child is None else child.get(entry)
    if text is None:
        return []
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != count or not all(map(math.isfinite, values)):
        wanted = "a number" if count == 1 else f"{count} numbers"
        raise UrdfError(f"{where} has <{tag} {entry}={_quoted(text)}>: {wanted} is needed")
    return values


def _check_inertial(name: str, link: ET.Element) -> None:
    inertial, where = link.find("inertial"), f"link {_quoted(name)}"
    if inertial is None:
        return
    mass = _numbers(inertial, "mass", "value", 1, where)
    if not mass or mass[0] < 0:
        raise UrdfError(f"{where} has an <inertial> {'with a negative' if mass else 'without a'} mass")
    for entry in ("xyz", "rpy"):
        _numbers(inertial, "origin", entry, 3, where)
    moments = [_numbers(inertial, "inertia", entry, 1, where) for entry in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")]
    if not all(moments):
        raise UrdfError(f"{where} has a mass but no complete <inertia>: ixx, iyy, izz, ixy, ixz and iyz are needed")


def _quoted(text: str) -> str:
    return '"' + "".join(c if c.isprintable() else "?" for c in text[:60]) + '"'


def _some(names: Sequence[str]) -> str:
    """Names in a sentence, not too many of them."""
    shown = ", ".join(name[:60] for name in names[:24])
    return shown + (f" and {len(names) - 24} more" if len(names) > 24 else "") if names else "none"


# ---- the reduction -------------------------------------------------------------------------------------------


def _reduced(tree: _Tree, chain: Sequence[str], foot: str, locked: Mapping[str, float]) -> UrdfLeg:
    """The moving chain, everything else locked, by Pinocchio."""
    try:
        whole = pin.buildModelFromXML(tree.xml(), pin.JointModelFreeFlyer())
        fixed = [k for k in range(2, whole.njoints) if whole.names[k] not in chain]
        model = pin.buildReducedModel(whole, fixed, _reference(whole, locked))
    except (ValueError, RuntimeError) as error:
        raise UrdfError(f"cannot be read by Pinocchio: {str(error).splitlines()[0][:200]}") from None
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    order = [model.getJointId(name) for name in chain]
    places = [data.oMi[k].translation for k in order] + [data.oMf[model.getFrameId(foot)].translation]
    links = []
    for k, name, here, beyond in zip(order, chain, places, places[1:], strict=False):
        links.append(_moving_link(tree, model, data, k, name, beyond - here))
    return UrdfLeg(float(model.inertias[1].mass), tuple(links))


def _reference(model: pin.Model, locked: Mapping[str, float]) -> np.ndarray:
    """Configuration with every joint at its locked value, or as near to zero as its limits allow."""
    q = pin.neutral(model)
    for k in range(2, model.njoints):
        joint, name = model.joints[k], model.names[k]
        if joint.nq == 1:
            limits = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
            q[joint.idx_q] = locked.get(name, float(np.clip(0.0, *limits)) if limits[0] < limits[1] else 0.0)
        elif name in locked:
            q[joint.idx_q : joint.idx_q + 2] = math.cos(locked[name]), math.sin(locked[name])
    return q


def _moving_link(
    tree: _Tree, model: pin.Model, data: pin.Data, index: int, joint: str, vector: np.ndarray
) -> MovingLink:
    turn, inertia, link = data.oMi[index].rotation, model.inertias[index], tree.ends(joint)[1]
    if inertia.mass <= 0:
        raise UrdfError(f"link {_quoted(link)} has no <inertial>, but joint {_quoted(joint)} moves it")
    matrix = turn @ inertia.inertia @ turn.T
    low, middle, high = np.linalg.eigvalsh(matrix)
    if low <= 0 or high > (low + middle) * (1 + SLACK):
        raise UrdfError(
            f"link {_quoted(link)} has principal moments of inertia {low:.3g}, {middle:.3g}, {high:.3g} kg m^2, which no "
            "body has: each is positive and at most the sum of the others"
        )
    joint_data = model.joints[index].createData()
    model.joints[index].calc(joint_data, pin.neutral(model))
    limit, at = tree.joints[joint], model.joints[index].idx_v
    lower, upper = (next(iter(_numbers(limit, "limit", side, 1, joint)), math.nan) for side in ("lower", "upper"))
    if tree.joints[joint].get("type") == "continuous":
        lower = upper = math.nan
    return MovingLink(
        joint, link, _clean(turn @ np.asarray(joint_data.S).reshape(6)[3:]), _clean(vector), float(inertia.mass),
        _clean(turn @ inertia.lever), _clean([matrix[i, j] for i, j in PAIRS]), lower, upper,
        *(float(x) if 0 < x < 1e9 else math.nan for x in (model.effortLimit[at], model.velocityLimit[at])),
    )  # fmt: skip


def _clean(values: Iterator[float] | Sequence[float] | np.ndarray) -> tuple[float, ...]:
    """Floats, without what rotations leave of zeros and ones."""
    array = np.array(list(values), dtype=float)
    array[np.abs(array) < ROUND * max(1.0, float(np.abs(array).max()))] = 0.0
    whole = np.round(array)
    return tuple(float(x) for x in np.where(np.abs(array - whole) < ROUND, whole + 0.0, array))
