"""Solving the hop again after an entry has changed by 1 %: from the start, from the last answer, and warm.

    python benchmarks/warm.py [PROBLEM] [REPEATS]

The first mesh of the problem, built once (the entries are numbers of the program). "Start" is the first guess again;
"answer" the last solution as a guess with the same options; "warm" that solution with its multipliers and the options
WARM of hopopt.nlp.solver.ipopt. Times of the solve alone, the best of the repeats (5 unless told), and the share that "warm" is
of "start" and of building and solving, as peers.py counts a cold solve. All three must agree.
"""

import sys
import time
from collections.abc import Callable

import numpy as np

import hopopt as ho
from hopopt.nlp.solver.ipopt import WARM, NlpSolution, NlpSolver
from hopopt.ocp.guesses.initial_guess import NAMED_STARTS, make_guess
from hopopt.ocp.hop import Hop
from hopopt.planner.search.multistart import first_transcription

ENTRIES = ("leg.gear.ratio", "leg.motor.max_torque", "leg.motor.max_speed", "leg.body.mass", "leg.shank.length")
SAME = 1e-6  # [objective's unit]: answers closer than this are one


def best(repeats: int, solve: Callable[[], NlpSolution]) -> tuple[float, NlpSolution]:
    """The shortest time [s] of a solve, and what it gave."""
    runs = []
    for _ in range(repeats):
        began = time.perf_counter()
        solution = solve()
        runs.append((time.perf_counter() - began, solution))
    return min(took for took, _ in runs), runs[-1][1]


def build(problem: str) -> tuple[Hop, NlpSolver]:
    """From the problem to a program with derivatives and a solver."""
    hop = Hop(ho.load(problem))
    return hop, NlpSolver(first_transcription(hop), {"ipopt.max_iter": 600})


def compared(hop: Hop, plain: NlpSolver, warm: NlpSolver, built: float, repeats: int, entry: str) -> str:
    """One entry's line of the table; ``built``: what building takes [s]."""
    guess = make_guess(hop, NAMED_STARTS[0])
    last = plain(guess)
    value = next(p.value for p in hop.problem.parameters if p.name == entry)
    changed, again = {entry: 1.01 * np.asarray(value)}, plain.transcription.guess_from(last.phases)
    known = changed | plain.transcription.free_from(last.parameters)
    from_start = best(repeats, lambda: plain(guess, changed))
    from_answer = best(repeats, lambda: plain(again, known))
    kept = best(repeats, lambda: warm(again, known, (last.lam_g, last.lam_x)))
    found = [s for _, s in (from_start, from_answer, kept)]
    cells = [f"{1e3 * t:.0f} ms ({s.iterations})" for t, s in (from_start, from_answer, kept)]
    objective = found[0].objective
    agree = all(s.success and abs(s.objective - objective) < SAME for s in found)
    said = "yes" if agree else ", ".join(f"{s.objective:.6f}" if s.success else s.status for s in found)
    shares = (f"{kept[0] / cold:.0%}" for cold in (from_start[0], built + from_start[0]))
    return f"| {entry} | {' | '.join(cells)} | {' | '.join(shares)} | {objective - last.objective:+.5f} | {said} |"


def main() -> None:
    """Measure and print."""
    problem, repeats = (sys.argv[1:] + ["paper", "5"][len(sys.argv) - 1 :])[:2]
    times, (hop, plain) = list[float](), build(problem)  # the first warms what is cached
    for _ in range(int(repeats)):
        began = time.perf_counter()
        hop, plain = build(problem)
        times.append(time.perf_counter() - began)
    built, warm = min(times), NlpSolver(plain.transcription, {"ipopt.max_iter": 600, **WARM})
    print(f"problem, program, derivatives and solver built: {1e3 * built:.0f} ms\n")
    print(
        "| 1 % more of | from the start (iterations) | from the answer | warm | of start | of build and start | objective | agree |"
    )
    print("|---" * 8 + "|")
    for entry in ENTRIES:
        print(compared(hop, plain, warm, built, int(repeats), entry), flush=True)


if __name__ == "__main__":
    main()
