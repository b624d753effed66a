"""A robot's hop as if it had been simulated: what its log amounts to by the simulation's definitions, beside the bound.

The body need not be measured. In stance the pinned foot and the joint angles place it; in flight the centre of mass follows
the parabola that it left the ground with.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hopopt.comparison.compare import planned_trace
from hopopt.design import Design
from hopopt.drivetrain.dynamics import refuse_series_springs
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.leg.robot import BASE, build_robot
from hopopt.planner.solution import Solution
from hopopt.robot_data.robot_log import RobotLog
from hopopt.sim.hop_metrics import HopFigures
from hopopt.sim.machine import Machine
from hopopt.sim.state import ACCOUNTS
from hopopt.sim.trace import Event, Trace

EXCESS = 0.05  # of the stall torque: a torque that is so much above what the drive gives is named


def trace_of(log: RobotLog, design: Design) -> Trace:
    """The log as if it had been simulated, the body placed by the leg in stance and by a parabola in flight."""
    refuse_series_springs(design.leg, "a robot's log")
    robot = build_robot(design.leg)
    machine, n, gravity = Machine(robot), len(robot.joints), robot.model.gravity.linear[[0, 2]]
    q, v = np.zeros((len(log.t), BASE + n)), np.zeros((len(log.t), BASE + n))
    foot, left = 0.0, (0.0, np.zeros(BASE), np.zeros(BASE))
    events: list[Event] = []
    for k, (t, contact) in enumerate(zip(log.t, log.contact, strict=True)):
        before = bool(log.contact[k - 1]) if k else True
        if not contact and before:  # it left at the row before
            com = np.array(machine.points(q[k - 1])["com"])
            left = (float(log.t[k - 1]), com, np.array(machine.com_velocity(q[k - 1], v[k - 1])))
            events.append(Event("lift-off", float(log.t[k - 1]), 0.0))
        q[k, BASE:], v[k, BASE:] = log.q[k], log.v[k]
        if contact:
            if not before:
                foot = float(machine.foot_motion(q[k - 1], v[k - 1])[0][0])
                events.append(Event("touchdown", float(t), 0.0))
            terms = machine.stance_terms(log.q[k], log.v[k])
            q[k], v[k] = terms.q, terms.v
            q[k, 0] += foot
        else:
            since, (began, com, speed) = t - left[0], left
            q[k, :BASE] = com + speed * since + 0.5 * gravity * (t - began) ** 2 - machine.points(q[k])["com"]
            v[k, :BASE] = speed + gravity * since - machine.com_velocity(q[k], v[k])
    power = np.sum(log.tau * log.v, axis=1)
    work = np.zeros((len(log.t), ACCOUNTS))  # losses are not logged
    work[1:, 0] = np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(log.t))
    arrays = (log.t, q, v, log.tau, robot.drive_torques(q, log.tau), log.tau, log.force, log.contact, work)
    return Trace(robot, *arrays, events=tuple(events), outcome="the log ends")


def torques_exceeded(design: Design, log: RobotLog) -> list[str]:
    """Joints whose logged torque is above what the drive can give at that speed, in words."""
    found, robot = [], build_robot(design.leg)
    of_body = np.zeros((len(log.t), BASE))
    q, v = (np.hstack([of_body, each]) for each in (log.q, log.v))
    speeds, torques = robot.drive_speeds(q, v), robot.drive_torques(q, log.tau)
    for k, joint in enumerate(design.leg.joints):
        region = operating_region(design.leg, joint, robot.parameters)
        low, high = region.torque_bounds(speeds[:, k])
        excess = np.maximum(torques[:, k] - high, low - torques[:, k])
        worst = int(np.argmax(excess))
        if excess[worst] > EXCESS * float(region.torque_bounds(0.0)[1]):
            tau, w = torques[worst, k], speeds[worst, k]
            found.append(
                f"{joint} with {tau:.0f} N m at {w:.1f} rad/s, {excess[worst]:.0f} N m above its drive's limit"
            )
    return found


def account(design: Design, log: RobotLog, bound: Solution | None) -> dict[str, Any]:
    """What ``HopFigures`` says of the first hop of a log, torques above the drives' limits among the limits exceeded; with
    a bound its clearance, the share of it that was reached and the gap [m] as push, timing and retraction."""
    unloaded = design.contact.model_copy(update={"least_force": 0.0})  # nothing is known of a force that was not logged
    judged = design if log.force.any() else design.model_copy(update={"contact": unloaded})
    figures = HopFigures(judged, trace_of(log, design))
    data = figures.as_dict()
    data["limits_exceeded"] = [*figures.limits_exceeded, *torques_exceeded(design, log)]
    del data["energy_error"]  # what impacts and gears took was not logged
    if bound is not None:
        best = HopFigures(bound.design, planned_trace(bound)).budget
        gap = {part: best[part] - figures.budget[part] for part in best}
        data |= {"bound_m": bound.clearance, "share_of_bound": figures.clearance / bound.clearance, "gap": gap}
    return data


def sentences(data: Mapping[str, Any]) -> list[str]:
    """An account in words, a sentence each."""
    first = f"clearance {data['clearance_m']:.3f} m"
    if "bound_m" in data:
        first += f", {data['share_of_bound']:.0%} of the bound of {data['bound_m']:.3f} m"
    left = data["lift_off"]
    found = [first, f"lift-off at {left['time_s']:.3f} s with {left['vertical_m_s']:.2f} m/s upwards"]
    if "gap" in data:
        parts = ", ".join(f"{part.removesuffix('_m')} {value:+.3f} m" for part, value in data["gap"].items())
        found.append(f"missing of the bound: {parts}")
    found += [f"limit exceeded: {words}" for words in data["limits_exceeded"]]
    return [*found, data["cut_short"]] if data["cut_short"] else found
