"""The optimum beside what controllers make of it: how near they come to the bound, and what is missing.

The bound is the verified optimum of the problem. ``track`` follows a second optimum that holds something back
from every limit (the problem's [reserve]), because on the limits themselves feedback has no room.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from hopopt.comparison.gap_steps import SINKS, gap_steps
from hopopt.control.closed_loop import Run, clearance_in_mujoco, make_controller, make_plant, simulate
from hopopt.control.strategies import BUILT_IN, Strategy, find
from hopopt.design import Design, refuse_landed
from hopopt.errors import NotSolvedError, UsageError
from hopopt.leg.kinematics import two_joints
from hopopt.leg.scales import Scale
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.ocp.phases import STANCE
from hopopt.paper.paper_results import PAPER, is_the_papers
from hopopt.planner.motion import Motion
from hopopt.planner.reserve import plan_to_track, reference_of, reserved
from hopopt.planner.solution import Solution
from hopopt.planner.solve import TIME_LIMIT, solve
from hopopt.problem.load import design_hash
from hopopt.sim.hop_metrics import HopFigures
from hopopt.sim.mujoco import library
from hopopt.sim.state import ACCOUNTS
from hopopt.sim.trace import Event, Trace

TUNED = ("force", "position")  # strategies whose gains can be tuned
ALL = "all"  # in place of names: every strategy that suits the leg
DEFAULT = ("track", "force", "force_tuck", SINKS)  # and the better of these two:
TUNED_PD = ("force_tuned", "position_tuned")
BEATEN = 1e-4  # [m] on the paper's leg, by which a strategy may pass the bound: what verification allows
EARLY_LIFT_OFF = 0.9  # share of the planned stance, before which a foot should not leave
OPTIMUM = "optimum"
COMPARED_OBJECTIVE = "clearance"  # by which strategies are compared


@dataclass(frozen=True)
class Comparison:
    """The bound, and controllers beside it.

    solution: the bound
    plan: what ``track`` followed; None if nothing was tracked
    runs: name of a strategy -> its run
    mujoco: name -> clearance in MuJoCo [m], where asked for
    notes: what else there is to say, a sentence each
    """

    solution: Solution
    plan: Solution | None
    runs: Mapping[str, Run]
    mujoco: Mapping[str, float] = field(default_factory=dict)  # clearances [m] there, where asked for
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        reached = ", ".join(f"{name} {f.clearance:.3f} m" for name, f in self.figures.items())
        return f"<Comparison on {self.solution.design.name}: {reached}>"

    @cached_property
    def figures(self) -> dict[str, HopFigures]:
        """The figures of every row by name, the optimum first."""
        optimum = HopFigures(self.solution.design, planned_trace(self.solution))
        return {OPTIMUM: optimum, **{name: run.figures for name, run in self.runs.items()}}

    @property
    def without_plan(self) -> dict[str, HopFigures]:
        """The figures of strategies that follow no plan."""
        return {name: run.figures for name, run in self.runs.items() if not run.strategy.needs_plan}

    @property
    def bound(self) -> float:
        """The verified optimum's clearance [m]."""
        return self.solution.clearance

    @property
    def beaten_by(self) -> list[str]:
        """Strategies that keep every limit and yet pass the bound: then the bound is wrong. None is said to where the bound
        keeps constraints of the user's own, which runs are not held against."""
        if self.solution.design.hop.constraints:
            return []
        most = unbeaten(self.solution)
        return [
            name for name, f in self.figures.items() if name != OPTIMUM and not f.limits_exceeded and f.clearance > most
        ]

    @property
    def exit_code(self) -> int:
        """0 if the bound is verified and holds, else 3."""
        return 0 if self.solution.verified and not self.beaten_by else 3

    def gap(self, name: str) -> dict[str, float]:
        """What a strategy misses of the bound [m], as push, timing and retraction; they sum to the gap."""
        best, own = self.figures[OPTIMUM].budget, self.figures[name].budget
        return {part: best[part] - own[part] for part in best}

    def left_early(self, name: str) -> str:
        """When a foot that should have stayed left the ground, in words; empty where it did not, or no plan says."""
        if name == OPTIMUM or not self.runs[name].strategy.needs_plan or self.plan is None:
            return ""
        left, planned = self.figures[name].lift_off["time_s"], self.plan.lift_off
        return (
            ""
            if left > EARLY_LIFT_OFF * planned
            else f"the foot left the ground at {left:.3f} s, not at {planned:.3f} s as planned"
        )

    def row(self, name: str) -> dict[str, Any]:
        """Everything known of one strategy, for ``--json``."""
        f, run = self.figures[name], self.runs.get(name)
        found = "the verified optimum" if self.solution.verified else "an optimum that was not verified"
        row: dict[str, Any] = {"meaning": run.strategy.meaning if run else found}
        row |= f.as_dict() | {"options": run.options if run else {}}
        counts = self.solution.verified and not f.no_hop
        row |= {"share_of_bound": f.clearance / self.bound if counts else None, "gap": self.gap(name)}
        row |= {"overshoot_m": run and run.overshoot, "feedback_moves": run and run.moves}
        row |= {"limited_by": run.limited_by if run else "", "left_early": self.left_early(name)}
        if name in self.mujoco:
            row["mujoco_clearance_m"] = self.mujoco[name]
        if name in PAPER and is_the_papers(self.solution.design.leg):
            row["paper"] = {key: list(values) for key, values in PAPER[name].items()}
        return row

    def as_dict(self) -> dict[str, Any]:
        """One object with the bound and every strategy."""
        return {
            "problem": self.solution.design.name,
            "objective": self.solution.objective,
            "bound_m": self.bound if self.solution.verified else None,
            "verified": self.solution.verified,
            "exit_code": self.exit_code,
            "beaten_by": self.beaten_by,
            "notes": list(self.notes),
            "tracked_plan_m": self.plan.clearance if self.plan else None,
            "tracked_plan_verified": self.plan.verified if self.plan else None,
            "gap_steps": [vars(step) for step in gap_steps(self.solution, self.plan, self.figures)],
            "strategies": {name: self.row(name) for name in self.figures},
        }


def compare(
    design: Design,
    strategies: Sequence[str] | None = None,
    *,
    bound: Solution | None = None,
    plan: Solution | None = None,
    mujoco: bool = False,
    tune: int = 0,
    progress: Callable[[str], None] | None = None,
    until: Deadline = NEVER,
) -> Comparison:
    """Solve for the bound (or take one that was solved), simulate strategies, and set them side by side.

    strategies: names; "all" for every one that suits the leg; by default the tracked optimum, the paper's force control,
    plain and with a tuck, the counter-movement, and the better of its tuned PD strategies. plan: to track, if there is one. tune: the tuned ones get the best gains among so
    many hops of this leg. mujoco: run all in MuJoCo too. until: when no strategy may be begun any more. Raises MissingExtraError without it, UsageError for strategies
    that are unknown or do not suit the leg and for a bound of another problem, NotSolvedError if there is none.
    """
    if mujoco:
        library()
        if design.simulation.torque_delay:
            raise UsageError("runs in MuJoCo have no delay: leave out --mujoco, or set simulation.torque_delay=0")
    say, (names, notes) = progress or (lambda text: None), chosen_names(design, strategies)
    chosen = [find(name) for name in names]
    if own := design.hop.constraints:
        words = f"the bound keeps {' and '.join(own)}, of which strategies without a plan know nothing: they may come higher"
        notes.append(words)
    refuse_landed(design, "a comparison of hops from rest")
    make_plant(design)  # what cannot be simulated, or does not suit the leg, is said before the work
    for strategy in chosen:
        if not strategy.needs_plan:
            make_controller(design, strategy)
    tracked = any(s.needs_plan for s in chosen)
    if tracked and plan is None:
        reserved(design)
    solution = (
        solve(design, progress=say, time_limit=min(TIME_LIMIT, until.seconds_left))
        if bound is None
        else answering(design, bound)
    )
    if tracked and plan is None:
        try:
            plan = plan_to_track(design, say, until)
        except NotSolvedError as error:  # the bound is solved: the other strategies can still be compared
            chosen = [s for s in chosen if not s.needs_plan]
            notes.append(f"nothing is tracked, as no plan keeps the problem's [reserve] back: {error}")
    reference = None if plan is None else reference_of(plan)
    for name in TUNED:
        near = f"{name}_tuned" in names and not is_the_papers(design.leg)
        if near or (tune and (name in names or f"{name}_tuned" in names)):
            strategy, found = tuned(design, name, tune, say)
            chosen = [s for s in chosen if s.name != strategy.name] + [strategy]
            notes.append(found)
    runs, elsewhere = {}, {}
    for strategy in chosen:
        if until.passed:
            notes.append(f"the time limit was reached before {strategy.name} was simulated")
            continue
        say(f"simulating {strategy.name}")
        runs[strategy.name] = simulate(design, strategy, plan=reference)
        if mujoco:
            elsewhere[strategy.name] = clearance_in_mujoco(design, strategy, reference)
    if strategies is None and runs.keys() >= set(TUNED_PD):
        worse = min(TUNED_PD, key=lambda name: _ranked(runs[name].figures))
        notes.append(f"{worse}, the lesser of the tuned two, clears {runs.pop(worse).figures.clearance:.3f} m")
        elsewhere.pop(worse, None)
    return Comparison(solution, plan, runs, elsewhere, tuple(notes))


def _ranked(f: HopFigures) -> tuple[bool, float]:
    """By which one run is better than another: within every limit first, then by clearance."""
    return not f.limits_exceeded and not f.no_hop, f.clearance


def unbeaten(bound: Solution) -> float:
    """The clearance [m] up to which a strategy may come without proving the bound wrong: what verification allows above it."""
    return bound.clearance + BEATEN * Scale.of(bound.design.leg).length


def chosen_names(design: Design, names: Sequence[str] | None) -> tuple[list[str], list[str]]:
    """Names of the strategies to compare: those given, with "all" for all that suit the leg, or the default ones; and a
    note of what does not suit it."""
    if names is not None and ALL not in names:
        return list(names), []
    tracking = [name for name, s in BUILT_IN.items() if s.needs_plan]
    wanted = [*DEFAULT, *TUNED_PD] if names is None else [*tracking, *(n for n in BUILT_IN if n not in tracking)]
    wanted = [name for name in wanted if name != SINKS or design.hop.counter_movement]
    wanted += [name for name in names or () if name not in (ALL, *wanted)]
    if two_joints(design.leg):
        return wanted, []
    kept = [name for name in wanted if name in tracking or name not in BUILT_IN]
    return kept, ["the paper's strategies are left out: their reference y is inverted for two joints in the x-z plane"]


def answering(design: Design, bound: Solution) -> Solution:
    """A bound for this problem's simulations: [reserve], [simulation], [solver], [control] and [uncertainty] may differ, which
    are no part of what is asked. UsageError if it answers another question."""
    if bound.objective != COMPARED_OBJECTIVE:
        raise UsageError(f"the bound given is of the objective {bound.objective}: strategies are compared by clearance")
    if bound.summary.functions.constraints:
        raise UsageError("the bound given: it keeps limits of your own, which no strategy keeps: solve without them")
    others = {name: getattr(design, name) for name in ("reserve", "simulation", "solver", "control", "uncertainty")}
    same = bound.design.model_copy(update=others)
    if design_hash(same) != design_hash(design):
        raise UsageError("the bound given: it was solved for another problem; leave out the problem or the bound")
    return replace(bound, design=design)


def tuned(design: Design, name: str, evaluations: int, say: Callable[[str], None]) -> tuple[Strategy, str]:
    """A strategy of the paper with the best gains that so many simulated hops find, or without a number the few about its
    untuned ones; and what was found in words."""
    from hopopt.comparison.gain_tuning import tune, tuned_nearby

    say(f"tuning {name}")
    strategy = find(name)
    if not evaluations:
        near = tuned_nearby(design, name)
        meaning = f"{strategy.meaning}, best of {near.evaluations} tries on this leg"
        return Strategy(f"{name}_tuned", meaning, strategy.make, near.best.options), near.found
    found = tune(design, name, evaluations=evaluations, progress=say)
    meaning = f"{strategy.meaning}, best of {evaluations} tries"
    return Strategy(f"{name}_tuned", meaning, strategy.make, found.best.options), found.found


def on_ideal_ground(solution: Solution, say: Callable[[str], None], **how: Any) -> Solution:
    """The bound of the same problem on ground that grips without limit; ``how``: options of ``solve``."""
    if solution.design.contact.friction is None:
        return solution
    say("solving for the bound on ideal ground")
    contact = solution.design.contact.model_copy(update={"friction": None})
    return solve(solution.design.model_copy(update={"contact": contact}), progress=say, **how)


def planned_trace(solution: Motion) -> Trace:
    """The optimum as if it had been simulated: samples of its own interpolant, inside every interval."""
    inside = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
    parts = [solution.everywhere(phase, inside) for phase in solution.phases]
    t, q, v, tau, f = (np.concatenate([getattr(p, name) for p in parts]) for name in ("t", "q", "v", "tau", "f"))
    contact = np.concatenate([np.full(len(p.t), p.phase[0] == STANCE) for p in parts])
    power = np.sum(tau * v[:, -tau.shape[1] :], axis=1).reshape(-1, len(inside))
    spans = np.ptp(t.reshape(power.shape), axis=1)[:, None]
    each = spans * (power @ integrals_to(inside).T)  # since each interval began
    work = (each + np.concatenate([[0.0], np.cumsum(each[:-1, -1])])[:, None]).ravel()
    works = np.stack([work, *[np.zeros_like(work)] * (ACCOUNTS - 1)], axis=1)
    events = (Event("lift-off", solution.lift_off, 0.0),)
    return Trace(solution.robot, t, q, v, tau, tau, tau, f, contact, works, events, "the clearance is reached")


def integrals_to(normalised_times: np.ndarray) -> np.ndarray:
    """W with W @ values = integrals from 0 to each place of the polynomial through the values, (k, k)."""
    powers = np.arange(1, len(normalised_times) + 1)
    return (normalised_times[:, None] ** powers / powers) @ np.linalg.inv(np.vander(normalised_times, increasing=True))
