"""A start for hops over an obstacle: the box below the middle of the trunk at the apex, then wherever it may stand below it.

From a box that may stand anywhere below a trunk the solver often ends where the trunk comes to rest above it, and lifts it no more.
"""

import time

import numpy as np

from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.ocp.guesses.initial_guess import make_guess, starts_of
from hopopt.ocp.hop import Hop
from hopopt.ocp.hops.obstacle import BELOW_APEX
from hopopt.planner.search.multistart import StartOutcome, first_solver, first_transcription, outcome_of
from hopopt.planner.search.neighbours.relaxations import asked_from, own_bounds

NAME = "the obstacle below the trunk's middle"
BEGUN_FROM = 2  # starts, at most, from which it is solved


def below_the_middle(hop: Hop, starts: int, until: Deadline = NEVER) -> list[StartOutcome]:
    """What hops over an obstacle below the middle of the trunk, from so many starts or BEGUN_FROM, lead to once that may stand
    elsewhere; nothing where the problem leaves it no choice."""
    t = first_transcription(hop)
    rows = next((r for r in t.rows if r.name == BELOW_APEX), None)
    if rows is None or np.array_equal(t.lbg[rows.start : rows.stop], t.ubg[rows.start : rows.stop]):
        return []
    narrow, outcomes = own_bounds(t), list[StartOutcome]()
    here = slice(rows.start, rows.stop)
    narrow.low_g[here] = narrow.high_g[here] = (narrow.low_g[here] + narrow.high_g[here]) / 2
    solver, asked = first_solver(hop, True, until=until), asked_from(hop, None, until)
    for start in starts_of(hop, min(starts, BEGUN_FROM)):
        if until.passed:
            break
        began, found = time.perf_counter(), solver(make_guess(hop, start), bounds=narrow)
        if found.success:
            name = f"{NAME}, {start.name}" if outcomes else NAME
            outcomes.append(outcome_of(name, asked.again(found, own_bounds(t)), time.perf_counter() - began))
    return outcomes
