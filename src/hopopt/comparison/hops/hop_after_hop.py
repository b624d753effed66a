"""Controllers that hop on and on, beside the periodic optimum: what they keep up, and whether errors die out.

Strategies that track begin in flight at the apex of their plan, a little too high; the others from rest, as the paper's robot
does. All run on the same plant, and each hop is measured as the hop from rest is.
"""

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from hopopt.amounts import check
from hopopt.comparison.compare import BEATEN, OPTIMUM, answering, chosen_names, planned_trace, reference_of
from hopopt.comparison.hops.return_map import Fallen, Multipliers, ReturnMap, multipliers, state_at_landing
from hopopt.comparison.robust.robustness import Draw
from hopopt.control.closed_loop import Run, highest_in, in_mujoco, make_controller, make_plant, simulate
from hopopt.control.reference import PlanReference
from hopopt.control.strategies import find
from hopopt.design import Design
from hopopt.errors import NotSolvedError, UsageError
from hopopt.leg.kinematics import start_angles
from hopopt.leg.scales import Scale
from hopopt.ocp.phases import FLIGHT
from hopopt.planner.reserve import plan_to_track
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.sim.controller import Controller
from hopopt.sim.hop_metrics import HopFigures
from hopopt.sim.hop_sequence import BOUNCED, hops_of, landings
from hopopt.sim.mujoco import library
from hopopt.sim.state import State

HOPS, OFFSET = 50, 0.02  # of a run; [m] by which tracking begins too high
DRAWN_HOPS = 20  # on drawn legs
MUJOCO_HOPS = 10
HIGHER = tuple(np.linspace(-0.15, 0.15, 7))  # [m] starts of a basin
FASTER = tuple(np.linspace(-0.6, 0.6, 7))  # [m/s]
BACK, NEAR = 4, 0.9  # hops after which a leg is back if it clears this share of what it keeps up


@dataclass(frozen=True)
class Hops:
    """Many hops of a strategy on one leg.

    run: as it was simulated
    asked: how many hops
    stable: multipliers of its orbit; None where there is none
    """

    run: Run
    asked: int
    stable: Multipliers | None = None

    @cached_property
    def each(self) -> tuple[HopFigures, ...]:
        """The figures of every whole hop, from landing to landing."""
        hops = hops_of(self.run.trace)[: self.asked]
        return tuple(HopFigures(self.run.design, hop, BOUNCED) for hop in hops)

    @cached_property
    def clearances(self) -> np.ndarray:
        """Of every whole hop (k,) [m]."""
        return np.array([hop.clearance for hop in self.each])

    @property
    def fell(self) -> str:
        """How the run ended before all hops were done, in words; else empty."""
        return "" if len(self.each) >= self.asked else self.run.trace.outcome

    @property
    def settled(self) -> tuple[HopFigures, ...]:
        """The second half of the hops that were asked for; none if the leg fell."""
        return () if self.fell else self.each[self.asked // 2 :]

    @property
    def kept(self) -> float:
        """The clearance that is kept up [m]: the lowest of the settled hops; 0 if the leg fell."""
        return min((hop.clearance for hop in self.settled), default=0.0)

    @property
    def typical(self) -> HopFigures | None:
        """The settled hop of median clearance."""
        ordered = sorted(self.settled, key=lambda hop: hop.clearance)
        return ordered[len(ordered) // 2] if ordered else None

    @property
    def drift(self) -> float:
        """How far the body moves along the ground in a hop, on average [m]."""
        x = self.run.trace.q[:, 0]
        return float(x[-1] - x[0]) / max(len(self.each), 1)

    @property
    def limits_exceeded(self) -> list[str]:
        """Limits that the typical hop does not keep, in words."""
        return self.typical.limits_exceeded if self.typical else []

    def as_dict(self) -> dict[str, Any]:
        """For ``--json``."""
        typical = self.typical
        return {
            "hops": len(self.each),
            "fell": self.fell,
            "clearances_m": self.clearances.tolist(),
            "kept_m": self.kept,
            "median_m": typical.clearance if typical else 0.0,
            "period_s": float(typical.trace.t[-1]) if typical else None,
            "touchdown_loss_J": _lost(typical) if typical else None,
            "drift_m_per_hop": self.drift,
            "limits_exceeded": self.limits_exceeded,
            "stability": self.stable.as_dict() if self.stable else None,
        }


def _lost(hop: HopFigures) -> float:
    """Energy [J] that the impacts of a hop take."""
    return float(sum(event.lost for event in hop.trace.events))


@dataclass(frozen=True)
class HopsComparison:
    """The periodic bound, the plan that was tracked, and every strategy's hops by name.

    solution, plan: the bound, and what was tracked
    hops: name -> hops on the believed leg
    asked, offset: how many hops, and by how much tracking began too high [m]
    drawn: name -> for every drawn leg, hops that it did and clearance [m] that it kept up, where asked for
    basins: name -> from where it comes back, where asked for
    mujoco: name -> clearances [m] of its hops there, where asked for
    """

    solution: Solution
    plan: Solution | None
    hops: Mapping[str, Hops]
    asked: int
    offset: float
    drawn: Mapping[str, Sequence[tuple[int, float]]] = field(default_factory=dict)
    basins: Mapping[str, "Basin"] = field(default_factory=dict)
    mujoco: Mapping[str, Sequence[float]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

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


@dataclass(frozen=True)
class Trial:
    """A strategy and what it is tried on.

    design: the believed leg
    strategy: its name
    reference: the plan that it follows, if any
    apex: of that plan
    """

    design: Design
    strategy: str
    reference: PlanReference | None = None
    apex: State | None = None

    @property
    def start(self) -> State:
        """The plan's apex, or at rest."""
        return self.apex or make_plant(self.design).stance_start(start_angles(self.design))

    def hop(self, hops: int, start: State, draw: Draw | None = None, fresh: Controller | None = None) -> Run:
        """So many whole hops from a state, on the believed leg or on a drawn one; bounces are no hops."""
        first = landings_needed = hops + (not start.contact)
        while True:
            run = simulate(
                self.design,
                find(self.strategy),
                plan=self.reference,
                plant=draw.leg if draw else None,
                torque_gain=draw.torque_gain if draw else None,
                hops=landings_needed,
                compiled=True,
                controller=deepcopy(fresh),
                start=start,
            )
            bounced = first - len(landings(run.trace))
            if bounced <= 0 or not run.trace.outcome.startswith("landing") or landings_needed > 2 * first:
                return run
            landings_needed += bounced


def apex_of(plan: Solution) -> State:
    """Where a plan's flight ends."""
    table = plan.tables[FLIGHT]
    return State(table.q[-1, -1], table.v[-1, -1], False, 0.0, since=-float(table.t[-1, -1] - table.t[0, 0]))


def reached_apex(hop: HopFigures) -> State:
    """Where the centre of mass of a simulated hop is highest."""
    t, span = hop.trace.t, hop.flight
    k = span.start + int(np.argmax(hop.trace.points["com"][span, 1]))
    return State(hop.trace.q[k], hop.trace.v[k], False, 0.0, since=-float(t[k] - t[span.start]))


def moved(apex: State, higher: float = 0.0, faster: float = 0.0) -> State:
    """A state in flight, higher by so much [m], and faster forward [m/s]."""
    q, v = apex.q.copy(), apex.v.copy()
    q[1] += higher
    v[0] += faster
    return replace(apex, q=q, v=v)


def hop_on(trial: Trial, hops: int = HOPS, offset: float = OFFSET) -> Hops:
    """So many hops of a strategy, and the multipliers of what it settles on."""
    start = moved(trial.start, offset) if trial.apex else trial.start
    found = Hops(trial.hop(hops, start), hops)
    if found.fell:
        return found
    try:
        orbit = multipliers(ReturnMap(trial.design, found.run.controller), state_at_landing(found.run.trace))
    except Fallen:
        orbit = None
    return replace(found, stable=orbit)


def in_another_plant(design: Design) -> None:
    """Raises MissingExtraError without MuJoCo, UsageError for what runs there do not know."""
    library()
    if design.contact.friction is None:
        raise UsageError("hop after hop in MuJoCo needs ground with friction: give --set contact.friction=0.6")
    if design.simulation.torque_delay:
        raise UsageError("runs in MuJoCo have no delay: leave out --mujoco, or set simulation.torque_delay=0")


def hops_in_mujoco(trial: Trial, hops: int) -> list[float]:
    """Clearances [m] of so many hops of a strategy in MuJoCo, from the same start; fewer if the leg falls."""
    fresh = make_controller(trial.design, find(trial.strategy), trial.reference)
    run = in_mujoco(trial.design, fresh, trial.start, hops + (trial.apex is not None), BOUNCED)
    edges = np.flatnonzero(np.diff(run.contact.astype(int))) + 1  # no flight before the first landing counts
    flights = [span for span in pairwise([*edges, len(run.t)]) if not run.contact[span[0]]]
    least = BOUNCED * Scale.of(trial.design.leg).time
    whole = [(a, b) for a, b in flights if run.t[b - 1] - run.t[a] > least]
    each = np.arange(len(run.t))
    return [highest_in(trial.design, run, (each >= a) & (each < b)) for a, b in whole]


def hops_on_draws(trial: Trial, draws: Sequence[Draw], hops: int = DRAWN_HOPS) -> list[tuple[int, float]]:
    """For each drawn leg: how many hops of so many it does, and the clearance [m] that it keeps up."""
    fresh, found = make_controller(trial.design, find(trial.strategy), trial.reference), []
    for draw in draws:
        start = trial.apex or make_plant(draw.leg).stance_start(draw.start)
        on = Hops(trial.hop(hops, start, draw, fresh), hops)
        found.append((len(on.each), on.kept))
    return found


@dataclass(frozen=True)
class Basin:
    """From where a strategy still hops: starts at its orbit's apex, higher by ``higher`` (i) [m] and faster forward by
    ``faster`` (j) [m/s]; ``hops`` (i, j): whether it is back on its orbit after a few hops."""

    higher: np.ndarray
    faster: np.ndarray
    hops: np.ndarray

    def as_dict(self) -> dict[str, Any]:
        """For ``--json``."""
        return {"higher_m": self.higher.tolist(), "faster_m_s": self.faster.tolist(), "hops": self.hops.tolist()}


def starts(apex: State) -> list[tuple[int, int, State]]:
    """Row, column and state of every start of a basin."""
    return [(i, j, moved(apex, h, v)) for i, h in enumerate(HIGHER) for j, v in enumerate(FASTER)]


def back(trial: Trial, kept: float, begin: Sequence[State]) -> list[bool]:
    """For each start whether the hops come back to the clearance that is kept up [m]."""
    fresh, found = make_controller(trial.design, find(trial.strategy), trial.reference), []
    for start in begin:
        on = Hops(trial.hop(BACK, start, fresh=fresh), BACK)
        found.append(not on.fell and float(on.clearances[-1]) >= NEAR * kept)
    return found


def basin(trial: Trial, found: Hops, processes: int) -> Basin | None:
    """From where a strategy comes back to what it settled on; None if it fell."""
    if found.typical is None:
        return None
    cells = starts(reached_apex(found.typical))
    parts = side_by_side(back, [(trial, found.kept, [s for *_, s in cells[k::processes]]) for k in range(processes)])
    hops = np.zeros((len(HIGHER), len(FASTER)), dtype=bool)
    for k, part in enumerate(parts):
        for (i, j, _), ok in zip(cells[k::processes], part, strict=True):
            hops[i, j] = ok
    return Basin(np.array(HIGHER), np.array(FASTER), hops)


def side_by_side(function: Callable[..., Any], jobs: Sequence[tuple[Any, ...]]) -> list[Any]:
    """A function's values for jobs, on as many processes."""
    from joblib import Parallel, delayed

    return list(Parallel(n_jobs=len(jobs), backend="loky")(delayed(function)(*job) for job in jobs))  # type: ignore[arg-type]


def compare_hops(
    design: Design,
    strategies: Sequence[str] | None = None,
    *,
    hops: int = HOPS,
    offset: float = OFFSET,
    bound: Solution | None = None,
    draws: Sequence[Draw] = (),
    basins: bool = False,
    mujoco: bool = False,
    processes: int = 1,
    progress: Callable[[str], None] | None = None,
) -> HopsComparison:
    """Solve for the periodic bound (or take one that was solved), hop on with strategies, and set them side by side.

    strategies: names, "all", or None for the usual ones, as ``compare`` takes them. hops: of each, at least 2. offset: by
    which tracking begins too high [m]. draws: legs on which all are tried too. basins: find from where they come back. mujoco: hop in
    MuJoCo too, MUJOCO_HOPS times. Raises MissingExtraError without it, UsageError for strategies that are unknown or do not suit the leg, and for a hop from rest; NotSolvedError if
    there is no bound.
    """
    if not design.hop.periodic:
        raise UsageError('hop after hop needs hop.kind = "periodic"')
    check("hops", hops, 2)
    say, (names, notes) = progress or (lambda text: None), chosen_names(design, strategies)
    chosen = [find(name) for name in names]
    make_plant(design)  # what cannot be simulated is said before the work
    if mujoco:
        in_another_plant(design)
    for strategy in chosen:
        if not strategy.needs_plan:
            make_controller(design, strategy)
    solution = solve(design, progress=say) if bound is None else answering(design, bound)
    plan = None
    if any(s.needs_plan for s in chosen):
        try:
            plan = plan_to_track(design, say)
        except NotSolvedError as error:
            chosen = [s for s in chosen if not s.needs_plan]
            notes.append(f"nothing is tracked, as no plan keeps the problem's [reserve] back: {error}")
    trials = [
        Trial(design, s.name, reference_of(plan), apex_of(plan)) if plan and s.needs_plan else Trial(design, s.name)
        for s in chosen
    ]
    say(f"{hops} hops of {', '.join(t.strategy for t in trials)}")
    found = dict[str, Hops]()
    for k in range(0, len(trials), processes):
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
