"""The first-order conditions of the nonlinear program, recomputed from the problem and the multipliers.

L = f + lam_g' g + lam_x' z (CasADi's signs: a multiplier is positive at an upper bound, negative at a lower
one). Derivatives here are CasADi's own reverse sweep, not the hand-assembled ones Ipopt was given.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from hopopt.nlp.solver.ipopt import NlpSolution


@dataclass(frozen=True)
class Residuals:
    """Largest violations (scaled): stationarity, constraints and bounds, complementarity and signs."""

    stationarity: float
    feasibility: float
    complementarity: float


def residuals(solution: NlpSolution) -> Residuals:
    """The KKT residuals of a solve, relative to the size of its multipliers as Ipopt scales them."""
    nlp, b = solution.transcription.nlp, solution.bounds
    lam = ca.MX.sym("lam", len(b.low_g))
    gradient = ca.gradient(nlp["f"] + ca.dot(lam, nlp["g"]), nlp["x"])
    evaluate = ca.Function("kkt", [nlp["x"], nlp["p"], lam], [gradient, nlp["g"]])
    slope, g = (np.array(r).ravel() for r in evaluate(solution.z, solution.p, solution.lam_g))
    size = max(1.0, float(np.mean(np.abs(np.concatenate([solution.lam_g, solution.lam_x])))))
    movable = b.low_z < b.high_z
    return Residuals(
        float(np.abs((slope + solution.lam_x)[movable]).max() / size),
        max(_outside(g, b.low_g, b.high_g), _outside(solution.z, b.low_z, b.high_z)),
        max(
            _slackness(g, b.low_g, b.high_g, solution.lam_g),
            _slackness(solution.z, b.low_z, b.high_z, solution.lam_x),
        )
        / size,
    )


def _outside(value: np.ndarray, low: np.ndarray, high: np.ndarray) -> float:
    return float(np.maximum(np.maximum(low - value, value - high), 0.0).max(initial=0.0))


def _slackness(value: np.ndarray, low: np.ndarray, high: np.ndarray, lam: np.ndarray) -> float:
    """Largest product of a multiplier and the distance to the bound it belongs to; equalities are exempt."""
    free = low < high
    upper = np.where(np.isfinite(high), np.abs(high - value), 1.0) * np.maximum(lam, 0.0)
    lower = np.where(np.isfinite(low), np.abs(value - low), 1.0) * np.maximum(-lam, 0.0)
    return float(np.maximum(upper, lower)[free].max(initial=0.0))
