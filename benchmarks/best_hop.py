"""Whether `solve` finds the best hop: legs that nobody tuned anything for, searched in three slower ways.

    python benchmarks/best_hop.py [LEGS] [SEED] [FIRST]

Draws feasible legs (100 unless told) as random_legs.py does, two of three on ground with friction. Each is solved as
`hopopt solve` does. Then it is searched in three other ways: from 60 starts; over friction, by following the hops of
neighbouring values to this one; and by dynamic programming on 41 nodes an axis, whose motions are solved from. What
these find on the first mesh is refined and verified as `solve` does it. Prints a line for each leg, with what beats `solve`
by more than 0.1 %, and the share of legs that nothing beats. A leg counts as beaten by a verified hop alone.
"""

import sys
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import random_legs

import hopopt as ho
from hopopt.design import Design
from hopopt.errors import HopoptError, NotSolvedError, one_line
from hopopt.evidence.family_optima import Continuation, followed, searched
from hopopt.global_search import applies, search
from hopopt.ocp.hop import Hop
from hopopt.planner.refine_and_verify import refined_and_verified
from hopopt.planner.search.first_mesh import rollout_starts
from hopopt.planner.search.multistart import StartOutcome, first_solver, run_chunk
from hopopt.planner.stopwatch import Stopwatch

STARTS, NODES = 60, 41
AROUND = (0.7, 0.85, 1.2, 1.5)  # times the leg's friction
BEATEN = 1e-3  # relative
CLOSE = 5e-3  # relative: so much lower on the first mesh, a hop may still be the better one


def legs(count: int, seed: int) -> list[dict[str, Any]]:
    """Feasible legs, two of three with a friction between 0.4 and 1."""
    rng = np.random.default_rng([seed, 1])
    found = random_legs.feasible_legs(count, seed)
    for k, entries in enumerate(found):
        entries.pop("contact.friction", None)
        if k % 3:
            entries["contact.friction"] = round(rng.uniform(0.4, 1.0), 3)
    return found


def from_many_starts(hop: Hop) -> list[StartOutcome]:
    """Named and drawn starts, each followed to its end."""
    return run_chunk(hop, range(STARTS), first_solver(hop, True), True)


def from_friction(hop: Hop, entries: dict[str, Any]) -> list[StartOutcome]:
    """The hops of neighbouring frictions, followed to this one."""
    mu, ended = float(entries.get("contact.friction", 0.0)), list[StartOutcome]()
    for factor in AROUND if mu else ():
        beside = random_legs.loaded(entries | {"contact.friction": factor * mu})
        half = random_legs.loaded(entries | {"contact.friction": (1 + factor) / 2 * mu})
        sources = [Continuation(beside, found, (half,)) for found in searched(beside, 6)[:6]]
        ended += [end.outcome for end in followed(hop.design, sources, f"{factor:g} times the friction") if end]
    return ended


def from_grid(hop: Hop) -> list[StartOutcome]:
    """The motions of dynamic programming on a fine grid."""
    return [] if applies(hop.design) else rollout_starts(hop, search(hop.design, NODES, threads=1).rollouts)


def challengers(design: Design, entries: dict[str, Any], clearance: float) -> Iterator[tuple[str, float, bool]]:
    """Of each way: its name, the clearance [m] of the best hop that may be better, refined, and whether it is verified."""
    hop = Hop(design)
    ways = {
        "60 starts": lambda: from_many_starts(hop), "friction": lambda: from_friction(hop, entries),
        "grid": lambda: from_grid(hop),
    }  # fmt: skip
    for way, search_it in ways.items():
        ended = [o for o in search_it() if o.success]
        ended = [o for o in ended if o.objective > (1 - CLOSE) * clearance]
        for best in sorted(ended, key=lambda o: -o.objective)[:1]:
            s = refined_and_verified(hop, best, [best], lambda text: None, Stopwatch())
            yield way, s.clearance, s.verified


def main() -> int:
    """Solve, search, print; 1 if more than three of a hundred are beaten."""
    count, seed, first = (int(x) for x in (sys.argv[1:] + ["100", "0", "0"][len(sys.argv) - 1 :])[:3])
    beaten, compared = 0, 0
    for k, entries in list(enumerate(legs(count, seed)))[first:]:
        began, design = time.perf_counter(), random_legs.loaded(entries)
        head = f"{k:3d} friction {entries.get('contact.friction', 'none')}: "
        try:
            s = ho.solve(design, processes=1)
        except NotSolvedError as error:
            print(f"{head}not solved, {one_line(error)[:120]}", flush=True)
            continue
        compared += 1
        solved = time.perf_counter() - began
        try:
            others = list(challengers(design, entries, s.clearance))
        except (HopoptError, ArithmeticError) as error:
            print(f"{head}{s.clearance:.5f} m; the search stopped: {one_line(error)[:120]}", flush=True)
            continue
        better = [o for o in others if o[2] and o[1] > (1 + BEATEN) * s.clearance]
        beaten += bool(better)
        told = ", ".join(
            f"{way} {height / s.clearance - 1:+.2%}{'' if sure else ' (not verified)'}" for way, height, sure in others
        )
        word = "verified" if s.verified else "not verified"
        alarm = ", alarm" if s.summary.global_ and s.summary.global_.alarm else ""
        print(
            f"{head}{s.clearance:.5f} m {word}{alarm}; {told or 'nothing as good'}{'; BEATEN' if better else ''}"
            f" ({solved:.0f} s and {time.perf_counter() - began - solved:.0f} s)",
            flush=True,
        )
        if better:
            print(f"    {entries}", flush=True)
    print(f"\n{beaten} of {compared} beaten by more than {BEATEN:.1%} (seed {seed})")
    return int(beaten > 0.03 * compared)


if __name__ == "__main__":
    sys.exit(main())
