"""A phase's right-hand sides, limits and integrands along a solution, with their first derivatives."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from hopopt.nlp.layout import PhaseLayout
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.ocp.problem import Parameter


@dataclass(frozen=True)
class Along:
    """Values at K places of each of N intervals: t (N, K) [s], x, u, right-hand sides f (N, K, nx), limits c
    (N, K, m), integrands l (N, K, k). Derivatives of f, c and l, stacked: by_x (N, K, nx + m + k, nx), and so
    on by_u, by_t (one column) and by_free (the free parameters)."""

    t: np.ndarray
    x: np.ndarray
    u: np.ndarray
    f: np.ndarray
    c: np.ndarray
    l: np.ndarray  # noqa: E741
    by_x: np.ndarray
    by_u: np.ndarray
    by_t: np.ndarray
    by_free: np.ndarray

    def hamiltonian(self, p: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """H = p' f + weights' l, (N, K)."""
        return np.einsum("ikx,ikx->ik", p, self.f) + self.l @ weights

    def gradient(self, by: np.ndarray, p: np.ndarray, weights: np.ndarray, density: np.ndarray) -> np.ndarray:
        """Derivative of p' f + weights' l - density' c by one of ``by_x``, ..., (N, K, columns)."""
        factors = np.concatenate([p, -density, np.broadcast_to(weights, (*p.shape[:2], len(weights)))], axis=2)
        return np.einsum("ikr,ikrc->ikc", factors, by)


class PhaseFunctions:
    """Compiled once for a phase: everything ``Along`` holds."""

    def __init__(self, layout: PhaseLayout, parameters: Sequence[Parameter]):
        stage = layout.stage.function
        x, u, t, p = (ca.SX.sym(name, stage.size1_in(k)) for k, name in enumerate("xutp"))
        f, path, integrands = stage(x, u, t, p)
        values = [f, ca.vertcat(path, x, u), integrands]
        at, free = 0, []
        for q in parameters:
            free += list(range(at, at + q.size)) if q.free else []
            at += q.size
        stacked = ca.vertcat(*values)
        by_p = ca.jacobian(stacked, p)[:, free] if free else ca.SX(stacked.numel(), 0)
        jacobians = [ca.jacobian(stacked, x), ca.jacobian(stacked, u), ca.jacobian(stacked, t), by_p]
        outputs = [ca.densify(o) for o in (*values, *jacobians)]
        self.function = ca.Function("along", [x, u, t, p], outputs, {"cse": True})

    def along(self, solution: NlpSolution, phase: str, places: np.ndarray) -> Along:
        """The values at the same normalised times of every interval."""
        t, x, u = solution.phases[phase].everywhere(places)
        flat = [np.ascontiguousarray(table.reshape(t.size, -1).T) for table in (x, u, t)]
        results = [np.array(r) for r in self.function.map(t.size)(*flat, solution.all_parameters)]
        values = [r.T.reshape(*t.shape, -1) for r in results[:3]]
        rows = sum(v.shape[2] for v in values)
        jacobians = [_unfold(r, t.shape, rows) for r in results[3:]]
        return Along(t, x, u, *values, *jacobians)


def _unfold(matrices: np.ndarray, shape: tuple[int, ...], rows: int) -> np.ndarray:
    """Matrices side by side (rows, K * columns) as (N, K, rows, columns)."""
    columns = matrices.size // max(1, rows * shape[0] * shape[1])
    return matrices.reshape(rows, *shape, columns).transpose(1, 2, 0, 3)
