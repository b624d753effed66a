"""A plan as good as a solved hop, but smoother in torque: what a robot is given of it.

The hop itself stays the answer, with its certificate, its multipliers and its error. The plan is another point of the same program
(nlp/refinement/smoothing.py), and is verified by its own table and by its own simulation in one piece.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from hopopt.drivetrain.motor import stall_torque
from hopopt.errors import NotSolvedError, ResultError
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.refinement.interval_errors import interval_errors
from hopopt.nlp.refinement.smoothing import Quantities, smoothed
from hopopt.ocp.drives import motor_torques
from hopopt.ocp.hop import Hop
from hopopt.ocp.phases import FLIGHT, ON_GROUND, STANCE
from hopopt.ocp.problem import Instant
from hopopt.planner.checks.judge import local_error, plan_checks, simulated_in_one_piece
from hopopt.planner.checks.program_limits import program_limits
from hopopt.planner.motion import Motion
from hopopt.planner.refine_and_verify import aims_of, stated_figure
from hopopt.planner.solution import Solution, has_multipliers, hop_of, stored_nlp
from hopopt.record import as_data
from hopopt.verify.check import Check, failed

LOST = 1e-5  # share of the objective that smoothness may cost, and of a height this at most [m]
EVERYWHERE = np.linspace(0.0, 1.0, 17)  # normalised times at which torques are added up


@dataclass(frozen=True)
class SmoothPlan:
    """A plan that is smoother in torque than the hop it was made from.

    motion: the plan
    claims: what is stated of it, by name [the name's unit]
    checks: of its intervals' errors, of its table, and of its simulation in one piece; all passed
    value: its objective
    unit: of the objective
    lost: by how much that is worse than the hop's [the same]
    may_lose: by how much it may be worse [the same]
    variation: total variation of each joint's motor torque, of the hop and of the plan, (2, n) [N m; N of a joint that slides]
    limited: what kept it from being smoother, in words
    """

    motion: Motion
    claims: Mapping[str, float]
    checks: tuple[Check, ...]
    value: float
    unit: str
    lost: float
    may_lose: float
    variation: np.ndarray
    limited: str

    def as_dict(self) -> dict[str, Any]:
        """What is stated of it, for JSON: its claims, what it lost, what limited it and its checks. Of each motor, by what its torque
        varies in the hop and in the plan."""
        leg, (hop, plan) = self.motion.design.leg, self.variation.tolist()
        varies = {
            joint: {"hop": before, "plan": after, "unit": leg.units(joint).tau}
            for joint, before, after in zip(leg.joints, hop, plan, strict=True)
        }
        stated = {name: getattr(self, name) for name in ("value", "unit", "lost", "may_lose", "limited")}
        checks = [as_data(check) for check in self.checks]
        return {**stated, "claims": dict(self.claims), "torque_variation": varies, "verification": checks}


def smooth_plan(solution: Solution, until: Deadline = NEVER) -> SmoothPlan:
    """A plan that loses at most LOST of a solved hop's objective and whose torques vary less; NotSolvedError, with what failed,
    where there is none. ResultError without stored multipliers."""
    if not has_multipliers(solution):
        raise ResultError(f"{_named(solution)}: the file holds no multipliers: solve it again")
    hop = hop_of(solution)
    settled, goal = stored_nlp(solution, hop.problem), hop.objective
    most = LOST * settled.magnitude
    most = min(most, LOST) if goal.unit == "m" else most
    smoother = smoothed(settled, torque_shares(hop), most, aims_of(hop, until))
    if smoother is None:
        why = " in the time there was" if until.passed else ": take the hop as it is"
        raise NotSolvedError(f"{_named(solution)}: no smoother plan was found{why}", [])
    found = smoother.solution
    stated = stated_figure(hop, found)
    plan = replace(Motion(hop.design, goal.name, found.phases, stated=stated), own=solution.own)
    claims = {**plan.claims(), **stated}
    rollout, _ = simulated_in_one_piece(plan, goal, found.magnitude, claims)
    errors = {name: interval_errors(found, name) for name in found.phases}
    checks = [local_error(hop.design, errors), *plan_checks(plan, goal, hop.own, claims)]
    checks += [*program_limits(found, errors, {check.name for check in checks}), *rollout]
    value = claims[goal.figure]
    lost = goal.sign * (solution.summary.objective_value - value)
    variation = np.array([total_variation(solution), total_variation(plan)])
    wrong = [f"{c.name}: {c.residual:.1e} for {c.tolerance:.0e} {c.unit}" for c in failed(checks)]
    if lost > most:
        wrong.append(f"the objective: {lost:.1e} {goal.unit} worse, {most:.1e} are allowed")
    stall = np.array([stall_torque(hop.leg, j, plan.robot.parameters) for j in hop.leg.joints], dtype=float)
    before, after = (variation / stall).sum(axis=1)
    if after >= before:
        wrong.append(f"the torques: they vary by {after:.4g} of their stall torques in place of {before:.4g}")
    if wrong:
        raise NotSolvedError(f"{_named(solution)}: the smoother plan is not as good: take the hop as it is", wrong)
    return SmoothPlan(plan, claims, tuple(checks), value, goal.unit, lost, most, variation, smoother.limited)


def torque_shares(hop: Hop) -> Quantities:
    """Torques of the motors as shares of their stall torques, in any phase of the hop."""

    def shares(phase: str, s: Instant) -> ca.SX:
        motion = hop.motion_in(STANCE if phase in ON_GROUND else FLIGHT)
        return motor_torques(hop, motion)(s) / ca.vertcat(*[stall_torque(hop.leg, j, s.p) for j in hop.leg.joints])

    return shares


def total_variation(motion: Motion) -> np.ndarray:
    """Sum of all changes of each joint's motor torque, jumps between intervals and phases included, (n,) [N m]."""
    torque = np.concatenate([motion.everywhere(name, EVERYWHERE).command for name in motion.phases])
    return np.abs(np.diff(torque, axis=0)).sum(axis=0)


def _named(solution: Solution) -> str:
    return str(solution.result_dir or solution.design.name)
