"""What follows from a leg's entries before anything is solved: weight, what its drives give at the joints, what they carry."""

from dataclasses import dataclass

import numpy as np

from hopopt.design import Design
from hopopt.drivetrain.motor import reflected_inertia
from hopopt.drivetrain.operating_region.half_planes import OperatingRegion
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.leg.kinematics import foot_jacobian, reach, start_angles
from hopopt.leg.robot import BASE, Robot, build_robot
from hopopt.leg.scales import time_scale, weight

UP = 2  # world axis z
MOVED = 1e-9  # m/rad: a joint that lifts the foot by less carries none of the ground force
ROUNDING = 1e-9  # share of a limit


@dataclass(frozen=True)
class JointFigures:
    """What one joint's drive gives at the joint, and what it has to move.

    name: of the joint
    stall_torque: largest torque at standstill, caps counted [N m]
    no_load_speed: speed at which no torque is left, caps counted [rad/s]
    peak_power: largest product of torque and speed within the operating region [W]
    rotor_inertia: of rotor and gear, reflected to the joint [kg m^2]
    link_inertia: of all links beyond the joint about its axis in the start pose, without rotors [kg m^2]
    holding_torque: that keeps the start pose on the ground [N m]
    """

    name: str
    stall_torque: float
    no_load_speed: float
    peak_power: float
    rotor_inertia: float
    link_inertia: float
    holding_torque: float


@dataclass(frozen=True)
class LegFigures:
    """What follows from the entries of a problem.

    mass: of all that moves [kg]
    weight: of it [N]
    reach: length of the stretched leg [m]
    time: sqrt(reach / gravity), in which legs of any size are alike [s]
    push: largest vertical ground force that the stall torques hold in the start pose [weights]; None if no
        joint lifts the foot
    joints: figures of each, from the body to the foot
    """

    mass: float
    weight: float
    reach: float
    time: float
    push: float | None
    joints: tuple[JointFigures, ...]


def derived(design: Design) -> LegFigures:
    """What follows from a problem's entries; UsageError if it has no start pose."""
    robot, angles = build_robot(design.leg), start_angles(design)
    heavy, length = weight(robot.model), reach(design.leg)
    model, q = robot.model, np.concatenate([np.zeros(BASE), angles])
    lifts = foot_jacobian(design.leg, angles)[UP]
    rotors = robot.turning.inertia(angles) if robot.turning else np.diag(robot.rotors)
    links = np.diag(robot.mass_matrix(q)[BASE:, BASE:] - rotors)
    held = robot.forces_at_rest(q)[BASE:] - lifts * heavy
    lifts, held = (robot.drive_torques(q, each) for each in (lifts, held))
    spun = [reflected_inertia(design.leg, name, robot.parameters) for name in robot.joints]
    joints = tuple(
        JointFigures(name, *_drive(robot, name), float(rotor), float(link), float(torque))
        for name, rotor, link, torque in zip(robot.joints, spun, links, held, strict=True)
    )
    pushes = [j.stall_torque / abs(by) for j, by in zip(joints, lifts, strict=True) if abs(by) > MOVED]
    return LegFigures(
        mass=float(sum(i.mass for i in model.inertias)),
        weight=heavy,
        reach=length,
        time=time_scale(model, length),
        push=min(pushes) / heavy if pushes else None,
        joints=joints,
    )


def effort_limit(region: OperatingRegion) -> float:
    """Largest joint torque at standstill [N m]."""
    return float(region.torque_bounds(0.0)[1])


def velocity_limit(region: OperatingRegion) -> float:
    """Largest joint speed at which no half-plane is left without torque [rad/s]."""
    return 1 / max(float(h.b) for h in region.planes)


def _drive(robot: Robot, joint: str) -> tuple[float, float, float]:
    """Torque at standstill [N m], speed without torque [rad/s] and most power [W] of a joint's drive."""
    region = operating_region(robot.leg, joint, robot.parameters)
    return effort_limit(region), velocity_limit(region), _peak_power(region)


def _peak_power(region: OperatingRegion) -> float:
    """On one line of the region most power is given at half of its torque and speed, or else at a corner [W]."""
    halves = [(0.5 / float(h.b), 0.5 / float(h.a)) for h in region.planes if h.a > 0 and h.b > 0]
    inside = [(w, tau) for w, tau in halves if max(region.use(w, tau)) <= 1 + ROUNDING]
    most = max(float(w * tau) for w, tau in [*inside, *region.corners()])
    return most if region.power is None else min(most, float(region.power))
