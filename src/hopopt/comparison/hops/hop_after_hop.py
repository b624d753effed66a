"""Controllers that hop on and on, beside the periodic optimum: what they keep up, and whether errors die out.

All run on the same plant, and each hop is measured as the hop from rest is.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from hopopt.amounts import check
from hopopt.comparison.compare import BEATEN, OPTIMUM, answering, chosen_names, planned_trace
from hopopt.comparison.hops.basin import Basin, basin, side_by_side
from hopopt.comparison.hops.trials import (
    DRAWN_HOPS,
    MOST_HOPS,
    Hops,
    HopsTrial,
    apex_of,
    hop_on,
    hops_in_mujoco,
    hops_on_draws,
    in_another_plant,
)
from hopopt.comparison.robust.robustness import Draw
from hopopt.control.closed_loop import make_controller, make_plant
from hopopt.control.strategies import find
from hopopt.design import Design
from hopopt.errors import NotSolvedError, UsageError
from hopopt.leg.scales import Scale
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.planner.reserve import plan_to_track, reference_of
from hopopt.planner.solution import Solution
from hopopt.planner.solve import TIME_LIMIT, solve
from hopopt.sim.hop_metrics import HopFigures

OFFSET = 0.02  # [m on the paper's leg] by which tracking begins too high
MUJOCO_HOPS = 10


@dataclass(frozen=True)
class HopsComparison:
    """The periodic bound, the plan that was tracked, and every strategy's hops by name.

    solution, plan: the bound, and what was tracked
    hops: name -> hops on the believed leg
    asked, offset: how many hops, and by how much tracking began too high [m]
    drawn: name -> for every drawn leg, hops that it did and clearance [m] that it kept up, where asked for
    basins: name -> from where it comes back, where asked for
    mujoco: name -> clearances [m] of its hops there, where asked for
    notes: what else there is to say, a sentence each
    rows: name -> what its folder states, of a comparison that was read
    """

    solution: Solution
    plan: Solution | None
    hops: Mapping[str, Hops]
    asked: int
    offset: float
    drawn: Mapping[str, Sequence[tuple[int, float]]] = field(default_factory=dict)
    basins: Mapping[str, Basin] = field(default_factory=dict)
    mujoco: Mapping[str, Sequence[float]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    rows: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def __repr__(self) -> str:
        kept = ", ".join(f"{name} {h.kept:.3f} m" for name, h in self.hops.items())
        return f"<HopsComparison on {self.solution.design.name}: bound {self.bound:.3f} m; kept up: {kept}>"

    @cached_property
    def optimum(self) -> HopFigures:
        """Of the periodic optimum."""
        return HopFigures(self.solution.design, planned_trace(self.solution))

    @cached_property
    def shown(self) -> dict[str, HopFigures]:
        """The optimum, and one hop of each strategy: its typical one, or the last if it fell; of none, all it did."""

        def one(h: Hops) -> HopFigures:
            return h.typical or (h.each[-1] if h.each else h.run.figures)

        return {OPTIMUM: self.optimum, **{name: one(h) for name, h in self.hops.items()}}

    @property
    def without_plan(self) -> dict[str, HopFigures]:
        """The settled hop of each strategy that follows no plan; none of those that fell."""
        own = {name: h for name, h in self.hops.items() if not h.run.strategy.needs_plan}
        return {name: h.typical for name, h in own.items() if h.typical is not None}

    @property
    def bound(self) -> float:
        """The verified periodic optimum's clearance [m]."""
        return self.solution.clearance

    @property
    def beaten_by(self) -> list[str]:
        """Strategies that keep every limit and keep up more than the bound: then the bound is wrong."""
        most = self.bound + BEATEN * Scale.of(self.solution.design.leg).length
        return [name for name, h in self.hops.items() if not h.limits_exceeded and h.kept > most]

    @property
    def exit_code(self) -> int:
        """0 if the bound is verified and holds, else 3."""
        return 0 if self.solution.verified and not self.beaten_by else 3

    def gap(self, name: str) -> dict[str, float] | None:
        """What a strategy's typical hop misses of the bound [m], as push, timing and retraction; None if it fell."""
        typical = self.hops[name].typical
        if typical is None:
            return None
        return {part: best - typical.budget[part] for part, best in self.optimum.budget.items()}

    def row(self, name: str) -> dict[str, Any]:
        """Everything known of one strategy."""
        if name in self.rows:
            return dict(self.rows[name])
        h = self.hops[name]
        share = h.kept / self.bound if self.solution.verified and not h.fell else None
        return {
            "meaning": h.run.strategy.meaning,
            "options": h.run.options,
            **h.as_dict(),
            "share_of_bound": share,
            "gap": self.gap(name),
            "drawn": self._on_draws(name),
            "basin": self.basins[name].as_dict() if name in self.basins else None,
            "mujoco_clearances_m": list(self.mujoco[name]) if name in self.mujoco else None,
        }

    def _on_draws(self, name: str) -> dict[str, Any] | None:
        if name not in self.drawn:
            return None
        counts, kept = np.array(self.drawn[name]).T
        still = counts >= DRAWN_HOPS
        lowest = float(kept[still].min()) if still.any() else None
        return {
            "draws": len(counts),
            "hops": DRAWN_HOPS,
            "still_hop": int(still.sum()),
            "lowest_kept_m": lowest,
            "median_kept_m": float(np.median(kept)),
            "kept_m": kept.tolist(),
        }

    def as_dict(self) -> dict[str, Any]:
        """One object with the bound and every strategy."""
        orbit = self.solution.summary.orbit
        return {
            "problem": self.solution.design.name,
            "hop": "periodic",
            "objective": self.solution.objective,
            "bound_m": self.bound if self.solution.verified else None,
            "verified": self.solution.verified,
            "exit_code": self.exit_code,
            "beaten_by": self.beaten_by,
            "notes": list(self.notes),
            "hops": self.asked,
            "start_offset_m": self.offset,
            "speed_m_s": self.solution.design.hop.speed,
            "period_s": orbit.period_s if orbit else None,
            "tracked_plan_m": self.plan.clearance if self.plan else None,
            "tracked_plan_verified": self.plan.verified if self.plan else None,
            "strategies": {name: self.row(name) for name in self.hops},
        }


def compare_hops(
    design: Design,
    strategies: Sequence[str] | None = None,
    *,
    hops: int = MOST_HOPS,
    offset: float | None = None,
    bound: Solution | None = None,
    draws: Sequence[Draw] = (),
    basins: bool = False,
    mujoco: bool = False,
    processes: int = 1,
    progress: Callable[[str], None] | None = None,
    until: Deadline = NEVER,
) -> HopsComparison:
    """Solve for the periodic bound (or take one that was solved), hop on with strategies, and set them side by side.

    strategies: names, "all", or None for the usual ones, as ``compare`` takes them. hops: of each, at least 2. offset: by
    which tracking begins too high [m] (a 37th of the leg's length). draws: legs on which all are tried too. basins: find from where they come back. mujoco: hop in
    MuJoCo too, MUJOCO_HOPS times. until: when no strategy may be begun any more. Raises MissingExtraError without it, UsageError for strategies that are unknown or do not suit the leg, and for a hop from rest; NotSolvedError if
    there is no bound.
    """
    if not design.hop.periodic:
        raise UsageError('hop after hop needs hop.kind = "periodic"')
    check("hops", hops, 2)
    offset = OFFSET * Scale.of(design.leg).length if offset is None else offset
    say, (names, notes) = progress or (lambda text: None), chosen_names(design, strategies)
    chosen = [find(name) for name in names]
    make_plant(design)  # what cannot be simulated is said before the work
    if mujoco:
        in_another_plant(design)
    for strategy in chosen:
        if not strategy.needs_plan:
            make_controller(design, strategy)
    solution = (
        solve(design, progress=say, time_limit=min(TIME_LIMIT, until.seconds_left))
        if bound is None
        else answering(design, bound)
    )
    plan = None
    if any(s.needs_plan for s in chosen):
        try:
            plan = plan_to_track(design, say, until)
        except NotSolvedError as error:
            chosen = [s for s in chosen if not s.needs_plan]
            notes.append(f"nothing is tracked, as no plan keeps the problem's [reserve] back: {error}")
    trials = [
        HopsTrial(design, s.name, reference_of(plan), apex_of(plan))
        if plan and s.needs_plan
        else HopsTrial(design, s.name)
        for s in chosen
    ]
    say(f"{hops} hops of {', '.join(t.strategy for t in trials)}")
    found = dict[str, Hops]()
    for k in range(0, len(trials), processes):
        if until.passed:
            left = ", ".join(t.strategy for t in trials[k:])
            notes.append(f"the time limit was reached before {left} hopped")
            del trials[k:]
            break
        some = trials[k : k + processes]
        done = side_by_side(hop_on, [(t, hops, offset) for t in some])
        found |= {t.strategy: h for t, h in zip(some, done, strict=True)}
    drawn, maps, elsewhere = dict[str, list[tuple[int, float]]](), dict[str, Basin](), dict[str, list[float]]()
    for trial in trials:
        if draws:
            say(f"{trial.strategy} on {len(draws)} drawn legs, {DRAWN_HOPS} hops each")
            parts = side_by_side(hops_on_draws, [(trial, draws[k::processes]) for k in range(processes)])
            drawn[trial.strategy] = [part[i] for i in range(len(parts[0])) for part in parts if i < len(part)]
        if basins:
            say(f"{trial.strategy} from other starts")
            if (area := basin(trial, found[trial.strategy], processes)) is not None:
                maps[trial.strategy] = area
        if mujoco:
            say(f"{trial.strategy} in MuJoCo")
            elsewhere[trial.strategy] = hops_in_mujoco(trial, min(hops, MUJOCO_HOPS))
    return HopsComparison(solution, plan, found, hops, offset, drawn, maps, elsewhere, tuple(notes))
