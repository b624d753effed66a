"""Every figure of a summary that follows from the problem, the program's solution and its verdict."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from hopopt.design import Design
from hopopt.leg.limit_id import Kind, kind_of, place_limit
from hopopt.leg.scales import Scale
from hopopt.nlp.refinement.continuous_limits import of_limits
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.nlp.transcription import Rows, Transcription
from hopopt.ocp.hop import Hop
from hopopt.ocp.phases import STANCE
from hopopt.ocp.rules import steepness
from hopopt.optimality.certificate import by_entry
from hopopt.optimality.minimum_principle.switching_structure import Stretch, sentences, structure
from hopopt.planner.answer.motion_figures import ACTIVE, MotionFigures, Sampled, active_limits, most_first
from hopopt.planner.checks.verdict import StatedError, Verdict, Verification
from hopopt.planner.motion import Motion
from hopopt.record import Real, Strict, computed, if_any, stated
from hopopt.verify.check import Condition

SLIGHT = 1e-6  # [the objective's unit] on the paper's leg: what a limit may gain without being named
BOUNDED = (  # limits whose range is their bound
    Kind.REGION, Kind.MOTOR_POWER, Kind.TORQUE_RATE, Kind.FORCE_RATE, Kind.WINDOW, Kind.LANDING_WINDOW, Kind.IMPULSE, Kind.IMPACT_LOSS, Kind.FOOT_SPEED, Kind.GEAR_IMPACT,
)  # fmt: skip


@dataclass(frozen=True)
class Structure(Strict):
    """Switching structure: which limit acts when."""

    words: tuple[str, ...] = stated("in words, a sentence for each phase and subject")
    stance: tuple[Stretch, ...] = stated("stretches of stance")
    flight: tuple[Stretch, ...] = stated("stretches of flight")
    descent: tuple[Stretch, ...] | None = if_any("stretches of the descent")
    landing: tuple[Stretch, ...] | None = if_any("stretches of a landing to rest")
    solved_again: bool | None = if_any("whether this is the hop with free switching times")
    note: str | None = if_any("why it is not")
    switches_s: Mapping[str, tuple[float, ...]] | None = if_any("switching times, by phase [s]")
    jumps_s: Mapping[str, tuple[float, ...]] | None = if_any("those at which a torque jumps, by phase [s]")
    difference: Real | None = if_any("of the objective from that before, relative")


@dataclass(frozen=True)
class FigureSource:
    """What the figures of a summary are computed from: the question, the motion, the program's solution, the verdict."""

    hop: Hop
    plan: Motion
    solution: NlpSolution
    verdict: Verdict

    @cached_property
    def sampled(self) -> Sampled:
        """The motion with its samples."""
        return Sampled(self.plan)

    @cached_property
    def gains(self) -> dict[str, float]:
        """What one per cent more of each limit's range would gain [objective's unit]."""
        return limit_gains(self.solution, self.plan.design)

    def if_length(self, figure: Any, length: bool) -> Any:
        """A figure if the objective is a length (or is none), for its name says the unit; else None."""
        return figure if (self.hop.objective.unit == "m") is length else None


def figures(source: FigureSource) -> dict[str, Any]:
    """Entries of a summary that can be computed again of a stored result (storage/stated_figures.py)."""
    own = {**source.plan.claims(), **source.plan.stated}
    of_motion, of_program = computed(MotionFigures, source.sampled), computed(ProgramFigures, source)
    return {**own, **of_motion, **of_program, **computed(Verification, source.verdict)}


def all_active(source: FigureSource) -> dict[str, float]:
    """Share of stance in which each limit acts, the user's own among them, largest first."""
    return most_first({**active_limits(source.plan, source.sampled.stance), **own_active(source.solution)})


def structure_of(solution: NlpSolution) -> Structure:
    """The switching structure, in words and by phase."""
    found = structure(solution)
    stretches: dict[str, Any] = {phase: tuple(parts) for phase, parts in found.items()}
    return Structure(words=tuple(sentences(found)), **stretches)


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
    """What one per cent of a user-defined limit is of: the distance of its two sides, or the size of its only one; of a limit at
    zero its scale, which is 1 in the program."""
    lower, upper = t.lbg[rows.start : rows.stop], t.ubg[rows.start : rows.stop]
    both = np.isfinite(lower) & np.isfinite(upper)
    one = np.abs(np.where(np.isfinite(upper), upper, lower))
    one[one == 0] = 1.0
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


def limit_gains(solution: NlpSolution, design: Design) -> dict[str, float]:
    """What relaxing each limit by one per cent of its range would gain [objective's unit], from the multipliers: more
    of what is maximised, less of what is minimised. The friction cone's range is its coefficient."""
    t, gains, lam_g, friction = solution.transcription, {}, of_limits(solution), design.contact.friction
    for rows in t.rows:
        kind, reported = kind_of(rows.name), str(rows.name)
        if kind in BOUNDED:
            bound = np.abs(t.ubg[rows.start : rows.stop])
            gains[reported] = gains.get(reported, 0.0) + 0.01 * float(np.abs(lam_g[rows.start : rows.stop]) @ bound)
        elif kind is Kind.TEMPERATURE:  # its scale is its range
            gains[reported] = gains.get(reported, 0.0) + 0.01 * float(np.abs(lam_g[rows.start : rows.stop]).sum())
        elif kind is Kind.USER:
            for side, way in (("upper", 1.0), ("lower", -1.0)):
                pushed = np.maximum(way * lam_g[rows.start : rows.stop], 0.0) @ _own_range(t, rows)
                name = f"{reported} ({side})"
                gains[name] = gains.get(name, 0.0) + 0.01 * float(pushed)
        elif kind is Kind.FRICTION and friction is not None:
            lam = solution.lam_g[rows.start : rows.stop].reshape(-1, len(rows.labels)) / rows.scale
            gain = -0.01 * friction * float((lam * by_friction(solution, rows.phase)).sum())
            gains[reported] = gains.get(reported, 0.0) + gain
    for name in t.variables:
        phase = t.problem.phase(name)
        gains[f"longest {name}"] = 0.01 * phase.duration[1] * by_longest(solution, name)
        q = next(s for s in phase.states if s.name == "q")
        lam, scale = t.nodes_of(name, "q", solution.lam_x)
        span = q.column("upper") - q.column("lower")
        for k, joint in enumerate(q.labels):
            angle = str(place_limit(design.leg, joint))
            pressed = float(np.abs(lam[1:, k]).sum())  # the start itself is given
            gains[angle] = gains.get(angle, 0.0) + 0.01 * pressed * span[k] / scale[k]
    least = SLIGHT * Scale.of(design.leg).unit(t.problem.objective.unit)
    return most_first({name: gain for name, gain in gains.items() if gain > least})


@dataclass(frozen=True, kw_only=True)
class ProgramFigures:
    """What a summary says of the question and of its answer; computed from a ``FigureSource``."""

    problem: str = stated("name of the problem", lambda s: s.plan.design.name)
    title: str = stated("its title", lambda s: s.plan.design.title)
    hop: Literal["single", "landing", "periodic"] = stated(
        "from rest to the apex, from rest to rest, or a cycle that repeats itself (hop.kind)",
        lambda s: s.plan.design.hop.kind,
    )
    objective: str = stated("name of the objective", lambda s: s.plan.objective)
    objective_meaning: str = stated("what it is", lambda s: s.hop.objective.meaning)
    objective_unit: str = stated("its unit (SI; 1 for none)", lambda s: s.hop.objective.unit)
    objective_figure: str = stated("key of this summary that states it", lambda s: s.hop.objective.figure)
    maximized: bool = stated("whether more is better", lambda s: s.hop.objective.maximize)
    clearance_asked_for_m: float | None = stated(
        "hop.clearance, for objectives that ask for one [m]",
        lambda s: s.plan.design.hop.clearance if s.hop.objective.ends == "required clearance" else None,
    )
    clearance_m: float = stated(
        "height of the leg's lowest point when flight ends [m]", lambda s: s.plan.claims()["clearance_m"]
    )
    objective_error: StatedError = stated("how far the objective may be off", lambda s: s.verdict.error)
    objective_value: float = stated(
        "what the hop was made for, without the tie-break [its unit]", lambda s: s.solution.value
    )
    tie_break_weighs: float = stated(
        "what the tie-break weighs beside it: by so much may the optimum be better, as gentle torques are preferred [its unit]",
        lambda s: s.solution.tie_break,
    )
    active_limits: Mapping[str, float] = stated("share of stance in which each limit acts", all_active)
    scheme: str = stated("transcription scheme", lambda s: s.solution.transcription.scheme.name)
    seed: int = stated("of the starts", lambda s: s.plan.design.solver.seed)
    certified: bool = stated("whether first-order optimality is certified", lambda s: s.verdict.certified)
    certificate: Mapping[str, Condition] = stated("its conditions", lambda s: by_entry(s.verdict.conditions))
    structure: Structure = stated("switching structure", lambda s: structure_of(s.solution))
    tie_break_bias_m: float | None = if_any(
        "bound on the tie-break's bias [m]", lambda s: s.if_length(s.hop.tie_break_bias, True)
    )
    tie_break_bias: float | None = if_any(
        "the same for objectives that are no lengths [the objective's unit]",
        lambda s: s.if_length(s.hop.tie_break_bias, False),
    )
    gain_per_percent_m: Mapping[str, float] | None = if_any(
        "what 1 % more of each limit's range gives [m]", lambda s: s.if_length(s.gains, True)
    )
    gain_per_percent: Mapping[str, float] | None = if_any(
        "the same for objectives that are no lengths [its unit]", lambda s: s.if_length(s.gains, False)
    )
