"""Refinement for programs with kinks of their own: accurate states first, then limits tightened on the settled mesh.

Where a control or a least number only bounds something from above, hulls (nlp/refinement/continuous_limits.py) make its kinks dearer; schemes
that collocate both ends of an interval, whose controls oscillate, hardly converge within them.
"""

import time
from collections.abc import Mapping

import numpy as np

from hopopt.nlp.mesh import PhaseMesh
from hopopt.nlp.refinement.continuous_limits import Chosen, holds
from hopopt.nlp.refinement.mesh_refinement import (
    MET,
    NO_NEARER,
    OUT_OF_TIME,
    TOO_FINE,
    UNSOLVED,
    Aims,
    MeshStep,
    Refinement,
    Report,
    moves_to,
)
from hopopt.nlp.refinement.mesh_step import Parts, cut, equal
from hopopt.nlp.refinement.tightening import tightened_by_excess
from hopopt.nlp.refinement.tightening_cost import excess_costs, tightening_cost
from hopopt.nlp.solver.ipopt import CARRIED, NEAR, NlpSolution
from hopopt.nlp.solver.warm_start import carried
from hopopt.nlp.transcription import Transcription

MOST = 4  # pieces into which an interval is cut at once
EARLY = 4  # meshes before an error that wanders is suspected
ROUNDS = 10  # of tightening the limits on one mesh
STALLED = 0.8  # share of the excess two rounds ago, above which another round will not help


def refinement_of(
    solution: NlpSolution, aims: Aims, report: Report = lambda step: None, held: Chosen | None = None
) -> Refinement:
    """The refinement that suits a program; ``held``: limits that ``solution`` holds between the nodes already."""
    return (Refinement if holds(solution.transcription) else TighteningRefinement)(solution, aims, report, held)


class TighteningRefinement(Refinement):
    """From a solution on a first mesh to an accurate one whose limits are tightened on the last: ``solution`` and
    ``history``."""

    def run(self) -> None:
        """Refine until the aims are met, or no mesh is left, or one cannot be solved or would be too fine."""
        for _ in range(self.aims.meshes):
            if self._stuck:
                self.ended = NO_NEARER
                return
            parts = self._faults()
            if not _any(parts):
                parts = self._draw_in() if self.change <= self.aims.change else _all(parts)
            if not _any(parts):
                self.ended = MET
                return
            if (fewer := self._fitting(parts)) is None:
                self.ended = TOO_FINE
                return
            if not self._solve_on({n: cut(self.solution, n, equal(p)) for n, p in fewer.items()}):
                return

    def _far(self, step: MeshStep) -> float:
        """By its local error alone: limits are tightened afterwards."""
        return step.local_error / self.aims.local_error

    def _faults(self) -> Parts:
        """What is to be cut: inaccurate intervals, and the dearest until the rest is within the budget."""
        costs, budget = excess_costs(self.solution, self.errors), self.aims.tightening_cost * self.solution.magnitude
        total = np.sort(np.concatenate(list(costs.values())))
        dear = total[np.searchsorted(np.cumsum(total), budget, side="right") :].min(initial=np.inf)
        return {
            name: np.maximum(self._inaccurate(name), np.where(costs[name] >= dear, MOST, 1)) for name in self.errors
        }

    def _inaccurate(self, name: str) -> np.ndarray:
        """Pieces for each interval by its local error; late in the refinement what the error may move to is halved."""
        over = self.errors[name].local > self.aims.local_error
        moves = moves_to(over, self.solution.phases[name].lengths) & (len(self.history) > EARLY)
        return np.where(over, MOST, np.where(moves, 2, 1))

    def _draw_in(self) -> Parts:
        """Draw in the limits until they hold; what is to be cut if that fails."""
        began, solver = time.perf_counter(), self._solver(self.solution.transcription, NEAR)
        for k in range(ROUNDS):
            last = [step.excess for step in self.history[-3:]]
            if last[-1] <= self.aims.excess or (k > 2 and last[-1] > STALLED * last[0]) or self.aims.until.passed:
                break
            built = time.perf_counter()
            solution = solver.again(self.solution, tightened_by_excess(self.solution, self.errors, self.aims.excess))
            if not solution.success or tightening_cost(solution) > self.aims.tightening_cost:
                break
            self._accept(solution, built - began, time.perf_counter() - built, k + 1)
            began = time.perf_counter()
        return {
            name: np.where((e.excess > self.aims.excess) | (e.local > self.aims.local_error), MOST, 1)
            for name, e in self.errors.items()
        }

    def _solve_on(self, mesh: Mapping[str, PhaseMesh]) -> bool:
        """Solve on another mesh from the last solution, with its multipliers and, if that fails, without."""
        if self.aims.until.passed:
            self.ended = OUT_OF_TIME
            return False
        began, old = time.perf_counter(), self.solution
        t = Transcription(old.transcription.problem, old.transcription.scheme, mesh)
        guess, free = t.guess_from(old.phases), t.free_from(old.parameters)
        solver = self._solver(t, CARRIED)
        built = time.perf_counter()
        solved = self._attempts(solver, guess, free, carried(old, t))
        if not solved:
            self.ended = OUT_OF_TIME if self.aims.until.passed else UNSOLVED
            return False
        self._accept(solved[-1], built - began, time.perf_counter() - built)
        return True


def _any(parts: Parts) -> bool:
    return any((p > 1).any() for p in parts.values())


def _all(parts: Parts) -> Parts:
    return {name: np.full_like(p, 2) for name, p in parts.items()}
