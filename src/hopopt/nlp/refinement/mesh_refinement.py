"""Mesh refinement: accurate states, limits enforced between the nodes too, at a cost that does not matter.

The loop; where intervals are cut says nlp/refinement/next_mesh.py. Where limits are passed, they are enforced between
the nodes on the next mesh (nlp/refinement/continuous_limits.py). What still passes them is tightened. Programs with
kinks of their own have accurate states first and limits tightened on the settled mesh. Where a control or a least
number only bounds something from above, hulls make such kinks cost more. Schemes that collocate both ends of an interval,
whose controls oscillate, hardly converge within them. Where states have sharp zeros, meshes have free edges there
(nlp/refinement/sharp/zeros.py); the last has none, and is solved as any other. Where that fails, or a state only touches zero
there, it begins again without.
"""

import time
from collections.abc import Mapping
from copy import copy
from dataclasses import replace
from math import inf
from typing import Self

import numpy as np

from hopopt.nlp.refinement.continuous_limits import (
    Chosen,
    Enforced,
    coming_close,
    enforcing,
    holds,
    kept_without,
    nothing_enforced,
)
from hopopt.nlp.refinement.interval_errors import interval_errors
from hopopt.nlp.refinement.mesh_step import STUCK, MeshStep, Report, change_of, stuck
from hopopt.nlp.refinement.next_mesh import (
    Aims,
    Cuts,
    Measured,
    any_cut,
    cut,
    cuts_before_tightening,
    cuts_of_what_is_wrong,
    equal,
    fitting,
    halved,
    next_cuts,
    outdone,
    pieces_of,
    uncut,
)
from hopopt.nlp.refinement.sharp.zeros import cut_at_zeros, free_at_zeros, keeps_zeros, sharp_states, zeros
from hopopt.nlp.refinement.solving import Solving, believable
from hopopt.nlp.refinement.tightening import passed, tightened, tightened_by_excess
from hopopt.nlp.refinement.tightening_cost import tightening_cost
from hopopt.nlp.solver.ipopt import NEAR_OPTIONS, WAYS, Bounds, NlpSolution
from hopopt.nlp.solver.warm_start import carried
from hopopt.nlp.transcription import Transcription

FINEST = 500  # intervals: a solution that needs more has torques that hardly matter and chatter; a larger tie-break calms them
TIGHTENING_ROUNDS = 10  # of tightening the limits on one mesh
STALLED = 0.8  # share of the excess two rounds ago, above which another round will not help
ROOM = 1.3  # times as many where a mesh was found and some more intervals are asked for
# How a refinement ends:
MET, NOT_ASKED, USED_UP = "its aims are met", "none was asked for", "all its meshes are used up"
TOO_FINE = f"the next mesh would have more than {FINEST} intervals"
NO_NEARER = f"its last {STUCK} meshes brought it no nearer to its aims"
OUT_OF_TIME = "the time limit was reached"
UNSOLVED, WORSE = "the next mesh's program was not solved", "the next mesh led to a worse hop"
ASTRAY = "an edge at a zero led to a hop without that zero"
FAILED = (UNSOLVED, WORSE, ASTRAY)
BEHIND = "a hop that is better, or as good, is known"


class Refinement:
    """From a solution on a first mesh to an accurate one that keeps its limits.

    solution, errors: of the last mesh, and what is wrong in its intervals
    history: every solve
    ended: why there is no further mesh
    between: whether limits are enforced between the nodes, or tightened at the end
    """

    def __init__(
        self, solution: NlpSolution, aims: Aims, report: Report = lambda step: None, enforced: Chosen | None = None,
        between: bool | None = None,
    ):  # fmt: skip
        """``enforced``: limits that ``solution`` holds between the nodes already; ``between``: None: what suits it."""
        self.aims, self.report, self._first = aims, report, (solution, enforced)
        self.clock, self.ended = time.perf_counter(), USED_UP if aims.meshes else NOT_ASKED
        self.between = holds(solution.transcription) if between is None else between
        self._sharp = self.between and sharp_states(solution.transcription.problem)
        self._at_zeros = self._sharp  # whether edges are set where states are zero
        self._room = 1.0  # so many times FINEST are the most intervals
        self._solving = Solving(aims, self._sharp, round(aims.restarts * aims.iterations))
        self._begin()

    def _begin(self) -> None:
        """With the solution on the first mesh."""
        solution, enforced = self._first
        self.history, self._solving.ways = list[MeshStep](), WAYS
        self._passes_zeros = False  # whether free edges at zeros led to where it is
        self._enforced = enforced or nothing_enforced(solution.transcription)
        self._program: Enforced | None = None  # of the last mesh
        # limits that are not enforced by their hulls, as these leave no room, (1, path limits)
        self._touched = {name: np.zeros_like(on[:1]) for name, on in self._enforced.items()}
        self._accept(solution, 0.0, 0.0)
        # how far lower and upper limits are tightened, (2, N, limits), and the excess that was answered to, (N,)
        none = {n: np.zeros((2, len(e.local), len(e.limits))) for n, e in self.errors.items()}
        self._tightened = none if self.between else {}
        self._answered = {n: np.full(len(e.local), np.inf) for n, e in self.errors.items()}

    def run(self) -> Self:
        """Refine until the aims are met, or no mesh is left, or one cannot be solved or would be too fine."""
        at_zeros = self._at_zeros
        self._to_its_end()
        if at_zeros and self.ended in FAILED:
            self._begin()
            self.ended = self._enforcing() or USED_UP
        return self

    def _to_its_end(self) -> None:
        """Refine from the mesh it is at; the last has no free edges."""
        self.ended = (self._enforcing() if self.between else self._tightening_at_the_end()) or self.ended
        self._at_zeros = False
        if self._with_zeros and self.ended != BEHIND:
            failed = self._solve_on(uncut(self._measured))
            self._passes_zeros = not failed
            self.ended = failed or self._enforcing() or USED_UP

    @property
    def _with_zeros(self) -> bool:
        """Whether the last mesh has free edges at zeros."""
        return any(mesh.zeros for mesh in self.solution.transcription.mesh.values())

    def further(self, aims: Aims) -> Self:
        """Another one that went on from where this ended, towards other aims; this stays as it is."""
        return self._going_on(aims) or self

    def on_pieces(self, pieces: Mapping[str, np.ndarray]) -> Self | None:
        """Another one that first cuts intervals into so many equal pieces, by phase, (N,) each, and goes on from there; None if
        that cannot be solved. This stays as it is."""
        return self._going_on(self.aims, {name: equal(n) for name, n in pieces.items()}, ROOM)

    def _going_on(self, aims: Aims, cuts: Cuts | None = None, room: float = 1.0) -> Self | None:
        """Another one that went on from where this ended, with these cuts first; None if they cannot be solved. Where free edges
        at zeros led here, first with such edges."""
        for at_zeros in (True, False) if self._passes_zeros else (False,):
            other = copy(self)
            other._solving, other.ended, other.history = copy(self._solving), USED_UP, list(self.history)
            other.aims = other._solving.aims = replace(aims, known=None)  # it was worth its end
            other._room, other._at_zeros = max(room, self._room), at_zeros
            if cuts is not None and other._solve_on(cuts):
                continue
            other._to_its_end()
            if not (at_zeros and other.ended in FAILED):
                return other
        return None

    def _enforcing(self) -> str:
        """How it ends where limits are enforced between the nodes; "" with the last mesh."""
        meshes = 0
        while True:
            cuts = next_cuts(self._measured, self.aims, len(self.history), self._answered)
            accurate = self._kept and not any_cut(cuts)
            if accurate and self.change <= self.aims.change:
                return MET
            if outdone(self._measured, self.aims, self.change):
                return BEHIND
            if meshes == self.aims.meshes or len(self.history) > 2 * self.aims.meshes:
                return ""
            if stuck(self.history, self.aims.local_error, self.aims.excess if self.between else inf):
                return NO_NEARER
            cuts = halved(self._measured) if accurate else cuts
            meshes += any_cut(cuts)
            if failed := self._solve_on(cuts):
                return failed

    def _tightening_at_the_end(self) -> str:
        """How it ends where limits are tightened on the settled mesh; "" with the last mesh."""
        for _ in range(self.aims.meshes):
            if outdone(self._measured, self.aims, self.change):
                return BEHIND
            if stuck(self.history, self.aims.local_error, self.aims.excess if self.between else inf):
                return NO_NEARER
            cuts = cuts_before_tightening(self._measured, self.aims, len(self.history))
            if not any_cut(cuts):
                if self.change > self.aims.change:
                    cuts = halved(self._measured)
                else:
                    self._tighten()
                    cuts = cuts_of_what_is_wrong(self._measured, self.aims)
            if not any_cut(cuts):
                return MET
            if failed := self._solve_on(cuts):
                return failed
        return ""

    @property
    def change(self) -> float:
        """Relative change of the objective with the last mesh, before its limits were tightened; infinite after one."""
        steps = [(step.intervals, step.objective, step.drawn_in) for step in self.history]
        return change_of(steps, self.solution.least)

    @property
    def _kept(self) -> bool:
        """Whether all limits are."""
        return all(e.excess.max() <= self.aims.excess for e in self.errors.values())

    # ---- the next mesh's program ---------------------------------------------------------------------------

    def _solve_on(self, cuts: Cuts) -> str:
        """Solve on the next mesh, which may be the same, with limits enforced and tightened; why not, if that fails."""
        if (fewer := fitting(cuts, self._measured.urgency(self.aims), int(self._room * FINEST))) is None:
            return TOO_FINE
        old, began, before = self.solution, time.perf_counter(), (self._enforced, self._tightened, self._answered)
        passed_at = {name: zeros(old, name) if self._at_zeros else [] for name in fewer}
        cuts = {name: cut_at_zeros(old.phases[name], times, passed_at[name]) for name, times in fewer.items()}
        finer = any_cut(cuts) or (self._with_zeros and not self._at_zeros)
        if self.between:
            self._enforce_and_tighten(cuts)
        if self.aims.until.passed:
            return OUT_OF_TIME
        t = old.transcription
        if finer:
            mesh = {name: free_at_zeros(cut(old, name, times), passed_at[name]) for name, times in cuts.items()}
            t = Transcription(t.problem, t.scheme, mesh)
        if self._program is None or not self._program.is_of(t, self._enforced):
            self._program = enforcing(t, self._enforced)
        enforced = self._program
        guess, free = t.guess_from(old.phases), t.free_from(old.parameters)
        bounds = tightened(Bounds(*t.bounds(guess), t.lbg, t.ubg), t, self._tightened)
        lam_g, lam_x = carried(old, t) if finer else (old.lam_g, old.lam_x)
        spare = self._unneeded is not None
        warm = self._solving.warm(enforced.transcription, any_cut(cuts), spare)
        built = time.perf_counter()
        begun = guess, free, (enforced.multipliers(lam_g), lam_x), bounds
        solved = self._solving.solutions(old, enforced, warm, *begun, spare, any_cut(cuts))
        accurate = self._kept and all(e.local.max() <= self.aims.local_error for e in self.errors.values())
        if (found := believable(solved, old, not self.between, accurate)) is None:
            unneeded, (self._enforced, self._tightened, self._answered) = self._unneeded, before
            if unneeded is not None:
                self._touched = dict(unneeded)
                self._enforced = {name: on & ~unneeded[name] for name, on in self._enforced.items()}
                return self._solve_on(cuts)
            return OUT_OF_TIME if self.aims.until.passed else WORSE if solved else UNSOLVED
        if self._at_zeros and not keeps_zeros(found):
            self._enforced, self._tightened, self._answered = before
            return ASTRAY
        self._accept(enforced.at_nodes(found), built - began, time.perf_counter() - built)
        return ""

    @property
    def _unneeded(self) -> Chosen | None:
        """Limits, (1, path limits) by phase, that the last mesh keeps and its hulls pass; None if none is enforced, or some were
        spared before."""
        if not self.between or self.aims.until.passed or any(on.any() for on in self._touched.values()):
            return None
        kept = kept_without(self.solution, self.errors, self.aims.excess)
        return kept if any((on & self._enforced[name]).any() for name, on in kept.items()) else None

    def _enforce_and_tighten(self, cuts: Cuts) -> None:
        """What is enforced and tightened on the next mesh, and the excess it answers to."""
        close, finer = coming_close(self.solution, self.errors, self.aims.excess), any_cut(cuts)
        for name, e in self.errors.items():
            n, enforced, over = pieces_of(cuts[name]), self._enforced[name], passed(e, self.aims.excess)
            smooth = self.solution.transcription.layouts[name].stage.smooth & ~self._touched[name]
            free = np.zeros(e.below.shape, dtype=bool)  # path limits that are not enforced yet
            free[:, : enforced.shape[1]] = ~enforced & smooth
            whole = (n == 1)[:, None] & ~free
            drawn_in = np.repeat(np.where(whole, self._tightened[name] + over, 0.0), n, axis=1)
            answers = (e.excess > self.aims.excess) & ~(free & over.any(axis=0)).any(axis=1)
            answers &= not finer  # on a finer mesh the excess is another
            answered = np.repeat(np.where(answers, e.excess, np.inf), n)
            self._tightened, self._answered = self._tightened | {name: drawn_in}, self._answered | {name: answered}
            self._enforced = {**self._enforced, name: np.repeat(enforced | (close[name] & smooth), n, axis=0)}

    def _tighten(self) -> None:
        """Tighten the limits on the last mesh until they hold, or that costs too much or no longer helps."""
        solver = self._solving.solver(self.solution.transcription, NEAR_OPTIONS, self._unneeded is not None)
        for k in range(TIGHTENING_ROUNDS):
            last, began = [step.excess for step in self.history[-3:]], time.perf_counter()
            if self._kept or (k > 2 and last[-1] > STALLED * last[0]) or self.aims.until.passed:
                return
            found = solver.again(self.solution, tightened_by_excess(self.solution, self.errors, self.aims.excess))
            if not found.success or tightening_cost(found) > self.aims.tightening_cost:
                return
            self._accept(found, 0.0, time.perf_counter() - began, k + 1)

    def _accept(self, s: NlpSolution, build_seconds: float, solve_seconds: float, drawn_in: int = 0) -> None:
        self.solution, self.errors = s, {name: interval_errors(s, name) for name in s.phases}
        self._measured = Measured(s, self.errors)
        sizes = {name: m.intervals for name, m in s.transcription.mesh.items()}
        enforced = sum(int(on.any(axis=1).sum()) for on in self._enforced.values())
        local, excess = (max(float(getattr(e, w).max()) for e in self.errors.values()) for w in ("local", "excess"))
        began, self.clock = self.clock, time.perf_counter()
        seconds = build_seconds, solve_seconds, self.clock - began
        self.history.append(MeshStep(sizes, enforced, s.objective, local, excess, s.iterations, *seconds, drawn_in))
        self.report(self.history[-1])
