"""Kinks of the optimum: limits that trade places there, and derivatives that differ to both sides.

Where the gradients of active limits depend on each other, such as of two caps at the same torque, the conditions of
the optimum leave their multipliers open: all of a polyhedron will do. A derivative is then one-sided. For a maximum it is
the least over the polyhedron towards more of a number, and the largest towards less (Gauvin and Dubeau, Differential
properties of the marginal function in mathematical programming, 1982; Fiacco 1983, section 2.3).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import sparse
from scipy.optimize import linprog
from scipy.sparse.linalg import splu

from hopopt.nlp.refinement.continuous_limits import enforced_in, enforcing
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.nlp.terms import Matrix
from hopopt.nlp.transcription import Transcription
from hopopt.optimality.limits import Limit, limits

NEARLY_AT_LIMIT = 1e-3  # share of its range by which a limit may be missed where it trades places with one that acts
LEAST_ACTING_SHARE = 1e-6  # of the largest multiplier: a limit with less does not act
SAME_GRADIENT = 1e-9  # 1 - cosine of the gradients of limits that are one and the same
DAMPED = 1e-12  # of the squared lengths of gradients, in the search for those that depend on others
ROUNDS, DRAWN = 8, 16  # of that search: inverse iterations, random vectors, twice as many where all of them depend
TAKES_PART = 1e-5  # component of a direction of length 1, above which a row takes part
DEPENDS = 1e-8  # singular value below which gradients of length 1 depend on each other
DIFFERS = 1e-3  # share of the larger by which derivatives to two sides differ, if they do


@dataclass(frozen=True)
class Kink:
    """Multipliers that an optimum leaves open: ``solution`` has some of them.

    places: which of (rows, variables) they belong to, (d,)
    basis: directions in which they may move together, (d, k)
    at, signs: the solution's own there, and the sign each must keep (0: either), (d,)
    """

    solution: NlpSolution
    places: np.ndarray
    basis: np.ndarray
    at: np.ndarray
    signs: np.ndarray
    to_given: Matrix

    def moved(self, step: np.ndarray) -> NlpSolution:
        """The solution with multipliers moved by ``step`` along the basis, (k,)."""
        s, m = self.solution, len(self.solution.lam_g)
        by = np.zeros(m + len(s.lam_x))
        by[self.places] = self.basis @ step
        return replace(s, lam_g=s.lam_g + self.to_given @ by[:m], lam_x=s.lam_x + by[m:])

    def ranges(self, values: Callable[[NlpSolution], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest of each of ``values``, linear in the multipliers, over all that will do."""
        here, columns = values(self.solution), list[np.ndarray]()
        for k, direction in enumerate(self.basis.T):
            size = self._room(direction)
            columns.append((values(self.moved(size * np.eye(len(self.basis.T))[k])) - here) / size)
        slope = np.array(columns)
        spans = [self._span(column) for column in slope.T]
        return here + np.array([s[0] for s in spans]), here + np.array([s[1] for s in spans])

    def _room(self, direction: np.ndarray) -> float:
        """A step along a direction that changes no sign."""
        against = self.signs * direction < 0
        return 0.5 * float(np.min(np.abs(self.at[against] / direction[against]), initial=1.0)) or 1e-9

    def _span(self, slope: np.ndarray) -> tuple[float, float]:
        """Least and largest of slope' step, over the steps that keep all signs; 0 of what has no bound."""
        if np.abs(slope).max(initial=0.0) == 0.0:
            return 0.0, 0.0
        kept, size = self.signs != 0, np.abs(self.at).max()
        A, b = -(self.signs[:, None] * self.basis)[kept], np.maximum(self.signs * self.at, 0.0)[kept] / size
        ends = []
        for way in (1.0, -1.0):
            found = linprog(way * slope / np.abs(slope).max(), A, b, bounds=(None, None), method="highs")
            ends.append(way * float(found.fun) * size * float(np.abs(slope).max()) if found.success else 0.0)
        return ends[0], ends[1]

    def limits(self) -> list[Limit]:
        """The limits that trade places."""
        chosen = {int(k): sign for k, sign in zip(self.places, self.signs, strict=True) if sign}
        return [
            limit
            for limit in limits(self.solution)
            if any(chosen.get(int(k)) == (1.0 if limit.upper else -1.0) for k in limit.places)
        ]


def kink(s: NlpSolution, fixed: Sequence[int] = ()) -> Kink | None:
    """What the conditions of an optimum leave open of its multipliers, or None where they determine all of them.

    fixed: variables that are taken as given values.
    """
    held = enforcing(s.transcription, enforced_in(s))
    lam_g, t = held.multipliers(s.lam_g), held.transcription
    _, J = t.program.jac_g()(s.z, s.p)
    J = sparse.csr_matrix(J.sparse())
    lam, equal = _sides(s, lam_g, fixed)
    rows = sparse.vstack([J, sparse.identity(len(s.z), format="csr")]).tocsr()
    signs = np.where(equal, 0.0, np.sign(lam))
    acting = equal | (np.abs(lam) > LEAST_ACTING_SHARE * np.abs(lam[~equal]).max(initial=0.0))
    for k, sign in _partners(held.M @ s.g, t, rows, acting & ~equal):
        acting[k], signs[k] = True, sign
    at = np.flatnonzero(acting)
    places, basis = _dependent(rows[at])
    if not len(places):
        return None
    chosen = at[places]
    return Kink(s, chosen, basis, lam[chosen], signs[chosen], held.M.T.tocsc())


def _sides(s: NlpSolution, lam_g: np.ndarray, fixed: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """Multipliers of (rows, variables), and which of them are equations."""
    t, b = s.transcription, s.bounds
    equal_z = b.low_z == b.high_z
    equal_z[list(fixed)] = True
    return np.concatenate([lam_g, s.lam_x]), np.concatenate([t.lbg == t.ubg, equal_z])


def _partners(g: np.ndarray, t: Transcription, rows: Matrix, acting: np.ndarray) -> Iterator[tuple[int, float]]:
    """Rows of limits that nearly act and are parallel to one that does at the same place, and the side they would act on."""
    lengths = np.sqrt(np.asarray(rows.multiply(rows).sum(axis=1))).ravel()
    for r in t.rows:
        width = len(r.labels)
        if r.kind != "path" or width < 2:
            continue
        for first in range(r.start, r.stop, width):
            group = range(first, first + width)
            for k in (k for k in group if acting[k]):
                for other in (j for j in group if not acting[j]):
                    low, high = t.lbg[other], t.ubg[other]
                    side = 1.0 if high - g[other] < g[other] - low else -1.0
                    if min(high - g[other], g[other] - low) > NEARLY_AT_LIMIT:
                        continue
                    along = abs((rows[k] @ rows[other].T).toarray().item()) / (lengths[k] * lengths[other])
                    if 1 - along < SAME_GRADIENT:
                        yield other, side


def _dependent(rows: Matrix) -> tuple[np.ndarray, np.ndarray]:
    """Which rows take part in a vanishing sum of multiples of rows, (d,), and a basis of such multiples, (d, k).

    Random vectors are projected on those that A' maps to almost nothing, by inverse iteration; of the few directions
    that remain, those that it maps to nothing are a small singular value decomposition's (Rayleigh and Ritz). Many rows
    can nearly depend on each other; what counts are those that do without the rest, as a decomposition of them alone says.
    """
    lengths = np.sqrt(np.asarray(rows.multiply(rows).sum(axis=1))).ravel()
    A: Any = sparse.csc_matrix(sparse.diags(1 / np.where(lengths > 0, lengths, 1.0)) @ rows)
    solver, count = splu(sparse.csc_matrix(A.T @ A + DAMPED * sparse.identity(A.shape[1]))), min(DRAWN, A.shape[0])
    while True:
        block = np.random.default_rng(0).standard_normal((A.shape[0], count))
        for _ in range(ROUNDS):
            block, _ = np.linalg.qr(block - A @ solver.solve(A.T @ block))
        _, sizes, directions = np.linalg.svd(A.T @ block, full_matrices=bool(count > A.shape[1]))
        zero = np.concatenate([sizes, np.zeros(count - len(sizes))]) < DEPENDS
        if not zero.all() or count == A.shape[0]:
            break
        count = min(2 * count, A.shape[0])
    places = np.flatnonzero(_takes_part(block @ directions[zero].T))
    if not len(places):
        return places, np.zeros((0, 0))
    dense = A[places].toarray()
    dense = dense[:, dense.any(axis=0)]
    left, sizes, _ = np.linalg.svd(dense, full_matrices=len(places) > dense.shape[1])
    basis = left[:, np.concatenate([sizes, np.zeros(len(places) - len(sizes))]) < DEPENDS]
    taking = _takes_part(basis)
    return places[taking], basis[taking] / lengths[places[taking], None]


def _takes_part(directions: np.ndarray) -> np.ndarray:
    """Which rows take part in any of the directions of length 1, one a column."""
    return np.abs(directions).max(axis=1, initial=0.0) > TAKES_PART
