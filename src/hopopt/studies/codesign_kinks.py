"""Where a co-design's optimum sits at a kink: between which limits, and what it would be without each of them.

Below the best value of a free entry one limit acts, above it another, such as the drive's cap times the ratio and the
gear's cap. Then neither is worth more than the other lets it be; the lesser one is that without which less is gained.
"""

from collections.abc import Hashable, Iterator
from dataclasses import replace

import numpy as np

from hopopt.nlp.solver.ipopt import NEAR_OPTIONS, Bounds, NlpSolution, NlpSolver
from hopopt.ocp.hop import Hop
from hopopt.optimality.directions.kinks import DIFFERS, kink
from hopopt.optimality.directions.parametric_sensitivity import gradient_by_parameters, slopes
from hopopt.optimality.limits import Limit
from hopopt.planner.answer.extras import Between, WithoutLimit


def between(hop: Hop, best: NlpSolution, entry: str) -> Between | None:
    """The limits that a free entry's best value sits between, or None where it sits at none or at one alone."""
    t = best.transcription
    index = t.parameters.start + [p.name for p in t.free].index(entry)
    if (at := kink(best, fixed=[index])) is None:
        return None
    by_parameters = gradient_by_parameters(t)

    def by_entry(s: NlpSolution) -> np.ndarray:
        by = slopes(s, by_parameters)
        return (by.low_z + by.high_z)[[index]]

    low, high = (float(side[0]) for side in at.ranges(by_entry))
    more, less = (low, high) if hop.objective.sign > 0 else (high, low)
    if abs(more - less) * max(abs(float(best.parameters[entry][0])), 1.0) <= DIFFERS * best.magnitude:
        return None
    groups: dict[Hashable, list[Limit]] = {}
    for limit in at.limits():
        groups.setdefault(limit.name.label or limit.name.of, []).append(limit)
    without = sorted(_without(hop, best, entry, groups), key=lambda w: hop.objective.signed_value(w.objective_value))
    return Between(more, less, tuple(str(name) for name in groups), tuple(without))


def _without(hop: Hop, best: NlpSolution, entry: str, groups: dict[Hashable, list[Limit]]) -> Iterator[WithoutLimit]:
    """The optimum on the same mesh without each of the limits, from the optimum with it; none that was not solved."""
    t, b = best.transcription, best.bounds
    solver = NlpSolver(t, NEAR_OPTIONS | {"ipopt.mu_init": 1e-4, "ipopt.max_iter": hop.design.solver.max_iterations})
    for name, limits in groups.items():
        low, high = b.low_g.copy(), b.high_g.copy()
        rows = np.concatenate([limit.places for limit in limits])
        rows = rows[rows < len(low)]
        low[rows], high[rows] = -np.inf, np.inf
        free = replace(best, lam_g=np.where(np.isin(np.arange(len(low)), rows), 0.0, best.lam_g))
        found = solver.again(free, Bounds(b.low_z, b.high_z, low, high))
        if found.success:
            yield WithoutLimit(str(name), found.value, float(found.parameters[entry][0]))
