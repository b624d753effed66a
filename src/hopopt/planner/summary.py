"""Every figure that is printed of a solution, computed once."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from hopopt.leg.kinematics import reach
from hopopt.leg.limit_id import Kind, LimitId, kind_of
from hopopt.leg.robot import BASE
from hopopt.leg.scales import DESCENT_RANGE, force_range
from hopopt.nlp.continuous_limits import of_limits
from hopopt.nlp.ipopt import NlpSolution
from hopopt.nlp.mesh_refinement import Refinement
from hopopt.nlp.transcription import Rows, Transcription
from hopopt.ocp.constraints import steepness
from hopopt.ocp.hop import Hop
from hopopt.ocp.phases import FLIGHT, STANCE
from hopopt.optimality import switching_structure as structure
from hopopt.optimality.free_switches import Resolved
from hopopt.planner.limit_use import as_dict, idle_uses
from hopopt.planner.multistart import StartOutcome, distinct, same
from hopopt.planner.orbit import orbit
from hopopt.planner.solution import Motion, Samples, Solution
from hopopt.planner.stopwatch import Stopwatch
from hopopt.planner.stored_summary import VERSION, Summary
from hopopt.planner.summary_extras import Functions
from hopopt.planner.summary_parts import (
    IdleLimit,
    LiftOff,
    Mesh,
    Optimum,
    Parts,
    PhaseFigures,
    StartEnded,
    Starts,
    UpperBound,
)
from hopopt.planner.verdict import Verdict
from hopopt.planner.verdict_entries import conditions, error_entry, structure_entry, verification_entries
from hopopt.verify.upper_bound import upper_bound

ACTIVE = 1e-3  # share of its range by which a limit may be missed and still count as active
BOUNDED = (  # limits whose range is their bound
    Kind.REGION, Kind.WINDOW, Kind.LANDING_WINDOW, Kind.IMPULSE, Kind.IMPACT_LOSS, Kind.FOOT_SPEED, Kind.GEAR_IMPACT,
)  # fmt: skip
FINE = np.linspace(0.0, 1.0, 9)


def summarize(
    hop: Hop,
    plan: Motion,
    refinement: Refinement | Resolved,
    verdict: Verdict,
    outcomes: Sequence[StartOutcome],
    chosen: StartOutcome,
    clock: Stopwatch,
) -> Solution:
    """The plan with its summary: what ``--json`` prints and ``summary.json`` keeps."""
    fine = {phase: plan.everywhere(phase, FINE) for phase in plan.phases}
    stance, goal, solution = fine[STANCE], hop.objective, refinement.solution
    assert verdict.error is not None, "a fresh solution has multipliers"
    found = {**plan.claims(), **plan.stated}
    summary = Summary(
        version=VERSION,
        problem=plan.design.name,
        title=plan.design.title,
        hop=plan.design.hop.kind,
        objective=plan.objective,
        objective_meaning=goal.meaning,
        objective_unit=goal.unit,
        objective_figure=goal.figure,
        maximized=goal.maximize,
        functions=Functions(goal.name if goal.custom else None, tuple(c.name for c in hop.constraints)),
        clearance_asked_for_m=plan.design.hop.clearance if goal.ends == "required clearance" else None,
        **verification_entries(verdict),
        **found,
        objective_error=error_entry(verdict.error),
        objective_value=solution.objective,
        tie_break_weighs=abs(solution.objective - plan.stated.get(goal.figure, solution.objective)),
        **motion_figures(plan, fine),
        active_limits=most_first({**active_limits(plan, stance), **own_active(solution)}),
        **in_the_objectives_unit(goal.unit, hop.tie_break_bias, limit_gains(solution, plan.design.contact.friction)),
        mesh=tuple(Mesh(**asdict(step)) for step in refinement.history),
        refinement_ended=refinement.ended,
        scheme=solution.transcription.scheme.name,
        starts=start_figures(outcomes, chosen),
        seed=plan.design.solver.seed,
        timings_s=clock.stages,
        wall_s=clock.last - clock.begin,
        result_dir=None,
        certified=verdict.certified,
        certificate=conditions(verdict),
        structure=structure_entry(structure.structure(solution)),
    )
    kkt = {name: getattr(solution, name) for name in ("z", "p", "g", "lam_g", "lam_x")} | asdict(solution.bounds)
    return Solution.of(plan, summary, kkt=kkt, multipliers=dict(verdict.multipliers), verdict=verdict)


def motion_figures(plan: Motion, fine: Mapping[str, Samples]) -> dict[str, Any]:
    """Entries of the summary that follow from the motion alone; ``fine``: its samples, by phase."""
    stance = fine[STANCE]
    return {
        "upper_bound": UpperBound(**upper_bound(plan.design).figures()),
        "parts": parts(plan),
        "orbit": orbit(plan),
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
        "idle_limits": {name: IdleLimit(**use) for name, use in as_dict(idle_uses(plan, fine)).items()},
    }


def in_the_objectives_unit(unit: str, bias: float, gains: dict[str, float]) -> dict[str, Any]:
    """Bias of the tie-break and gains of the limits, named by whether the objective is a length."""
    of_unit = "_m" if unit == "m" else ""
    return {f"tie_break_bias{of_unit}": bias, f"gain_per_percent{of_unit}": gains}


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
    (shortest, longest), lasted = plan.design.hop.stance_duration, plan.phases[STANCE].duration
    shares["longest stance"] = lasted >= longest - ACTIVE * longest
    shares["shortest stance"] = lasted <= shortest + ACTIVE * shortest
    means = {name: _time_mean(stance, np.broadcast_to(active, stance.t.shape) + 0.0) for name, active in shares.items()}
    return most_first({name: share for name, share in means.items() if share > 1e-3})


def most_first(amounts: Mapping[str, float]) -> dict[str, float]:
    """Sorted, the largest first."""
    return dict(sorted(amounts.items(), key=lambda pair: -pair[1]))


def own_active(solution: NlpSolution) -> dict[str, float]:
    """Share of stance in which sides of user-defined constraints, by name, are active, at the nodes."""
    t, b, shares = solution.transcription, solution.bounds, dict[str, float]()
    h, weights = solution.phases[STANCE].lengths, t.layouts[STANCE].scheme.b
    for rows in (r for r in t.rows if r.phase == STANCE and kind_of(r.name) is Kind.USER):
        at, size = slice(rows.start, rows.stop), _own_range(t, rows)
        for side, left in (("upper", b.high_g[at] - solution.g[at]), ("lower", solution.g[at] - b.low_g[at])):
            active = (left < ACTIVE * size).reshape(len(h), len(weights), -1).any(axis=2)
            shares[f"{rows.name} ({side})"] = float(h @ active @ weights / h.sum())
    return {name: share for name, share in shares.items() if share > 1e-3}


def _own_range(t: Transcription, rows: Rows) -> np.ndarray:
    """What one per cent of a user-defined limit is of: the distance of its two sides, or the size of its only one."""
    lower, upper = t.lbg[rows.start : rows.stop], t.ubg[rows.start : rows.stop]
    both = np.isfinite(lower) & np.isfinite(upper)
    one = np.abs(np.where(np.isfinite(upper), upper, lower))
    return np.where(both, np.subtract(upper, lower, out=np.zeros_like(one), where=both), one)


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


def by_friction(solution: NlpSolution) -> np.ndarray:
    """Change of each row of the friction cone with the coefficient [N], (instants, sides)."""
    rows = {kind_of(r.name): r for r in solution.transcription.rows if r.phase == STANCE}
    ground, sides = rows[Kind.GROUND_FORCE], rows[Kind.FRICTION].labels
    force = solution.g[ground.start : ground.stop] * ground.scale
    return np.outer(force, np.full(len(sides), steepness(1 + len(sides) // 2)))


def limit_gains(solution: NlpSolution, friction: float | None) -> dict[str, float]:
    """What relaxing each limit by one per cent of its range would gain [objective's unit], from the multipliers: more
    of what is maximised, less of what is minimised. The friction cone's range is its coefficient."""
    t, gains, lam_g = solution.transcription, {}, of_limits(solution)
    for rows in t.rows:
        kind, reported = kind_of(rows.name), str(rows.name)
        if kind in BOUNDED:
            bound = np.abs(t.ubg[rows.start : rows.stop])
            gains[reported] = gains.get(reported, 0.0) + 0.01 * float(np.abs(lam_g[rows.start : rows.stop]) @ bound)
        elif kind is Kind.USER:
            for side, way in (("upper", 1.0), ("lower", -1.0)):
                pushed = np.maximum(way * lam_g[rows.start : rows.stop], 0.0) @ _own_range(t, rows)
                name = f"{reported} ({side})"
                gains[name] = gains.get(name, 0.0) + 0.01 * float(pushed)
        elif kind is Kind.FRICTION and friction is not None:
            lam = solution.lam_g[rows.start : rows.stop].reshape(-1, len(rows.labels)) / rows.scale
            gains[reported] = -0.01 * friction * float((lam * by_friction(solution)).sum())
    for name, where in t.variables.items():
        phase = t.problem.phase(name)
        gains[f"longest {name}"] = (
            0.01
            * phase.duration[1]
            / t.scale[where.durations][0]
            * float(np.maximum(solution.lam_x[where.durations], 0).sum())
        )
        q = next(s for s in phase.states if s.name == "q")
        at = sum(s.size for s in phase.states[: phase.states.index(q)])
        size = sum(s.size for s in phase.states)
        lam = solution.lam_x[where.x].reshape(-1, size)[1:, at : at + q.size]  # the start itself is given
        span = q.column("upper") - q.column("lower")
        for k, joint in enumerate(q.labels):
            angle = str(LimitId(Kind.ANGLE, joint))
            gains[angle] = gains.get(angle, 0.0) + 0.01 * float(
                np.abs(lam[:, k]).sum() * span[k] / q.column("scale")[k]
            )
    return most_first({name: gain for name, gain in gains.items() if gain > 1e-6})


def start_figures(outcomes: Sequence[StartOutcome], chosen: StartOutcome) -> Starts:
    """How many starts ended where, on the first mesh."""

    def optimum(best: StartOutcome) -> Optimum:
        members = tuple(o.name for o in outcomes if o.success and same(o.objective, best.objective))
        return Optimum(best.objective, len(members), members)

    return Starts(
        count=len(outcomes),
        agreeing=sum(o.success and same(o.objective, chosen.objective) for o in outcomes),
        failed=tuple(o.name for o in outcomes if not o.success),
        chosen=chosen.name,
        optima=tuple(optimum(best) for best in distinct(outcomes)),
        each=tuple(StartEnded(o.name, o.status, o.objective, o.iterations, o.seconds) for o in outcomes),
    )
