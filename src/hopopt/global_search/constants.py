"""A two-joint leg in stance by the absolute angles of its links: a handful of constants from which the equations of
motion follow in closed form.

phi1, phi2 [rad] are the angles of the links, positive forward, zero as they point at zero joint angles. Points are
complex numbers x + i z, with the foot at the origin. Where e1 and e2 are the links' ends at zero angles, the knee
stands at -e2 exp(i phi2) and the hip at -e2 exp(i phi2) - e1 exp(i phi1).
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from hopopt.design import Design
from hopopt.design.fields import TRUNK
from hopopt.drivetrain.gear import Gear
from hopopt.drivetrain.operating_region.half_planes import OperatingRegion
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.leg.geometry.above import height_rows
from hopopt.leg.geometry.smooth import clearances, least
from hopopt.leg.geometry.solids import BODY, counted_points
from hopopt.leg.kinematics import TwoJoints, start_angles
from hopopt.leg.robot import BASE, build_robot

UNLIMITED = 1e9  # friction coefficient of ground on which the foot never slips
TORQUE_LINES = 4  # that bound a torque on one side: two of a torque-speed law, two caps
NO_LINE = 1e9  # N m, rad/s: where nothing bounds it
DEEP = -1e3  # m: least height of a joint that may pass through the ground
ROOM_ANGLES = 121  # of each joint, at which it is known how far links are from what they pass


class StanceConstants(NamedTuple):
    """What the compiled functions need of a leg and its problem.

    m11, m22: mass matrix on the diagonal [kg m^2]
    coupling, coupling_across, rotor: m12 = coupling cos(d) - coupling_across sin(d) + rotor, d = phi2 - phi1 [kg m^2]
    first, first_across, second, second_across: first moments of mass, real and imaginary [kg m]
    mass: of the leg [kg]
    gravity: downward [m/s^2]
    thigh_x, thigh_z, shank_x, shank_z: ends of the links at zero angles [m]
    turn1, turn2: +1 where a positive joint angle swings the link forward, else -1
    most1, least1, most2, least2: lines of each drive, of which the strictest holds: the greatest (least) torque at
        joint speed w is [i, 0] + [i, 1] w (TORQUE_LINES, 2) [N m, N m s/rad]
    gear1, gear2: of each gear efficiency, friction [N m], damping [N m s/rad], the speed [rad/s] and the torque [N m] over
        which they change smoothly, and the reflected inertia in front of it [kg m^2], (6,)
    fastest1, fastest2: speeds beyond which a drive gives no torque [rad/s]
    friction: coefficient [1]
    least_force: vertical ground force at least [N]
    lower1, upper1, lower2, upper2: joint limits [rad]
    knee_least, hip_least: heights at least [m]
    trunk: lowest point of the body's shapes over the hip [m], 0 without any
    corners: of the thigh's shapes, x and z from the hip at zero angles (k, 2) [m]
    room: by how much links keep their distances, on ROOM_ANGLES of each joint over its limits [m]; empty where nothing is met
    descent: whether the body may descend
    springs, spring_...: as ``Springs.numbers`` has them
    """

    m11: float
    m22: float
    coupling: float
    coupling_across: float
    rotor: float
    first: float
    first_across: float
    second: float
    second_across: float
    mass: float
    gravity: float
    thigh_x: float
    thigh_z: float
    shank_x: float
    shank_z: float
    turn1: float
    turn2: float
    most1: np.ndarray
    least1: np.ndarray
    fastest1: float
    most2: np.ndarray
    least2: np.ndarray
    fastest2: float
    gear1: np.ndarray
    gear2: np.ndarray
    friction: float
    least_force: float
    lower1: float
    upper1: float
    lower2: float
    upper2: float
    knee_least: float
    hip_least: float
    trunk: float
    corners: np.ndarray
    room: np.ndarray
    descent: bool
    springs: int
    spring_level: np.ndarray
    spring_slope: np.ndarray
    spring_width: np.ndarray
    spring_coefficients: np.ndarray
    spring_knots: np.ndarray
    spring_bends: np.ndarray


def stance_constants(design: Design) -> StanceConstants:
    """The constants of a problem's leg; masses and inertias from the Pinocchio model."""
    robot, geometry = build_robot(design.leg), TwoJoints.of(design.leg)
    e1, e2 = geometry.ends
    inertias, rotors = robot.model.inertias, [float(a) for a in robot.model.armature[BASE:]]
    masses = np.array([inertias[BASE].mass, inertias[BASE + 1].mass, inertias[BASE + 2].mass])
    com1, com2 = (complex(inertias[k].lever[0], inertias[k].lever[2]) for k in (BASE + 1, BASE + 2))
    spin1, spin2 = (float(inertias[k].inertia[1, 1]) for k in (BASE + 1, BASE + 2))
    by_first = np.array([-e1, com1 - e1, 0])  # places of the three bodies: by_first exp(i phi1) + by_second exp(i phi2)
    by_second = np.array([-e2, -e2, com2 - e2])
    cross = complex(masses @ (by_first * by_second.conj()))
    first, second = complex(masses @ by_first), complex(masses @ by_second)
    joints = [design.leg.joint[name] for name in design.leg.joints]
    drives = [_drive(operating_region(design.leg, name, robot.parameters)) for name in design.leg.joints]
    laws = (Gear.of(design.leg, name, robot.parameters).level.entries for name in design.leg.joints)
    gears = [np.array([*law, rotor], dtype=float) for law, rotor in zip(laws, rotors, strict=True)]
    trunk, corners = _counted(design)
    rows = {point: height for _, point, height in height_rows(design)}
    hip_least, knee_least = (rows.get(name, DEEP) for name in design.leg.joints)
    hip_least = max(hip_least, rows[TRUNK] - trunk) if TRUNK in rows else hip_least
    friction = design.contact.friction
    return StanceConstants(
        float(masses @ np.abs(by_first) ** 2) + spin1 + rotors[0] + rotors[1],
        float(masses @ np.abs(by_second) ** 2) + spin2 + rotors[1],
        cross.real, cross.imag, -rotors[1],
        first.real, first.imag, second.real, second.imag,
        float(masses.sum()), -float(robot.model.gravity.linear[2]),
        e1.real, e1.imag, e2.real, e2.imag, float(geometry.signs[0]), float(geometry.signs[1]),
        *drives[0], *drives[1], gears[0], gears[1],
        UNLIMITED if friction is None else float(friction), float(design.contact.least_force),
        joints[0].lower, joints[0].upper, joints[1].lower, joints[1].upper, knee_least, hip_least,
        trunk, corners, _room(design), bool(design.hop.counter_movement), **robot.springs.numbers(2),
    )  # fmt: skip


def _counted(design: Design) -> tuple[float, np.ndarray]:
    """``trunk`` and ``corners`` as in ``StanceConstants``."""
    found = counted_points(design.leg)
    trunk = [place[2] for _, joint, place in found if joint == BODY]
    corners = [(place[0], place[2]) for _, joint, place in found if joint == 0]
    return float(trunk[0]) if trunk else 0.0, np.array(corners, dtype=float).reshape(-1, 2)


def _room(design: Design) -> np.ndarray:
    """``room`` as in ``StanceConstants``: what the planner's smooth distances (leg/geometry/smooth.py) leave beyond what it keeps."""
    found = clearances(design)
    if found is None or not found.links:
        return np.zeros((0, 0))
    poses = np.stack(np.meshgrid(*_room_angles(design), indexing="ij"), axis=-1).reshape(-1, 2)
    kept = zip(found.links, least(design, found), strict=True)
    left = [np.array(link.function(poses[:, link.angles].T)).ravel() - most for link, most in kept]
    return np.min(left, axis=0).reshape(ROOM_ANGLES, ROOM_ANGLES)


def _room_angles(design: Design) -> list[np.ndarray]:
    joints = [design.leg.joint[name] for name in design.leg.joints]
    return [np.linspace(joint.lower, joint.upper, ROOM_ANGLES) for joint in joints]


def room_at(c: StanceConstants, q: np.ndarray) -> np.ndarray:
    """``room`` at joint angles q (..., 2) [rad]; 0 where nothing is met [m]."""
    if not c.room.size:
        return np.zeros(q.shape[:-1])
    low, high = np.array([c.lower1, c.lower2]), np.array([c.upper1, c.upper2])
    axes = tuple(np.linspace(low, high, ROOM_ANGLES).T)
    return RegularGridInterpolator(axes, c.room)(np.clip(q, low, high))


def _drive(region: OperatingRegion) -> tuple[np.ndarray, np.ndarray, float]:
    """Lines of the greatest and of the least torque, and the fastest speed, as in ``StanceConstants``."""
    planes = [(float(h.a), float(h.b)) for h in region.planes]
    most, least = np.tile([NO_LINE, 0.0], (TORQUE_LINES, 1)), np.tile([-NO_LINE, 0.0], (TORQUE_LINES, 1))
    for lines, side in ((most, 1), (least, -1)):
        caps = [1 / a for a, b in planes if a * side > 0 and b == 0]
        mine = [(1 / a, -b / a) for a, b in planes if a * side > 0 and b != 0]
        mine += [(min(caps, key=abs), 0.0)] if caps else []
        lines[: len(mine)] = mine
    return most, least, min([1 / abs(b) for a, b in planes if a == 0], default=NO_LINE)


def to_link_angles(constants: StanceConstants, q: np.ndarray) -> np.ndarray:
    """Absolute angles of the links for joint angles q (..., 2) [rad]; rates and accelerations alike."""
    first = constants.turn1 * q[..., 0]
    return np.stack([first, first + constants.turn2 * q[..., 1]], axis=-1)


def to_joint_angles(constants: StanceConstants, phi: np.ndarray) -> np.ndarray:
    """Joint angles for absolute angles of the links phi (..., 2) [rad]; rates and accelerations alike."""
    return np.stack([constants.turn1 * phi[..., 0], constants.turn2 * (phi[..., 1] - phi[..., 0])], axis=-1)


def start_state(constants: StanceConstants, design: Design) -> np.ndarray:
    """Link angles [rad] and rates [rad/s] at the start, (4,)."""
    return np.concatenate([to_link_angles(constants, start_angles(design)), np.zeros(2)])
