"""Back-off: a limit that is passed between the nodes of an interval is tightened at those nodes by the excess.

That serves bounds of states and controls, and what little passes the hull of a path limit (nlp/refinement/continuous_limits.py).
"""

from collections.abc import Iterator, Mapping

import numpy as np

from hopopt.nlp.refinement.interval_errors import IntervalErrors
from hopopt.nlp.solver.ipopt import Bounds, NlpSolution
from hopopt.nlp.transcription import Transcription

Errors = Mapping[str, IntervalErrors]


def tightened_by_excess(solution: NlpSolution, errors: Errors, allowed: float) -> Bounds:
    """The solution's bounds, tightened by each excess above ``allowed`` at all nodes of its interval."""
    return tightened(solution.bounds, solution.transcription, {name: passed(e, allowed) for name, e in errors.items()})


def passed(e: IntervalErrors, allowed: float) -> np.ndarray:
    """By how much lower and upper limits are passed where it is more than ``allowed``, (2, N, limits)."""
    excess = np.array([e.below, e.above])
    return np.where(excess > allowed, excess, 0.0)


def tightened(old: Bounds, t: Transcription, amounts: Mapping[str, np.ndarray]) -> Bounds:
    """Bounds tightened by ``amounts`` (2, N, limits) of each phase, lower and upper, at all nodes of each interval."""
    n = len(old.low_z)
    low, high = np.concatenate([old.low_z, old.low_g]), np.concatenate([old.high_z, old.high_g])
    up, down = np.zeros(len(low)), np.zeros(len(low))
    for phase, (below, above) in amounts.items():
        for k, nodes in enumerate(limit_nodes(t, phase)):
            np.maximum.at(up, nodes, below[:, k, None])
            np.maximum.at(down, nodes, above[:, k, None])
    crossed = low + up > high - down  # values that are given, such as those at the start
    low, high = np.where(crossed, low, low + up), np.where(crossed, high, high - down)
    return Bounds(low[:n], high[:n], low[n:], high[n:])


def limit_nodes(t: Transcription, phase: str) -> Iterator[np.ndarray]:
    """For each limit of ``IntervalErrors``, where each interval's nodes stand in (z, g), shape (N, nodes)."""
    layout, where, start = t.layouts[phase], t.variables[phase], len(t.scale)
    N = layout.mesh.intervals
    for rows in t.rows:
        if rows.kind == "path" and rows.phase == phase:
            first = (start + rows.start + np.arange(len(rows.interval)) * len(rows.labels)).reshape(N, -1)
            yield from (first + k for k in range(len(rows.labels)))
    sizes = [layout.stage.function.size1_in(k) for k in range(2)]
    for nodes, size, block in zip((layout.states_of, layout.controls_of), sizes, (where.x, where.u), strict=True):
        yield from (block.start + nodes * size + k for k in range(size))
