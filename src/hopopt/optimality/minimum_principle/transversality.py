"""What the ends of the phases ask of the costates: derivatives of J - multipliers' (boundary constraints)."""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from hopopt.nlp.layout import EndSymbols
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.ocp.problem import Component, Problem, stack
from hopopt.optimality.minimum_principle.costates import sign

CONDITION_PARTS: tuple[str, ...] = ("initial", "final", "duration", "integrals")


@dataclass(frozen=True)
class TransversalityConditions:
    """Derivatives of the objective less the boundary constraints times their multipliers, by phase: by the initial
    and final state (nx,), the duration (), the integrals (k,); by the free parameters (f,).

    objective is J of these ends; value, multiplier, lower and upper (rows,) are those of the boundary constraints;
    free_multiplier (f,) those of the free parameters' bounds.
    """

    phases: Mapping[str, Mapping[str, np.ndarray]]
    free: np.ndarray
    objective: float
    value: np.ndarray
    multiplier: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    labels: tuple[Component, ...]
    free_multiplier: np.ndarray


def transversality_conditions(solution: NlpSolution, integrals: Mapping[str, np.ndarray]) -> TransversalityConditions:
    """The slopes at a solution whose phases' integrals are given, by phase (k,)."""
    t, s = solution.transcription, sign(solution)
    rows = [r for r in t.rows if r.kind == "boundary"]
    multiplier, lower, upper = (
        np.concatenate([np.zeros(0), *(v[r.start : r.stop] * f for r, f in zip(rows, factors, strict=True))])
        for v, factors in (
            (-s * solution.lam_g, [1 / r.scale for r in rows]),
            (t.lbg, [r.scale for r in rows]),
            (t.ubg, [r.scale for r in rows]),
        )
    )
    names, (value, (objective,), *found) = _evaluated(solution, multiplier, integrals)
    phases = {name: dict(zip(CONDITION_PARTS, found[4 * k : 4 * k + 4], strict=True)) for k, name in enumerate(names)}
    labels = tuple(label for r in rows for label in r.labels)
    bounds_of_free = -s * (solution.lam_x / t.scale)[t.parameters]
    return TransversalityConditions(
        phases, found[-1], float(objective), value, multiplier, lower, upper, labels, bounds_of_free
    )


def _slopes(problem: Problem) -> tuple[EndSymbols, ca.Function]:
    """Symbols of the ends, and a function of them, the parameters and the multipliers: the boundary constraints, J, and
    the slopes by every part of every phase, then by the free parameters."""
    symbol = EndSymbols(problem)
    value = ca.vertcat(*[ca.vec(ca.SX(c.value(symbol.ends))) for c in problem.boundary])
    objective, multiplier = ca.SX(problem.objective.value(symbol.ends)), ca.SX.sym("multiplier", value.numel())
    total, free = objective - ca.dot(value, multiplier), [q for q in problem.parameters if q.free]
    y = [part for parts in symbol.parts.values() for part in parts]
    gradients = [ca.gradient(total, w) for w in (*y, stack(symbol.p, free) if free else ca.SX(0, 1))]
    inputs = [*y, stack(symbol.p, problem.parameters), multiplier]
    return symbol, ca.Function("ends", inputs, [value, objective, *gradients])


def _evaluated(
    solution: NlpSolution, multiplier: np.ndarray, integrals: Mapping[str, np.ndarray]
) -> tuple[list[str], list[np.ndarray]]:
    """Names of the phases, and what ``_slopes`` says at a solution."""
    problem, numbers = solution.transcription.problem, []
    symbol, slopes = problem.once("end slopes", lambda: _slopes(problem))
    for name in symbol.parts:
        trajectory = solution.phases[name]
        numbers += [trajectory.x_start[0], trajectory.x_end, trajectory.duration, integrals[name]]
    return list(symbol.parts), [np.array(v).ravel() for v in slopes(*numbers, solution.all_parameters, multiplier)]
