"""The local optima of one problem on the first mesh: searched for, followed to the problem next to it, refined."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from hopopt.design import Design
from hopopt.errors import SolverError, one_line
from hopopt.nlp.deadline import NEVER
from hopopt.nlp.solver.ipopt import CARRIED, NlpSolution, NlpSolver
from hopopt.nlp.trajectory import PhaseTrajectory
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.guesses.feasibility import cannot_begin
from hopopt.ocp.guesses.initial_guess import motion_guess
from hopopt.ocp.hop import Hop
from hopopt.ocp.phases import STANCE
from hopopt.planner.motion import Motion
from hopopt.planner.refine_and_verify import refined_and_verified
from hopopt.planner.search.families import motion, words
from hopopt.planner.search.first_mesh import search_first_mesh
from hopopt.planner.search.multistart import (
    SAME_OPTIMUM,
    StartOutcome,
    first_options,
    first_transcription,
    outcome_of,
    solution_of,
)
from hopopt.planner.solve import TIME_LIMIT
from hopopt.planner.stopwatch import Stopwatch

OBJECTIVE = "clearance"
PROGRAMS = 8  # that a process keeps: some tens of megabytes each
NEIGHBOUR_ITERATIONS = 60  # iterations from a neighbour's multipliers
SAME_LIFT_OFF = 0.1  # of the scaled states at lift-off: closer than this, and as high, it is the same push
HEIGHT_NOISE = 1e-4  # relative
# Of the longest stance, counted back from lift-off, where a motion's shape is taken:
BEFORE_LIFT_OFF = np.linspace(0.0, 1.0, 13)
# Of the scaled states; of the paper's leg hops of one kind differ by at most 0.6, others by 1.1 and more:
SAME_KIND = 0.7
NEARLY_AS_HIGH = 2e-2  # relative: hops of one kind count as one optimum if they are as close in height
POSE_SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)  # of the stance, where poses are drawn; one more at the apex


@dataclass(frozen=True)
class LocalOptimum:
    """A local optimum on the first mesh.

    outcome: how its solve ended, with the NLP's vectors
    found_by: names of the starts that led to it
    x: variables (nz,), SI
    shape: scaled states (times, states) of the stance at times counted back from lift-off, so that waiting at the start
        counts nothing
    clearance: of the leg's lowest point at the apex [m]
    words: what the leg does
    poses: joints and foot (poses, points, 2), x and z [m], at the shares of the stance and at the apex
    """

    outcome: StartOutcome = field(repr=False)
    found_by: tuple[str, ...]
    x: np.ndarray = field(repr=False)
    shape: np.ndarray = field(repr=False)
    clearance: float
    words: str
    poses: np.ndarray = field(repr=False)

    def alike(self, other: "LocalOptimum") -> bool:
        """Whether two optima of one problem count as one: nearly as high, by a motion of the same kind; or as high, with the
        same lift-off, whatever they do long before."""
        differ = np.abs(self.shape[0] - other.shape[0])
        apart = abs(self.clearance - other.clearance) / max(abs(self.clearance), abs(other.clearance), 1e-3)
        return (apart <= NEARLY_AS_HIGH and self.kin(other)) or bool(
            apart <= SAME_OPTIMUM and differ.max() < SAME_LIFT_OFF
        )

    def kin(self, other: "LocalOptimum") -> bool:
        """Whether the two do the same, also if they are of different problems."""
        return bool(np.abs(self.shape - other.shape).max() < SAME_KIND)

    def beats(self, other: "LocalOptimum") -> bool:
        """Whether it is higher by more than the tolerances' noise."""
        return self.clearance > other.clearance + HEIGHT_NOISE * abs(other.clearance)


@dataclass(frozen=True)
class Continuation:
    """An optimum to follow: its problem, and problems between that one and where it is to lead."""

    design: Design
    optimum: LocalOptimum
    between: tuple[Design, ...] = ()


@dataclass(frozen=True)
class Refined:
    """An optimum after refinement: its clearance [m], whether it is verified, and names of the checks that failed."""

    clearance: float
    verified: bool
    failed: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Program:
    """A problem's first mesh, ready to be solved: from multipliers (warm), and from a point or a guess (cold)."""

    hop: Hop
    t: Transcription
    warm: NlpSolver
    cold: NlpSolver


@lru_cache(maxsize=PROGRAMS)
def _program(design: Design) -> _Program:
    """The programs of a problem, built once in each process."""
    hop = Hop(design, OBJECTIVE)
    t, options = first_transcription(hop), first_options(hop, True)
    warm = NlpSolver(t, options | CARRIED | {"ipopt.max_iter": NEIGHBOUR_ITERATIONS})
    return _Program(hop, t, warm, NlpSolver(t, options))


def searched(design: Design, count: int) -> list[LocalOptimum]:
    """The distinct optima that so many starts, relaxed problems and the global method lead to, best first."""
    p = _program(design)
    if cannot_begin(p.hop.design, p.hop.robot):
        return []
    outcomes = search_first_mesh(p.hop, count, 1, _silent, until=NEVER.within(TIME_LIMIT)).outcomes
    found = list[LocalOptimum]()
    for outcome in sorted((o for o in outcomes if o.success), key=lambda o: -o.signed_value):
        remember(found, _optimum(p, outcome))
    return found


def remember(found: list[LocalOptimum], new: LocalOptimum) -> tuple[int, bool]:
    """Add an optimum to those of its problem, or take it for the one that it is alike if it is better: its place, and
    whether anything is new."""
    for k, known in enumerate(found):
        if known.alike(new):
            names = tuple(dict.fromkeys((*known.found_by, *new.found_by)))
            found[k] = replace(new if new.beats(known) else known, found_by=names)
            return k, new.beats(known)
    found.append(new)
    return len(found) - 1, True


def followed(design: Design, sources: Sequence[Continuation], name: str) -> list[LocalOptimum | None]:
    """Where each optimum of a neighbouring problem leads in this one, or None; ``name``: of such a start."""
    return [_followed(design, source, name) for source in sources]


def _followed(design: Design, source: Continuation, name: str) -> LocalOptimum | None:
    """At once or, if that leads nowhere or to another kind of hop, in smaller steps."""
    end = _step(design, source.design, source.optimum, name)
    if end is not None and end.kin(source.optimum):
        return end
    last, before = source.optimum, source.design
    for problem in (*source.between, design):
        if (there := _step(problem, before, last, name)) is None or not there.kin(last):
            return end
        last, before = there, problem
    return last


def _step(design: Design, before: Design, optimum: LocalOptimum, name: str) -> LocalOptimum | None:
    began = time.perf_counter()
    try:
        p = _program(design)
        s = _from_neighbour(p, before, optimum)
        return _optimum(p, outcome_of(name, s, time.perf_counter() - began)) if s.success else None
    except SolverError:
        return None


def _from_neighbour(p: _Program, before: Design, source: LocalOptimum) -> NlpSolution:
    """This problem from a neighbour's optimum: with its multipliers, else without; from its motion if it does not fit."""
    v = source.outcome.vectors
    if len(source.x) != len(p.t.scale) or len(v["lam_g"]) != len(p.t.lbg):
        return p.cold(motion_guess(p.hop, solution_of(source.outcome, _program(before).t).phases))
    z = source.x / p.t.scale
    s = p.warm.from_vector(z, (v["lam_g"], v["lam_x"]))
    return s if s.success else p.cold.from_vector(z)


def _optimum(p: _Program, outcome: StartOutcome) -> LocalOptimum:
    phases = solution_of(outcome, p.t).phases
    plan = Motion(p.hop.design, OBJECTIVE, phases)
    return LocalOptimum(
        outcome, (outcome.name,), outcome.vectors["z"] * p.t.scale, _shape(p, phases[STANCE]),
        plan.claims()["clearance_m"], words(motion(p.hop, plan)), _poses(plan),
    )  # fmt: skip


def _shape(p: _Program, stance: PhaseTrajectory) -> np.ndarray:
    phase = p.t.layouts[STANCE].phase
    times = np.clip(stance.duration - BEFORE_LIFT_OFF * p.hop.design.hop.stance_duration[1], 0.0, None)
    return stance.sample(times)[0] / phase.columns(phase.states, "scale")


def _poses(plan: Motion) -> np.ndarray:
    names = (*plan.design.leg.pivots, "foot")
    each = (plan.sample_phase(STANCE, np.array(POSE_SHARES) * plan.lift_off), plan.apex)
    return np.concatenate([np.stack([s.points[name] for name in names], axis=1) for s in each])


def refined(design: Design, optimum: LocalOptimum) -> Refined:
    """The optimum on meshes fine enough for its checks."""
    hop, until = _program(design).hop, NEVER.within(TIME_LIMIT)
    try:
        found = refined_and_verified(hop, optimum.outcome, [optimum.outcome], _silent, Stopwatch(), until=until)
    except SolverError as error:
        return Refined(optimum.clearance, False, (one_line(error),))
    return Refined(found.clearance, found.verified, tuple(found.summary.failed_checks))


def _silent(text: str) -> None:
    """Progress is the study's, not one problem's."""
