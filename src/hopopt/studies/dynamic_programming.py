"""A reduced hop whose global optimum can be computed: the leg with its foot under the hip, the body on a slider.

One degree of freedom is left, the height y of the body with speed v. Dynamic programming over a grid of both finds the
best push without derivatives, starting points or local optima; the transcription solves the same problem. That they
agree, ever closer on finer grids, is evidence for the planner from a method that shares nothing with it but the leg
model and the motor law (Bellman 1957; Falcone and Ferretti, Semi-Lagrangian Approximation Schemes, 2013).
"""

from dataclasses import dataclass
from itertools import combinations, takewhile
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

from hopopt.design import Design
from hopopt.errors import NotSolvedError, ProblemFileError, UsageError
from hopopt.leg.actuator import operating_region
from hopopt.leg.kinematics import (
    TwoJoints,
    joint_positions,
    reach,
    start_angles,
    start_place,
    two_joints,
    within_limits,
)
from hopopt.leg.robot import BASE, build_robot
from hopopt.nlp.ipopt import NlpSolver
from hopopt.nlp.mesh import uniform
from hopopt.nlp.schemes import radau
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.hop import Hop
from hopopt.ocp.initial_guess import NAMED, make_guess
from hopopt.ocp.phases import STANCE
from hopopt.ocp.problem import Ends, Objective, Parameter, Problem
from hopopt.problem.load import changed
from hopopt.sim.machine import Machine

ACCELERATIONS = 9  # tried between the least and the largest
TIE = 1e-6  # m/s: weight of the effort in the planner's reduced problem
PACE = 1.0  # steps in the time of a fast rise, for each row of the grid to the power 2/3
SHORTEST = 1e-3  # s: a stance may be as short as it likes
NOWHERE = -1.0  # m: value of a state from which the leg cannot go on
MOST = 2000  # rows of a grid: 4 million states
TELLING = 40  # rows of a grid below which its height may be wrong by more than
CONTRADICTED = 0.01  # relative: by so much more than the planner's, it speaks against the planner
HEIGHTS = 4001  # among which the ends of the body's range are looked for


@dataclass(frozen=True)
class Upright:
    """The leg by the height of its body, y (m,) [m]: joint angles q (m, n), their change with height dq (m, n)
    [rad/m], centre of mass com (m,) [m] and its change dcom (m,).

    Joint torques, and the vertical force, are terms[..., 0] + terms[..., 1] a + terms[..., 2] v^2 at the body's
    speed v and acceleration a; levers (m, n) [m]: what a horizontal force on the foot takes from the torques.
    """

    y: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    com: np.ndarray
    dcom: np.ndarray
    torque: np.ndarray
    force: np.ndarray
    levers: np.ndarray


def reduced(design: Design) -> Design:
    """The problem on a vertical slider, the foot under the hip at the height of the start, on ideal ground, with no
    other limits than the drives', the joints' and the ground's; UsageError if the leg has other than two joints in a
    plane, or cannot stand so."""
    if not two_joints(design.leg):
        raise UsageError(f"{design.name}: the reduced hop needs a leg of two joints in the x-z plane")
    height = float(start_place(design)[1])
    longest = design.hop.stance_duration[1]
    plain = {
        "leg.guides": ("z",), "start.foot_x": 0.0, "start.hip_height": height,
        "contact.friction": None, "contact.least_force": 0.0, "hop.counter_movement": True, "hop.least_height": 0.0,
        "hop.above_ground": (), "hop.stance_duration": (min(SHORTEST, longest), longest),
    }  # fmt: skip
    try:
        return changed(design, plain)
    except ProblemFileError as error:
        raise UsageError(f"{design.name}: no reduced hop: {' '.join(error.problems)}") from None


def by_dynamic_programming(design: Design, size: int) -> float:
    """Greatest height [m] to which the centre of mass can be thrown, on a grid of size x size states."""
    if not 8 <= size <= MOST:
        raise UsageError(f"a grid of {size} x {size} states: a size from 8 to {MOST} is needed")
    leg = upright(design, size)
    share = np.linspace(-1.0, 1.0, 2 * (size // 2) + 1)  # of the largest speed
    robot = build_robot(design.leg)
    regions = [operating_region(design.leg, joint, robot.parameters) for joint in robot.joints]
    speeds = [np.abs(region.corners()[:, 0]).max() for region in regions]  # open ones: twice what they can drive at
    fastest = np.min(np.array(speeds) / np.maximum(np.abs(leg.dq), 1e-9), axis=1)  # (m,)
    v = fastest[:, None] * share
    gravity = -float(robot.model.gravity.linear[2])
    rise = leg.com[:, None] + np.maximum(leg.dcom[:, None] * v, 0.0) ** 2 / (2 * gravity)
    least, largest = accelerations(design, leg, v)
    longest = design.hop.stance_duration[1]
    crossing = (leg.y[-1] - leg.y[0]) / float(np.median(fastest))  # [s], from the lowest to the highest
    steps = max(4, round(PACE * longest / crossing * size ** (2 / 3)))  # they err with dt, cells with their size
    dt = longest / steps
    a = least[..., None] + (largest - least)[..., None] * np.linspace(0, 1, ACCELERATIONS)
    then_v, then_y = v[..., None] + a * dt, leg.y[:, None, None] + v[..., None] * dt + 0.5 * a * dt**2
    then_share = then_v / np.interp(then_y, leg.y, fastest)
    look_up = _Bilinear(leg.y, share, then_y, then_share)
    value = rise.copy()
    for _ in range(steps):
        value = np.maximum(rise, look_up(value).max(axis=-1))
    begin = start_place(design)[1]
    return float(_Bilinear(leg.y, share, np.array(begin), np.array(0.0))(value))


def upright(design: Design, size: int) -> Upright:
    """The leg at ``size`` heights between the lowest and the highest that joint limits and ground allow."""
    robot, geometry = build_robot(design.leg), TwoJoints.of(design.leg)
    machine, side = Machine(robot), np.sign(geometry.bend(start_angles(design)[1]))
    lowest, highest = _range(design, geometry, side)
    y = np.linspace(lowest, highest, size)
    rows = [_at_height(machine, _pose(geometry, side, height)) for height in y]
    return Upright(y, *(np.array(column) for column in zip(*rows, strict=True)))


def _pose(geometry: TwoJoints, side: float, height: float) -> np.ndarray:
    """Joint angles with the foot ``height`` under the hip, the leg bent to one side."""
    return next(q for q in geometry.angles(np.array([0.0, -height])) if geometry.bend(q[1]) * side >= 0)


def _range(design: Design, geometry: TwoJoints, side: float) -> tuple[float, float]:
    """Lowest and highest body about the start that joint limits and the ground below the joints allow [m]."""
    start = float(start_place(design)[1])

    def allowed(height: float) -> bool:
        if not geometry.angles(np.array([0.0, -height])):
            return False
        q = _pose(geometry, side, height)
        places = joint_positions(design.leg, q)[:, 2]
        return within_limits(design.leg, q, 1e-9) and bool(np.all(places >= places[-1] - 1e-9))

    heights = np.linspace(0.0, reach(design.leg), HEIGHTS)[1:-1]
    below, above = heights[heights <= start][::-1], heights[heights >= start]
    return min(takewhile(allowed, below), default=start), max(takewhile(allowed, above), default=start)


def _at_height(machine: Machine, q_j: np.ndarray) -> tuple[Any, ...]:
    """One row of each array of ``Upright`` after y."""
    s = machine.stance_terms(q_j, np.zeros(2))
    dq = -np.linalg.solve(s.jacobian, np.array([0.0, 1.0]))  # the foot stays: base' + J q' = 0
    turning = machine.stance_terms(q_j, dq)
    dcom = machine.com_velocity(s.q, np.concatenate([[0.0, 1.0], dq]))[1]
    com = machine.points(s.q)["com"][1]
    rest = _forces(machine, s.q, np.zeros(4), np.zeros(4))
    ahead = _forces(machine, s.q, np.zeros(4), np.concatenate([[0.0, 1.0], dq])) - rest
    v = np.concatenate([[0.0, 1.0], dq])
    curve = -np.linalg.solve(s.jacobian, turning.drift)  # joint acceleration that keeps foot and body in place at v = 1
    fast = _forces(machine, s.q, v, np.concatenate([[0.0, 0.0], curve])) - rest
    terms = np.stack([rest, ahead, fast], axis=-1)  # (4, 3)
    torque = terms[BASE:] - np.outer(s.jacobian[1], terms[1])  # less what the vertical force takes
    return q_j, dq, com, dcom, torque, terms[1], s.jacobian[0]


def _forces(machine: Machine, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    return pin.rnea(machine.model, machine.data, q, v, a).copy()


def accelerations(design: Design, leg: Upright, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest acceleration [m/s^2] of the body at heights leg.y (m,) and speeds v (m, k), nan where there is
    none: a linear program in it and the horizontal force, solved at the corners of its polygon."""
    robot, rows, right = build_robot(design.leg), [], []
    for k, joint in enumerate(design.leg.joints):
        for plane in operating_region(design.leg, joint, robot.parameters).planes:
            a, b = float(plane.a), float(plane.b)
            rows.append(np.stack([a * leg.torque[:, k, 1], -a * leg.levers[:, k]], axis=-1))
            tau = leg.torque[:, k, 0, None] + leg.torque[:, k, 2, None] * v**2
            right.append(1.0 - a * tau - b * leg.dq[:, k, None] * v)
    rows.append(np.stack([-leg.force[:, 1], np.zeros(len(leg.y))], axis=-1))
    right.append(leg.force[:, 0, None] + leg.force[:, 2, None] * v**2 - design.contact.least_force)
    G, r = np.stack(rows, axis=1), np.stack(right, axis=1)  # (m, c, 2), (m, c, k): G (a, f_x) <= r
    least, largest = np.full(v.shape, np.inf), np.full(v.shape, -np.inf)
    for i, j in combinations(range(G.shape[1]), 2):
        pair = G[:, [i, j]]
        determinant = np.linalg.det(pair)
        sound = np.abs(determinant) > 1e-12 * np.abs(pair).max(axis=(1, 2)) ** 2
        inverse = np.linalg.inv(np.where(sound[:, None, None], pair, np.eye(2)))
        corner = np.einsum("mij,mjk->mik", inverse, r[:, [i, j]])  # (m, 2, k)
        inside = np.all(np.einsum("mci,mik->mck", G, corner) <= r + 1e-9 * (1 + np.abs(r)), axis=1) & sound[:, None]
        least = np.where(inside, np.minimum(least, corner[:, 0]), least)
        largest = np.where(inside, np.maximum(largest, corner[:, 0]), largest)
    none = least > largest
    return np.where(none, np.nan, least), np.where(none, np.nan, largest)


class _Bilinear:
    """Values at given places of a grid of rows and columns, interpolated; NOWHERE outside."""

    def __init__(self, rows: np.ndarray, columns: np.ndarray, at_row: np.ndarray, at_column: np.ndarray):
        i, j = ((at - grid[0]) / (grid[1] - grid[0]) for at, grid in ((at_row, rows), (at_column, columns)))
        last = len(rows) - 1, len(columns) - 1
        with np.errstate(invalid="ignore"):
            self.outside = ~((i >= -1e-9) & (i <= last[0] + 1e-9) & (j >= -1e-9) & (j <= last[1] + 1e-9))
        i, j = (np.where(self.outside, 0.0, np.clip(x, 0, n - 1e-9)) for x, n in zip((i, j), last, strict=True))
        self.i, self.j = i.astype(int), j.astype(int)
        self.s, self.t = i - self.i, j - self.j

    def __call__(self, values: np.ndarray) -> np.ndarray:
        i, j, s, t = self.i, self.j, self.s, self.t
        low = (1 - t) * values[i, j] + t * values[i, j + 1]
        high = (1 - t) * values[i + 1, j] + t * values[i + 1, j + 1]
        return np.where(self.outside, NOWHERE, (1 - s) * low + s * high)


def by_transcription(design: Design, intervals: int) -> float:
    """The same height [m] by the planner: stance alone, on a mesh of equal intervals; NotSolvedError if it fails."""
    hop = Hop(design)
    gravity = -float(hop.robot.model.gravity.linear[2])

    def rise(e: Ends) -> ca.SX:
        s = e.final[STANCE]
        com = hop.dynamics(s).points(hop.dynamics(s).stance_pose(s.q, s.v)[0])["com"][1]
        return com + ca.jtimes(com, s.q, s.v) ** 2 / (2 * gravity) - TIE * e.integral[STANCE]["effort"]

    fixed = tuple(Parameter(path, value=value) for path, value in hop.robot.parameters.items())
    problem = Problem(
        design.name, (hop.problem.phase(STANCE),), Objective("rise", rise, maximize=True, unit="m"), fixed
    )
    program = Transcription(problem, radau(3), {STANCE: uniform(intervals)})
    guess = {STANCE: make_guess(hop, NAMED[1])[STANCE]}
    solution = NlpSolver(program)(guess)
    if not solution.success:
        raise NotSolvedError(
            f"{design.name}: the reduced hop was not solved on {intervals} intervals.", [solution.status]
        )
    return float(solution.objective)
