"""Limits enforced between the nodes too, by the hull of their Bernstein coefficients.

Path constraints hold at the nodes; where a control switches inside an interval its polynomial passes them in between,
on any mesh. Between its nodes a limited quantity is nearly the polynomial through their values g. A polynomial lies
within the hull of its Bernstein coefficients b = B^-1 g, with B_jk = C(n, k) c_j^k (1 - c_j)^(n - k) (Farin, Curves and
Surfaces for CAGD, chapter 5). Where limits are to hold throughout, these are bounded in place of the values.
"""

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from math import comb

import numpy as np
from scipy import sparse

from hopopt.nlp.layout import PhaseLayout
from hopopt.nlp.refinement.interval_errors import IntervalErrors, stage_values
from hopopt.nlp.refinement.tightening import limit_nodes
from hopopt.nlp.solver.ipopt import Bounds, NlpSolution
from hopopt.nlp.terms import Matrix, csc
from hopopt.nlp.transcription import Transcription

ENFORCED_BESIDE = 0.3  # share of its range by which a limit may be missed and be enforced too, where another is passed
LOOKED_AT = np.linspace(0.0, 1.0, 9)  # normalised times where limits may come close
NOISE = 1e-10  # multipliers below this are none
Chosen = Mapping[str, np.ndarray]  # for each phase, which path limits are enforced in which intervals, (N, path limits)


def bernstein(c: Sequence[float]) -> np.ndarray:
    """B: the len(c) Bernstein polynomials at as many normalised times c, one in each column."""
    return bernstein_at(c, len(c))


def bernstein_at(normalised_times: Sequence[float] | np.ndarray, count: int) -> np.ndarray:
    """The ``count`` Bernstein polynomials of degree count - 1 at any normalised times, (times, count)."""
    s, n = np.array(normalised_times)[:, None], count - 1
    k = np.arange(count)
    return np.array([comb(n, int(j)) for j in k]) * s**k * (1 - s) ** (n - k)


def centres(count: int) -> np.ndarray:
    """Where in an interval the weight of each of ``count`` Bernstein polynomials has its centre."""
    return (1 + np.arange(count)) / (1 + count)


def holds(t: Transcription) -> bool:
    """Whether enforcing limits between the nodes pays: not where a control or a least number only bounds from above, nor
    with both ends of an interval collocated, where controls oscillate."""
    least = bool(t.free) and t.problem.objective.sign < 0
    bounding = any(c.only_bounds for phase in t.problem.phases for c in phase.controls)
    return not (least or bounding or t.scheme.starts_at_node)


def nothing_enforced(t: Transcription) -> dict[str, np.ndarray]:
    """No path limit in any interval."""
    sizes = {name: len(layout.stage.path_column("scale")) for name, layout in t.layouts.items()}
    return {name: np.zeros((layout.mesh.intervals, sizes[name]), dtype=bool) for name, layout in t.layouts.items()}


def coming_close(solution: NlpSolution, errors: Mapping[str, IntervalErrors], allowed: float) -> Chosen:
    """If some limit is passed by more than ``allowed``: the path limits that come close in an interval or beside it.

    Enforced only where one is passed, a torque that hardly matters goes on chattering in the next interval.
    """
    chosen = {}
    for name, e in errors.items():
        stage = solution.transcription.layouts[name].stage
        path = stage_values(solution, name, LOOKED_AT)[2]
        lower, upper, scale = (stage.path_column(side) for side in ("lower", "upper", "scale"))
        close = ((path > upper - ENFORCED_BESIDE * scale) | (path < lower + ENFORCED_BESIDE * scale)).any(axis=1)
        beside = np.pad(close, ((1, 1), (0, 0)))
        chosen[name] = (close | beside[:-2] | beside[2:]) & bool((e.excess > allowed).any()) & stage.smooth
    return chosen


def kept_without(solution: NlpSolution, errors: Mapping[str, IntervalErrors], allowed: float) -> Chosen:
    """Path limits that need not be enforced, by phase, (1, path limits): of states alone, and passed nowhere by more than
    ``allowed``. Their hulls can leave no room, as that of a foot that comes off the ground with the cube of time."""
    found = {}
    for name, e in errors.items():
        stage = solution.transcription.layouts[name].stage
        of_controls = np.array(stage.function.jac_sparsity(1, 1).row(), dtype=int)  # of path limits by controls
        kept = stage.smooth & ~(np.maximum(e.below, e.above) > allowed)[:, : len(stage.smooth)].any(axis=0)
        kept[of_controls] = False
        found[name] = kept[None]
    return found


@dataclass(frozen=True)
class Enforced:
    """A program in which the ``chosen`` limits are enforced between the nodes: its rows are M times those of ``given``, the
    one with limits at the nodes alone; ``touched``: which rows that changes."""

    given: Transcription
    chosen: Chosen
    transcription: Transcription
    inverse: Matrix  # M^-1
    M: Matrix
    touched: np.ndarray

    def is_of(self, t: Transcription, chosen: Chosen) -> bool:
        """Whether it is the program of ``t`` in which these limits are enforced."""
        return self.given is t and all(np.array_equal(self.chosen[name], on) for name, on in chosen.items())

    def multipliers(self, lam_g: np.ndarray) -> np.ndarray:
        """Multipliers of the rows from those of the given program's."""
        return self.inverse.T @ lam_g

    def at_nodes(self, s: NlpSolution) -> NlpSolution:
        """A solution as one of the given program, its limits tightened at the nodes to where the enforced ones keep it."""
        lam, g, b = self.M.T @ s.lam_g, self.inverse @ s.g, s.bounds
        low, high = (np.where(self.touched, *pair) for pair in ((self.given.lbg, b.low_g), (self.given.ubg, b.high_g)))
        up, down = self.touched & (lam > NOISE), self.touched & (lam < -NOISE)
        high[up], low[down] = g[up], g[down]
        return replace(s, transcription=self.given, lam_g=lam, g=g, bounds=Bounds(b.low_z, b.high_z, low, high))


def enforced_in(s: NlpSolution) -> Chosen:
    """Which path limits a solution enforces between the nodes, seen from its bounds: those that are tightened, if enforcing pays."""
    t, b = s.transcription, s.bounds
    drawn, found = ((b.low_g != t.lbg) | (b.high_g != t.ubg)) & holds(t), nothing_enforced(t)
    for name, enforced in found.items():
        for column, nodes in zip(enforced.T, limit_nodes(t, name), strict=False):  # path limits come first
            column[:] = drawn[nodes - len(t.scale)].any(axis=1)
    return found


def of_limits(s: NlpSolution) -> np.ndarray:
    """Multipliers by the side of their limit: of the hull where a limit is enforced, for its nodes' have both signs."""
    groups, touched = _touching(s.transcription, enforced_in(s))
    return _by_blocks(groups, np.flatnonzero(~touched), invert=False).T @ s.lam_g


def enforcing(t: Transcription, chosen: Chosen) -> Enforced:
    """The program of ``t`` with the chosen limits enforced between the nodes."""
    groups, touched = _touching(t, chosen)
    inverse, M = (_by_blocks(groups, np.flatnonzero(~touched), invert) for invert in (False, True))
    p, other = t.program, copy(t)
    if groups:
        terms = (replace(term, scatter=_on_rows(M, term.scatter)) for term in p.phases)
        other.program = replace(p, linear=csc(M @ p.linear), phases=tuple(terms))
    return Enforced(t, chosen, other, inverse, M, touched)


def _touching(t: Transcription, chosen: Chosen) -> tuple[list[tuple[PhaseLayout, np.ndarray]], np.ndarray]:
    """The groups of rows of the chosen limits, and for every row whether it is among them."""
    groups, touched = list(_groups(t, chosen)), np.zeros(len(t.lbg), dtype=bool)
    for _, rows in groups:
        touched[rows] = True
    return groups, touched


def _groups(t: Transcription, chosen: Chosen) -> Iterator[tuple[PhaseLayout, np.ndarray]]:
    """Layout of a phase and rows, (intervals, nodes), of each limit that is enforced somewhere."""
    for name, enforced in chosen.items():
        for nodes, at in zip(limit_nodes(t, name), enforced.T, strict=False):  # path limits come first
            if at.any():
                yield t.layouts[name], nodes[at] - len(t.scale)


def _by_blocks(groups: list[tuple[PhaseLayout, np.ndarray]], rest: np.ndarray, invert: bool) -> Matrix:
    """B (or its inverse) for each group of rows, 1 for the rest."""
    i, j, value = [rest], [rest], [np.ones(len(rest))]
    for layout, rows in groups:
        B = bernstein(layout.scheme.control_c)
        i.append(np.repeat(rows, len(B), axis=1).ravel())
        j.append(np.tile(rows, (1, len(B))).ravel())
        value.append(np.tile((np.linalg.inv(B) if invert else B).ravel(), len(rows)))
    size = sum(len(part) for part in (rest, *(rows.ravel() for _, rows in groups)))
    return csc((np.concatenate(value), (np.concatenate(i), np.concatenate(j))), (size, size))


def _on_rows(M: Matrix, scatter: Matrix) -> Matrix:
    """M times the rows of the program, what comes after them as it is."""
    rows = M.shape[0]
    return csc(sparse.vstack([M @ scatter[:rows], scatter[rows:]]))
