"""The next mesh's program solved: from the last mesh's point and multipliers, gently, in another way, or from the point alone.

What a way costs where it fails is bounded. Which way succeeded last is remembered, and how many iterations from points alone are
left.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import inf
from typing import Any

from hopopt.nlp.refinement.continuous_limits import Enforced
from hopopt.nlp.refinement.mesh_step import relative
from hopopt.nlp.refinement.next_mesh import Aims
from hopopt.nlp.refinement.sharp.gentler import led_gently
from hopopt.nlp.refinement.sharp.zeros import keeping_signs, without_signs
from hopopt.nlp.solver.ipopt import NEAR_OPTIONS, RESTARTED, WAYS, Bounds, Multipliers, NlpSolution, NlpSolver, enough
from hopopt.nlp.transcription import Transcription

MOST_LOST = 0.02  # relative: a finer mesh's objective may be worse by this much, and by more if two solves agree on it
AGREED = 1e-4  # relative
CARRIED_ITERATIONS = 60  # from carried multipliers
SHARP = 3  # times as many where states have sharp zeros
FIRST_ITERATIONS = 80  # there, before a gentler program is tried
STEPS = 5  # in a row that are good, which end a solve there
LONGER = 5  # times as many before starting without
RESTARTS = ("adaptive", "monotone")  # barriers that are tried then


@dataclass
class Solving:
    """Solves one mesh's program after another, each from the solution on the mesh before.

    aims: of the refinement
    sharp: whether states have sharp zeros
    restarts_left: iterations from points alone that failed solves may still cost
    ways: Ipopt's options from carried multipliers, those that succeeded last first
    """

    aims: Aims
    sharp: bool
    restarts_left: int
    ways: tuple[Mapping[str, Any], ...] = WAYS

    def solver(
        self, t: Transcription, options: Mapping[str, Any], spare: bool, steps: int = STEPS, most: float = inf
    ) -> NlpSolver:
        """Ipopt from what is known; not for long if there is something else to try, which is ``spare``, and never for more than
        ``most`` iterations. ``steps``: so many that are good in a row end it where states have sharp zeros."""
        longer = self.aims.restarts and not spare  # from the point alone it takes hundreds
        times = LONGER if longer else SHARP if self.sharp else 1
        limited = {"ipopt.max_iter": min(CARRIED_ITERATIONS * times, self.aims.iterations, most)}
        asked = t.problem.solver_options
        ended = {k: v for k, v in enough(t.problem.objective.scale, steps).items() if self.sharp and k not in asked}
        return NlpSolver(t, {**options, **limited, **ended}, until=self.aims.until)

    def warm(self, t: Transcription, is_cut: bool, spare: bool) -> NlpSolver:
        """The first to be tried: of a finer mesh, or of the same intervals within other limits."""
        most = FIRST_ITERATIONS if self.sharp and t.problem.gentler is not None else inf
        return self.solver(t, self.ways[0] if is_cut else NEAR_OPTIONS, spare, most=most)

    def solutions(
        self, last: NlpSolution, program: Enforced, warm: NlpSolver, guess: Any, free: Mapping[str, Any],
        multipliers: Multipliers, bounds: Bounds, spare: bool, is_cut: bool,
    ) -> list[NlpSolution]:  # fmt: skip
        """What was solved from the last mesh's point and multipliers, where that fails gently or in another way.

        Then, until a solution is no worse than that mesh's, from the point alone; not if something is ``spare``, to be tried next.
        ``is_cut``: whether its intervals are not the last mesh's.
        """

        def solver(t: Transcription, options: Mapping[str, Any], steps: int = STEPS) -> NlpSolver:
            return self.solver(t, options, spare, steps)

        def from_last(ipopt: NlpSolver) -> NlpSolution:
            """With sharp states on their side of zero and, if that holds it, once more without; no success if that fails."""
            if not self.sharp:
                return ipopt(guess, free, multipliers, bounds)
            signed = keeping_signs(program.given, guess, bounds, None if is_cut else last.transcription.mesh)
            s, held = without_signs(ipopt(guess, free, multipliers, signed), bounds)
            if not (s.success and held):
                return s
            again = solver(s.transcription, NEAR_OPTIONS).again(s, bounds)
            return replace(again, iterations=s.iterations + again.iterations)

        def known() -> NlpSolution:
            return from_last(warm)

        def gently() -> NlpSolution | None:
            return led_gently(program, solver, guess, free, multipliers, bounds)

        def otherwise() -> NlpSolution | None:
            if not self.sharp:
                return None
            found = from_last(solver(warm.transcription, self.ways[1]))
            self.ways = self.ways[::-1] if found.success else self.ways
            return found

        until, tried = self.aims.until, list[NlpSolution]()
        for way in (known, gently, otherwise):
            if until.passed and tried:
                break
            if (found := way()) is not None:
                tried = [found]
                if found.success:
                    break
        if not tried[0].success and spare:
            return []
        for strategy in RESTARTS:
            most = self.aims.iterations
            if not tried[0].success:
                most = min(most, self.restarts_left)
            if most == 0 or until.passed or (tried[-1].success and not worse(tried[-1], last)):
                break
            options = RESTARTED | {"ipopt.max_iter": most, "ipopt.mu_strategy": strategy}
            tried.append(NlpSolver(warm.transcription, options, until=until)(guess, free, None, bounds))
            self.restarts_left = max(0, self.restarts_left - tried[-1].iterations)
        return [s for s in tried if s.success]


def believable(solved: Sequence[NlpSolution], last: NlpSolution, at_nodes: bool, accurate: bool) -> NlpSolution | None:
    """The last of them, if it is no worse than the last mesh's solution; else what two agree on, if that mesh was not ``accurate``
    and may have claimed too much. Limits that hold ``at_nodes`` alone always allow a coarse mesh that."""
    if solved and (at_nodes or not worse(solved[-1], last)):
        return solved[-1]
    if accurate:
        return None
    pairs = combinations(solved, 2)
    return next((b for a, b in pairs if relative(a.objective, b.objective, a.least) <= AGREED), None)


def worse(solution: NlpSolution, last: NlpSolution) -> bool:
    """Whether it may be another, worse optimum than the last mesh's."""
    loss = solution.transcription.problem.objective.cost(solution.objective - last.objective)
    return loss > MOST_LOST * last.magnitude
