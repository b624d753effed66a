"""A nonlinear program made of small functions evaluated at many points, with its exact derivatives.

Every part of a transcription is a ``Term``: y = L z (linear), F(y_k) at the points k, O vec(F) (linear). So

    jacobian = O blkdiag(dF/dy) L        hessian = L' blkdiag(sum_i w_i d2F_i/dy2) L,  w = O' lambda

and only the small functions are differentiated, once, in SX; the rest are constant matrices that send the
nonzeros of the small derivatives to those of the large ones. Building then hardly depends on the mesh. (Betts,
Practical Methods for Optimal Control, chapter 4, calls this structure discretization separability.)
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from scipy import sparse

Matrix = Any  # a SciPy sparse matrix: its kinds have no useful common type


@dataclass(frozen=True)
class Term:
    """outputs(y, extra) at all points, extra being shared; gather L (points * ny, n), scatter O (rows, points * no)."""

    name: str
    y: ca.SX
    extra: ca.SX
    outputs: ca.SX
    gather: Matrix
    scatter: Matrix

    @property
    def points(self) -> int:
        return self.gather.shape[0] // self.y.numel()

    @cached_property
    def gather_dm(self) -> ca.DM:
        """L for CasADi."""
        return to_dm(self.gather)

    def part(self, outputs: slice, rows: slice) -> "Term":
        """The same with some of the outputs and rows only."""
        count = self.outputs.numel()
        columns = np.arange(self.points)[:, None] * count + np.arange(count)[outputs]
        scatter = csc(self.scatter[:, columns.ravel()][rows])
        return Term(self.name, self.y, self.extra, self.outputs[outputs], self.gather, scatter)

    def at_points(self, what: str, z: ca.MX, extra: ca.MX, results: list[ca.SX], *weights: tuple[ca.SX, ca.MX]) -> Any:
        """Dense results at all points, each (size, points); weights are further inputs, (size, points) each."""
        inputs = [self.y, self.extra, *(w for w, _ in weights)]
        function = ca.Function(f"{what}_of_terms", inputs, [ca.densify(r) for r in results], {"cse": True})
        y = ca.reshape(self.gather_dm @ z, self.y.numel(), self.points)
        return function.map(self.points).call([y, extra, *(w for _, w in weights)])

    def at_ends(self, what: str, z: ca.MX, extra: ca.MX, result: ca.SX, *weights: tuple[ca.SX, ca.MX]) -> ca.MX:
        """One sparse result of a term that has a single point."""
        (dense,) = self.at_points(what, z, extra, [nonzeros(result)], *weights)
        return ca.MX(result.sparsity(), ca.vec(dense))

    def values(self, z: ca.MX, extra: ca.MX) -> ca.MX:
        """O vec(F), (rows, 1)."""
        (values,) = self.at_points("values", z, extra, [self.outputs])
        return to_dm(self.scatter) @ ca.vec(values)

    def jacobian(self, z: ca.MX, extra: ca.MX) -> tuple[ca.MX, "Scattered"]:
        """O vec(F) and its derivative by z, (rows, n)."""
        local = ca.jacobian(self.outputs, self.y)
        values, entries = self.at_points("jacobian", z, extra, [self.outputs, nonzeros(local)])
        i, j = triplet(local.sparsity())
        places = _products(self.scatter.T, self.gather, self.points, i, j, np.arange(len(i)))
        return to_dm(self.scatter) @ ca.vec(values), Scattered(ca.vec(entries), *places)

    def hessian(self, z: ca.MX, extra: ca.MX, rows: ca.MX) -> "Scattered":
        """Upper triangle of the second derivative by z of rows' O vec(F), (n, n)."""
        w = ca.SX.sym("w", self.outputs.numel())
        local = ca.hessian(ca.dot(w, self.outputs), self.y)[0]
        weights = ca.reshape(to_dm(self.scatter.T) @ rows, w.numel(), self.points)
        (entries,) = self.at_points("hessian", z, extra, [nonzeros(ca.triu(local))], (w, weights))
        return Scattered(ca.vec(entries), *self._symmetric(local.sparsity()))

    def _symmetric(self, local: ca.Sparsity) -> tuple[np.ndarray, ...]:
        """Where the nonzeros of the small Hessian's upper triangle go in the large one's."""
        i, j = triplet(local)
        upper = np.flatnonzero(i <= j)
        source = {(a, b): k for k, (a, b) in enumerate(zip(i[upper], j[upper], strict=True))}
        index = np.array([source[min(a, b), max(a, b)] for a, b in zip(i, j, strict=True)], dtype=int)
        value, row, column, entry = _products(self.gather, self.gather, self.points, i, j, index)
        keep = row <= column
        return value[keep], row[keep], column[keep], entry[keep]


@dataclass(frozen=True)
class Scattered:
    """A sparse matrix as a sum: ``value * entries[entry]`` is added at (row, column)."""

    entries: ca.MX
    value: np.ndarray
    row: np.ndarray
    column: np.ndarray
    entry: np.ndarray


def assemble(shape: tuple[int, int], parts: Sequence[Scattered], constant: Matrix | None = None) -> ca.MX:
    """The sparse sum of all parts and a constant."""
    fixed = sparse.coo_matrix(shape if constant is None else constant)
    keys = [p.column * shape[0] + p.row for p in parts] + [fixed.col.astype(int) * shape[0] + fixed.row]
    key, place = np.unique(np.concatenate(keys), return_inverse=True)  # ascending: column by column
    places = np.split(place, np.cumsum([len(k) for k in keys])[:-1])
    columns = np.searchsorted(key, np.arange(shape[1] + 1) * shape[0])
    pattern = ca.Sparsity(*shape, columns.tolist(), (key % shape[0]).tolist())
    total = ca.MX(ca.DM(np.bincount(places[-1], fixed.data, len(key))))
    for p, at in zip(parts, places[:-1], strict=True):
        if p.entries.numel():
            total += to_dm(csc((p.value, (at, p.entry)), (len(key), p.entries.numel()))) @ p.entries
    return ca.MX(pattern, total)


def _products(
    left: Any, right: Any, points: int, i: np.ndarray, j: np.ndarray, index: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Every left[k, i] * right[k, j]: value, column of left, column of right, and points-major index of the entry."""
    left, right, k = sparse.csr_matrix(left), sparse.csr_matrix(right), np.arange(points)[:, None]
    a = (k * (left.shape[0] // points) + i).ravel()
    b = (k * (right.shape[0] // points) + j).ravel()
    entry = (k * (index.max(initial=-1) + 1) + index).ravel()
    first, second = np.diff(left.indptr)[a], np.diff(right.indptr)[b]
    count = first * second
    pair = np.repeat(np.arange(len(a)), count)
    within = np.arange(len(pair)) - np.repeat(np.cumsum(count) - count, count)
    at_left = left.indptr[a[pair]] + within // np.maximum(second[pair], 1)
    at_right = right.indptr[b[pair]] + within % np.maximum(second[pair], 1)
    value = left.data[at_left] * right.data[at_right]
    return value, left.indices[at_left].astype(int), right.indices[at_right].astype(int), entry[pair]


def nonzeros(matrix: ca.SX) -> ca.SX:
    """The structural nonzeros as a column."""
    return ca.SX(ca.Sparsity.dense(matrix.nnz(), 1), matrix.nz[:])


def triplet(pattern: ca.Sparsity) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of a pattern's nonzeros, column by column."""
    rows, columns = pattern.get_triplet()
    return np.array(rows, dtype=int), np.array(columns, dtype=int)


def csc(matrix: Any, shape: tuple[int, int] | None = None) -> Matrix:
    """A SciPy matrix by columns, or one of (values, (rows, columns)); itself if it is by columns already."""
    return matrix.tocsc() if sparse.issparse(matrix) else sparse.csc_matrix(matrix, shape=shape)


def shifted(block: Any, start: int, width: int) -> Matrix:
    """``block`` with zeros left and right: columns from ``start`` of ``width``."""
    m: Any = sparse.coo_matrix(block)
    return csc((m.data, (m.row, m.col + start)), (int(m.shape[0]), width))


def to_dm(matrix: Any) -> ca.DM:
    """A SciPy sparse matrix as a CasADi one."""
    m = csc(matrix)
    m.sum_duplicates()
    rows, columns = m.shape
    return ca.DM(ca.Sparsity(rows, columns, m.indptr.tolist(), m.indices.tolist()), m.data)
