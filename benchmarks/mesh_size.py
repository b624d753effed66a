"""What the hop costs to build and to solve on meshes from 10 to 640 intervals.

    python benchmarks/mesh_size.py [PROBLEM] [REPEATS]

Four intervals of stance for one of flight, the problem's own scheme, one start ("upright push"), no refinement; times
are the best of the repeats (3 unless told). An objective that differs from that of the row below is not converged yet.
"""

import sys
import time
from dataclasses import dataclass

import hopopt as ho
from hopopt.nlp.mesh import uniform
from hopopt.nlp.schemes import scheme
from hopopt.nlp.solver.ipopt import NlpSolution, NlpSolver
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.guesses.initial_guess import NAMED_STARTS, make_guess
from hopopt.ocp.hop import Hop
from hopopt.ocp.phases import FLIGHT, STANCE

SIZES = (10, 20, 40, 80, 160, 320, 640)


@dataclass(frozen=True)
class Cost:
    """Seconds of building and of solving, and the solution."""

    build: float
    solve: float
    solution: NlpSolution


def measured(hop: Hop, intervals: int) -> Cost:
    """The hop on a uniform mesh of so many intervals in all."""
    s, flight = hop.design.solver, intervals // 5
    mesh = {STANCE: uniform(intervals - flight), FLIGHT: uniform(flight)}
    guess, problem, began = make_guess(hop, NAMED_STARTS[0]), hop.problem, time.perf_counter()
    solver = NlpSolver(Transcription(problem, scheme(s.scheme, s.degree), mesh), {"ipopt.max_iter": s.max_iterations})
    built = time.perf_counter()
    solution = solver(guess)
    return Cost(built - began, time.perf_counter() - built, solution)


def row(intervals: int, costs: list[Cost]) -> str:
    """A line of the table."""
    s = costs[0].solution
    build, solve = (min(getattr(c, what) for c in costs) for what in ("build", "solve"))
    each = 1e3 * solve / max(s.iterations, 1)
    outcome = f"{s.objective:.6f}" if s.success else s.status
    return f"| {intervals} | {len(s.z)} | {build:.3f} | {solve:.3f} | {s.iterations} | {each:.1f} | {outcome} |"


def main() -> None:
    """Measure and print."""
    problem, repeats = (sys.argv[1:] + ["paper", "3"][len(sys.argv) - 1 :])[:2]
    hop = Hop(ho.load(problem))
    print("| intervals | variables | build s | solve s | iterations | ms each | objective |\n" + "|---" * 7 + "|")
    for intervals in SIZES:
        print(row(intervals, [measured(hop, intervals) for _ in range(int(repeats))]), flush=True)


if __name__ == "__main__":
    main()
