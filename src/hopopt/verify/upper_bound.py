"""What no hop can pass that keeps the drives' limits and the longest stance: by power over it, by speeds at lift-off.

docs/bound.md proves both; numbers of the problem alone, without a solver.
"""

from dataclasses import dataclass

import numpy as np

from hopopt.design import Design
from hopopt.drivetrain.dynamics import added_states
from hopopt.drivetrain.operating_region.half_planes import OperatingRegion
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.leg.closed_chains import side_lever
from hopopt.leg.kinematics import longest_travel, start_angles
from hopopt.leg.robot import BASE, Robot, build_robot
from hopopt.record import Real, Strict, stated
from hopopt.sim.machine import Machine

PARALLEL = 1e-15  # determinant of two half-planes [1/(N m) s/rad] below which their edges do not meet


@dataclass(frozen=True)
class UpperBound(Strict):
    """What no hop within the drives' limits and the longest stance can pass; null for what nothing bounds."""

    clearance_m: Real = stated("clearance [m]")
    by_energy_m: Real = stated("height of the centre of mass by energy [m]")
    by_speed_m: Real = stated("height of the centre of mass by the drives' speeds [m]")
    power_W: Real = stated("what all drives together can give at most [W]")
    lift_off_speed_m_s: Real = stated("of the centre of mass at most [m/s]")


def upper_bound(design: Design) -> UpperBound:
    """The bound on a problem's hop (docs/bound.md)."""
    robot = build_robot(design.leg)
    machine, q_j = Machine(robot), start_angles(design)
    regions = [operating_region(design.leg, joint, robot.parameters) for joint in robot.joints]
    weight = machine.mass * -machine.gravity[1]
    at = machine.points(np.concatenate([np.zeros(BASE), q_j]))
    start = float(at["com"][1] - at["foot"][1])
    power = sum(most_power(region) for region in regions)
    speeds = np.array([most_speed(region) for region in regions])
    told = robot.leg.direct and not robot.leg.elastic
    height, speed = _stretched(robot, speeds if told else np.zeros(len(speeds)))
    beside = side_lever(design.leg, robot.parameters) / machine.mass  # of five-bars, which the model has in the body
    height += beside
    if not told:
        speed = np.inf  # of a joint at any angle, which a speed of its drive does not tell
    downhill = machine.mass * abs(machine.gravity[0]) * (height + abs(float(at["com"][0] - at["foot"][0])))
    sprung = robot.springs.most_given(q_j.tolist(), design.leg) + _loaded(machine, q_j)
    given = design.hop.stance_duration[1] * power + downhill + sprung
    by_energy = np.inf if design.hop.periodic else start + given / weight
    by_speed = height + speed**2 / (2 * -machine.gravity[1])
    clearance = min(by_energy, by_speed) + _below_com(robot) + beside
    return UpperBound(*map(float, (clearance, by_energy, by_speed, power, speed)))


def _loaded(machine: Machine, q_j: np.ndarray) -> float:
    """What series springs store at rest at joint angles q_j (n) [J]."""
    states = added_states(machine.leg, machine.robot.parameters)
    held = machine.stance_terms(q_j, np.zeros(len(q_j))).joint_bias if states.sprung else np.zeros(len(q_j))
    return float(states.stored(states.at_rest(held)))


def most_power(region: OperatingRegion) -> float:
    """Largest tau w [W] in a joint's operating region; infinite where nothing bounds it."""
    planes = np.array([[float(h.a), float(h.b)] for h in region.planes])
    line = any(a * b > 0 for a, b in planes)  # a law that weakens the motor as it drives faster
    capped = np.inf if region.power is None else float(region.power)
    if not line and not (np.isfinite(most_speed(region)) and planes[:, 0].any()):
        return capped
    return min(capped, max(_most_power(planes), _most_power(-planes)))


def _most_power(planes: np.ndarray) -> float:
    """Largest tau w over {tau, w >= 0, a tau + b w <= 1 for each row (a, b)}, a polygon.

    It lies on an edge, where tau w is a parabola: at its top or at an end of the edge.
    """
    a, b = planes.T
    first, second = np.triu_indices(len(planes), 1)
    det = a[first] * b[second] - a[second] * b[first]
    meet = np.abs(det) > PARALLEL
    i, j, det = first[meet], second[meet], det[meet]
    corners = np.column_stack([(b[j] - b[i]) / det, (a[i] - a[j]) / det])
    both = planes[(a > 0) & (b > 0)]
    points = np.vstack([corners, 0.5 / both])
    inside = np.all(points >= 0, axis=1) & np.all(points @ planes.T <= 1 + 1e-9, axis=1)
    return float(points[inside].prod(axis=1).max(initial=0.0))


def most_speed(region: OperatingRegion) -> float:
    """Largest |w| [rad/s] at which the region is not empty; infinite where nothing bounds it.

    A combination of two half-planes (weights s, 1 - s) that leaves no torque bounds the speed: the best such pair.
    """
    planes = [(float(h.a), float(h.b)) for h in region.planes]
    speeds = [1 / b for a, b in planes if a == 0 and b > 0]
    for a, b in planes:
        for c, d in planes:
            if a > 0 > c and (slope := (b * -c + d * a) / (a - c)) > 0:
                speeds.append(1 / slope)
    return min(speeds, default=np.inf)


def _stretched(robot: Robot, speeds: np.ndarray) -> tuple[float, float]:
    """Height [m] and speed [m/s] that the centre of mass cannot pass over a foot at rest, joints at most so fast."""
    bodies, ends = robot.model.inertias.tolist()[BASE:], _ends(robot)
    joints = robot.leg.link_joints
    own = np.array([abs(at.ratio) * speeds[at.coordinate] for at in joints])
    slides = np.array([at.slides for at in joints])
    turning, height, speed, above, fast = np.cumsum(np.where(slides, 0.0, own)), 0.0, 0.0, 0.0, 0.0
    for k in reversed(range(len(ends))):  # from the foot up
        lever, mass = float(np.linalg.norm(bodies[k + 1].lever - ends[k])), bodies[k + 1].mass
        height, speed = height + mass * (above + lever), speed + mass * (fast + turning[k] * lever)
        far = float(np.linalg.norm(ends[k]))
        if slides[k]:
            far, fast = far + longest_travel(robot.leg.joint[joints[k].name]), fast + own[k]
        above, fast = above + far, fast + turning[k] * far
    total = sum(body.mass for body in bodies)
    return (height + bodies[0].mass * above) / total, (speed + bodies[0].mass * fast) / total


def _ends(robot: Robot) -> list[np.ndarray]:
    """Where each link ends, from its joint, (3,) [m] each."""
    placed = [robot.model.jointPlacements[BASE + 2 + k].translation for k in range(len(robot.leg.links) - 1)]
    return [*placed, np.array(robot.points["foot"][1], dtype=float)]


def _below_com(robot: Robot) -> float:
    """Mean distance of the links' centres of mass from the lines between their joints, by mass [m]."""
    bodies, distance = robot.model.inertias.tolist()[BASE:], 0.0
    for body, end in zip(bodies[1:], _ends(robot), strict=True):
        along = np.clip(body.lever @ end / (end @ end), 0.0, 1.0)
        distance += body.mass * float(np.linalg.norm(body.lever - along * end))
    return distance / sum(body.mass for body in bodies)
