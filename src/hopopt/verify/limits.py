"""By how much a motion passes the limits of its phase, by Pinocchio and the drives' half-planes."""

import numpy as np

from hopopt.design import Design
from hopopt.drivetrain.dynamics import added_states
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.drivetrain.supply import power_drawn, power_limits, voltage_share
from hopopt.leg.geometry.above import above_ground
from hopopt.leg.kinematics import reach
from hopopt.leg.limit_id import Kind, LimitId, motor_power, place_limit, torque_rate
from hopopt.leg.robot import BASE, Robot
from hopopt.leg.scales import descent_range, force_range
from hopopt.sim.machine import Machine
from hopopt.verify.table import DESCENT, STANCE, STANDING

LIMIT_KINDS = (  # kinds of limits of a phase that are looked at here
    Kind.REGION, Kind.ANGLE, Kind.TRAVEL, Kind.HEIGHT, Kind.SLIDER, Kind.FOOT, Kind.GROUND_FORCE, Kind.FRICTION, Kind.DESCENT,
    Kind.WINDOW, Kind.SUPPLY, Kind.MOTOR_POWER, Kind.TORQUE_RATE, Kind.FORCE_RATE,
)  # fmt: skip


def limit_words(phase: str, limit: LimitId) -> str:
    """What a check of a limit of a phase is called."""
    return f"{phase} {'ground pushes' if limit.kind is Kind.GROUND_FORCE else limit}"


def windowed(design: Design, phase: str, ends: str) -> bool:
    """Whether the foot has to be within its window when a phase of flight ends: a hop that goes on lands where it will."""
    return ends != "free" and not (design.hop.lands and phase == DESCENT)


def limits_of(
    machine: Machine,
    robot: Robot,
    design: Design,
    phase: str,
    motion: tuple[np.ndarray, ...],
    window: bool,
    rates: tuple[np.ndarray, np.ndarray] | None = None,
    drive: np.ndarray | None = None,
) -> dict[LimitId, np.ndarray]:
    """By how much each limit of a phase is passed, as shares of its range (negative: kept), at k instants of a motion
    q, v (k, 2 + n), tau (k, n) that the motors are asked for, f (k, 2); one value for those of its end;
    ``window``: the foot's window is one; rates of tau (k, n) [N m/s] and f (k, 2) [N/s], if they
    are to be looked at; drive (k, m): the drives' states, if they have any."""
    (q, v, tau, f), contact = motion, phase in STANDING
    w = robot.drive_speeds(q, v, drive)
    columns = list(tau.T), list(w.T)
    voltage = voltage_share(design.leg, robot.parameters, *columns) if design.leg.supply else None
    found: dict[LimitId, np.ndarray] = {}
    for k, joint in enumerate(robot.joints):
        region = operating_region(design.leg, joint, robot.parameters)
        use = np.array(region.use(w[:, k], tau[:, k], voltage, None if rates is None else rates[0][:, k]))
        if region.power is not None:
            found[motor_power(design.leg, joint)] = (np.abs(tau[:, k] * w[:, k]) / region.power - 1.0) / 2
        found[LimitId(Kind.REGION, joint)] = (use.max(axis=0) - 1.0) / 2  # a tau + b w goes from -1 to 1
        low, high = design.leg.joint[joint].lower, design.leg.joint[joint].upper
        angle = q[:, BASE + k]
        found[place_limit(design.leg, joint)] = np.maximum(low - angle, angle - high) / (high - low)
    if rates is not None:
        most_of_force = design.contact.force_rate
        if contact and most_of_force is not None:
            found[LimitId(Kind.FORCE_RATE)] = (np.abs(rates[1][:, -1]) / most_of_force - 1.0) / 2
        for k, most in added_states(design.leg, robot.parameters).limited.items():
            found[torque_rate(design.leg, robot.joints[k])] = (np.abs(rates[0][:, k]) / most - 1.0) / 2
    drawn = power_drawn(design.leg, robot.parameters, *columns) if design.leg.supply else 0.0
    for entry, most in power_limits(design.leg, robot.parameters).items():
        found[LimitId(Kind.SUPPLY, entry.replace("_", " "), f"supply.{entry}", "W")] = drawn / most - 1.0
    found |= _ground(machine, design, phase, q, v, f)
    if window and not contact:
        found |= _window(machine, robot, design, q)
    return found


def _ground(
    machine: Machine, design: Design, phase: str, q: np.ndarray, v: np.ndarray, f: np.ndarray
) -> dict[LimitId, np.ndarray]:
    size_of_leg, contact = reach(design.leg), phase in STANDING
    paths, found = machine.paths(q), dict[LimitId, np.ndarray]()
    for name, points in above_ground(design).items():
        if not contact or name != "foot":
            least = 0.0 if name == "foot" else design.hop.least_height
            low = np.min([paths[point][:, 1] for point in points], axis=0)
            found[LimitId(Kind.HEIGHT, name)] = (least - low) / size_of_leg
    if machine.held:
        found[LimitId(Kind.SLIDER)] = np.abs(q[:, machine.held] - q[0, machine.held]).max(axis=1) / size_of_leg
    if contact:
        size = force_range(machine.model)
        beside = np.array([machine.foot_beside(row) for row in q]) if 1 in machine.contact else np.zeros(len(q))
        moved = np.maximum(np.abs(paths["foot"]).max(axis=1), np.abs(beside - beside[0]))
        found[LimitId(Kind.FOOT)] = moved / size_of_leg
        found[LimitId(Kind.GROUND_FORCE)] = (design.contact.least_force - f[:, -1]) / size
        if design.contact.friction is not None:
            found[LimitId(Kind.FRICTION)] = (
                np.linalg.norm(f[:, :-1], axis=1) - design.contact.friction * f[:, -1]
            ) / size
        if not design.hop.counter_movement and phase == STANCE:
            found[LimitId(Kind.DESCENT)] = -v[:, 1] / descent_range(design.leg)
    return found


def _window(machine: Machine, robot: Robot, design: Design, q: np.ndarray) -> dict[LimitId, np.ndarray]:
    points = machine.points(q[-1])
    offset = abs(points["foot"][0] - points[robot.joints[0]][0])
    return {LimitId(Kind.WINDOW): np.array([(offset - design.hop.foot_window) / (2 * design.hop.foot_window)])}
