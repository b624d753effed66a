"""Whether a leg can move, and stand, where its hop starts: the one is asked before anything is solved, the other of a leg
for which no hop was found (a leg that cannot stand may still hop: it falls into a pose in which it is stronger)."""

import numpy as np
import pinocchio as pin

from hopopt.design import Design, Leg
from hopopt.drivetrain.motor import behind_torque, entries_behind
from hopopt.drivetrain.operating_region.limits import CAPS
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.drivetrain.supply import power_drawn, power_limits, voltage_share
from hopopt.leg.kinematics import PLANE, loop_axes, reach, start_angles
from hopopt.leg.robot import BASE, Robot
from hopopt.leg.scales import weight

UP = 1  # row of the body's vertical motion
SINGULAR = 1e-14  # of the largest eigenvalue of the mass matrix, scaled by mass and reach: what rounding leaves of none


def cannot_begin(design: Design, robot: Robot) -> list[str]:
    """Sentences on what keeps a leg from moving, or from standing, in its start pose at all."""
    return [*joints_without_inertia(design, robot), *springs_lift_the_foot(design, robot)]


def joints_without_inertia(design: Design, robot: Robot) -> list[str]:
    """A sentence if joints turn without inertia in the start pose: no force moves such a leg in a way that is known."""
    q = np.concatenate([np.zeros(BASE), start_angles(design)])
    M = robot.mass_matrix(q)
    scale = np.array([1.0] * BASE + [reach(design.leg)] * len(design.leg.joints))
    values, motions = np.linalg.eigh(M / np.outer(scale, scale), UPLO="U")
    free = np.abs(motions[BASE:, values <= SINGULAR * values[-1]]).max(axis=1, initial=0.0)
    joints = [joint for joint, part in zip(design.leg.joints, free, strict=True) if part > 0.5 * free.max()]
    if not joints:
        return []
    rotors = dict(design.leg.drive(joint, "motor", "rotor_inertia") for joint in joints)
    stated = " and ".join(f"{path} = {rotor:g} kg m^2" for path, rotor in rotors.items())
    return [
        f"nothing resists the {' and the '.join(joints)} in the start pose at 0 s, as a thin rod that turns about itself, "
        f"with {stated}: give a rotor's inertia, or the inertia_tensor of the links"
    ]


def springs_lift_the_foot(design: Design, robot: Robot) -> list[str]:
    """A sentence if, in the start pose at rest, springs pull the foot off the ground whatever the drives do."""
    if not robot.springs or loop_axes(design.leg) or design.hop.periodic:
        return []
    q = np.concatenate([np.zeros(BASE), start_angles(design)])
    jacobian, M = _foot_jacobian(robot, q), robot.mass_matrix(q)
    turns = robot.turning.jacobian(q[BASE:]) if robot.turning else np.eye(len(robot.joints))
    columns, force = M[:, BASE:] - M[:, :BASE] @ jacobian, robot.forces_at_rest(q)
    reduced = columns[BASE:] - jacobian.T @ columns[:BASE]
    by_torque = np.linalg.solve(reduced.T, columns[UP])  # of the vertical ground force [N], for each N m
    without = force[UP] - by_torque @ (force[BASE:] - jacobian.T @ force[:BASE])
    bounds = [operating_region(design.leg, j, robot.parameters).torque_bounds(0.0) for j in design.leg.joints]
    by_drive = turns @ by_torque
    most = without + sum(float(np.max(by * np.array(ends))) for by, ends in zip(by_drive, bounds, strict=True))
    if most >= design.contact.least_force:
        return []
    given = dict(zip(design.leg.joints, robot.spring_forces(q)[BASE:].tolist(), strict=True))
    stated = ", ".join(f"{torque:.1f} N m at the {joint}" for joint, torque in given.items() if torque)
    return [
        f"springs pull the foot off the ground in the start pose at 0 s, whatever the drives do: they give {stated}; choose a "
        "lower leg.spring stiffness, a rest_angle nearer to the start, or stronger drives"
    ]


def drives_too_weak(design: Design, robot: Robot) -> list[str]:
    """A sentence for each joint whose drive cannot hold the start pose, the foot on the ground."""
    if loop_axes(design.leg):  # joints can press against the guides
        return []
    leg, hold = design.leg, holding_torques(design, robot)
    faults = _supply_too_weak(leg, robot, hold)
    for k, joint in enumerate(leg.joints):
        region = operating_region(leg, joint, robot.parameters)
        lower, upper = region.torque_bounds(0.0)
        if not lower <= hold[k] <= upper:
            cap = CAPS.get(region.binding(0.0, hold[k]), ())
            given = entries_behind(leg, joint, cap) if cap else behind_torque(leg, joint)
            stated = " and ".join(f"{path} = {robot.parameters[path]:g}" for path in given)
            stronger = f"a higher {given[0]}" if cap else "a stronger motor"
            geared = ", a higher gear ratio" if given[1:] else ""
            start = start_angles(design)
            springs = np.array(robot.springs.torques(start.tolist()), dtype=float)
            sprung = robot.drive_torques(np.concatenate([np.zeros(BASE), start]), springs)[k]
            gives = f" (springs give it {sprung:.1f} N m)" if sprung else ""
            softer = ", softer springs" if sprung * hold[k] < 0 else ""
            faults.append(
                f"the {joint} needs {abs(hold[k]):.1f} N m to hold the start pose in stance at 0 s{gives}; "
                f"its drive gives {float(upper):.1f} N m ({stated}, for {weight(robot.model):.0f} N): {stronger}{geared}{softer}, "
                "a lighter leg.body.mass or a higher start"
            )
    return faults


def holding_torques(design: Design, robot: Robot) -> np.ndarray:
    """Torques (n) [N m] of the drives, behind their gears, that hold the start pose, the foot on the ground, which alone
    carries the leg."""
    q = np.concatenate([np.zeros(BASE), start_angles(design)])
    forces = robot.forces_at_rest(q)
    jacobian = _foot_jacobian(robot, q)
    return robot.drive_torques(q, forces[BASE:] - jacobian.T @ forces[:BASE])


def _foot_jacobian(robot: Robot, q: np.ndarray) -> np.ndarray:
    """How the foot's place (x, z) [m] over the body's changes with the joints' angles, (2, n)."""
    foot, data = robot.model.getFrameId("point_foot"), robot.model.createData()
    return pin.computeFrameJacobian(robot.model, data, q, foot, pin.LOCAL_WORLD_ALIGNED)[list(PLANE), BASE:]


def strength(design: Design, robot: Robot) -> float:
    """Share of the torques that hold the start pose which its drives give at standstill; infinite where guides may carry the
    leg."""
    if loop_axes(design.leg):
        return np.inf
    shares = [np.inf]
    for joint, torque in zip(design.leg.joints, holding_torques(design, robot).tolist(), strict=True):
        lower, upper = map(float, operating_region(design.leg, joint, robot.parameters).torque_bounds(0.0))
        shares += [(upper if torque > 0 else lower) / torque] if torque else []
    return min(shares)


def _supply_too_weak(leg: Leg, robot: Robot, hold: np.ndarray) -> list[str]:
    """A sentence if the supply cannot feed the torques (n) [N m] that hold the start pose."""
    if leg.supply is None:
        return []
    power = float(power_drawn(leg, robot.parameters, list(hold), [0.0] * len(hold)))
    for entry, most in power_limits(leg, robot.parameters).items():
        if power > most:
            value = getattr(leg.supply, entry)
            return [
                f"holding the start pose in stance at 0 s draws {power:.0f} W, and supply.{entry} = {value:g} lets {float(most):.0f} W "
                "through: a stronger supply (supply.count, supply.voltage), a lighter leg.body.mass or a higher start"
            ]
    voltage = float(voltage_share(leg, robot.parameters, list(hold), [0.0] * len(hold)))
    for joint, torque in zip(leg.joints, hold.tolist(), strict=True):
        most = voltage * float(operating_region(leg, joint, robot.parameters).torque_bounds(0.0)[1])
        if abs(torque) > most:
            return [
                f"the {joint} needs {abs(torque):.1f} N m to hold the start pose in stance at 0 s; at the "
                f"{voltage * leg.supply.voltage:.1f} V that the supply keeps meanwhile its drive gives {most:.1f} N m: less "
                "supply.internal_resistance, a stronger motor or a higher start"
            ]
    return []
