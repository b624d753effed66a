"""Back-off: a limit that is passed between the nodes of an interval is drawn in at those nodes.

Path constraints hold at the nodes; between them a solution may pass them, most where a control switches. Wherever
a limit is passed, it is drawn in at the interval's nodes by the excess, and the same program is solved again until
no limit is passed anywhere. The objective can only fall; by how much is the price of the limits holding everywhere.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from hopopt.nlp.accuracy import IntervalErrors
from hopopt.nlp.ipopt import Bounds, NlpSolution
from hopopt.nlp.transcribe import Transcription

PRICE = 1e-5  # relative: what keeping the limits between the nodes may cost the objective
Errors = Mapping[str, IntervalErrors]


def drawn_in(solution: NlpSolution, errors: Errors, allowed: float) -> Bounds:
    """The solution's bounds, drawn in by each excess above ``allowed`` at all nodes of its interval."""
    return tightened(solution.bounds, solution.transcription, {name: passed(e, allowed) for name, e in errors.items()})


def passed(e: IntervalErrors, allowed: float) -> np.ndarray:
    """By how much lower and upper limits are passed where it is more than ``allowed``, (2, N, limits)."""
    excess = np.array([e.below, e.above])
    return np.where(excess > allowed, excess, 0.0)


def tightened(old: Bounds, t: Transcription, amounts: Mapping[str, np.ndarray]) -> Bounds:
    """Bounds drawn in by ``amounts`` (2, N, limits) of each phase, lower and upper, at all nodes of each interval."""
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


def price(solution: NlpSolution) -> float:
    """What the limits that were drawn in cost the objective, relative to it, by their multipliers."""
    t, b = solution.transcription, solution.bounds
    low_z, high_z = t.bounds(t.guess_from(solution.phases))
    cost = 0.0
    for drawn, given, multiplier in (
        (b.low_z, low_z, -solution.lam_x), (b.high_z, high_z, solution.lam_x),
        (b.low_g, t.lbg, -solution.lam_g), (b.high_g, t.ubg, solution.lam_g),
    ):  # fmt: skip
        moved = drawn != given
        cost += float(np.abs(drawn[moved] - given[moved]) @ np.maximum(multiplier, 0.0)[moved])
    return cost / max(abs(solution.objective), 1e-9)


def prices(solution: NlpSolution, errors: Errors) -> dict[str, np.ndarray]:
    """What drawing in the limits would cost, by the multipliers, in each interval of each phase [objective's unit]."""
    multipliers, found = np.concatenate([solution.lam_x, solution.lam_g]), {}
    for phase, e in errors.items():
        found[phase] = np.zeros(len(e.local))
        for k, nodes in enumerate(limit_nodes(solution.transcription, phase)):
            lam = multipliers[nodes]
            found[phase] += (
                np.maximum(lam, 0).sum(axis=1) * e.above[:, k] - np.minimum(lam, 0).sum(axis=1) * e.below[:, k]
            )
    return found


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
