"""The search on the first mesh: starts of several kinds, each different from the others, and what they led to.

Named and drawn starts come first, then relaxed problems that are tightened again and, of hops that land, restricted ones
that are released. Then come motions that a global method finds on a grid of states. A start that runs into a hop known
already is stopped.
"""

import os
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from hopopt.errors import one_line
from hopopt.global_search import GlobalSearch, Rollout, applies, search
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.solver.ipopt import NlpSolution, NlpSolver
from hopopt.ocp.guesses.feasibility import drives_too_weak
from hopopt.ocp.guesses.initial_guess import posture_guess, stance_guess
from hopopt.ocp.guesses.posture import Posture
from hopopt.ocp.hop import Hop
from hopopt.ocp.phases import FLIGHT
from hopopt.planner.search.beside import Beside, Task
from hopopt.planner.search.multistart import (
    Progress,
    StartOutcome,
    distinct,
    first_solver,
    first_transcription,
    known_optima,
    noted,
    outcome_of,
    remember,
    run_starts,
    solution_of,
)
from hopopt.planner.search.neighbours.relaxations import (
    BEGUN_FROM,
    QUICK,
    asked_from,
    own_bounds,
    relaxed_starts,
    suiting,
)
from hopopt.planner.search.neighbours.restrictions import restricted_starts, restricting
from hopopt.planner.stopwatch import Countdown

SEARCH = 2  # starting points from which on relaxed problems and the global method are tried too
GRID_NODES = 15  # nodes along each axis of the global method's grid in a plain solve
FINER_GRID_NODES = 21  # where the first grid has not found the answer, or promises more
ROLLOUTS = 6  # of its motions, that are solved from
GLOBAL = "global method"  # begins the names of its motions
GRID_OBJECTIVES = ("clearance", "apex")  # objectives that its motions suit
POSTURE_LOSS = 1e-3  # share of the reach by which a posture may be lower than the best one


@dataclass(frozen=True)
class FirstMesh:
    """What a search on the first mesh led to.

    outcomes: how each start ended; overall: what the global method found, or None; reason: why it was not used.
    """

    outcomes: tuple[StartOutcome, ...]
    overall: GlobalSearch | None = None
    reason: str | None = None


def search_first_mesh(
    hop: Hop, count: int, processes: int | None, say: Progress, besides: Sequence[StartOutcome] = (),
    until: Deadline = NEVER,
) -> FirstMesh:  # fmt: skip
    """So many starts, and those ``besides``, as many as there is time for.

    If SEARCH or more are asked for, also relaxed and restricted problems, and motions of the global method, which is at work beside the starts.
    """
    side_by_side, weak = processes or os.cpu_count() or 1, bool(drives_too_weak(hop.design, hop.robot))
    reason = "one start was asked for" if count < SEARCH else _not_used(hop)
    reason = "the drives cannot hold the leg where it starts" if weak else reason
    neighbours = list[Task[list[StartOutcome]]]()
    with Beside(hop, side_by_side - 1 if count >= SEARCH else 0) as beside, ThreadPoolExecutor(1) as pool:
        # its loops leave Python's time free
        overall = None if reason else pool.submit(_searched, hop, GRID_NODES, 1, until)

        def relax(first: StartOutcome) -> None:
            known = [first, *besides]
            neighbours.extend(beside.task(relaxed_starts, r, known, BEGUN_FROM, until) for r in suiting(hop, QUICK))
            neighbours.extend(beside.task(restricted_starts, r, known, until) for r in restricting(hop))

        then = relax if count >= SEARCH and not weak else lambda first: None
        outcomes = run_starts(hop, count, beside, say, besides, until, then)
        if weak and count >= SEARCH and any(o.success for o in outcomes):  # else they seldom help a weak leg
            relax(outcomes[0])
        found, reason = (None, reason) if overall is None else overall.result()
        moved = list[StartOutcome]()
        if found is not None:
            say(f"solving from {len(found.rollouts)} motions of the global method")
            moved = rollout_starts(hop, found.rollouts, outcomes, say=say, until=until)
        count_down = Countdown(say, "problems with other limits, each led to what is asked", len(neighbours))
        for task in reversed(neighbours):
            task.done_here()
        for task in neighbours:
            outcomes += task.result()
            count_down.more()
    outcomes += moved
    if count >= SEARCH:
        outcomes += posture_starts(hop, outcomes, until)
    return FirstMesh(tuple(outcomes), found, reason)


def _not_used(hop: Hop) -> str | None:
    """Why the global method is of no use here, or None."""
    if hop.design.hop.lands:
        return "it knows a hop from rest to the apex alone"
    if hop.objective.name not in GRID_OBJECTIVES or hop.constraints or hop.design.hop.constraints:
        return "it knows heights alone, without user-defined constraints"
    return applies(hop.design)


def posture_starts(hop: Hop, known: Sequence[StartOutcome], until: Deadline = NEVER) -> list[StartOutcome]:
    """Hops that are known, and end in a posture that is not the one which clears most, solved again with a flight to that
    one: where the leg has two ways to fold, the nearer of them is a local optimum."""
    if hop.objective.name != "clearance" or hop.loops or hop.drive_states.size:
        return []
    posture, outcomes, t = Posture(hop), list[StartOutcome](), first_transcription(hop)
    best, lands = posture.best(), hop.design.hop.lands
    solver = asked_from(hop, None, until) if lands else first_solver(hop, True, until=until)
    for known_hop in distinct(known):
        phases = solution_of(known_hop, t).phases
        ends = phases[FLIGHT].x_end[2 * len(hop.falling) :][: hop.n]
        if until.passed or np.ptp(posture.height(np.array([ends, best]))) < POSTURE_LOSS * hop.reach:
            continue
        began = time.perf_counter()
        s = folded_at_apex(solver, known_hop, best) if lands else solver(posture_guess(hop, phases, best))
        outcomes.append(outcome_of(f"{known_hop.name}, folded otherwise", s, time.perf_counter() - began))
    return outcomes


def folded_at_apex(asked: NlpSolver, known: StartOutcome, pose: np.ndarray) -> NlpSolution:
    """What a hop that lands leads to with its joints led to a pose (n,) [rad] at the apex, and then released: a guess of
    the flight alone falls back to the hop that is known, whose descent and landing it has not."""
    t = asked.transcription
    held = own_bounds(t)
    for side in (held.low_z, held.high_z):
        nodes, scale = t.nodes_of(FLIGHT, "q", side)
        nodes[-1] = pose / scale
    led = asked.from_vector(known.vectors["z"], bounds=(held.low_z, held.high_z))
    return asked.again(led, own_bounds(t)) if led.success else led


def looked_closer(hop: Hop, searched: FirstMesh, say: Progress, until: Deadline) -> FirstMesh:
    """The same search with a finer grid of the global method, and what its motions lead to."""
    say(f"the global method does not agree with what was found: looking on a grid of {FINER_GRID_NODES} nodes an axis")
    found, _ = _searched(hop, FINER_GRID_NODES, 2, until)
    if found is None:
        return searched
    more = rollout_starts(hop, found.rollouts, searched.outcomes, f"{GLOBAL}, finer grid", say, until)
    return FirstMesh((*searched.outcomes, *more), found)


def _searched(hop: Hop, size: int, threads: int, until: Deadline) -> tuple[GlobalSearch | None, str | None]:
    """What the global method finds on a grid of so many nodes an axis, or why it finds nothing."""
    try:
        return search(hop.design, size=size, rollouts=ROLLOUTS, threads=threads, until=until), None
    except TimeoutError:
        return None, "there was no time for it"
    except (ArithmeticError, ValueError, IndexError) as error:  # no reason to lose what the starts found
        return None, f"it stopped with a {type(error).__name__} ({one_line(error)})"


def rollout_starts(
    hop: Hop,
    rollouts: Sequence[Rollout],
    known: Sequence[StartOutcome] = (),
    name: str = GLOBAL,
    say: Progress = lambda text: None,
    until: Deadline = NEVER,
) -> list[StartOutcome]:
    """What the motions of the global method lead to on the first mesh, as many as there is time for; none is followed to a
    hop that is known."""
    watch, outcomes = known_optima(hop, known), list[StartOutcome]()
    solver = first_solver(hop, any(o.success for o in known), watch, until)
    count_down = Countdown(say, f"motions of the {name}", len(rollouts))
    for k, r in enumerate(rollouts):
        if until.passed:
            break
        began = time.perf_counter()
        s = solver(stance_guess(hop, r.t, r.q, r.v, r.a))
        outcomes.append(noted(solver, outcome_of(f"{name} {k + 1}", s, time.perf_counter() - began)))
        remember(watch, outcomes[-1])
        count_down.more()
    return outcomes
