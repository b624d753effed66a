"""Refinement in few solves, for a first solution that is one of many alike (a design study's).

Its aims and tools are those of nlp/refine.py; it goes to them more directly. An interval is cut at once into as many
pieces as its error and its price ask for by their orders; limits are drawn in as soon as an interval is not cut any
more, and what was drawn in is carried to the next mesh; an interval that does not answer is cut right away. It may give
up sooner: then nlp/refine.py does the work.
"""

from collections.abc import Mapping

import numpy as np

from hopopt.nlp.backoff import PRICE, passed, price, prices, tightened
from hopopt.nlp.carry import carried
from hopopt.nlp.ipopt import NEAR, WARM, Bounds
from hopopt.nlp.mesh import PhaseMesh
from hopopt.nlp.refine import MOST, Parts, Refinement, cut, relative
from hopopt.nlp.transcribe import Transcription

AIM = 0.2  # share of the allowed local error that a cut aims at
PIECES = 4, 8  # into which an inaccurate interval, and one with a switch in it, is cut at most
FAR = 0.02  # excess that drawing in hardly ever takes away: the interval is cut once more
ANSWERS = 0.5  # share of the excess before the last drawing in, above which an interval does not answer
SOLVES = 16  # at most
Amounts = dict[str, np.ndarray]  # for each phase, how far lower and upper limits are drawn in, (2, N, limits)


class DirectRefinement(Refinement):
    """From a solution on a first mesh to an accurate one that keeps its limits, in few solves."""

    def run(self) -> None:
        """Refine until the aims are met, or the solves are used up, or one fails."""
        drawn = {name: np.zeros((2, *e.below.shape)) for name, e in self.errors.items()}
        before = {name: np.full(len(e.local), np.inf) for name, e in self.errors.items()}
        for _ in range(min(SOLVES, 2 * self.aims.meshes)):
            parts = self._pieces(before, drawn)
            if not any((p > 1).any() for p in parts.values()):
                if self.change <= self.aims.change and self._kept:
                    return
                if self._kept:
                    parts = {name: np.full_like(p, 2) for name, p in parts.items()}
            drawn, before = self._draw(drawn, parts)
            if not self._solve_within(drawn, parts):
                return

    @property
    def change(self) -> float:
        """Relative change of the objective from mesh to mesh; what the limits cost is less than a tenth of its aim."""
        sizes = [step.intervals for step in self.history]
        first = [k for k, size in enumerate(sizes) if k == 0 or size != sizes[k - 1]]
        if len(first) < 2:
            return float("inf")
        return relative(self.history[first[-1]].objective, self.history[first[-1] - 1].objective)

    @property
    def _kept(self) -> bool:
        """Whether all limits are."""
        return all(e.excess.max() <= self.aims.excess for e in self.errors.values())

    def _pieces(self, before: Mapping[str, np.ndarray], drawn: Amounts) -> Parts:
        """Into how many pieces each interval is to be cut."""
        cost, budget = prices(self.solution, self.errors), PRICE * abs(self.solution.objective)
        total = np.sort(np.concatenate(list(cost.values())))
        dear = total[np.searchsorted(np.cumsum(total), budget, side="right") :].min(initial=np.inf)
        share = 0.5 * budget / max(1, int((total >= dear).sum()))
        order, parts, coarse = len(self.solution.transcription.scheme.c) + 1, {}, len(self.history) == 1
        for name, e in self.errors.items():
            accurate = (e.local / (AIM * self.aims.local_error)) ** (1 / order)
            accurate = np.where(e.local > self.aims.local_error, np.clip(np.ceil(accurate), 2, PIECES[0]), 1)
            switch = np.where(cost[name] >= dear, np.clip(np.ceil(np.sqrt(cost[name] / share)), 2, PIECES[1]), 1)
            stubborn = (e.excess > self.aims.excess) & (e.excess > ANSWERS * before[name])
            far = (e.excess > FAR) & (drawn[name].max(axis=(0, 2)) == 0.0) & (len(self.history) == 2)
            parts[name] = np.maximum(accurate, switch).astype(int)
            if not coarse:
                parts[name] = np.where(stubborn | far, np.maximum(parts[name], MOST), parts[name])
        return parts

    def _draw(self, drawn: Amounts, parts: Parts) -> tuple[Amounts, dict[str, np.ndarray]]:
        """What is drawn in on the next mesh, and the excess it answers to: nothing yet where an interval is cut."""
        amounts, before = {}, {}
        for name, e in self.errors.items():
            whole = (parts[name] == 1) & (len(self.history) > 1)
            amount = np.where(whole[:, None], drawn[name] + passed(e, self.aims.excess), 0.0)
            amounts[name] = np.repeat(amount, parts[name], axis=1)
            before[name] = np.repeat(np.where(whole & (e.excess > self.aims.excess), e.excess, np.inf), parts[name])
        return amounts, before

    def _solve_within(self, drawn: Amounts, parts: Parts) -> bool:
        """Solve on the next mesh, which may be the same, within limits that are drawn in."""
        old, finer = self.solution, any((p > 1).any() for p in parts.values())
        t = old.transcription
        if finer:
            mesh: dict[str, PhaseMesh] = {name: cut(old, name, p) for name, p in parts.items()}
            t = Transcription(t.problem, t.scheme, mesh)
        guess, free = t.guess_from(old.phases), {q.name: old.parameters[q.name] for q in t.free}
        bounds = tightened(Bounds(*t.bounds(guess), t.lbg, t.ubg), t, drawn)
        if finer:
            solution = self._solver(t, WARM)(guess, free, carried(old, t), bounds)
        else:
            solution = self._solver(t, NEAR).again(old, bounds)
        if not solution.success:
            solution = self._cold(t, "adaptive")(guess, free, None, bounds)
        if not solution.success or self._lost(solution) or price(solution) > PRICE:
            return False
        self._accept(solution, int(any(a.any() for a in drawn.values())), 0.0, 0.0)
        return True

    @property
    def reached(self) -> bool:
        """Whether the aims are met."""
        accurate = all(e.local.max() <= self.aims.local_error for e in self.errors.values())
        return accurate and self._kept and self.change <= self.aims.change
