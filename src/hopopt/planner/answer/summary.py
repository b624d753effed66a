"""Every figure that is printed of a solution, computed once."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from hopopt.leg.limit_id import Kind, LimitId, kind_of
from hopopt.nlp.refinement.continuous_limits import of_limits
from hopopt.nlp.refinement.mesh_refinement import Refinement
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.nlp.transcription import Rows, Transcription
from hopopt.ocp.hop import Hop
from hopopt.ocp.phases import STANCE
from hopopt.ocp.rules import steepness
from hopopt.optimality.minimum_principle import switching_structure as structure
from hopopt.optimality.minimum_principle.free_switches import Resolved
from hopopt.planner.answer.motion_figures import ACTIVE, FINE, active_limits, most_first, motion_figures
from hopopt.planner.answer.stored_summary import VERSION, Summary
from hopopt.planner.answer.summary_extras import Functions
from hopopt.planner.answer.summary_parts import Mesh, Optimum, StartEnded, Starts
from hopopt.planner.answer.verdict import Verdict
from hopopt.planner.answer.verdict_entries import conditions, error_entry, structure_entry, verification_entries
from hopopt.planner.search.multistart import StartOutcome, grouped, same
from hopopt.planner.solution import Motion, Solution
from hopopt.planner.stopwatch import Stopwatch

BOUNDED = (  # limits whose range is their bound
    Kind.REGION, Kind.WINDOW, Kind.LANDING_WINDOW, Kind.IMPULSE, Kind.IMPACT_LOSS, Kind.FOOT_SPEED, Kind.GEAR_IMPACT,
)  # fmt: skip


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
    solution = refinement.solution
    summary = Summary(
        version=VERSION,
        functions=Functions(
            hop.objective.name if hop.objective.custom else None,
            tuple(c.name for c in hop.constraints),
            rules=hop.added_rules,
        ),
        **figures(hop, plan, solution, verdict),
        **verification_entries(verdict),
        mesh=tuple(Mesh(**asdict(step)) for step in refinement.history),
        refinement_ended=refinement.ended,
        starts=start_figures(outcomes, chosen),
        timings_s=clock.stages,
        wall_s=clock.last - clock.begin,
        result_dir=None,
    )
    kkt = {name: getattr(solution, name) for name in ("z", "p", "g", "lam_g", "lam_x")} | asdict(solution.bounds)
    return Solution.of(plan, summary, kkt=kkt, multipliers=dict(verdict.multipliers), verdict=verdict)


def figures(hop: Hop, plan: Motion, solution: NlpSolution, verdict: Verdict) -> dict[str, Any]:
    """Entries of the summary that follow from the motion, the program's solution and the verdict, and can be computed
    again of a stored result (storage/stated_figures.py)."""
    fine, goal, design = {phase: plan.everywhere(phase, FINE) for phase in plan.phases}, hop.objective, plan.design
    assert verdict.error is not None, "a solution has multipliers"
    return {
        "problem": design.name,
        "title": design.title,
        "hop": design.hop.kind,
        "objective": plan.objective,
        "objective_meaning": goal.meaning,
        "objective_unit": goal.unit,
        "objective_figure": goal.figure,
        "maximized": goal.maximize,
        "clearance_asked_for_m": design.hop.clearance if goal.ends == "required clearance" else None,
        **plan.claims(),
        **plan.stated,
        **motion_figures(plan, fine),
        "objective_error": error_entry(verdict.error),
        "objective_value": solution.value,
        "tie_break_weighs": solution.tie_break,
        "active_limits": most_first({**active_limits(plan, fine[STANCE]), **own_active(solution)}),
        **in_the_objectives_unit(goal.unit, hop.tie_break_bias, limit_gains(solution, design.contact.friction)),
        "scheme": solution.transcription.scheme.name,
        "seed": design.solver.seed,
        "certified": verdict.certified,
        "certificate": conditions(verdict),
        "structure": structure_entry(structure.structure(solution)),
    }


def in_the_objectives_unit(unit: str, bias: float, gains: dict[str, float]) -> dict[str, Any]:
    """Bias of the tie-break and gains of the limits, named by whether the objective is a length."""
    of_unit = "_m" if unit == "m" else ""
    return {f"tie_break_bias{of_unit}": bias, f"gain_per_percent{of_unit}": gains}


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


def by_friction(solution: NlpSolution, phase: str) -> np.ndarray:
    """Change of each row of the friction cone in a phase with the coefficient [N], (instants, sides)."""
    rows = {kind_of(r.name): r for r in solution.transcription.rows if r.phase == phase}
    ground, sides = rows[Kind.GROUND_FORCE], rows[Kind.FRICTION].labels
    force = solution.g[ground.start : ground.stop] * ground.scale
    return np.outer(force, np.full(len(sides), steepness(1 + len(sides) // 2)))


def by_longest(solution: NlpSolution, phase: str) -> float:
    """What one second more for a phase of one arc would gain [objective's unit/s], from the multiplier of its longest duration."""
    where = solution.transcription.variables[phase].durations
    return float(np.maximum(solution.lam_x[where], 0).sum() / solution.transcription.scale[where][0])


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
            gain = -0.01 * friction * float((lam * by_friction(solution, rows.phase)).sum())
            gains[reported] = gains.get(reported, 0.0) + gain
    for name, where in t.variables.items():
        phase = t.problem.phase(name)
        gains[f"longest {name}"] = 0.01 * phase.duration[1] * by_longest(solution, name)
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


def start_figures(
    outcomes: Sequence[StartOutcome], chosen: StartOutcome, asked: int | None = None, apart: float | None = None
) -> Starts:
    """How many starts ended where, on the first mesh; ``asked``: the starting points among them; ``apart``: as of ``grouped``."""

    def optimum(group: Sequence[StartOutcome]) -> Optimum:
        return Optimum(group[0].value, len(group), tuple(o.name for o in group))

    ranked = sorted(outcomes, key=lambda o: -o.merit)

    return Starts(
        count=len(outcomes),
        agreeing=sum(o.success and same(o.objective, chosen.objective, apart) for o in outcomes),
        failed=tuple(o.name for o in outcomes if not o.success),
        chosen=chosen.name,
        optima=tuple(optimum(group) for group in grouped(ranked, apart)),
        each=tuple(StartEnded(o.name, o.status, o.value, o.iterations, o.seconds, near=o.near) for o in outcomes),
        ended=sum(o.success and o.near is None for o in outcomes),
        stopped=tuple(o.name for o in outcomes if o.near is not None),
        asked=asked,
        apart=apart,
    )
