"""How a leg looks by its URDF: meshes and simple bodies, each placed in the frame of the joint that moves it."""

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote, urlparse

import numpy as np
import pinocchio as pin

from hopopt.leg.files.urdf import link_frame, reduced_model
from hopopt.leg.files.urdf_mimic import moving_chain
from hopopt.leg.files.urdf_xml import Tree, UrdfError, decimals, quoted, root_of

LARGEST = 1e3  # m or rad, of any number
BODY = -1  # the joint of what does not move with any
SIZES = {"box": ("size", 3), "cylinder": ("radius length", 1), "sphere": ("radius", 1)}  # attributes, numbers in each


@dataclass(frozen=True)
class Visual:
    """A mesh, or a simple body, of a leg.

    link: of the URDF. joint: number of the joint that moves it, from the body down, or BODY.
    own: whether it is of the very link that the joint moves, or of a link from the root to the first joint; of what collides
    also of what fixed joints hang on these. Else it is of what is fixed to a moving link, or of another limb.
    rotation (3, 3), position (3) [m]: in the joint's frame, whose axes are the robot's with all angles zero; of the
    body from the first joint.
    file: the mesh where it lies on disk; None of a simple body, or of a mesh that is not there; named: what the URDF calls it.
    shape: "mesh", "box", "cylinder" or "sphere". size: of a mesh its scale (3), else its measures [m].
    """

    link: str
    joint: int
    own: bool
    rotation: np.ndarray
    position: np.ndarray
    file: Path | None
    shape: str
    size: tuple[float, ...]
    named: str = ""


def visuals(
    raw: bytes,
    folder: Path,
    joints: Sequence[str],
    foot: str,
    locked: Mapping[str, float],
    what: str = "visual",
    within: Path | None = None,
) -> list[Visual]:
    """How the moving links look, what is fixed to them, and the links from the root to the first joint; no other limbs.

    raw: the URDF. folder: where it lies, for its meshes. joints, foot, locked: as ``read_leg`` takes them.
    what: "visual", or "collision" for what collides, of all limbs: what cannot be read then is refused, not left out. What
    stands beyond a joint on which the body slides or floats is no part of the robot then: a test stand, a floor.
    within: the folder in which meshes have to lie, if they have to.
    Raises UrdfError.
    """
    tree = Tree(root_of(raw))
    chain = list(moving_chain(tree, foot, joints))
    model = reduced_model(tree, chain, locked)
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    order = [model.getJointId(name) for name in chain]
    hip, found = data.oMi[order[0]].translation, list[Visual]()
    above, robot = set(_links_above(tree, chain[0])), set(tree.links)
    if what == "collision":
        held = list(_held(tree, chain[0], locked))
        above = _fixed_to(tree, set(_without_world(tree, held))) | set(held)
        robot = {name for name in robot if name in held or held[-1] in _links_over(tree, name)}
    for name, link in tree.links.items():
        if name not in robot:
            continue
        frame = model.frames[link_frame(model, name)]
        joint = order.index(frame.parentJoint) if frame.parentJoint in order else BODY
        if joint == BODY and name not in above and what == "visual":
            continue
        turn = data.oMi[frame.parentJoint].rotation
        rotation, position = turn @ frame.placement.rotation, turn @ frame.placement.translation
        if joint == BODY:
            position = data.oMf[link_frame(model, name)].translation - hip
        for visual in link.iter(what):
            where = f"link {quoted(name)} has a <{what}> that" if what == "collision" else ""
            shape = _shape(visual, where)
            if shape is not None:
                origin = visual.find("origin")
                spin, shift = (_numbers(origin, entry, 3, 0.0, where) for entry in ("rpy", "xyz"))
                own = pin.rpy.rpyToMatrix(*spin)
                place = rotation @ own, position + rotation @ np.array(shift)
                itself = name in above if joint == BODY else name == tree.ends(chain[joint])[1]
                found.append(Visual(name, joint, itself, *place, _file(shape[-1], folder, within), *shape))
    return found


def _fixed_to(tree: Tree, links: set[str]) -> set[str]:
    """These links and what fixed joints hang on them."""
    found = set(links)
    fixed = [tree.ends(name) for name, joint in tree.joints.items() if joint.get("type") == "fixed"]
    while more := {child for parent, child in fixed if parent in found} - found:
        found |= more
    return found


def _held(tree: Tree, joint: str, locked: Mapping[str, float]) -> Iterator[str]:
    """The links from a joint up to the root, or to the last below a joint on which the robot slides or floats."""
    for link in _links_above(tree, joint):
        yield link
        over = tree.above.get(link)
        if over and over not in locked and tree.joints[over].get("type") in ("prismatic", "floating"):
            return


def _without_world(tree: Tree, held: Sequence[str]) -> Sequence[str]:
    """These links without a root of no mass to which the next is fixed, with all that moves: a world, on which hangs what is no
    body."""
    *others, last = held
    mass = tree.links[last].find("inertial/mass")
    if not others or last in tree.above or (mass is not None and float(mass.get("value", "0")) > 0):
        return held
    moved = [tree.ends(name)[1] for name in tree.movable]
    fixed = tree.joints[tree.above[others[-1]]].get("type") == "fixed"
    return others if fixed and all(others[-1] in _links_over(tree, link) for link in moved) else held


def _links_above(tree: Tree, joint: str) -> Iterator[str]:
    """The links from a joint up to the root."""
    link = tree.ends(joint)[0]
    yield link
    yield from _links_over(tree, link)


def _links_over(tree: Tree, link: str) -> Iterator[str]:
    """The links above a link up to the root."""
    while link in tree.above:
        link = tree.ends(tree.above[link])[0]
        yield link


def _shape(visual: ET.Element, where: str) -> tuple[str, tuple[float, ...], str] | None:
    """Shape, size and file's name of a visual; None if it has none that is known, or UrdfError that begins with ``where``."""
    mesh = visual.find("geometry/mesh")
    if mesh is not None:
        return "mesh", _numbers(mesh, "scale", 3, 1.0, where), mesh.get("filename", "")
    for shape, (entries, count) in SIZES.items():
        simple = visual.find(f"geometry/{shape}")
        if simple is not None:
            size = tuple(x for entry in entries.split() for x in _numbers(simple, entry, count, 0.0, where))
            if where and min(size) <= 0:
                raise UrdfError(f"{where} is a {shape} with {entries} = {size}: numbers above zero are needed")
            return (shape, size, "") if min(size) > 0 else None
    if where:
        kinds = [f"<{child.tag[:40]}>" for child in visual.findall("geometry/*")]
        raise UrdfError(
            f"{where} is {' and '.join(kinds) or 'empty'}: hopopt reads <mesh>, <box>, <cylinder> and <sphere>"
        )
    return None


def _numbers(element: ET.Element | None, entry: str, count: int, other: float, where: str) -> tuple[float, ...]:
    """The finite numbers of an attribute, or as many others where it is not there; or where it holds none: looks matter to no
    answer, so that nothing is refused. Of what matters, ``where`` it is, UrdfError."""
    text = "" if element is None else element.get(entry, "")
    if where and text:
        return tuple(decimals(text, count, f"{where} has {entry}={quoted(text)}", LARGEST))
    try:
        values = tuple(float(word) for word in text.split())
    except ValueError:
        values = ()
    return values if len(values) == count and np.isfinite(values).all() else (other,) * count


def _file(name: str, folder: Path, within: Path | None) -> Path | None:
    """The mesh that a URDF names, on disk: a package is looked for in the folders above the URDF. None where there is none, or
    none ``within`` a folder."""
    if not name:
        return None
    url = urlparse(name)
    if url.scheme not in ("package", "file", "model", ""):
        return None
    inside = unquote(f"{url.netloc}{url.path}") if url.scheme in ("package", "model") else unquote(url.path)
    places = [folder / inside]
    if url.scheme in ("package", "model"):
        homes = [folder, *folder.resolve().parents]
        places = [home / inside for home in homes] + [home / unquote(url.path).lstrip("/") for home in homes]
    try:
        return next((place for place in places if place.is_file() and _lies(place, within)), None)
    except (OSError, ValueError, RuntimeError):  # no name of a file, a loop of links
        return None


def _lies(place: Path, within: Path | None) -> bool:
    """Whether a file lies in a folder, links followed."""
    return within is None or place.resolve().is_relative_to(within.resolve())
