"""Every figure of a summary that follows from the motion alone."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hopopt.leg.kinematics import reach
from hopopt.leg.limit_id import Kind, LimitId
from hopopt.leg.robot import BASE
from hopopt.leg.scales import DESCENT_RANGE, force_range, friction_needed
from hopopt.ocp.phases import FLIGHT, STANCE
from hopopt.ocp.rules import steepness
from hopopt.planner.answer.limit_use import LOADED, as_dict, idle_uses
from hopopt.planner.answer.summary_parts import IdleLimit, LeansOn, LiftOff, Parts, PhaseFigures, UpperBound
from hopopt.planner.answer.touchdown import landing, obstacle, orbit
from hopopt.planner.solution import Motion, Samples
from hopopt.verify.check import LIMIT
from hopopt.verify.upper_bound import upper_bound

ACTIVE = 1e-3  # share of its range by which a limit may be missed and still count as active
FINE = np.linspace(0.0, 1.0, 9)
NO_FRICTION = 10.0  # coefficient that no ground has, and no problem may ask for more


def motion_figures(plan: Motion, fine: Mapping[str, Samples]) -> dict[str, Any]:
    """Entries of the summary that follow from the motion alone; ``fine``: its samples, by phase."""
    stance = fine[STANCE]
    return {
        "upper_bound": UpperBound(**upper_bound(plan.design).figures()),
        "parts": parts(plan),
        "orbit": orbit(plan),
        "landing": landing(plan),
        "obstacle": obstacle(plan),
        "lowest_point": _lowest(plan),
        "phases": {name: phase_figures(plan, name, s) for name, s in fine.items()},
        "lift_off": lift_off(plan),
        "vertical_at_end_of_flight_m_s": float(plan.apex.com_v[0, 1]),
        "peak_ground_force_N": float(np.linalg.norm(stance.f, axis=1).max()),
        "peak_vertical_force_N": float(stance.f[:, -1].max()),
        "friction": plan.design.contact.friction,
        "grip_without_load_N": float(np.abs(stance.f[stance.f[:, -1] < 1.0, :-1]).max(initial=0.0)),
        "saturation_mean": saturation_mean(plan, stance),
        "energy": energy(plan, fine),
        "leans_on": leans_on(plan, stance),
        "idle_limits": {name: IdleLimit(**use) for name, use in as_dict(idle_uses(plan, fine)).items()},
    }


def _time_mean(samples: Samples, values: np.ndarray, per_interval: int = len(FINE)) -> float:
    """Mean over time [values' unit] of values at the FINE normalised times of every interval (trapezoids)."""
    t, y = samples.t.reshape(-1, per_interval), values.reshape(-1, per_interval)
    return float(np.trapezoid(y, t, axis=1).sum() / (t[-1, -1] - t[0, 0]))


def parts(plan: Motion) -> Parts:
    """The three exact, signed parts [m] that sum to the clearance (COM is the whole leg's centre of mass)."""
    start, end = plan.sample_phase(FLIGHT, np.array([0.0])), plan.apex
    low, high = float(start.points["com"][0, 1]), float(end.points["com"][0, 1])
    return Parts(low, high - low, plan.claims()["clearance_m"] - high)


def _lowest(plan: Motion) -> str:
    end = plan.apex
    heights = {name: round(float(end.points[name][0, 1]), 9) for name in ("foot", *plan.robot.joints)}
    return min(heights, key=lambda name: heights[name])


def phase_figures(plan: Motion, phase: str, samples: Samples) -> PhaseFigures:
    """Duration, mesh and the extremes of one phase."""
    joints = plan.robot.joints
    return PhaseFigures(
        duration_s=plan.phases[phase].duration,
        intervals=len(plan.phases[phase].x_start),
        peak_torque_Nm={j: float(np.abs(samples.tau[:, k]).max()) for k, j in enumerate(joints)},
        peak_speed_rad_s={j: float(np.abs(samples.v[:, BASE + k]).max()) for k, j in enumerate(joints)},
    )


def lift_off(plan: Motion) -> LiftOff:
    """Time [s], speed of the centre of mass [m/s] and its direction at lift-off."""
    s = plan.sample_phase(FLIGHT, np.array([0.0]))
    vx, vz = (float(x) for x in s.com_v[0])
    return LiftOff(plan.lift_off, float(np.hypot(vx, vz)), vertical_m_s=vz, horizontal_m_s=vx)


def saturation_mean(plan: Motion, stance: Samples) -> dict[str, float]:
    """C_avg of every joint in stance (eq. sim_cactavg), capped at 1 between the nodes."""
    means = {}
    for k, joint in enumerate(plan.robot.joints):
        ratio = plan.region(joint).saturation(stance.v[:, BASE + k], stance.tau[:, k])
        means[joint] = _time_mean(stance, np.minimum(ratio, 1.0))
    return means


def energy(plan: Motion, fine: Mapping[str, Samples]) -> dict[str, float]:
    """Mechanical work of the joints [J]: net and positive, in every phase."""
    figures = {}
    for name, s in fine.items():
        power, T = s.tau * s.v[:, BASE:], plan.phases[name].duration
        figures[f"{name}_net_J"] = _time_mean(s, power.sum(axis=1)) * T
        figures[f"{name}_positive_J"] = sum(_time_mean(s, np.maximum(column, 0.0)) * T for column in power.T)
    return figures


def active_limits(plan: Motion, stance: Samples) -> dict[str, float]:
    """Share of stance in which each limit is active, largest first; a limit of its duration is active in all of it."""
    shares: dict[str, np.ndarray | bool] = {}
    leg, size = plan.design.leg, reach(plan.design.leg)
    for k, joint in enumerate(plan.robot.joints):
        region, angle = plan.region(joint), stance.q[:, BASE + k]
        use = np.array(region.use(stance.v[:, BASE + k], stance.tau[:, k]))
        shares[str(LimitId(Kind.REGION, joint))] = use.max(axis=0) > 1 - ACTIVE
        margin = ACTIVE * (leg.joint[joint].upper - leg.joint[joint].lower)
        near = np.minimum(angle - leg.joint[joint].lower, leg.joint[joint].upper - angle)
        shares[str(LimitId(Kind.ANGLE, joint))] = near < margin
    shares |= _active_at_the_ground(plan, stance)
    for name in plan.design.hop.above_ground:
        if name != "foot":
            shares[f"{name} on the ground"] = stance.points[name][:, 1] < ACTIVE * size
    shares |= {f"{end} stance": True for end in _ends_of_stance_time(plan)}
    means = {name: _time_mean(stance, np.broadcast_to(active, stance.t.shape) + 0.0) for name, active in shares.items()}
    return most_first({name: share for name, share in means.items() if share > 1e-3})


def most_first(amounts: Mapping[str, float]) -> dict[str, float]:
    """Sorted, the largest first."""
    return dict(sorted(amounts.items(), key=lambda pair: -pair[1]))


def _active_at_the_ground(plan: Motion, stance: Samples) -> dict[str, np.ndarray]:
    """Where the ground's limits are active: it cannot pull, a loaded foot may not slip, the body may not descend."""
    margin, friction = ACTIVE * force_range(plan.robot.model), plan.design.contact.friction
    along, up = np.abs(stance.f[:, :-1]).max(axis=1) / steepness(stance.f.shape[1]), stance.f[:, -1]
    active = {"ground cannot pull": up < margin}
    if friction is not None:
        active["friction cone"] = (along > friction * up - margin) & (up >= margin)
    if not plan.design.hop.counter_movement:
        active["body never descends"] = stance.v[:, 1] < ACTIVE * DESCENT_RANGE
    return active


def leans_on(plan: Motion, stance: Samples) -> LeansOn:
    """What the hop needs of the ground and of the time that it is allowed."""
    size, friction = force_range(plan.robot.model), plan.design.contact.friction
    up, along = stance.f[:, -1], np.linalg.norm(stance.f[:, :-1], axis=1)
    loaded = up >= LOADED * size
    held = along[~loaded].max(initial=0.0) > NO_FRICTION * LOADED * size
    needed = np.inf if held else friction_needed(along[loaded], up[loaded], friction, LIMIT * size)
    share = _time_mean(stance, ~loaded + 0.0)
    return LeansOn(needed, share, next(iter(_ends_of_stance_time(plan)), None))


def _ends_of_stance_time(plan: Motion) -> list[str]:
    """Which ends of the time that stance may take are reached: both where it is given."""
    (shortest, longest), lasted = plan.design.hop.stance_duration, plan.phases[STANCE].duration
    ends = {"longest": lasted >= (1 - ACTIVE) * longest, "shortest": lasted <= (1 + ACTIVE) * shortest}
    return [name for name, reached in ends.items() if reached]
