"""An MJCF in the words of a URDF: MuJoCo's model of a robot as links and joints, and what a URDF has no place for.

Nothing but numbers is read from the file: no meshes, no other files. The tree that comes of it is checked and read like any
URDF (leg/files/urdf.py). Angles count from the pose that the file draws.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
import pinocchio as pin

from hopopt.leg.files.mjcf_xml import FLAT, LARGEST, Compiler, Defaults, Placement, numbers
from hopopt.leg.files.urdf_xml import UrdfError, decimals, quoted, root_of
from hopopt.leg.inertia import PAIRS

WORLD = "world"  # link that the robot hangs on
KINDS = {"hinge": "revolute", "slide": "prismatic", "free": "floating", "ball": "fixed"}
FORCE_BY_DEFAULT = {"dyntype": "none", "gaintype": "fixed", "biastype": "none"}  # of <general>: its control is a force
NOT_READ = (
    "include",
    "replicate",
    "composite",
    "flexcomp",
    "attach",
)  # of the bodies: what only MuJoCo itself resolves


@dataclass(frozen=True)
class Drive:
    """What an MJCF says of a joint's drive and a URDF cannot: reflected rotor inertia armature [kg m^2], Coulomb friction
    [N m] and viscous friction damping [N m s/rad]."""

    armature: float = 0.0
    friction: float = 0.0
    damping: float = 0.0

    def beside(self, other: "Drive", turns: float) -> "Drive":
        """With what another joint has that turns so often for one turn of this one."""
        inertia, damping = (
            x + turns**2 * y for x, y in ((self.armature, other.armature), (self.damping, other.damping))
        )
        return Drive(inertia, self.friction + turns * other.friction, damping)


BARE = Drive()
STRAIGHT = (0.0, 1.0, 0.0, 0.0, 0.0)  # MuJoCo's polycoef of a joint that follows another one where it says nothing


def read_mjcf(raw: bytes, joints: Sequence[str]) -> tuple[ET.Element, dict[str, Drive]]:
    """The robot that has a leg of these ``joints``, as the <robot> of a URDF, and drives of its joints by name. Raises
    UrdfError."""
    root = root_of(raw, "mujoco", "MJCF")
    for element in root.iter():
        if element.tag in NOT_READ:
            raise UrdfError(f"has <{element.tag}>, which leads elsewhere: {FLAT}")
    made = _Robot(root, joints)
    made.add()
    for rod, mimic in made.coupled():
        if rod in made.joints:
            ET.SubElement(made.joints[rod], "mimic", mimic)
    made.refuse_loops(joints[0])
    return made.urdf, made.drives


class _Robot:
    """A URDF in the making."""

    def __init__(self, root: ET.Element, chain: Sequence[str]):
        self.root, self.chain, self.defaults, self.compiler = root, chain, Defaults.of(root), Compiler.of(root)
        self.urdf, self.drives = ET.Element("robot", name="mjcf"), dict[str, Drive]()
        self.joints: dict[str, ET.Element] = {}
        self.above: dict[str, str] = {}  # link -> link
        self.efforts = self._efforts()
        self._link(WORLD)

    def add(self) -> None:
        """The robot's bodies with all within them, and the sites whose names no body has."""
        todo = [(body, WORLD, at, kind) for body, at, kind in reversed(self._tops())]
        sites = list[tuple[ET.Element, str, Placement, str]]()
        while todo:
            body, parent, frame, inherited = todo.pop()
            inherited = body.get("childclass", inherited)
            name, where = self._named(body), f"body {quoted(body.get('name', ''))}"
            inside = list(self._inside(body, inherited))
            self._hang(parent, name, frame * self.compiler.placement(body.attrib, where), inside, where)
            self._link(name, self._inertial(body, inside, where))
            sites += [(e, name, at, kind) for e, at, kind in inside if e.tag == "site"]
            todo += [(e, name, at, kind) for e, at, kind in reversed(inside) if e.tag == "body"]
        for element, body, at, kind in sites:
            if (site := element.get("name")) and site not in self.above:
                given, where = self.defaults.attributes(element, kind), f"site {quoted(site)}"
                self._link(site)
                self._joint(where, "fixed", body, site, at * self.compiler.placement(given, where))

    def _tops(self) -> list[tuple[ET.Element, Placement, str]]:
        """The bodies of the world, or only that one which has the leg: what else lies about is no part of the robot."""
        of_world = (item for world in self.root.findall("worldbody") for item in self._inside(world, "main"))
        bodies = [item for item in of_world if item[0].tag == "body"]
        mine = [item for item in bodies if any(j.get("name") == self.chain[0] for j in item[0].iter("joint"))]
        return mine[:1] or bodies

    def _inside(self, body: ET.Element, inherited: str) -> Iterator[tuple[ET.Element, Placement, str]]:
        """What lies in a body, with where its frames put it and the class it inherits."""
        todo = [(child, Placement.Identity(), inherited) for child in reversed(body)]
        while todo:
            element, at, kind = todo.pop()
            if element.tag != "frame":
                yield element, at, kind
                continue
            there = at * self.compiler.placement(element.attrib, "a <frame>")
            todo += [(child, there, element.get("childclass", kind)) for child in reversed(element)]

    def _hang(
        self, parent: str, name: str, place: Placement, inside: list[tuple[ET.Element, Placement, str]], where: str
    ) -> None:
        """The joints between two bodies, in a row; a joint beside the body's origin moves a link of its own."""
        moving = [(e, kind) for e, _, kind in inside if e.tag in ("joint", "freejoint")]
        for k, (element, inherited) in enumerate(moving):
            given = (
                self.defaults.attributes(element, inherited)
                if element.tag == "joint"
                else {"type": "free", **element.attrib}
            )
            own = given.get("name") or f"joint {k + 1} of {name}"
            at = np.array(numbers(given, "pos", f"joint {quoted(own)}", 3) or [0.0] * 3)
            last = k == len(moving) - 1 and not at.any()
            link = name if last else f"{name} at {own}"
            self._moving(own, given, parent, link, place * Placement(np.eye(3), at))
            if last:
                return
            self._link(link)
            parent, place = link, Placement(np.eye(3), -at)
        self._joint(f"fixed {name}", "fixed", parent, name, place)

    def _moving(self, name: str, given: Mapping[str, str], parent: str, child: str, place: Placement) -> None:
        """A joint that moves, with its limits and what its drive has."""
        kind, where = given.get("type", "hinge"), f"joint {quoted(name)}"
        if kind not in KINDS:
            raise UrdfError(f"{where} is of type {quoted(kind)}: hopopt reads {', '.join(KINDS)}")
        if any(numbers(given, "ref", where)):
            raise UrdfError(
                f"{where} has ref = {given['ref'][:20]}: hopopt counts angles from the pose that the file draws: {FLAT}"
            )
        made = self._joint(name, KINDS[kind], parent, child, place)
        if kind not in ("hinge", "slide"):
            return
        ET.SubElement(made, "axis", xyz=_text(numbers(given, "axis", where, 3) or [0.0, 0.0, 1.0]))
        lower, upper = self.compiler.limits(given, "range", where, "limited")
        unit, limit = self.compiler.unit if kind == "hinge" else 1.0, dict[str, str]()
        if lower > -inf:
            limit = {"lower": repr(unit * lower), "upper": repr(unit * upper)}
        elif kind == "hinge":
            made.set("type", "continuous")
        forces = self.compiler.limits(given, "actuatorfrcrange", where, "actuatorfrclimited")
        if (effort := min(_least(forces), self.efforts.get(name, inf))) < inf:
            limit["effort"] = repr(effort)
        ET.SubElement(made, "limit", limit)
        losses = (next(iter(numbers(given, key, where)), 0.0) for key in ("armature", "frictionloss", "damping"))
        self.drives[name] = Drive(*losses)
        if name in self.chain and any(numbers(given, "stiffness", where)):
            raise UrdfError(
                f"{where} has a spring (stiffness = {given['stiffness'][:20]}), which a leg of hopopt has not: take it out"
            )

    def _efforts(self) -> dict[str, float]:
        """The greatest force that each joint's actuators give at the joint, the least where several drive it."""
        found = dict[str, float]()
        for element in self.root.findall("actuator/*"):
            given = self.defaults.attributes(element, "main")
            joint, where = given.get("joint") or given.get("jointinparent"), f"actuator {quoted(given.get('name', ''))}"
            if not joint:
                continue
            force = _least(self.compiler.limits(given, "forcerange", where, "forcelimited"))
            if gain := _gain(element.tag, given, where):
                force = min(force, gain * _least(self.compiler.limits(given, "ctrlrange", where, "ctrllimited")))
            (gear,) = decimals(" ".join(given.get("gear", "1").split()[:1]), 1, f"{where} has a gear", LARGEST)
            found[joint] = min(found.get(joint, inf), abs(gear) * force)
        return found

    def _inertial(
        self, body: ET.Element, inside: list[tuple[ET.Element, Placement, str]], where: str
    ) -> ET.Element | None:
        """What a body weighs, its axes those of the body."""
        element = body.find("inertial")
        if element is None:
            if any(e.tag == "geom" and self._weighs(self.defaults.attributes(e, kind)) for e, _, kind in inside):
                raise UrdfError(
                    f"{where} has geoms that weigh something and no <inertial>: give it one, with its mass and inertia"
                )
            return None
        at, mass = self.compiler.placement(element.attrib, where), numbers(element.attrib, "mass", where)
        moments = numbers(element.attrib, "diaginertia", where, 3) or numbers(element.attrib, "fullinertia", where, 6)
        if not mass or mass[0] < 0 or not moments:
            raise UrdfError(f"{where} has an <inertial> without a mass, or without diaginertia or fullinertia")
        matrix = np.diag(moments[:3])
        for (i, j), value in zip(PAIRS[3:], moments[3:], strict=False):
            matrix[i, j] = matrix[j, i] = value
        turned = at.rotation @ matrix @ at.rotation.T
        made = ET.Element("inertial")
        ET.SubElement(made, "origin", xyz=_text(at.translation), rpy="0 0 0")
        ET.SubElement(made, "mass", value=repr(mass[0]))
        ET.SubElement(made, "inertia", {f"i{'xyz'[i]}{'xyz'[j]}": repr(float(turned[i, j])) for i, j in PAIRS})
        return made

    @staticmethod
    def _weighs(geom: Mapping[str, str]) -> bool:
        """Whether a geom has a mass."""
        if "mass" in geom:
            return any(numbers(geom, "mass", "a geom"))
        return any(numbers(geom, "density", "a geom") or [1.0])

    def coupled(self) -> Iterator[tuple[str, dict[str, str]]]:
        """Joints that an equality lets follow another one, and how; UrdfError where that is no straight line."""
        tied = dict[str, tuple[str, ...]]()
        for element in self.root.findall("equality/joint"):
            rod, other = element.get("joint1", ""), element.get("joint2", "")
            if element.get("active") == "false" or not other:
                continue
            text = element.get("polycoef", "0")
            count = min(max(len(text.split()), 1), len(STRAIGHT))
            given = decimals(text, count, f"joint {quoted(rod)} has polycoef={quoted(text)}", LARGEST)
            offset, ratio, *bent = [*given, *STRAIGHT[len(given) :]]
            of_leg, before = {*self.chain}, tied.get(rod, ())
            tied[rod] = (*before, other)
            follows = f"joint {quoted(rod)} follows {quoted(other)}"
            if any(bent) and {rod, other} & of_leg:
                raise UrdfError(f"{follows} along a curve: polycoef has two numbers at most")
            if not ratio and {rod, other} & of_leg:
                raise UrdfError(
                    f"{follows} by polycoef={quoted(text)}, which holds it still: take its equality out, and lock it by leg.locked"
                )
            if before and {rod, *tied[rod]} & of_leg:
                raise UrdfError(f"{follows}, and another equality says how it moves too: keep one of them")
            yield rod, {"joint": other, "multiplier": repr(ratio), "offset": repr(offset)}

    def refuse_loops(self, joint: str) -> None:
        """UrdfError where an equality closes a loop through what a joint moves."""
        for element in [*self.root.findall("equality/connect"), *self.root.findall("equality/weld")]:
            ends = [element.get(key, "") for key in ("body1", "body2", "site1", "site2")]
            if element.get("active") != "false" and any(joint in self._joints_above(end) for end in ends):
                named = " and ".join(quoted(end) for end in ends if end)
                raise UrdfError(
                    f"closes a loop in the leg by <{element.tag}> of {named}, which a chain of joints has not"
                )

    def _joints_above(self, link: str) -> Iterator[str]:
        by_child = {joint.find("child").get("link"): name for name, joint in self.joints.items()}  # type: ignore[union-attr]
        while link in self.above:
            yield by_child[link]
            link = self.above[link]

    def _named(self, body: ET.Element) -> str:
        name = body.get("name") or f"body {len(self.above) + 1}"
        if name in self.above or name == WORLD:
            raise UrdfError(f"has two bodies called {quoted(name)}, or one called world")
        return name

    def _link(self, name: str, inertial: ET.Element | None = None) -> None:
        made = ET.SubElement(self.urdf, "link", name=name)
        if inertial is not None:
            made.append(inertial)

    def _joint(self, name: str, kind: str, parent: str, child: str, place: Placement) -> ET.Element:
        made = ET.SubElement(self.urdf, "joint", name=name, type=kind)
        ET.SubElement(made, "parent", link=parent)
        ET.SubElement(made, "child", link=child)
        ET.SubElement(made, "origin", xyz=_text(place.translation), rpy=_text(pin.rpy.matrixToRpy(place.rotation)))
        self.joints[name], self.above[child] = made, parent
        return made


def _gain(tag: str, given: Mapping[str, str], where: str) -> float:
    """The force of an actuator for each unit of its control, where that is a force; 0 where it is something else."""
    if tag == "motor":
        return 1.0
    if tag != "general" or any(given.get(key, usual) != usual for key, usual in FORCE_BY_DEFAULT.items()):
        return 0.0
    (gain,) = decimals(" ".join(given.get("gainprm", "1").split()[:1]), 1, f"{where} has a gainprm", LARGEST)
    return abs(gain)


def _least(limits: tuple[float, float]) -> float:
    """What a range allows either way; infinite where it allows nothing one way, as for a muscle."""
    return min(map(abs, limits)) or inf


def _text(values: list[float] | np.ndarray) -> str:
    return " ".join(repr(float(x)) for x in values)
