"""Mesh refinement, then back-off: accurate states on a settled mesh, then limits that hold between the nodes too.

Intervals are cut where the states are not accurate, and where drawing in the limits would cost too much: the price
of an interval with a switch in it falls with the square of its length. On the last mesh the limits are drawn in
until they hold everywhere.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hopopt.nlp.accuracy import interval_errors
from hopopt.nlp.backoff import PRICE, drawn_in, price, prices
from hopopt.nlp.carry import carried
from hopopt.nlp.ipopt import NEAR, WARM, NlpSolution, NlpSolver
from hopopt.nlp.mesh import PhaseMesh
from hopopt.nlp.transcribe import Transcription

MOST = 4  # pieces into which an interval is cut at once
BUDGET = PRICE  # of the intervals' prices before anything is drawn in: an estimate from above
EARLY = 4  # meshes before an error that wanders is suspected
COARSE = 0.01  # share of the phase: longer intervals may harbour one
FINEST = 1000  # intervals: a solution that asks for more will not be accurate
ROUNDS = 10  # of drawing in the limits on one mesh
STALLED = 0.8  # share of the excess two rounds ago, above which another round will not help
LOST = 0.02  # relative: a finer mesh's objective may be worse by this much and no more
PATIENCE = 100  # iterations from carried multipliers, before starting without
Parts = Mapping[str, np.ndarray]  # for each phase, into how many pieces each interval is to be cut


@dataclass(frozen=True)
class Aims:
    """Local error (scaled), relative change of the objective, excess over the limits; meshes, iterations at most."""

    local_error: float
    change: float
    excess: float
    meshes: int
    iterations: int


@dataclass(frozen=True)
class MeshStep:
    """One solve: intervals by phase, how often the limits were drawn in, objective, largest errors, effort."""

    intervals: dict[str, int]
    drawn_in: int
    objective: float
    local_error: float
    excess: float
    iterations: int
    build_seconds: float
    solve_seconds: float
    seconds: float


class Refinement:
    """From a solution on a first mesh to an accurate one that keeps its limits: ``solution`` and ``history``."""

    def __init__(self, solution: NlpSolution, aims: Aims, report: Callable[[MeshStep], None] = lambda step: None):
        self.aims, self.report, self.history = aims, report, list[MeshStep]()
        self.clock = time.perf_counter()
        self._accept(solution, 0, 0.0, 0.0)

    def run(self) -> None:
        """Refine until the aims are met, or no mesh is left, or one cannot be solved or would be too fine."""
        for _ in range(self.aims.meshes):
            parts = self._faults()
            if not _any(parts):
                parts = self._draw_in() if self.change <= self.aims.change else _all(parts)
            if not _any(parts) or not self._solve_on({n: cut(self.solution, n, p) for n, p in parts.items()}):
                return

    @property
    def change(self) -> float:
        """Relative change of the objective with the last mesh, before its limits were drawn in; infinite after one."""
        meshes = [step.objective for step in self.history if not step.drawn_in]
        return relative(meshes[-1], meshes[-2]) if len(meshes) > 1 else float("inf")

    def _faults(self) -> Parts:
        """What is to be cut: inaccurate intervals, and the dearest until the rest is within the budget."""
        price, budget = prices(self.solution, self.errors), BUDGET * abs(self.solution.objective)
        total = np.sort(np.concatenate(list(price.values())))
        dear = total[np.searchsorted(np.cumsum(total), budget, side="right") :].min(initial=np.inf)
        return {
            name: np.maximum(
                self._inaccurate(e.local, self.solution.phases[name].lengths), np.where(price[name] >= dear, MOST, 1)
            )
            for name, e in self.errors.items()
        }

    def _inaccurate(self, local: np.ndarray, lengths: np.ndarray) -> np.ndarray:
        """Pieces for each interval by its local error; late in the refinement, where an error only moves on, what it
        moves to is halved too: a switch goes to its neighbours, what lives on coarse intervals to any other of them."""
        over = local > self.aims.local_error
        if len(self.history) <= EARLY:
            return np.where(over, MOST, 1)
        coarse = lengths > max(0.5 * lengths.max(), COARSE * lengths.sum())
        moves = (np.convolve(over, [1, 1, 1], "same") > 0) | (coarse & (over & coarse).any())
        return np.where(over, MOST, np.where(moves, 2, 1))

    def _draw_in(self) -> Parts:
        """Draw in the limits until they hold; what is to be cut if that fails."""
        began, solver = time.perf_counter(), self._solver(self.solution.transcription, NEAR)
        for k in range(ROUNDS):
            last = [step.excess for step in self.history[-3:]]
            if last[-1] <= self.aims.excess or (k > 2 and last[-1] > STALLED * last[0]):
                break
            built = time.perf_counter()
            solution = solver.again(self.solution, drawn_in(self.solution, self.errors, self.aims.excess))
            if not solution.success or price(solution) > PRICE:
                break
            self._accept(solution, k + 1, built - began, time.perf_counter() - built)
            began = time.perf_counter()
        return {
            name: np.where((e.excess > self.aims.excess) | (e.local > self.aims.local_error), MOST, 1)
            for name, e in self.errors.items()
        }

    def _solve_on(self, mesh: Mapping[str, PhaseMesh]) -> bool:
        """Solve on another mesh from the last solution, with its multipliers and, if that fails, without."""
        if sum(m.intervals for m in mesh.values()) > FINEST:
            return False
        began, old = time.perf_counter(), self.solution
        t = Transcription(old.transcription.problem, old.transcription.scheme, mesh)
        guess, free = t.guess_from(old.phases), {q.name: old.parameters[q.name] for q in t.free}
        solver = self._solver(t, WARM)
        built = time.perf_counter()
        solution = solver(guess, free, carried(old, t))
        for strategy in ("adaptive", "monotone"):
            if not solution.success or self._lost(solution):
                solution = self._cold(t, strategy)(guess, free)
        if solution.success:
            self._accept(solution, 0, built - began, time.perf_counter() - built)
        return solution.success

    def _lost(self, solution: NlpSolution) -> bool:
        """Whether it is another, worse optimum than the last mesh's."""
        sign = -1.0 if solution.transcription.problem.objective.maximize else 1.0
        return sign * (solution.objective - self.solution.objective) > LOST * abs(self.solution.objective)

    def _solver(self, t: Transcription, known: Mapping[str, Any]) -> NlpSolver:
        return NlpSolver(t, {**known, "ipopt.max_iter": min(PATIENCE, self.aims.iterations)})

    def _cold(self, t: Transcription, strategy: str) -> NlpSolver:
        return NlpSolver(t, {"ipopt.max_iter": self.aims.iterations, "ipopt.mu_strategy": strategy})

    def _accept(self, s: NlpSolution, drawn_in: int, build_seconds: float, solve_seconds: float) -> None:
        self.solution, self.errors = s, {name: interval_errors(s, name) for name in s.phases}
        sizes = {name: m.intervals for name, m in s.transcription.mesh.items()}
        local, excess = (max(float(getattr(e, w).max()) for e in self.errors.values()) for w in ("local", "excess"))
        now = time.perf_counter()
        self.history.append(
            MeshStep(
                sizes,
                drawn_in,
                s.objective,
                local,
                excess,
                s.iterations,
                build_seconds,
                solve_seconds,
                now - self.clock,
            )
        )
        self.clock = now
        self.report(self.history[-1])


def relative(a: float, b: float) -> float:
    """|a - b| relative to |a|."""
    return abs(a - b) / max(abs(a), 1e-9)


def cut(solution: NlpSolution, phase: str, parts: np.ndarray) -> PhaseMesh:
    """Every interval of a phase cut into its number of equal parts."""
    trajectory, first = solution.phases[phase], np.concatenate([[0], np.cumsum(parts)])
    t = trajectory.edges / trajectory.duration
    pieces = [t[k] + (t[k + 1] - t[k]) * np.arange(n) / n for k, n in enumerate(parts)]
    free = tuple(int(first[k]) for k in solution.transcription.mesh[phase].free)
    return PhaseMesh((*np.concatenate(pieces).tolist(), 1.0), free)


def _any(parts: Parts) -> bool:
    return any((p > 1).any() for p in parts.values())


def _all(parts: Parts) -> Parts:
    return {name: np.full_like(p, 2) for name, p in parts.items()}
