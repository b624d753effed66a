"""Complementarity and signs of what is bounded once: initial states, durations and free parameters.

A multiplier belongs to that bound of the problem which its sign names. Times the distance to it, it is what moving
there would gain, to first order; a value that is held away from its bounds has a multiplier and a distance. The bounds
are those of the problem's statement, not those that the program was solved within.
"""

import numpy as np

from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.optimality.minimum_principle.costates import sign
from hopopt.optimality.minimum_principle.pontryagin import missed


def initial_state_residual(solution: NlpSolution, phase: str) -> tuple[float, str]:
    """What the multipliers of the initial state's bounds leave open, of the objective; and the worst state."""
    t = solution.transcription
    states = t.layouts[phase].phase.states
    lower, upper = (np.concatenate(side) for side in zip(*(s.end_bounds("initial") for s in states), strict=True))
    size = len(lower)
    own = slice(t.variables[phase].x.start, t.variables[phase].x.start + size)
    names = [str(name) for s in states for name in s.components()]
    return _left_open(solution, own, solution.phases[phase].x_start[0], lower, upper, names)


def duration_bounds_residual(solution: NlpSolution, phase: str) -> float:
    """What the multipliers of the duration's bounds leave open, of the objective.

    Where a phase has several arcs, each lasts from nothing to the phase's longest, and all together as it is bounded.
    """
    t, trajectory = solution.transcription, solution.phases[phase]
    layout, where = t.layouts[phase], t.variables[phase].durations
    shortest, longest = layout.phase.duration
    arcs = np.bincount(layout.mesh.arc, weights=trajectory.lengths)
    low, high = np.full(len(arcs), shortest if len(arcs) == 1 else 0.0), np.full(len(arcs), longest)
    total = _left_open(solution, where, arcs, low, high, [""] * len(arcs))[0]
    for rows in t.rows:
        if rows.phase == phase and rows.kind == "duration":
            nu = -sign(solution) * solution.lam_g[rows.start : rows.stop] / rows.scale
            lasted, least, most = (np.array([v]) for v in (trajectory.duration, shortest, longest))
            total += float(_gain(solution, nu, lasted, least, most).sum())
    return total


def free_parameters_residual(solution: NlpSolution) -> tuple[float, str]:
    """What the multipliers of the free parameters' bounds leave open, of the objective; and the worst parameter."""
    t = solution.transcription
    value, lower, upper = (
        np.concatenate([np.broadcast_to(of(q), (q.size,)) for q in t.free])
        for of in (lambda q: solution.parameters[q.name], lambda q: q.lower, lambda q: q.upper)
    )
    names = [str(name) for q in t.free for name in q.components()]
    return _left_open(solution, t.parameters, value, lower, upper, names)


def _left_open(
    solution: NlpSolution, own: slice, value: np.ndarray, lower: np.ndarray, upper: np.ndarray, names: list[str]
) -> tuple[float, str]:
    """Sum over the program's variables ``own`` of multiplier times distance, of the objective; and the worst's name."""
    scale = solution.transcription.scale[own]
    gain = _gain(solution, -sign(solution) * solution.lam_x[own] / scale, value, lower, upper, scale)
    return float(gain.sum()), names[int(gain.argmax())] if gain.any() else ""


def _gain(
    solution: NlpSolution, nu: np.ndarray, value: np.ndarray, lower: np.ndarray, upper: np.ndarray, scale: object = 1.0
) -> np.ndarray:
    """|multiplier| times the distance to the bound that it belongs to by its sign, of the objective."""
    distance = missed(nu, value, lower, upper, sign(solution), scale)
    return np.abs(nu) * distance / solution.magnitude
