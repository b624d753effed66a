"""Flat directions: what of an optimum can move, all else following, without a change of the objective.

A quantity c'z is moved by d. Everything else may follow within the rows and the limits that act. To second order the
objective then changes by k d^2 / 2, with k = 1 / (c' C c). C is the inverse of

    W + D_z + A' D_g A

    W  second derivative of the Lagrangian
    A  derivative of the rows
    D  multiplier / distance of each limit: large where it acts, near 0 where it does not

C is the reduced Hessian's inverse in the tangent space of what acts (Nocedal and Wright, Numerical Optimization, 16.2
and 17.1). D is at most S, and what acts gives way by 1 / S. From C of two values of S the limit without it is
extrapolated (Richardson). A change far above INSENSITIVE is still understated where limits act. Where C has no bound,
the objective does not depend on the move.

The quantities asked are the means of every control over tenths of its phase, each duration and each free parameter.
They are means, because a control at a single node matters the less, the finer the mesh.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Any

import casadi as ca
import numpy as np
from pydantic import PlainSerializer, PlainValidator, WithJsonSchema
from scipy import sparse
from scipy.sparse.linalg import splu

from hopopt.nlp.solver.ipopt import Bounds, NlpSolution, NlpSolver
from hopopt.nlp.terms import Matrix, csc
from hopopt.ocp.problem import Component
from hopopt.record import Strict, stated

BLOCKS = 10  # of a phase, over which a control is averaged
INSENSITIVE = (
    1e-4  # relative change of the objective, if a quantity is moved by its whole range, below which it is flat
)
LEAST_ACTING_MULTIPLIER = 1e-7  # of the objective: a multiplier below it (scaled limit by its scale) comes of a tie-break, not of the objective
HELD = 1e-8  # added to W for each variable, of the objective: what stands for no bound
MOST_GAIN = 1e6  # most that a limit that acts may gain, of the objective
SOFTER = 10.0  # times less, to see what gives way
INEXACT = 1e-11  # backward error of a solve that is not believed: with MOST_GAIN, well below FELT
PIVOTS = (  # none first: a symmetric matrix that is nearly definite then stays as sparse as intervals in a row are
    {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}},
    {},
)
UNUSED_CONTROL = 1e-3  # largest scaled value below which a control counts as unused; its scale is taken instead
STRETCH = 0.1  # of a duration, by which it is moved when all else is optimised anew
DIRECTION_ITERATIONS = 200
InJson = Annotated[  # the name of a component is a text there
    Component, PlainValidator(Component), PlainSerializer(str), WithJsonSchema({"type": "string"})
]
Who = tuple[str, str, Component, tuple[float, float] | None]


class NotInvertible(ArithmeticError):
    """The second derivatives at the optimum cannot be inverted."""


@dataclass(frozen=True)
class Flat(Strict):
    """A quantity to which the objective is insensitive."""

    kind: str = stated("duration, control or parameter")
    phase: str = stated("in which phase")
    name: InJson = stated("which component")
    when: tuple[float, float] | None = stated("from when to when [s since the phase began]")
    felt: float = stated("largest relative change of the objective if it moved by its whole range")


def flat(solution: NlpSolution, allowed: float = INSENSITIVE) -> list[Flat]:
    """To what the objective is insensitive at an optimum of the program (which has no tie-break); raises NotInvertible."""
    found = [q for q in sensitivities(solution) if q.felt < allowed]
    joined: list[Flat] = []
    for q in found:
        last = joined[-1] if joined else None
        if last and q.when and last.when and (last.phase, last.name, last.when[1]) == (q.phase, q.name, q.when[0]):
            joined[-1] = Flat(q.kind, q.phase, q.name, (last.when[0], q.when[1]), max(last.felt, q.felt))
        else:
            joined.append(q)
    return joined


def sensitivities(solution: NlpSolution) -> list[Flat]:
    """Every quantity asked, with how far the objective depends on it."""
    asked = list(_quantities(solution))
    stiffness = _stiffness(solution, [c for _, c, _ in asked])
    size = _size(solution)
    return [
        Flat(*who, float(0.5 * abs(k) * reach**2 / size)) for (who, _, reach), k in zip(asked, stiffness, strict=True)
    ]


def _size(solution: NlpSolution) -> float:
    goal = solution.transcription.problem.objective
    return max(abs(solution.objective), 1e-3 * goal.scale)


def _quantities(solution: NlpSolution) -> Iterator[tuple[Who, np.ndarray, float]]:
    """(kind, phase, name, when), the row c, and the range of each quantity, in the scaled variables."""
    t = solution.transcription
    for name, where in t.variables.items():
        c = _row(solution, where.durations)
        yield ("duration", name, Component("duration"), None), c, float(c @ solution.z)
        yield from _means(solution, name)
    labels = [label for p in t.free for label in p.components()]
    for at, label in enumerate(labels, t.parameters.start):
        yield ("parameter", "", label, None), _row(solution, at), max(abs(float(solution.z[at])), 1e-3)


def _means(solution: NlpSolution, phase: str) -> Iterator[tuple[Who, np.ndarray, float]]:
    """The means of a phase's controls over the intervals of each of its tenths."""
    t, trajectory = solution.transcription, solution.phases[phase]
    layout, where = t.layouts[phase], t.variables[phase]
    labels = [label for u in layout.phase.controls for label in u.components()]
    weights = layout.control_matrix @ np.outer(trajectory.lengths, layout.scheme.b).ravel()
    interval, edges = layout.control_place[0], trajectory.edges
    block = ((edges[:-1] + edges[1:]) / 2 / trajectory.duration * BLOCKS).astype(int)[interval]
    at = np.arange(where.u.start, where.u.stop).reshape(len(interval), -1)
    for k, label in enumerate(labels):
        largest = float(np.abs(solution.z[at[:, k]]).max())
        for own in (np.flatnonzero(block == b) for b in np.unique(block)):
            when = float(edges[interval[own[0]]]), float(edges[interval[own[-1]] + 1])
            row = _row(solution, at[own, k], weights[own] / weights[own].sum())
            yield ("control", phase, label, when), row, largest if largest > UNUSED_CONTROL else 1.0


def _row(solution: NlpSolution, at: Any, weights: Any = 1.0) -> np.ndarray:
    c = np.zeros(len(solution.z))
    c[at] = weights
    return c


def _stiffness(solution: NlpSolution, rows: list[np.ndarray]) -> np.ndarray:
    """k of each row c; those that cannot move at all have none but the stiffest."""
    t, size = solution.transcription, _size(solution)
    g, A = t.program.jac_g().call([ca.DM(solution.z), ca.DM(solution.p)])
    W = t.program.hess_lag().call([ca.DM(solution.z), ca.DM(solution.p), ca.DM(1.0), ca.DM(solution.lam_g)])[0].sparse()
    W = W + sparse.triu(W, 1).T
    values = np.array(g).ravel()
    stiff, softer = (_moved(solution, W, A.sparse().tocsr(), values, rows, S) for S in (MOST_GAIN, MOST_GAIN / SOFTER))
    moved = stiff - (softer - stiff) / (SOFTER - 1)
    return 1 / np.maximum(np.abs(moved), 1 / (MOST_GAIN * size))


def _moved(
    solution: NlpSolution, W: Matrix, A: Matrix, g: np.ndarray, rows: list[np.ndarray], most: float
) -> np.ndarray:
    """c' C c of each row c, where what acts gains at most so much of the objective."""
    b, size = solution.bounds, _size(solution)
    movable = b.low_z < b.high_z
    on_z = _acting(solution.lam_x, solution.z, b.low_z, b.high_z, size, most)
    on_g = _acting(solution.lam_g, g, b.low_g, b.high_g, size, most)
    held = on_g > 0
    top = (W + sparse.diags(on_z + HELD * size)).tocsr()[movable][:, movable]
    A = A[held][:, movable]
    C = np.array(rows)[:, movable]
    return np.einsum("ij,ji->i", C, solved(csc(top + A.T @ sparse.diags(on_g[held]) @ A), C.T))


def solved(matrix: Matrix, right: np.ndarray) -> np.ndarray:
    """matrix^-1 right, (n, k); NotInvertible if it has none."""
    for pivots in PIVOTS:
        try:
            x = splu(matrix, **pivots).solve(right)
        except RuntimeError:  # exactly singular
            continue
        wrong, size = np.abs(matrix @ x - right), abs(matrix) @ np.abs(x)
        if (wrong.max(axis=0) <= INEXACT * size.max(axis=0)).all():  # never of what is not a number
            return x
    raise NotInvertible("the second derivatives at the optimum cannot be inverted")


def _acting(
    lam: np.ndarray, value: np.ndarray, low: np.ndarray, high: np.ndarray, size: float, stiffest: float
) -> np.ndarray:
    """multiplier / distance of each limit, at most the stiffest, which equations have; 0 for those that do not act."""
    push, most = np.abs(lam), stiffest * size
    acts = push > LEAST_ACTING_MULTIPLIER * size
    distance = np.where(lam > 0, high - value, value - low)
    found = np.zeros(len(lam))
    found[acts] = push[acts] / np.maximum(distance[acts], push[acts] / most)
    return np.where(low == high, most, found)


def longer_or_shorter(solution: NlpSolution, phase: str) -> dict[str, float | None]:
    """By which share of itself the objective gets worse if the phase lasts STRETCH of its time shorter or longer and
    all else is optimised anew: where limits take turns, second derivatives at the optimum do not tell. None where the
    phase's limits, or any others, do not allow it (or the solver found no way)."""
    t, where = solution.transcription, solution.transcription.variables[phase]
    b = Bounds(*t.bounds(t.guess_from(solution.phases)), t.lbg, t.ubg)  # nothing tightened, or held at a switch
    shortest, longest = t.problem.phase(phase).duration
    cost, changes = t.problem.objective.cost, dict[str, float | None]()
    solver = NlpSolver(t, {"ipopt.max_iter": DIRECTION_ITERATIONS})
    for name, factor in (("shorter", 1 - STRETCH), ("longer", 1 + STRETCH)):
        low, high = b.low_z.copy(), b.high_z.copy()
        low[where.durations] = high[where.durations] = factor * solution.z[where.durations]
        changes[name] = None
        if shortest <= factor * solution.phases[phase].duration <= longest:
            found = solver(
                t.guess_from(solution.phases), solution.parameters, bounds=replace(b, low_z=low, high_z=high)
            )
            if found.success:
                changes[name] = cost(found.objective - solution.objective) / _size(solution)
    return changes
