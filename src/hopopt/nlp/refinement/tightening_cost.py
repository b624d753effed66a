"""What it costs the objective that limits are enforced between the nodes too, by the multipliers, interval by interval.

A control that switches inside an interval cannot follow its limit up to the switch, as it could if it were no polynomial.
A multiplier whose density in time has the moments mu_k with the Bernstein polynomials lies, in the mean, at their
centres: what that costs is the sum of mu_k times the distance to the limit there, and falls with the square of the
interval's length. (Against closed forms: what it costs, with three nodes; a third more, with two.)
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hopopt.nlp.refinement.continuous_limits import bernstein, centres
from hopopt.nlp.refinement.tightening import Errors, limit_nodes
from hopopt.nlp.schemes import lagrange
from hopopt.nlp.solver.ipopt import OPTIONS, NlpSolution

SLIGHT_MISS = 0.02  # share of its range: a limit that is missed by less beside an interval was not left in it
UNMET_SLACK = 0.3  # share of the slack on the other side, above which a limit was not met at all
SPREAD = 0.1  # of the places that several limits tell
BARRIER = 10 * OPTIONS["ipopt.tol"]  # of the objective's scale: a smaller multiplier times slack is Ipopt's own


def tightening_cost(solution: NlpSolution) -> float:
    """What the limits that were tightened cost the objective, relative to it."""
    cost = sum(float(each.sum()) for each in tightening_costs(solution).values())
    return cost / solution.magnitude


def tightening_costs(solution: NlpSolution) -> dict[str, np.ndarray]:
    """What the limits that were tightened cost in each interval of each phase, (N,) [objective's unit]."""
    found = {name: np.zeros(p.lengths.shape) for name, p in solution.phases.items()}
    for name, cost in found.items():
        for each in _limits(solution, name):
            cost += np.where(each.tightened, each.costs.sum(axis=(0, 2)), 0.0)
    return found


def normalised_switch_times(solution: NlpSolution) -> dict[str, np.ndarray]:
    """Where in each interval of each phase it goes from one limit to another, (N,), 0 to 1; NaN where that is unknown.

    A limit that is left at s, where its slack jumps from none to D, has the mean slack (1 - s) D.
    """
    found = {}
    for name, p in solution.phases.items():
        weight, first, second = (np.zeros(len(p.lengths)) for _ in range(3))
        for each in _limits(solution, name):
            for slack, cost in zip(each.slack, each.costs.sum(axis=2), strict=True):
                before, after = (np.pad(slack, ((1, 1), (0, 0)))[k : k + len(slack), -(k == 0)] for k in (0, 2))
                large, small = np.maximum(before, after), np.minimum(before, after)
                share = (
                    (slack @ p.scheme.b) / np.maximum(large, SLIGHT_MISS)
                    if each.at_controls
                    else np.full(len(slack), -1.0)
                )
                s = np.where(after > before, 1 - share, share)
                w = np.where((small < UNMET_SLACK * large) & (large > SLIGHT_MISS) & (s > 0) & (s < 1), cost, 0.0)
                weight, first, second = weight + w, first + w * s, second + w * s**2
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = first / weight
            spread = second / weight - mean**2
        found[name] = np.where(spread < SPREAD**2, mean, np.nan)
    return found


@dataclass(frozen=True)
class _Limit:
    """A limit in all N intervals: slack to the upper and to the lower side at its nodes, (2, N, nodes), scaled; what the
    multipliers of either side cost, (2, N, nodes); whether it was tightened, (N,); whether its nodes are the controls'."""

    slack: np.ndarray
    costs: np.ndarray
    tightened: np.ndarray
    at_controls: bool


def _limits(s: NlpSolution, name: str) -> Iterator[_Limit]:
    t, b = s.transcription, s.bounds
    low_z, high_z = t.bounds(t.guess_from(s.phases))
    stacked = [
        (s.lam_x, s.lam_g),
        (s.z, s.g),
        (b.low_z, b.low_g),
        (b.high_z, b.high_g),
        (low_z, t.lbg),
        (high_z, t.ubg),
    ]
    columns, control_c = [np.concatenate(pair) for pair in stacked], t.layouts[name].scheme.control_c
    for nodes in limit_nodes(t, name):
        lam, value, low, high, lower, upper = (column[nodes] for column in columns)
        tightened = ((low != lower) | (high != upper)).any(axis=1)
        slack = _finite(np.array([upper - value, value - lower]))
        at_controls = nodes.shape[1] == len(control_c)
        costs = _costs_within(lam, slack, control_c) if at_controls else _costs(lam, slack)
        yield _Limit(slack, np.where(costs > BARRIER * t.problem.objective.scale, costs, 0.0), tightened, at_controls)


def _costs(lam: np.ndarray, slack: np.ndarray) -> np.ndarray:
    """Upper and lower multipliers times slacks."""
    return np.maximum([lam, -lam], 0.0) * np.maximum(slack, 0.0)


def _costs_within(lam: np.ndarray, slack: np.ndarray, control_c: tuple[float, ...]) -> np.ndarray:
    """The same by moments; but a multiplier at a phase's very end need not be a density's."""
    atoms = np.zeros(lam.shape)
    atoms[-1, -1], atoms[0, 0] = control_c[-1] == 1.0, control_c[0] == 0.0
    moments = (lam * (1 - atoms)) @ bernstein(control_c)
    return _costs(lam * atoms, slack) + _costs(moments, slack @ lagrange(control_c, centres(len(control_c))).T)


def _finite(slack: np.ndarray) -> np.ndarray:
    """Distance to a limit, scaled; one where there is none, to which no more than noise belongs."""
    return np.where(np.isfinite(slack), slack, 1.0)


def excess_costs(solution: NlpSolution, errors: Errors) -> dict[str, np.ndarray]:
    """What tightening the limits by their excess would cost in each interval of each phase, (N,) [objective's unit]."""
    multipliers, found = np.concatenate([solution.lam_x, solution.lam_g]), {}
    for phase, e in errors.items():
        found[phase] = np.zeros(len(e.local))
        for k, nodes in enumerate(limit_nodes(solution.transcription, phase)):
            lam = multipliers[nodes]
            found[phase] += np.maximum(lam, 0).sum(axis=1) * e.above[:, k]
            found[phase] -= np.minimum(lam, 0).sum(axis=1) * e.below[:, k]
    return found
