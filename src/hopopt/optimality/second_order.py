"""Second-order test: is an optimum a minimum of its program, or may it be a saddle?

Of a program min f with rows and limits, let d be a direction along which all equations and all limits with a multiplier
stay met to first order. At a strict local minimum the second derivative of the Lagrangian W is positive there: d' W d > 0
for every such d is sufficient (Nocedal and Wright, Numerical Optimization, theorem 12.6). It is as much as that the KKT
matrix has the right inertia: as many negative eigenvalues as equations and limits that act (16.3).

Counted here are the eigenvalues of W on these directions (Z' W Z, dense): its inertia is that of the KKT matrix but for the
equations. States are eliminated first, as they follow from controls, durations, initial states and free parameters. Limits
without a multiplier are let go: so the test is sufficient, but a direction that gains may be one that they forbid. Where
there is one, it is counted again with every limit held on which the solution lies: with one left, it is a saddle.

A direction's size is the root of: every control's mean square over its phase, relative to its largest; every duration's
square, relative to it; the squares of initial states and free parameters in their scales. So what is counted does not
depend on the mesh. Flat is a direction along which a move of size 1 changes the objective by less than FLAT.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import splu

from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.nlp.terms import Matrix, csc
from hopopt.optimality.directions.flat_directions import LEAST_ACTING_MULTIPLIER, UNUSED_CONTROL
from hopopt.record import Strict, stated

FLAT_CURVATURE = 1e-6  # of the objective, by a move of size 1
ON_LIMIT = 1e-4  # scaled: a solution that is nearer to a limit lies on it, as verification has it
DEPENDENT = 1e-9  # of the largest: what is left of a row that follows from the others
MOST_VARIABLES = 4000  # controls, durations, initial states and parameters: dense matrices of more take too long


@dataclass(frozen=True)
class Curvature(Strict):
    """Directions that keep all equations and limits that act, by what moving along them does to the objective."""

    worse: int = stated("directions that make the objective worse")
    flat: int = stated("directions that hardly change it")
    better: int = stated("directions that make it better, if no limit without a multiplier forbids them")
    lowest: float = stated("least loss by a move of size 1, of the objective; negative: a gain (docs/certificate.md)")
    saddle: int = stated("directions that make it better within every limit: with any, the hop is no optimum")


def curvature(solution: NlpSolution) -> Curvature | None:
    """The second derivatives of a program at its optimum, counted; None of a program that is too large."""
    b, size = solution.bounds, solution.magnitude
    held_z = (b.low_z == b.high_z) | (np.abs(solution.lam_x) > LEAST_ACTING_MULTIPLIER * size)
    held_g = (b.low_g == b.high_g) | (np.abs(solution.lam_g) > LEAST_ACTING_MULTIPLIER * size)
    if int((~_states(solution)[0] & ~held_z).sum()) > MOST_VARIABLES:
        return None
    found = _curvatures(solution, held_z, held_g)
    better, flat, saddle = int((found < -FLAT_CURVATURE).sum()), int((np.abs(found) <= FLAT_CURVATURE).sum()), 0
    if better:
        on_z = np.minimum(solution.z - b.low_z, b.high_z - solution.z) < ON_LIMIT
        on_g = np.minimum(solution.g - b.low_g, b.high_g - solution.g) < ON_LIMIT
        saddle = int((_curvatures(solution, held_z | on_z, held_g | on_g) < -FLAT_CURVATURE).sum())
    return Curvature(len(found) - better - flat, flat, better, float(found.min(initial=np.inf)), saddle)


def _curvatures(solution: NlpSolution, held_z: np.ndarray, held_g: np.ndarray) -> np.ndarray:
    """What moves of size 1 along directions at right angles change, that keep these variables and rows, of the objective."""
    follows, of_defects = _states(solution)
    free = np.flatnonzero(~follows & ~held_z)
    W, A = _derivatives(solution)
    defects, state = A[of_defects], np.flatnonzero(follows)
    S = -splu(csc(defects[:, state])).solve(defects[:, free].toarray())
    at = np.flatnonzero(held_z & follows)
    held = sparse.csr_matrix((np.ones(len(at)), (np.arange(len(at)), at)), shape=(len(at), len(held_z)))
    rows = sparse.vstack([A[held_g & ~of_defects], held]).tocsr()
    weight = np.sqrt(_metric(solution)[free])
    Z = _null_space((rows[:, free].toarray() + rows[:, state] @ S) / weight) / weight[:, None]
    moved = np.zeros((len(held_z), Z.shape[1]))
    moved[free], moved[state] = Z, S @ Z
    return np.linalg.eigvalsh(moved.T @ (W @ moved)) / (2 * solution.magnitude)


def _derivatives(solution: NlpSolution) -> tuple[Matrix, Matrix]:
    """Second derivative of the Lagrangian, and derivative of the rows."""
    program, z, p = solution.transcription.program, ca.DM(solution.z), ca.DM(solution.p)
    A = program.jac_g().call([z, p])[1].sparse()
    W = program.hess_lag().call([z, p, ca.DM(1.0), ca.DM(solution.lam_g)])[0].sparse()
    return (W + sparse.triu(W, 1).T).tocsr(), A.tocsr()


def _states(solution: NlpSolution) -> tuple[np.ndarray, np.ndarray]:
    """Which variables are states after a phase's first, and which rows are the defects that they follow from."""
    t = solution.transcription
    follows, defects = np.zeros(len(solution.z), dtype=bool), np.zeros(len(solution.lam_g), dtype=bool)
    for name, where in t.variables.items():
        follows[where.x.start + sum(s.size for s in t.problem.phase(name).states) : where.x.stop] = True
    for rows in t.rows:
        defects[rows.start : rows.stop] = rows.kind == "defect"
    return follows, defects


def _metric(solution: NlpSolution) -> np.ndarray:
    """What a move's square counts, of each variable."""
    found, t = np.ones(len(solution.z)), solution.transcription
    for name, where in t.variables.items():
        found[where.durations] = 1 / solution.z[where.durations] ** 2
        for at, weights in _controls(solution, name):
            largest = float(np.abs(solution.z[at]).max(initial=0.0))
            found[at] = weights / (largest if largest > UNUSED_CONTROL else 1.0) ** 2
    return found


def _controls(solution: NlpSolution, phase: str) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Where each control's values stand, and which share of the phase each stands for."""
    t, trajectory = solution.transcription, solution.phases[phase]
    layout, where = t.layouts[phase], t.variables[phase].u
    weights = layout.control_matrix @ np.outer(trajectory.lengths, layout.scheme.b).ravel() / trajectory.duration
    every = np.arange(where.start, where.stop).reshape(len(weights), -1)
    return ((at, weights) for at in every.T)


def _null_space(rows: np.ndarray) -> np.ndarray:
    """Directions, of size 1 and at right angles, that no row feels."""
    size = np.linalg.norm(rows, axis=1)
    rows = rows[size > 0] / size[size > 0, None]
    factors: Any = linalg.qr(rows.T, pivoting=True)
    Q, R = factors[:2]
    left = np.abs(np.diag(R))
    return Q[:, int((left > DEPENDENT * left.max(initial=0.0)).sum()) :]
