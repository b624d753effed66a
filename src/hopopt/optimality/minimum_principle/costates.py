"""Costates and multipliers of limits as functions of time, from the multipliers of the nonlinear program.

Every multiplier here is the derivative of the objective as it is stated (larger or smaller is better) by the bound
it belongs to; the costate is that by the state. With lam the program's multipliers (CasADi's signs), s = -1 where
the objective is maximised and +1 where it is minimised, and defects x_k - x_0 - h sum_j A_kj f_j,

    p at the beginning of an interval = -s sum_k lam_k,        p_j = -s sum_k A_kj lam_k / b_j at abscissa j,
    density of a limit at abscissa j  = -s lam / (h b_j)

(Kameswaran and Biegler, Convergence rates for direct transcription of optimal control problems using collocation at
Radau points, 2008; Garg et al., Direct trajectory optimization and costate estimation using a Radau pseudospectral
method, 2011.) docs/certificate.md states the conventions once.
"""

from dataclasses import dataclass

import numpy as np

from hopopt.nlp.layout import PhaseLayout
from hopopt.nlp.refinement.continuous_limits import bernstein
from hopopt.nlp.schemes import Scheme, lagrange
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.ocp.problem import Component


@dataclass(frozen=True)
class PhaseMultipliers:
    """Multipliers of one phase with N intervals, n abscissae, m limits (path constraints, states, controls).

    costate (N, nx) at the beginning of every interval, without what a collocated left end adds; inner (N, n, nx) at
    the abscissae; density (N, n, m) of the limits, per second; atom (m,) of the limits at the phase's end; start
    (nx,) of the initial state's bounds; duration (arcs,) of the bounds of arcs and phase. Names of the limits.
    """

    costate: np.ndarray
    inner: np.ndarray
    density: np.ndarray
    atom: np.ndarray
    start: np.ndarray
    duration: np.ndarray
    limits: tuple[Component, ...]

    def moments(self, h: np.ndarray, scheme: Scheme) -> np.ndarray:
        """Each limit's density by its moments with the Bernstein polynomials of every interval (of length h), (N, n, m):
        none is of the wrong sign where a limit is enforced between the nodes (nlp/refinement/continuous_limits.py), as single nodes' can be."""
        lam = self.density * (h[:, None] * scheme.b)[..., None]
        return np.einsum("ijm,jk->ikm", lam, bernstein(scheme.c))


def sign(solution: NlpSolution) -> float:
    """-1 where the objective is maximised, else +1."""
    return -solution.transcription.problem.objective.sign


def phase_multipliers(solution: NlpSolution, phase: str) -> PhaseMultipliers:
    """Costates and limits' multipliers of one phase."""
    t, s = solution.transcription, sign(solution)
    layout, where, scheme = t.layouts[phase], t.variables[phase], t.scheme
    N, n = layout.mesh.intervals, len(scheme.c)
    defect, mass, duration = np.zeros(0), [], -s * (solution.lam_x / t.scale)[where.durations]
    names: list[Component] = []
    for rows in t.rows:
        lam = -s * solution.lam_g[rows.start : rows.stop].reshape(-1, len(rows.labels)) / rows.scale
        if rows.phase == phase and rows.kind == "defect":
            defect = lam.reshape(N, scheme.steps, -1)
        elif rows.phase == phase and rows.kind == "path":
            at_points = np.zeros((N * n, len(rows.labels)))
            at_points[layout.constrained] = lam
            mass.append(at_points.reshape(N, n, -1))
            names += rows.labels
        elif rows.phase == phase and rows.kind == "duration":
            duration = duration + lam.ravel()
    x = -s * (solution.lam_x / t.scale)[where.x].reshape(layout.state_nodes, -1)
    u = -s * (solution.lam_x / t.scale)[where.u].reshape(N, len(scheme.control_c), -1)
    mass += [_of_states(x, layout), _at_abscissae(u, scheme)]
    names += [name for v in (*layout.phase.states, *layout.phase.controls) for name in v.components()]
    h, b = solution.phases[phase].lengths[:, None, None], scheme.b[:, None]
    density = np.concatenate(mass, axis=2) / (h * b)
    atom = _take_atom(density, scheme) * float(h[-1, 0, 0]) * scheme.b[-1]
    inner = np.einsum("kj,ikx->ijx", scheme.A, defect) / b
    return PhaseMultipliers(defect.sum(axis=1), inner, density, atom, x[0], duration, tuple(names))


def _of_states(x: np.ndarray, layout: PhaseLayout) -> np.ndarray:
    """Multipliers of the states' bounds (nodes, nx) at the abscissae, (N, n, nx); the initial state's are its own.

    A node that two intervals collocate is shared between them by their quadrature weights.
    """
    scheme, N = layout.scheme, layout.mesh.intervals
    inner = x[1:].reshape(N, scheme.steps, -1).copy()
    if not scheme.starts_at_node:
        return inner
    widths = np.diff(layout.mesh.edges)
    left, right = scheme.b[-1] * widths[:-1], scheme.b[0] * widths[1:]
    share, shared = (right / (left + right))[:, None], inner[:-1, -1].copy()
    first = np.concatenate([np.zeros((1, x.shape[1])), share * shared])
    inner[:-1, -1] = (1 - share) * shared
    return np.concatenate([first[:, None], inner], axis=1)


def _at_abscissae(u: np.ndarray, scheme: Scheme) -> np.ndarray:
    """Multipliers of the controls' bounds (N, controls, nu) at the abscissae, (N, n, nu)."""
    at = np.isclose(np.array(scheme.c)[:, None], np.array(scheme.control_c))
    return np.einsum("jk,iku->iju", at.astype(float), u)


def _take_atom(density: np.ndarray, scheme: Scheme) -> np.ndarray:
    """What the last node's density (m,) has beyond the trend of its interval, which is what is left in place."""
    if len(scheme.c) == 1:
        trend = np.zeros_like(density[-1, -1])
    else:
        trend = (lagrange(scheme.c[:-1], 1.0) @ density[-1, :-1])[0]
    atom = density[-1, -1] - trend
    density[-1, -1] = trend
    return atom
