"""A nonlinear program made of small functions evaluated at many points, with its exact derivatives.

Every part of a transcription is a ``Term``: y = L z (linear), F(y_k) at the points k, O vec(F) (linear). So

    jacobian = O blkdiag(dF/dy) L        hessian = L' blkdiag(sum_i w_i d2F_i/dy2) L,  w = O' lambda

and only the small functions are differentiated, once, in SX; the rest are constant matrices that send the
nonzeros of the small derivatives to those of the large ones. Building then hardly depends on the mesh. (Betts,
Practical Methods for Optimal Control, chapter 4, calls this structure discretization separability.)
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from scipy import sparse

from hopopt.nlp.solver.compiled import compiled

Matrix = Any  # a SciPy sparse matrix: its kinds have no useful common type
Triplets = tuple[np.ndarray, np.ndarray, np.ndarray]  # values, rows, columns
FUNCTIONS = {"cse": True}  # options of the small functions
EMPTY: Triplets = (np.zeros(0), np.zeros(0, dtype=int), np.zeros(0, dtype=int))


@dataclass(frozen=True, eq=False)
class Local:
    """outputs(y, extra) at one point, with what is derived of it: made once for all meshes."""

    name: str
    y: ca.SX
    extra: ca.SX
    outputs: ca.SX
    kept: dict[Any, Any] = field(default_factory=dict, repr=False)

    def once(self, name: Any, make: Callable[[], Any]) -> Any:
        """The value called ``name``, made at its first use."""
        if name not in self.kept:
            self.kept[name] = make()
        return self.kept[name]

    def part(self, chosen: slice) -> "Local":
        """The same with some of the outputs only."""
        make = lambda: Local(self.name, self.y, self.extra, self.outputs[chosen])  # noqa: E731
        return self.once(("part", chosen.start, chosen.stop), make)

    def function(self, what: str, results: Sequence[ca.SX], *weights: ca.SX) -> ca.Function:
        """Dense results of (y, extra, weights); ``what`` names them, once and for all."""
        inputs, dense = [self.y, self.extra, *weights], [ca.densify(r) for r in results]
        return self.once(what, lambda: ca.Function(f"{what}_of_terms", inputs, dense, FUNCTIONS))

    @cached_property
    def values(self) -> ca.Function:
        """Outputs."""
        return self.function("values", [self.outputs])

    @cached_property
    def jacobian(self) -> tuple[ca.Function, np.ndarray, np.ndarray]:
        """Outputs and the nonzeros of their derivative by y; rows and columns of these."""
        slope = ca.jacobian(self.outputs, self.y)
        return compiled(self.function("jacobian", [self.outputs, nonzeros(slope)])), *triplet(slope.sparsity())

    @property
    def curved(self) -> bool:
        """Whether outputs have second derivatives by y."""
        return self._curvature[1].nnz() > 0

    @cached_property
    def _curvature(self) -> tuple[ca.SX, ca.SX]:
        """Weights w, and the lower triangle of the second derivative of w' outputs by y; by columns this takes fewer steps
        than ca.hessian or the upper triangle."""
        w = ca.SX.sym("w", self.outputs.numel())
        gradient = ca.gradient(ca.dot(w, ca.cse(self.outputs)), self.y)
        return w, ca.tril(ca.jacobian(gradient, self.y))

    @cached_property
    def hessian(self) -> tuple[ca.Function, np.ndarray, np.ndarray]:
        """Nonzeros of the upper triangle of the second derivative of w' outputs by y; rows and columns of all."""
        w, lower = self._curvature
        both = lower.sparsity() + lower.T.sparsity()
        return compiled(self.function("hessian", [nonzeros(lower.T)], w)), *triplet(both)


@dataclass(frozen=True)
class Term:
    """``local`` at all points, extra being shared; gather L (points * ny, n), scatter O (rows, points * no)."""

    local: Local
    gather: Matrix
    scatter: Matrix

    @property
    def points(self) -> int:
        return self.gather.shape[0] // self.local.y.numel()

    @cached_property
    def gather_dm(self) -> ca.DM:
        """L for CasADi."""
        return to_dm(self.gather)

    @cached_property
    def scatter_dm(self) -> ca.DM:
        """O for CasADi."""
        return to_dm(self.scatter)

    @cached_property
    def gather_rows(self) -> Matrix:
        """L by rows."""
        return self.gather.tocsr()

    def part(self, outputs: slice, rows: slice) -> "Term":
        """The same with some of the outputs and rows only."""
        count = self.local.outputs.numel()
        columns = np.arange(self.points)[:, None] * count + np.arange(count)[outputs]
        scatter = self.scatter[:, columns.ravel()] if columns.size < self.scatter.shape[1] else self.scatter
        if len(range(scatter.shape[0])[rows]) < scatter.shape[0]:
            scatter = scatter[rows]
        return Term(self.local.part(outputs), self.gather, scatter)

    def at_points(self, function: ca.Function, z: ca.MX, extra: ca.MX, *weights: ca.MX) -> Any:
        """A function of ``local`` at all points, each result (size, points); weights are (size, points) each too."""
        y = ca.reshape(self.gather_dm @ z, self.local.y.numel(), self.points)
        return function.map(self.points).call([y, extra, *weights])

    def at_ends(self, what: str, z: ca.MX, extra: ca.MX, result: ca.SX, *weights: tuple[ca.SX, ca.MX]) -> ca.MX:
        """One sparse result of a term that has a single point."""
        function = self.local.function(what, [nonzeros(result)], *(symbol for symbol, _ in weights))
        (dense,) = self.at_points(function, z, extra, *(value for _, value in weights))
        return ca.MX(result.sparsity(), ca.vec(dense))

    def values(self, z: ca.MX, extra: ca.MX) -> ca.MX:
        """O vec(F), (rows, 1)."""
        (values,) = self.at_points(self.local.values, z, extra)
        return self.scatter_dm @ ca.vec(values)

    def jacobian(self, z: ca.MX, extra: ca.MX) -> tuple[ca.MX, "Scattered"]:
        """O vec(F) and its derivative by z, (rows, n)."""
        function, i, j = self.local.jacobian
        values, entries = self.at_points(function, z, extra)
        places = _products(self.scatter.T, self.gather_rows, self.points, i, j, np.arange(len(i)))
        return self.scatter_dm @ ca.vec(values), Scattered(ca.vec(entries), *places)

    def hessian(self, z: ca.MX, extra: ca.MX, rows: ca.MX) -> "Scattered":
        """Upper triangle of the second derivative by z of rows' O vec(F), (n, n)."""
        function, i, j = self.local.hessian
        weights = ca.reshape(self.scatter_dm.T @ rows, self.local.outputs.numel(), self.points)
        (entries,) = self.at_points(function, z, extra, weights)
        return Scattered(ca.vec(entries), *self._symmetric(i, j))

    def _symmetric(self, i: np.ndarray, j: np.ndarray) -> tuple[np.ndarray, ...]:
        """Where the nonzeros of the small Hessian's upper triangle go in the large one's."""
        upper = np.flatnonzero(i <= j)
        source = {(a, b): k for k, (a, b) in enumerate(zip(i[upper], j[upper], strict=True))}
        index = np.array([source[min(a, b), max(a, b)] for a, b in zip(i, j, strict=True)], dtype=int)
        value, row, column, entry = _products(self.gather_rows, self.gather_rows, self.points, i, j, index)
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
    fixed, i, j = EMPTY if constant is None else entries(constant)
    keys = [p.column * shape[0] + p.row for p in parts] + [j.astype(int) * shape[0] + i]
    key, place = np.unique(np.concatenate(keys), return_inverse=True)  # ascending: column by column
    places = np.split(place, np.cumsum([len(k) for k in keys])[:-1])
    columns = np.searchsorted(key, np.arange(shape[1] + 1) * shape[0])
    pattern = ca.Sparsity(*shape, columns.tolist(), (key % shape[0]).tolist())
    total = ca.MX(ca.DM(np.bincount(places[-1], fixed, len(key)).tolist()))
    for p, at in zip(parts, places[:-1], strict=True):
        if p.entries.numel():
            total += to_dm(csc((p.value, (at, p.entry)), (len(key), p.entries.numel()))) @ p.entries
    return ca.MX(pattern, total)


def _products(
    left: Any, right: Any, points: int, i: np.ndarray, j: np.ndarray, index: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Every left[k, i] * right[k, j] of two matrices by rows: value, column of left, column of right, and points-major
    index of the entry."""
    k = np.arange(points)[:, None]
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


def entries(matrix: Any) -> Triplets:
    """Values, rows and columns of what is not zero in an array, or is stored in a SciPy matrix."""
    if sparse.issparse(matrix):
        coo = matrix.tocoo()
        return coo.data, coo.row, coo.col
    rows, columns = np.nonzero(matrix)
    return matrix[rows, columns], rows, columns


def blocks(places: Any, block: np.ndarray, height: int, width: int, row: int = 0, column: int = 0) -> Triplets:
    """``block`` times each entry (i, j) of ``places`` (a matrix or triplets), at row i * height + row and column
    j * width + column."""
    value, i, j = places if isinstance(places, tuple) else entries(places)
    b, k, l = entries(block)  # noqa: E741
    return (
        np.multiply.outer(value, b).ravel(),
        np.add.outer(i * height + row, k).ravel(),
        np.add.outer(j * width + column, l).ravel(),
    )


def stacked(parts: Iterable[Triplets]) -> Triplets:
    """The triplets of all parts, one after another."""
    value, row, column = (np.concatenate(side) for side in zip(EMPTY, *parts, strict=True))
    return value, row, column


def together(parts: Iterable[Triplets], shape: tuple[int, int]) -> Matrix:
    """The sum of all parts by columns."""
    value, row, column = stacked(parts)
    return csc((value, (row, column)), shape)


def to_dm(matrix: Any) -> ca.DM:
    """A SciPy sparse matrix as a CasADi one."""
    m = csc(matrix)
    m.sum_duplicates()
    rows, columns = m.shape  # lists: CasADi takes arrays number by number
    return ca.DM(ca.Sparsity(rows, columns, m.indptr.tolist(), m.indices.tolist()), m.data.tolist())
