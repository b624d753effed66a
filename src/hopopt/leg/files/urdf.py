"""A leg out of a URDF or an MJCF: the file checked as data, then reduced with Pinocchio to the joints that move.

Everything between the body and the first joint that moves, and all other limbs, becomes the body: on guides it only
translates, so nothing but its mass enters the motion. What is locked below a joint becomes part of that joint's link.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from hopopt.leg.files.mjcf import BARE, Drive, read_mjcf
from hopopt.leg.files.urdf_mimic import Mimic, moving_chain
from hopopt.leg.files.urdf_transmission import DIRECT, Gearing, gearings
from hopopt.leg.files.urdf_xml import Tree, UrdfError, link_in_xml, numbers, quoted, root_of
from hopopt.leg.inertia import PAIRS, obeys_triangle, principal_moments

FREE_BASE = (
    "free base of the robot"  # the joint that Pinocchio puts above the root; "root_joint", its own name, may be in use
)
ROTATION_ROUNDING = 1e-10  # what rotations by a rounded half turn leave of a zero


@dataclass(frozen=True)
class MovingLink:
    """What moves with one joint, all joint angles zero, axes parallel to the robot's: unit axis of the joint (3),
    vector (3) [m] to the next joint or the foot, mass [kg], com (3) [m] from the joint, inertia (xx, yy, zz, xy, xz,
    yz) [kg m^2] about it; limits lower, upper [rad], effort [N m], velocity [rad/s] (nan: not given); whether the joint is
    continuous, which has no lower and upper; what else an MJCF says of its drive; whether the joint slides (then m, N, m/s); what it
    follows in place of a drive; how its actuator turns."""

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
    continuous: bool
    drive: Drive = BARE
    slides: bool = False
    follows: Mimic | None = None
    gearing: Gearing = DIRECT


@dataclass(frozen=True)
class UrdfLeg:
    """A chain of moving links from the body, of mass body_mass [kg], to the foot."""

    body_mass: float
    links: tuple[MovingLink, ...]


def read_leg(
    raw: bytes,
    joints: Sequence[str],
    foot: str,
    locked: Mapping[str, float],
    point: Sequence[float] = (0.0, 0.0, 0.0),
    kind: str = "urdf",
) -> UrdfLeg:
    """The chain of ``joints`` down to the ``point`` (3) [m] in the frame of the link ``foot`` (of an MJCF, a body or a site);
    every other joint is locked at ``locked`` [rad, m], or at zero or its limit nearest to zero. kind: urdf or mjcf. Raises
    UrdfError."""
    root, drives = read_mjcf(raw, joints) if kind == "mjcf" else (root_of(raw), {})
    tree = Tree(root)
    chain, gears = moving_chain(tree, foot, joints), gearings(root, joints)
    for name in locked:
        tree.known(name, "locked", [j for j in tree.movable if j not in chain])
    leg = _reduced(tree, list(chain), foot, np.array(point), locked)
    links = [replace(x, follows=chain[x.joint], gearing=gears.get(x.joint, DIRECT)) for x in leg.links]
    return replace(leg, links=tuple(replace(x, drive=_all_driven(x, links, drives)) for x in links))


def _all_driven(link: MovingLink, links: Sequence[MovingLink], drives: Mapping[str, Drive]) -> Drive:
    """What a joint's drive has besides torque and speed: its own, and what the file gives to the joints that follow it."""
    found = drives.get(link.joint, BARE)
    for other in links:
        if other.follows is not None and other.follows.joint == link.joint:
            found = found.beside(drives.get(other.joint, BARE), abs(other.follows.ratio))
    return found


def _reduced(tree: Tree, chain: Sequence[str], foot: str, point: np.ndarray, locked: Mapping[str, float]) -> UrdfLeg:
    """The moving chain, everything else locked, by Pinocchio."""
    model = reduced_model(tree, chain, locked)
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    order = [model.getJointId(name) for name in chain]
    positions = [data.oMi[k].translation for k in order] + [data.oMf[link_frame(model, foot)].act(point)]
    links = []
    for k, name, here, beyond in zip(order, chain, positions, positions[1:], strict=False):
        links.append(_moving_link(tree, model, data, k, name, beyond - here))
    return UrdfLeg(float(model.inertias[1].mass), tuple(links))


def reduced_model(tree: Tree, chain: Sequence[str], locked: Mapping[str, float]) -> pin.Model:
    """The whole robot on a free base with all joints locked but those of the chain; UrdfError if Pinocchio cannot read it."""
    try:
        whole = pin.buildModelFromXML(tree.xml(), pin.JointModelFreeFlyer(), FREE_BASE)
        fixed = [k for k in range(2, whole.njoints) if whole.names[k] not in chain]
        return pin.buildReducedModel(whole, fixed, _reference(whole, locked))
    except (ValueError, RuntimeError) as error:
        raise UrdfError(f"cannot be read by Pinocchio: {str(error).splitlines()[0][:200]}") from None


def link_frame(model: pin.Model, link: str) -> int:
    """Index of the frame of a link."""
    return model.getFrameId(link_in_xml(link))


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
    tree: Tree, model: pin.Model, data: pin.Data, index: int, joint: str, vector: np.ndarray
) -> MovingLink:
    turn, inertia, link = data.oMi[index].rotation, model.inertias[index], tree.ends(joint)[1]
    if inertia.mass <= 0:
        raise UrdfError(f"link {quoted(link)} has no <inertial>, but joint {quoted(joint)} moves it")
    matrix = turn @ inertia.inertia @ turn.T
    moments = _clean([matrix[i, j] for i, j in PAIRS])
    low, middle, high = principal_moments(moments)
    if low <= 0 or not obeys_triangle(low, middle, high):
        raise UrdfError(
            f"link {quoted(link)} has principal moments of inertia {low:.3g}, {middle:.3g}, {high:.3g} kg m^2, which no "
            "body has: each is positive and at most the sum of the others"
        )
    joint_data = model.joints[index].createData()
    model.joints[index].calc(joint_data, pin.neutral(model))
    limit, at, slides = tree.joints[joint], model.joints[index].idx_v, tree.joints[joint].get("type") == "prismatic"
    axis = np.asarray(joint_data.S).reshape(6)[:3] if slides else np.asarray(joint_data.S).reshape(6)[3:]
    lower, upper = (next(iter(numbers(limit, "limit", side, 1, joint)), math.nan) for side in ("lower", "upper"))
    if continuous := tree.joints[joint].get("type") == "continuous":
        lower = upper = math.nan
    return MovingLink(
        joint, link, _clean(turn @ axis), _clean(vector), float(inertia.mass),
        _clean(turn @ inertia.lever), moments, lower, upper,
        *(float(x) if 0 < x < 1e9 else math.nan for x in (model.effortLimit[at], model.velocityLimit[at])),
        continuous=continuous, slides=slides,
    )  # fmt: skip


def _clean(values: Iterator[float] | Sequence[float] | np.ndarray) -> tuple[float, ...]:
    """Floats, without what rotations leave of zeros and ones."""
    array = np.array(list(values), dtype=float)
    array[np.abs(array) < ROTATION_ROUNDING * max(1.0, float(np.abs(array).max()))] = 0.0
    whole = np.round(array)
    return tuple(float(x) for x in np.where(np.abs(array - whole) < ROTATION_ROUNDING, whole + 0.0, array))
