"""A planned hop at the control rate, for whoever moves a robot by it: CSV, JSON, and a message of ROS 2.

Angles and speeds are those of the joints as the problem file defines them, torques are behind the gear. SI throughout.
"""

import csv
import io
import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from hopopt.control.closed_loop import make_plant
from hopopt.control.setting import Setting
from hopopt.control.tracking.track import Track
from hopopt.drivetrain.dynamics import refuse_series_springs
from hopopt.leg.kinematics import loop_axes
from hopopt.leg.robot import BASE
from hopopt.ocp.phases import DESCENT, FLIGHT, STANCE
from hopopt.planner.motion import Motion, Samples
from hopopt.planner.reserve import TrackedPlan

NANOSECONDS = 10**9  # in a second
FORMAT = 1  # of the JSON object


def tracker_of(plan: TrackedPlan) -> Track:
    """The strategy ``track`` with its own settings, for a plan. Raises UsageError for a leg that cannot be simulated."""
    design = plan.motion.design
    make_plant(design)
    return Track(Setting(design, 1 / design.simulation.control_rate, plan.reference))


def gains_of(plan: TrackedPlan, samples: Samples) -> np.ndarray:
    """K (k, n, 2 n) of the tracker's torque tau - K (q - q_plan, v - v_plan) [N m/rad, N m s/rad] at k control instants.

    NaN in phases that the tracker does not follow (the descent of a hop from rest, a landing), and all along for a leg that
    cannot be simulated.
    """
    solution, design = plan.motion, plan.motion.design
    n = len(solution.robot.joints)
    gains, period = np.full((len(samples.t), n, 2 * n), np.nan), 1 / design.simulation.control_rate
    if not loop_axes(design.leg):
        tracker = tracker_of(plan)
        followed = (STANCE, FLIGHT, DESCENT) if design.hop.periodic else (STANCE, FLIGHT)
        for k in np.flatnonzero(np.isin(samples.phase, followed)):
            contact = bool(samples.phase[k] == STANCE)
            since = samples.t[k] - (0.0 if contact else solution.lift_off)
            gains[k] = tracker.gains[contact].at(round(since / period))[2]
    return gains


def samples_at_control_rate(motion: Motion) -> Samples:
    """The whole leg at every control instant of the hop, and at its end."""
    rate = motion.design.simulation.control_rate
    instants = np.arange(int(np.ceil(motion.end * rate - 1e-6))) / rate
    return motion.sample([*instants, motion.end])


def columns(plan: TrackedPlan) -> dict[str, tuple[str, Sequence[Any]]]:
    """name -> (unit, values) at the control instants: time, phase, body, joints, ground force, gains if the leg has any."""
    s, joints, found = samples_at_control_rate(plan.motion), plan.motion.design.leg.joints, {}
    gains, torques = gains_of(plan, s), plan.motion.robot.joint_torques(s.q, s.command)
    found["t"], found["phase"] = ("s", s.t), ("", s.phase)
    for k, axis in enumerate("xz"):
        found[f"body_{axis}"], found[f"body_v{axis}"] = ("m", s.q[:, k]), ("m/s", s.v[:, k])
    for k, joint in enumerate(joints):
        units = plan.motion.design.leg.units(joint)
        found[f"q_{joint}"] = units.q, s.q[:, BASE + k]
        found[f"v_{joint}"] = units.v, s.v[:, BASE + k]
        found[f"tau_{joint}"] = units.tau, torques[:, k]
    for k, axis in ((0, "x"), (-1, "z")):
        found[f"force_{axis}"] = "N", s.f[:, k]
    for k, joint in enumerate(joints if np.isfinite(gains).any() else ()):
        for m, other in enumerate(joints):
            units = plan.motion.design.leg.units(joint).tau, plan.motion.design.leg.units(other).q
            found[f"K_{joint}_q_{other}"] = "{}/{}".format(*units), gains[:, k, m]
            found[f"K_{joint}_v_{other}"] = "{} s/{}".format(*units), gains[:, k, len(joints) + m]
    return found


def to_csv(plan: TrackedPlan) -> str:
    """One header line of names with units in brackets, one line for each instant; an empty cell where there is no gain."""
    found, text = columns(plan), io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([f"{name} [{unit}]" if unit else name for name, (unit, _) in found.items()])
    writer.writerows(zip(*([_plain(x) for x in values] for _, values in found.values()), strict=True))
    return text.getvalue()


def to_json(plan: TrackedPlan) -> str:
    """One object: the columns of the CSV file by name, their units, and what the plan is; null where there is no gain."""
    found, design = columns(plan), plan.motion.design
    head = {"format": FORMAT, "problem": design.name, "joints": design.leg.joints}
    head |= {"period_s": 1 / design.simulation.control_rate, "clearance_m": plan.reference.clearance}
    units = {name: unit for name, (unit, _) in found.items() if unit}
    values = {name: [_plain(x) for x in values] for name, (_, values) in found.items()}
    return json.dumps({**head, "units": units, "columns": values}) + "\n"


def to_ros2(plan: TrackedPlan) -> str:
    """A trajectory_msgs/msg/JointTrajectory as YAML, a point for each control instant; effort is the planned torque."""
    refuse_series_springs(plan.motion.design.leg, "a trajectory for ROS 2")
    s, joints = samples_at_control_rate(plan.motion), plan.motion.design.leg.joints
    torques = plan.motion.robot.joint_torques(s.q, s.command)
    lines = ["header: {stamp: {sec: 0, nanosec: 0}, frame_id: ''}", f"joint_names: {json.dumps(joints)}", "points:"]
    for k, t in enumerate(s.t):
        seconds, rest = divmod(round(float(t) * NANOSECONDS), NANOSECONDS)
        values = {"positions": s.q[k, BASE:], "velocities": s.v[k, BASE:], "accelerations": s.a[k, BASE:]}
        for mark, (name, numbers) in zip("-   ", (values | {"effort": torques[k]}).items(), strict=True):
            lines.append(f"{mark} {name}: [{', '.join(f'{x:.12f}' for x in numbers)}]")
        lines.append(f"  time_from_start: {{sec: {seconds}, nanosec: {rest}}}")
    return "\n".join(lines) + "\n"


def _plain(value: Any) -> Any:
    """A number or word as Python has it; None for NaN."""
    return str(value) if isinstance(value, str) else None if np.isnan(value) else float(value)
