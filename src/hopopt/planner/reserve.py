"""The problem with a reserve held back from its limits, and the plan that a controller can follow for it."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Any

from hopopt.control.reference import PlanReference
from hopopt.design import Design, Leg, Reserve, as_changed
from hopopt.design.drives.motor import LINEAR
from hopopt.drivetrain.gear import states
from hopopt.drivetrain.motor import state_ratings
from hopopt.drivetrain.operating_region.limits import SPEEDS, TORQUES
from hopopt.leg.kinematics import start_angles
from hopopt.leg.scales import radians, reserve_of
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.planner.motion import Motion
from hopopt.planner.solution import Solution
from hopopt.planner.solve import TIME_LIMIT, solve
from hopopt.verify.table import NORMALISED_TIMES

TRACKED_TIE_BREAK = (
    1e-4  # [m/s] tie-break of a plan to track: torques that quiver where it hardly matters are hard to follow
)


@dataclass(frozen=True)
class TrackedPlan:
    """A planned hop, and what a controller follows of it.

    motion: the plan; its problem has the leg that the controller believes in
    reference: joint angles, speeds and torques, and the plan's own feedback if it has one
    """

    motion: Motion
    reference: PlanReference

    @classmethod
    def of(cls, solution: Solution) -> "TrackedPlan":
        """A solved hop, followed by the tracker's own gains."""
        return cls(solution, reference_of(solution))


def reference_of(plan: Solution) -> PlanReference:
    """A plan as a controller follows it."""
    return PlanReference.from_tables(NORMALISED_TIMES, plan.tables, plan.clearance)


def plan_to_track(design: Design, say: Callable[[str], None], until: Deadline = NEVER) -> Solution:
    """The optimum that keeps the problem's reserve from every limit."""
    say("planning with a reserve")
    return solve(reserved(design), starts=2, progress=say, time_limit=min(TIME_LIMIT, until.seconds_left))


def reserved(design: Design) -> Design:
    """The problem with its [reserve] taken off every limit, as far as the start itself allows, and off the torques what
    gears of the machine alone take, which the plan does not know; UsageError if that leaves a limit that no problem may have."""
    r, data = reserve_of(design), design.model_dump(exclude_none=True)
    state_ratings(design.leg, data["leg"])
    passed = {name: _passed(design, name) for name in design.leg.joints}
    if len(set(passed.values())) > 1:
        _state_torques(design.leg, data["leg"])
    data["contact"]["least_force"] += r.ground_force
    data["hop"]["least_height"] += r.height
    away = r.angle * radians(design.leg)
    for name, angle, room in zip(design.leg.joints, start_angles(design), away.tolist(), strict=True):
        joint = data["leg"][name]
        joint["lower"] = max(joint["lower"], min(joint["lower"] + room, float(angle) - 1e-6))
        joint["upper"] = min(joint["upper"], max(joint["upper"] - room, float(angle) + 1e-6))
        _hold_back(joint, r, passed[name])
    _hold_back(data["leg"], r, min(passed.values()))
    data["solver"]["tie_break"] = max(design.solver.tie_break, TRACKED_TIE_BREAK)
    remedy = "hold less back, or leave out the strategies that track a plan"
    return as_changed(data, "[reserve] leaves", remedy)


def _passed(design: Design, joint: str) -> float:
    """Share of a motor's torque that a joint's gear passes on, as far as the plan does not know of it."""
    return 1.0 if states(design.leg, joint, "efficiency") else design.simulation.gear_efficiency


def _state_torques(leg: Leg, tables: dict[str, Any]) -> None:
    """Write every limit of a torque that joints share into the tables of each, for gears that differ."""
    for joint, (part, key) in product(leg.joints, TORQUES):
        path, value = leg.drive(joint, part, key)
        if value is not None and path == f"leg.{part}.{key}":
            tables[joint].setdefault(part, {})[key] = value


def _hold_back(drive: dict[str, Any], reserve: Reserve, passed: float) -> None:
    for entries, share in ((TORQUES, 1 - passed * (1 - reserve.torque)), (SPEEDS, reserve.speed)):
        for part, key in entries:
            for name in {key, LINEAR.get(key, key)} & drive.get(part, {}).keys():
                drive[part][name] *= 1 - share
