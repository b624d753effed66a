"""Mesh refinement: accurate states, limits enforced between the nodes too, at a cost that does not matter.

An interval is cut at once into as many pieces as its local error and its tightening cost ask for by their orders. The
local error falls with the interval's length to the power of the nodes and one, the cost of a switch with its square.
Where limits are passed, they are enforced between the nodes on the next mesh (nlp/refinement/continuous_limits.py). What still
passes them is tightened. An interval that does not answer to that on the same mesh is cut.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Self

import numpy as np

from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.refinement.continuous_limits import Chosen, Held, coming_close, held_between, nothing_held
from hopopt.nlp.refinement.interval_errors import interval_errors
from hopopt.nlp.refinement.mesh_step import Cuts, Parts, about, any_cut, cut, equal, fitting, only, pieces_of
from hopopt.nlp.refinement.tightening import passed, tightened
from hopopt.nlp.refinement.tightening_cost import excess_costs, normalised_switch_times, tightening_costs
from hopopt.nlp.solver.ipopt import CARRIED, GENTLE, NEAR, Bounds, Multipliers, NlpSolution, NlpSolver
from hopopt.nlp.solver.warm_start import carried
from hopopt.nlp.transcription import Transcription
from hopopt.record import Real, Strict, stated

BUDGET = 0.5  # share of the allowed tightening cost that a refinement is content with
AIM = 0.3  # share of the allowed local error, and of the tightening cost, that a cut aims at
NEARLY = 0.3  # share of what is allowed, above which an interval is cut where others must be
PIECES = 8  # into which an interval is cut at most
STUBBORN = 4  # pieces for an interval that does not answer
SLOW = 2  # order to which an error falls that is still there on the second mesh
GRADED = 4.0  # times shorter: intervals of switches that should be that are cut about them
ANSWERS = 0.5  # share of its last excess, above which an interval does not answer to holding its limits
EARLY = 2  # meshes before an error that wanders is suspected
COARSE = 0.01  # share of the phase: longer intervals may harbour one
FINEST = 500  # intervals: a solution that needs more has torques that hardly matter and chatter; a larger tie-break calms them
LOST = 0.02  # relative: a finer mesh's objective may be worse by this much, and by more if two solves agree on it
AGREED = 1e-4  # relative
PATIENCE, LONGER = 60, 5  # iterations from carried multipliers, and how many times as many before starting without
RESTARTS = ("adaptive", "monotone")  # barriers that are tried then
STUCK, NEARER = 5, 0.5  # so many meshes, none of which is nearer to the aims than by this factor
NEARBY = 4.0  # times its aim: an error within that is not called stuck, for wandering it will meet it
# How a refinement ends:
MET, NOT_ASKED, USED_UP = "its aims are met", "none was asked for", "all its meshes are used up"
TOO_FINE = f"the next mesh would have more than {FINEST} intervals"
NO_NEARER = f"its last {STUCK} meshes brought it no nearer to its aims"
OUT_OF_TIME = "the time limit was reached"
UNSOLVED, WORSE = "the next mesh's program was not solved", "the next mesh led to a worse hop"
Amounts = dict[str, np.ndarray]  # for each phase, how far lower and upper limits are tightened, (2, N, limits)


@dataclass(frozen=True)
class Aims:
    """What a refinement is to reach, and with how much effort.

    local_error: of any interval, scaled
    change: relative change of the objective with the last mesh
    excess: share of its range by which a limit may be passed
    tightening_cost: relative to the objective
    meshes: most of them
    iterations: most of them on each mesh
    restarts: so many times ``iterations`` may go, over all meshes, into solving again without the last one's
        multipliers; restarts that only a doubt asks for are counted, but never refused
    until: by when it ends, with the mesh it is at
    """

    local_error: float
    change: float
    excess: float
    tightening_cost: float
    meshes: int
    iterations: int
    restarts: float = 5.0
    until: Deadline = NEVER


@dataclass(frozen=True)
class MeshStep(Strict):
    """One solve of the refinement."""

    intervals: Mapping[str, int] = stated("by phase")
    held: int = stated("intervals in which limits are enforced between the nodes")
    objective: Real = stated("[its unit]")
    local_error: Real = stated("largest of any interval, scaled")
    excess: Real = stated("largest share of its range by which a limit is passed between the nodes")
    iterations: int = stated("of Ipopt")
    build_seconds: float = stated("to build the program [s]")
    solve_seconds: float = stated("to solve it [s]")
    seconds: float = stated("in all [s]")
    drawn_in: int = stated("how often limits were tightened on this mesh before")


Report = Callable[[MeshStep], None]


class Refinement:
    """From a solution on a first mesh to an accurate one that keeps its limits: ``solution``, ``history`` and how it
    ``ended``; ``held``: those that the first one enforces between the nodes already."""

    def __init__(
        self,
        solution: NlpSolution,
        aims: Aims,
        report: Report = lambda step: None,
        held: Chosen | None = None,
    ):
        self.aims, self.report, self.history = aims, report, list[MeshStep]()
        self.clock, self.ended = time.perf_counter(), USED_UP if aims.meshes else NOT_ASKED
        self._held = held or nothing_held(solution.transcription)
        self._program: Held | None = None  # of the last mesh
        self._restarts_left = round(aims.restarts * aims.iterations)
        self._accept(solution, 0.0, 0.0)
        limits = {name: (len(e.local), len(e.limits)) for name, e in self.errors.items()}
        self._tightened: Amounts = {name: np.zeros((2, *shape)) for name, shape in limits.items()}
        self._before = {name: np.full(N, np.inf) for name, (N, _) in limits.items()}  # excess that was answered to

    def run(self) -> None:
        """Refine until the aims are met, or no mesh is left, or one cannot be solved or would be too fine."""
        meshes, solved = 0, True
        while solved:
            cuts = self._cuts()
            accurate = not any_cut(cuts) and self._kept
            if accurate and self.change <= self.aims.change:
                self.ended = MET
                return
            if meshes == self.aims.meshes or len(self.history) > 2 * self.aims.meshes:
                return
            if self._stuck:
                self.ended = NO_NEARER
                return
            if accurate:
                cuts = {name: equal(np.full(len(normalised_times), 2)) for name, normalised_times in cuts.items()}
            if (fewer := self._fitting({name: pieces_of(cuts[name]) for name in cuts})) is None:
                self.ended = TOO_FINE
                return
            cuts = only(cuts, fewer)
            self._prepare(cuts)
            meshes += any_cut(cuts)
            solved = self._solve(cuts)

    def further(self, aims: Aims) -> Self:
        """Another one that went on from where this ended, towards other aims; this stays as it is."""
        other = copy(self)
        other.aims, other.ended, other.history = aims, USED_UP, list(self.history)
        other.run()
        return other

    @property
    def change(self) -> float:
        """Relative change of the objective with the last mesh, before its limits were tightened; infinite after one."""
        steps = [(step.intervals, step.objective, step.drawn_in) for step in self.history]
        return change_of(steps, self.solution.least)

    @property
    def _kept(self) -> bool:
        """Whether all limits are."""
        return all(e.excess.max() <= self.aims.excess for e in self.errors.values())

    @property
    def _stuck(self) -> bool:
        """Whether errors and excess are far from their aims and no longer fall, as where an optimum is an impulse."""
        far = [self._far(step) for step in self.history]
        return len(far) > STUCK and min(far[-STUCK:]) > max(NEARBY, NEARER * min(far[:-STUCK]))

    def _far(self, step: MeshStep) -> float:
        """How far a mesh is from its aims: at most 1 where it meets them."""
        return max(step.local_error / self.aims.local_error, step.excess / self.aims.excess)

    # ---- what is to be done ----------------------------------------------------------------------------

    def _cuts(self) -> Cuts:
        """Where each interval is to be cut: if something asks for it, what nearly does is cut too."""
        cost, allowed = self._costs(), self.aims
        stubborn = {
            n: (e.excess > allowed.excess) & (e.excess > ANSWERS * self._before[n]) for n, e in self.errors.items()
        }
        inaccurate = any((e.local > allowed.local_error).any() for e in self.errors.values())
        asked = inaccurate or any(any(on) for on in stubborn.values())
        if not asked and sum(each.sum() for each in cost.values()) <= self._budget:
            return {name: equal(np.ones(len(on), dtype=int)) for name, on in stubborn.items()}
        finer = {name: np.maximum(self._inaccurate(name), np.where(on, STUBBORN, 1)) for name, on in stubborn.items()}
        return self._dear(cost, finer)

    def _inaccurate(self, name: str) -> np.ndarray:
        """Pieces for each interval by its local error; late in the refinement what the error may move to is halved."""
        local = self.errors[name].local
        allowed = NEARLY * self.aims.local_error
        order = len(self.solution.transcription.scheme.c) + 1 if len(self.history) == 1 else SLOW
        over = local > allowed
        asked = np.clip(np.ceil((local / (AIM * self.aims.local_error)) ** (1 / order)), 2, PIECES)
        moves = moves_to(over, self.solution.phases[name].lengths) & (len(self.history) > EARLY)
        return np.where(over, asked, np.where(moves, 2, 1)).astype(int)

    @property
    def _budget(self) -> float:
        """What all limits may cost [objective's unit]."""
        return BUDGET * self.aims.tightening_cost * self.solution.magnitude

    def _costs(self) -> dict[str, np.ndarray]:
        """What the limits of each interval cost, or would cost [objective's unit]."""
        drawn, over = tightening_costs(self.solution), excess_costs(self.solution, self.errors)
        return {name: drawn[name] + over[name] for name in drawn}

    def _dear(self, cost: Mapping[str, np.ndarray], others: Mapping[str, np.ndarray]) -> Cuts:
        """The dearest intervals cut until the rest is well within the budget, about their switch if that is known well
        enough (not on the first mesh); the others into so many pieces."""
        total = np.sort(np.concatenate(list(cost.values())))
        dear = total[np.searchsorted(np.cumsum(total), NEARLY * self._budget, side="right") :]
        share, least = AIM * self._budget / max(1, len(dear)), dear.min(initial=np.inf)
        switch, found = normalised_switch_times(self.solution), {}
        for name, each in cost.items():
            shorter = np.where(each >= least, np.sqrt(each / share), 1.0)  # by which share they should be
            pieces = np.maximum(others[name], np.clip(np.ceil(shorter), 1, PIECES)).astype(int)
            found[name] = equal(pieces)
            if len(self.history) > 1:
                for k in np.flatnonzero((shorter > GRADED) & np.isfinite(switch[name])):
                    found[name][k] = about(float(switch[name][k]), 1.0 / float(shorter[k]))
        return found

    def _prepare(self, cuts: Cuts) -> None:
        """What is held and tightened on the next mesh, and the excess it answers to."""
        close, finer = coming_close(self.solution, self.errors, self.aims.excess), any_cut(cuts)
        for name, e in self.errors.items():
            n, held, over = pieces_of(cuts[name]), self._held[name], passed(e, self.aims.excess)
            free = np.zeros(e.below.shape, dtype=bool)  # path limits that are not held yet
            free[:, : held.shape[1]] = ~held & self.solution.transcription.layouts[name].stage.smooth
            whole = (n == 1)[:, None] & ~free
            drawn_in = np.repeat(np.where(whole, self._tightened[name] + over, 0.0), n, axis=1)
            answers = (e.excess > self.aims.excess) & ~(free & over.any(axis=0)).any(axis=1)
            answers &= not finer  # on a finer mesh the excess is another
            before = np.repeat(np.where(answers, e.excess, np.inf), n)
            self._tightened, self._before = {**self._tightened, name: drawn_in}, {**self._before, name: before}
            self._held = {**self._held, name: np.repeat(held | close[name], n, axis=0)}

    def _fitting(self, pieces: Parts) -> Parts | None:
        """The pieces, or those of the most urgent if the next mesh would be too fine; None if those would be too few."""
        aims, cost = self.aims, self._costs()
        urgency = {
            name: e.local / aims.local_error + e.excess / aims.excess + cost[name] / self._budget
            for name, e in self.errors.items()
        }
        return fitting(pieces, urgency, FINEST)

    # ---- doing it ----------------------------------------------------------------------------------------

    def _solve(self, cuts: Cuts) -> bool:
        """Solve on the next mesh, which may be the same, with limits held and tightened."""
        began, old, finer = time.perf_counter(), self.solution, any_cut(cuts)
        if self.aims.until.passed:
            self.ended = OUT_OF_TIME
            return False
        t = old.transcription
        if finer:
            t = Transcription(
                t.problem, t.scheme, {name: cut(old, name, normalised_times) for name, normalised_times in cuts.items()}
            )
        if self._program is None or not self._program.is_of(t, self._held):
            self._program = held_between(t, self._held)
        held = self._program
        guess, free = t.guess_from(old.phases), t.free_from(old.parameters)
        bounds = tightened(Bounds(*t.bounds(guess), t.lbg, t.ubg), t, self._tightened)
        lam_g, lam_x = carried(old, t) if finer else (old.lam_g, old.lam_x)
        solver = self._solver(held.transcription, CARRIED if finer else NEAR)
        built = time.perf_counter()
        solved = self._attempts(solver, guess, free, (held.multipliers(lam_g), lam_x), bounds)
        found = self._believable(solved)
        if found is None:
            self.ended = OUT_OF_TIME if self.aims.until.passed else WORSE if solved else UNSOLVED
            return False
        self._accept(held.at_nodes(found), built - began, time.perf_counter() - built)
        return True

    def _attempts(
        self,
        warm: NlpSolver,
        guess: Any,
        free: Mapping[str, Any],
        multipliers: Multipliers,
        bounds: Bounds | None = None,
    ) -> list[NlpSolution]:
        """What was solved from the last mesh's point and multipliers and then, until a solution is no worse than that
        mesh's, from the point alone."""
        tried = [warm(guess, free, multipliers, bounds)]
        for strategy in RESTARTS:
            most = self.aims.iterations
            if not tried[0].success:
                most = min(most, self._restarts_left)
            if most == 0 or self.aims.until.passed or (tried[-1].success and not self._worse(tried[-1])):
                break
            options = GENTLE | {"ipopt.max_iter": most, "ipopt.mu_strategy": strategy}
            tried.append(NlpSolver(warm.transcription, options, until=self.aims.until)(guess, free, None, bounds))
            self._restarts_left = max(0, self._restarts_left - tried[-1].iterations)
        return [s for s in tried if s.success]

    def _believable(self, solved: Sequence[NlpSolution]) -> NlpSolution | None:
        """The last, if it is no worse than the last mesh's solution; else what two agree on, if that mesh was inaccurate
        and may have claimed too much."""
        if solved and not self._worse(solved[-1]):
            return solved[-1]
        aims = self.aims
        if all(e.local.max() <= aims.local_error and e.excess.max() <= aims.excess for e in self.errors.values()):
            return None
        pairs = combinations(solved, 2)
        return next((b for a, b in pairs if relative(a.objective, b.objective, a.least) <= AGREED), None)

    def _worse(self, solution: NlpSolution) -> bool:
        """Whether it may be another, worse optimum than the last mesh's."""
        loss = solution.transcription.problem.objective.cost(solution.objective - self.solution.objective)
        return loss > LOST * self.solution.magnitude

    def _solver(self, t: Transcription, known: Mapping[str, Any]) -> NlpSolver:
        patience = PATIENCE * (LONGER if self.aims.restarts else 1)  # from the point alone it takes hundreds
        most = {"ipopt.max_iter": min(patience, self.aims.iterations)}
        return NlpSolver(t, {**known, **most}, until=self.aims.until)

    def _accept(self, s: NlpSolution, build_seconds: float, solve_seconds: float, drawn_in: int = 0) -> None:
        self.solution, self.errors = s, {name: interval_errors(s, name) for name in s.phases}
        sizes = {name: m.intervals for name, m in s.transcription.mesh.items()}
        local, excess = (max(float(getattr(e, w).max()) for e in self.errors.values()) for w in ("local", "excess"))
        now = time.perf_counter()
        self.history.append(
            MeshStep(
                sizes,
                sum(int(on.any(axis=1).sum()) for on in self._held.values()),
                s.objective,
                local,
                excess,
                s.iterations,
                build_seconds,
                solve_seconds,
                now - self.clock,
                drawn_in,
            )
        )
        self.clock = now
        self.report(self.history[-1])


def moves_to(over: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Where errors of the intervals that are ``over`` may move to: those of a switch to its neighbours, those that live on
    coarse intervals to any other of them, (N,)."""
    coarse = lengths > max(0.5 * lengths.max(), COARSE * lengths.sum())
    return (np.convolve(over, [1, 1, 1])[1:-1] > 0) | (coarse & (over & coarse).any())


def change_of(steps: Sequence[tuple[Mapping[str, int], float, int]], least: float) -> float:
    """Relative change of the objective with the last mesh, from (intervals by phase, objective, how often limits were
    tightened) of every solve: of those with none tightened; infinite after one mesh."""
    plain = [(sizes, objective) for sizes, objective, tightened in steps if not tightened]
    before = [objective for sizes, objective in plain if sizes != plain[-1][0]]
    return relative(plain[-1][1], before[-1], least) if before else float("inf")


def relative(a: float, b: float, least: float = 1e-9) -> float:
    """|a - b| relative to |a|, or to what that is at least."""
    return abs(a - b) / max(abs(a), least)
