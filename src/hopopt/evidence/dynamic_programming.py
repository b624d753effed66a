"""A reduced hop whose global optimum can be computed: the leg with its foot under the hip, the body on a slider.

One degree of freedom is left, the height y of the body with speed v. Dynamic programming over a grid of both finds the
best push without derivatives, starting points or local optima; the transcription solves the same problem. They agree,
ever closer on finer grids. The method shares nothing with the planner but the leg model and the motor law (Bellman 1957; Falcone and Ferretti, Semi-Lagrangian Approximation Schemes, 2013).
"""

import casadi as ca
import numpy as np

from hopopt.design import Design, refuse_landed
from hopopt.drivetrain.dynamics import refuse_series_springs
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.errors import NotSolvedError, ProblemFileError, UsageError
from hopopt.global_search.equations.bilinear import Bilinear
from hopopt.global_search.equations.slider_leg import accelerations, slider_leg
from hopopt.leg.kinematics import start_place, two_joints
from hopopt.leg.robot import build_robot
from hopopt.leg.scales import Scale
from hopopt.nlp.mesh import uniform
from hopopt.nlp.schemes import radau
from hopopt.nlp.solver.ipopt import NlpSolver
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.guesses.initial_guess import NAMED_STARTS, make_guess
from hopopt.ocp.hop import Hop
from hopopt.ocp.phases import STANCE, length
from hopopt.ocp.problem import Ends, Objective, Parameter, Problem
from hopopt.problem.load import changed

ACCELERATIONS = 9  # tried between the least and the largest
TIE_BREAK = 1e-6  # [m/s] on the paper's leg: weight of the effort in the planner's reduced problem
STEPS_PER_RISE = 1.0  # steps in the time of a fast rise, for each row of the grid to the power 2/3
SHORTEST_STANCE = 1e-3  # [s] on the paper's leg: a stance may be as short as it likes
STUCK = -1.0  # m: value of a state from which the leg cannot go on
MOST_ROWS = 2000  # rows of a grid: 4 million states
TELLING = 40  # rows of a grid below which its height may be wrong by more than
CONTRADICTING_HEIGHT = 0.01  # relative: by so much more than the planner's, it speaks against the planner


def reduced(design: Design) -> Design:
    """The problem on a vertical slider, the foot under the hip at the height of the start, on ideal ground.

    No limits are left but the drives', the joints' and the ground's. Raises UsageError if the leg has other than two
    joints in a plane, or cannot stand so.
    """
    refuse_landed(design, "dynamic programming")
    if not two_joints(design.leg):
        raise UsageError(f"{design.name}: the reduced hop needs a leg of two joints in the x-z plane")
    refuse_series_springs(design.leg, "dynamic programming")
    if not design.leg.direct:
        raise UsageError(
            f"{design.name}: the reduced hop has drives that turn as their joints do: leave out transmissions"
        )
    if design.surroundings.slope:
        raise UsageError(f"{design.name}: the reduced hop is one on level ground: leave out environment.slope")
    height = float(start_place(design)[1])
    longest = design.hop.stance_duration[1]
    plain = {
        "leg.guides": ("z",), "start.foot_x": 0.0, "start.hip_height": height,
        "contact.friction": None, "contact.least_force": 0.0, "hop.counter_movement": True, "hop.least_height": 0.0,
        "hop.above_ground": (), "hop.stance_duration": (min(SHORTEST_STANCE * Scale.of(design.leg).time, longest), longest),
    }  # fmt: skip
    try:
        return changed(design, plain)
    except ProblemFileError as error:
        raise UsageError(f"{design.name}: no reduced hop: {' '.join(error.problems)}") from None


def by_dynamic_programming(design: Design, size: int) -> float:
    """Greatest height [m] to which the centre of mass can be thrown, on a grid of size x size states."""
    if not 8 <= size <= MOST_ROWS:
        raise UsageError(f"a grid of {size} x {size} states: a size from 8 to {MOST_ROWS} is needed")
    leg = slider_leg(design, size)
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
    steps = max(
        4, round(STEPS_PER_RISE * longest / crossing * size ** (2 / 3))
    )  # they err with dt, cells with their size
    dt = longest / steps
    a = least[..., None] + (largest - least)[..., None] * np.linspace(0, 1, ACCELERATIONS)
    then_v, then_y = v[..., None] + a * dt, leg.y[:, None, None] + v[..., None] * dt + 0.5 * a * dt**2
    then_share = then_v / np.interp(then_y, leg.y, fastest)
    look_up = Bilinear(leg.y, share, then_y, then_share, STUCK)
    value = rise.copy()
    for _ in range(steps):
        value = np.maximum(rise, look_up(value).max(axis=-1))
    begin = start_place(design)[1]
    return float(Bilinear(leg.y, share, np.array(begin), np.array(0.0), STUCK)(value))


def by_transcription(design: Design, intervals: int) -> float:
    """The same height [m] by the planner: stance alone, on a mesh of equal intervals; NotSolvedError if it fails."""
    hop = Hop(design)
    gravity = -float(hop.robot.model.gravity.linear[2])

    def rise(e: Ends) -> ca.SX:
        s = e.final[STANCE]
        com = hop.dynamics(s).points(hop.dynamics(s).stance_pose(s.q, s.v)[0])["com"][1]
        return (
            com
            + ca.jtimes(com, s.q, s.v) ** 2 / (2 * gravity)
            - TIE_BREAK * hop.scale.time * e.integral[STANCE]["effort"]
        )

    fixed = tuple(Parameter(path, value=value) for path, value in hop.robot.parameters.items())
    problem = Problem(design.name, (hop.problem.phase(STANCE),), Objective("rise", rise, True, "m", length(hop)), fixed)
    program = Transcription(problem, radau(3), {STANCE: uniform(intervals)})
    guess = {STANCE: make_guess(hop, NAMED_STARTS[1])[STANCE]}
    solution = NlpSolver(program)(guess)
    if not solution.success:
        raise NotSolvedError(
            f"{design.name}: the reduced hop was not solved on {intervals} intervals.", [solution.status]
        )
    return float(solution.objective)
