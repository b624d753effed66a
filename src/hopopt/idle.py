"""Limits that never act: how much of each a plan uses, and to what it could be tightened without effect on the plan."""

from collections.abc import Iterator, Mapping
from typing import Any, Literal

import numpy as np

from hopopt.leg.robot import BASE
from hopopt.leg.scales import force_range
from hopopt.ocp.objectives import find
from hopopt.solution import Samples, Solution

IDLE = 0.999  # largest share of a limit that may be used if it is to count as idle
LOADED = 1e-3  # of the force's range: a foot with less is not loaded
CAPS: dict[str, tuple[Literal["motor", "gear"], str]] = {
    "drive torque cap": ("motor", "torque_cap"),
    "gear torque cap": ("gear", "torque_cap"),
    "gear speed cap": ("gear", "speed_cap"),
}
Use = tuple[str, str, float, float, float]  # name, entry, its value, the share used, the value that would do


def idle_limits(plan: Solution, fine: Mapping[str, Samples]) -> dict[str, dict[str, Any]]:
    """Limits that no instant of the plan touches, by name, the least used first, durations last: ``used`` (largest share
    of the range), ``entry`` of the problem, its value ``limit`` and what it could be (``enough``), both in the entry's
    unit (SI).

    fine: the plan's samples by phase. The plan stays what it is if such a limit is dropped or tightened to ``enough``.
    """
    found = [*_joints(plan, fine), *_whole(plan, fine)]
    return {
        name: {"used": used, "entry": entry, "limit": limit, "enough": enough}
        for name, entry, limit, used, enough in sorted(found, key=lambda use: ("duration" in use[1], use[3]))
        if used < IDLE
    }


def _joints(plan: Solution, fine: Mapping[str, Samples]) -> Iterator[Use]:
    """Angles and operating regions, over all phases."""
    leg = plan.design.leg
    q, v = (np.concatenate([getattr(s, part)[:, BASE:] for s in fine.values()]) for part in "qv")
    tau = np.concatenate([s.tau for s in fine.values()])
    for k, joint in enumerate(plan.robot.joints):
        (low, high), (least, most) = (leg.joint[joint].lower, leg.joint[joint].upper), (q[:, k].min(), q[:, k].max())
        yield f"{joint} lower angle", f"leg.{joint}.lower", low, float((high - least) / (high - low)), float(least)
        yield f"{joint} upper angle", f"leg.{joint}.upper", high, float((most - low) / (high - low)), float(most)
        region, used = plan.region(joint), dict[str, float]()
        for plane, use in zip(region.planes, region.use(v[:, k], tau[:, k]), strict=True):
            name = plane.name.rsplit(", ", 1)[0]
            used[name] = max(used.get(name, 0.0), float(np.max(use)))
        for name, share in used.items():
            if name in CAPS:
                path, cap = leg.drive(joint, *CAPS[name])
                yield f"{joint} {name}", path, cap, share, share * cap
            else:
                yield f"{joint} {name}", "", 1.0, share, share


def _whole(plan: Solution, fine: Mapping[str, Samples]) -> Iterator[Use]:
    """Durations, friction, and the window of the foot."""
    hop, goal = plan.design.hop, plan.own[0] or find(plan.objective)
    for phase in fine:
        (shortest, longest), lasted = getattr(hop, f"{phase}_duration"), plan.phases[phase].duration
        entry = f"hop.{'flight' if phase == 'descent' else phase}_duration"
        yield f"shortest {phase}", f"{entry}[0]", shortest, shortest / lasted, lasted
        yield f"longest {phase}", f"{entry}[1]", longest, lasted / longest, lasted
    friction, f = plan.design.contact.friction, fine["stance"].f
    if friction:
        loaded = f[:, -1] >= LOADED * force_range(plan.robot.model)
        needed = float((np.linalg.norm(f[loaded, :-1], axis=1) / f[loaded, -1]).max(initial=0.0))
        yield "friction cone", "contact.friction", friction, needed / friction, needed
    if goal.ends != "free":
        points = plan.apex.points
        off = float(abs(points["foot"][0, 0] - points[plan.robot.joints[0]][0, 0]))
        yield "foot window", "hop.foot_window", hop.foot_window, off / hop.foot_window, off
