"""A longer search for the best hop than a solve makes: more relaxed problems, finer grids of the global method and, where
no grid reaches, basin hopping over where starts lean and dip (Wales and Doye 1997, by scipy)."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.optimize import OptimizeResult, basinhopping

from hopopt.global_search import search
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.ocp.guesses.initial_guess import StartGuess
from hopopt.ocp.hop import Hop
from hopopt.planner.search.first_mesh import rollout_starts
from hopopt.planner.search.multistart import StartOutcome, first_solver, known_optima, run_start
from hopopt.planner.search.neighbours.relaxations import THOROUGH, relaxed_starts, suiting

Say = Callable[[str], None]
BEGUN_FROM = (0, 3)  # starts that relaxed problems begin from: an upright push, and a swing
LOW, HIGH = np.array([-0.5, -0.3, 0.0, 0.2]), np.array([0.6, 0.4, 0.4, 1.0])  # sway, lean, dip, duration of a start
LARGEST_MOVE = 0.3  # of that range, by which basin hopping moves at most
LONGEST_GRID = 3600.0  # s of one grid
TEMPERATURE = 0.01  # relative: by so much a worse hop is accepted now and then
NO_HOP = 0.0  # signed value of a start that leads to no hop


def relaxed(hop: Hop, known: Sequence[StartOutcome], say: Say, until: Deadline = NEVER) -> list[StartOutcome]:
    """All relaxed problems that there is time for, each from two starts, tightened to what is asked."""
    say(f"solving {len(THOROUGH)} relaxed problems from {len(BEGUN_FROM)} starts each, and tightening them")
    outcomes = list[StartOutcome]()
    for relaxation in suiting(hop, THOROUGH):
        outcomes += relaxed_starts(hop, relaxation, [*known, *outcomes], BEGUN_FROM, until)
    return outcomes


def on_grids(
    hop: Hop, sizes: Sequence[int], known: Sequence[StartOutcome], say: Say
) -> tuple[list[dict[str, Any]], list[StartOutcome]]:
    """The global method on growing grids: for each the value, the best motion's clearance [m], the hop on the first mesh
    that its motions lead to [m] and the time [s]; and all that they led to. A grid that takes too long is the last."""
    rows, outcomes = list[dict[str, Any]](), list[StartOutcome]()
    for size in sizes:
        say(f"dynamic programming on {size} nodes along each of the states' axes")
        until = NEVER.within(LONGEST_GRID)
        try:
            found = search(hop.design, size=size, progress=say, until=until)
        except TimeoutError:
            say(f"{size} nodes: no end after {LONGEST_GRID:g} s")
            break
        ended = rollout_starts(hop, found.rollouts, [*known, *outcomes], until=until)
        solved = [o for o in ended if o.success]
        outcomes += ended
        rows.append({
            "size": size, "grid": list(found.grid), "steps": found.steps, "value_m": found.value,
            "rollout_m": max((r.clearance for r in found.rollouts), default=None),
            "solved_m": max((o.objective for o in solved), default=None), "seconds": found.seconds,
            "method": found.method,
        })  # fmt: skip
    return rows, outcomes


def hopped(
    hop: Hop, count: int, known: Sequence[StartOutcome], say: Say, until: Deadline = NEVER
) -> list[StartOutcome]:
    """What so many steps of basin hopping over the starts lead to, or as many as there is time for; drawn by the problem's
    seed."""
    solver, outcomes = first_solver(hop, True, known_optima(hop, known), until), list[StartOutcome]()
    best = max((o.signed_value for o in known if o.success), default=1.0)

    def height(x: np.ndarray) -> float:
        start = StartGuess(f"basin hopping {len(outcomes) + 1}", *map(float, x))
        say(f"basin hopping, {len(outcomes) + 1} of {count + 1}")
        outcomes.append(run_start(hop, solver, start, True))
        return -outcomes[-1].signed_value if outcomes[-1].success else -NO_HOP

    rng = np.random.default_rng(hop.design.solver.seed)

    def step(x: np.ndarray) -> np.ndarray:
        return np.clip(x + LARGEST_MOVE * rng.uniform(-1, 1, len(x)) * (HIGH - LOW), LOW, HIGH)

    def as_it_is(fun: Callable[[np.ndarray], float], x0: np.ndarray, args: tuple[Any, ...], **_: Any) -> OptimizeResult:
        return OptimizeResult(x=x0, fun=fun(x0), success=True, nfev=1)  # Ipopt has made the descent already

    basinhopping(
        height, rng.uniform(LOW, HIGH), niter=count, T=TEMPERATURE * abs(best), take_step=step,
        minimizer_kwargs={"method": as_it_is}, rng=rng, callback=lambda *_: until.passed,
    )  # fmt: skip
    return outcomes
