"""Of solutions that are equally good, one whose chosen quantities change less: last solves on the settled mesh or a finer one.

What an objective hardly depends on, it leaves to the solver, which leaves saw teeth there. The roughness of a quantity r,
over a whole duration T with times s = t / T from 0 to 1, is

    Phi = integral of phi(dr/ds) ds,  phi(d) = STEEP^2 (sqrt(1 + (d / STEEP)^2) - 1)

A slope below STEEP counts by its square, so that saw teeth vanish; a steeper one by itself alone, so that the jumps of an optimum
stay: they are total variation. In every interval r is the polynomial through its values at the abscissae. A jump at an edge
counts as a slope over a JUMP-th of the interval.

The settled program is solved again with epsilon times Q added to its cost: Q = 1/2 sum of w d^2 with weights w = phi'(d) / d of
the last solution lies above Phi and touches it there (iteratively reweighted least squares). What is best for the sum cannot
have lost more than epsilon Q of the last solution. So epsilon is what may be lost, over that Q. Where a limit is passed between
the nodes, it is enforced or tightened there, and the program solved again. Where its local error is more than is allowed, the
settled solution is solved on a mesh that is finer there, and smoothed. Where a program is not solved, or too much is lost, it is
solved with a smaller epsilon.
"""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import casadi as ca
import numpy as np
from numpy.polynomial import legendre
from scipy.sparse import diags_array

from hopopt.nlp.layout import Stage
from hopopt.nlp.program import Program
from hopopt.nlp.refinement.continuous_limits import Chosen, Enforced, coming_close, enforced_in, enforcing, holds
from hopopt.nlp.refinement.interval_errors import interval_errors
from hopopt.nlp.refinement.mesh_refinement import MET, Refinement
from hopopt.nlp.refinement.next_mesh import AIM, PIECES, Aims
from hopopt.nlp.refinement.tightening import Errors, passed, tightened
from hopopt.nlp.refinement.tightening_cost import BARRIER
from hopopt.nlp.schemes import Scheme, lagrange
from hopopt.nlp.solver.ipopt import WAYS, Bounds, NlpSolution, NlpSolver
from hopopt.nlp.terms import Local, Matrix, Term, Triplets, assemble, blocks, csc, stacked, together
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.problem import Instant, stack, symbols

STEEP = 10.0  # slope per duration: what changes by its whole size in a tenth of the hop or faster is a jump
JUMP = 20  # parts of an interval: over one of them a jump is a slope
SOLVES = 2  # each with the weights of the one before
MOST_SOLVES = 9  # where some are not solved, or pass what they may not
SHARE = 0.1  # of the allowance that a solve may lose: with all of it solo12_leg is not solved
MOST_MESHES = 2  # that are finer where a smoother solution errs
LESS = 0.1  # of the share, where so much spoils a solve
LEAST = 1e-12  # Q of what is smooth already
OPTIONS = WAYS[0] | {"ipopt.max_iter": 60}  # more of them are spent on what is not solved after all
ALLOWANCE = "the weight on smoothness, which spends at most a tenth of what may be lost"  # what limits a smooth solution, in words
UNSOLVED = "programs that were not solved with a larger weight on smoothness"
LOCAL_ERROR = "the local error of the intervals"
TIGHTENED = "limits that are passed between the nodes, and cost more to be kept there"
# What is to be smooth at an instant of a phase, by its name, dimensionless.
Quantities = Callable[[str, Instant], ca.SX]


@dataclass(frozen=True)
class Roughness(Program):
    """A program to whose cost half the square of what ``parts`` add up to is added."""

    parts: tuple[Term, ...] = ()

    def _residuals(self, z: ca.MX, p: ca.MX) -> ca.MX:
        """What is squared."""
        return sum((term.values(z, p) for term in self.parts), ca.MX(0))

    def _slope(self, z: ca.MX, p: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Residuals and their derivative by z."""
        found = [term.jacobian(z, p) for term in self.parts]
        value: ca.MX = sum((v for v, _ in found), ca.MX(0))
        return value, assemble((value.numel(), self.linear.shape[1]), [slope for _, slope in found])

    @cached_property
    def nlp(self) -> dict[str, ca.MX]:
        """x, p, f, g for nlpsol."""
        own = super().nlp
        return {**own, "f": own["f"] + ca.sumsqr(self._residuals(own["x"], own["p"])) / 2}

    def grad_f(self) -> ca.Function:
        """(x, p) -> f, gradient."""
        z, p = self.symbols()
        f, gradient = super().grad_f()(z, p)
        r, J = self._slope(z, p)
        outputs = [f + ca.sumsqr(r) / 2, gradient + J.T @ r]
        return ca.Function("nlp_grad_f", [z, p], outputs, ["x", "p"], ["f", "grad"])

    def hess_lag(self) -> ca.Function:
        """(x, p, lam_f, lam_g) -> upper triangle of the Hessian of lam_f f + lam_g' g."""
        (z, p), n = self.symbols(), self.linear.shape[1]
        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", self.linear.shape[0])
        r, J = self._slope(z, p)
        H = super().hess_lag()(z, p, lam_f, lam_g) + lam_f * ca.triu(J.T @ J)
        H += assemble((n, n), [term.hessian(z, p, lam_f * r) for term in self.parts if term.local.curved])
        inputs, names = [z, p, lam_f, lam_g], ["x", "p", "lam_f", "lam_g"]
        return ca.Function("nlp_hess_l", inputs, [H], names, ["hess"])


@dataclass(frozen=True)
class Slopes:
    """Slopes of the quantities, S times their values at all points, and their measures, which add up to what the phases last.

    terms: of each phase, whose values add up to the slopes
    measure: share of the duration in which a slope holds
    """

    terms: tuple[Term, ...]
    measure: np.ndarray

    @classmethod
    def of(cls, solution: NlpSolution, quantities: Quantities) -> "Slopes":
        """With the times of a solution."""
        t = solution.transcription
        own = [_local(t, layout.stage, quantities) for layout in t.layouts.values()]
        (count,) = {local.outputs.numel() for local in own}
        found, measure = _slopes(t.scheme, [p.lengths for p in solution.phases.values()])
        scatters = (
            _scatter(S, count, len(measure), phase.points) for S, phase in zip(found, t.program.phases, strict=True)
        )
        terms = zip(own, t.program.phases, scatters, strict=True)
        return cls(tuple(Term(local, phase.gather, S) for local, phase, S in terms), np.repeat(measure, count))

    @cached_property
    def _values(self) -> ca.Function:
        z, p = ca.MX.sym("z", self.terms[0].gather.shape[1]), ca.MX.sym("p", self.terms[0].local.extra.numel())
        return ca.Function("slopes", [z, p], [sum((term.values(z, p) for term in self.terms), ca.MX(0))])

    def at(self, solution: NlpSolution) -> np.ndarray:
        """The slopes of a solution of the same program."""
        return np.array(self._values(solution.z, solution.p)).ravel()

    def roughness(self, solution: NlpSolution) -> float:
        """Phi."""
        return float(self.measure @ (STEEP**2 * (np.sqrt(1 + (self.at(solution) / STEEP) ** 2) - 1)))

    def weighted(self, solution: NlpSolution) -> tuple[np.ndarray, float]:
        """The weights of squares of slopes that a solution gives, and its own Q."""
        d = self.at(solution)
        weight = self.measure / np.sqrt(1 + (d / STEEP) ** 2)
        return weight, float(weight @ d**2) / 2

    def added_to(self, p: Program, weight: np.ndarray) -> Roughness:
        """A program with half the weighted sum of their squares in its cost."""
        root = diags_array(np.sqrt(weight))
        parts = (replace(term, scatter=csc(root @ term.scatter)) for term in self.terms)
        return Roughness(p.linear, p.phases, p.rows, p.ends, p.count, tuple(parts))


@dataclass(frozen=True)
class Smoothed:
    """A solution whose quantities are smoother.

    solution: it
    roughness: Phi
    limited: what kept it from being smoother: what may be lost, or why only a part of that was spent
    """

    solution: NlpSolution
    roughness: float
    limited: str


def smoothed(solution: NlpSolution, quantities: Quantities, allowance: float, aims: Aims) -> Smoothed | None:
    """A solution whose quantities are smoother, on the same mesh or a finer one; None if none is found.

    solution: of the settled mesh, with its multipliers and bounds
    quantities: as many in every phase
    allowance: by how much the objective may be worse [its unit]
    aims: by how much limits may be passed between the nodes, how large the local error may be, how long it may take
    """
    slopes, last, found = Slopes.of(solution, quantities), solution, list[Smoothed]()
    chosen, bounds, share, limited, meshes = enforced_in(solution), None, SHARE, ALLOWANCE, MOST_MESHES
    for _ in range(MOST_SOLVES):
        weight, Q = slopes.weighted(last)
        t = copy(solution.transcription)
        t.program = slopes.added_to(t.program, weight * share * allowance / max(Q, LEAST))
        enforced = enforcing(t, chosen)
        bounds = bounds or _settled_bounds(solution, enforced)
        begin = replace(last, lam_g=enforced.multipliers(last.lam_g))
        again = NlpSolver(enforced.transcription, OPTIONS, until=aims.until).again(begin, bounds)
        if not again.success:
            share, limited = LESS * share, UNSOLVED
            continue
        nodal = enforced.at_nodes(again)
        errors = {name: interval_errors(nodal, name) for name in nodal.phases}
        if max(float(e.local.max()) for e in errors.values()) > aims.local_error:
            if meshes and (finer := _finer(solution, errors, aims)) is not None:
                solution = last = finer
                slopes, chosen, bounds, meshes = Slopes.of(finer, quantities), enforced_in(finer), None, meshes - 1
            else:
                share, limited, meshes = LESS * share, LOCAL_ERROR, 0
            continue
        last = nodal
        if max(float(e.excess.max()) for e in errors.values()) > aims.excess:
            chosen, bounds = _stricter(last, errors, chosen, bounds, aims.excess)
            continue
        plain = _without_roughness(last, solution.transcription)
        if t.problem.objective.cost(plain.objective - solution.objective) > allowance:
            share, limited = LESS * share, TIGHTENED
            continue
        found.append(Smoothed(plain, slopes.roughness(plain), limited))
        if len(found) == SOLVES:
            break
    return min(found, key=lambda s: s.roughness, default=None)


def _finer(s: NlpSolution, errors: Errors, aims: Aims) -> NlpSolution | None:
    """The settled solution on a mesh that is finer where a smoother one errs by more than is allowed; None if it is not solved."""
    order = len(s.transcription.scheme.c) + 1
    pieces = {}
    for name, e in errors.items():
        asked = np.ceil((e.local / (AIM * aims.local_error)) ** (1 / order))
        pieces[name] = np.where(e.local > AIM * aims.local_error, np.clip(asked, 2, PIECES), 1).astype(int)
    finer = Refinement(s, aims, enforced=enforced_in(s)).on_pieces(pieces)
    return None if finer is None or finer.ended != MET else finer.solution


def _without_roughness(s: NlpSolution, t: Transcription) -> NlpSolution:
    """A solution as a point of the program ``t`` that has its own objective alone."""
    cost = ca.Function("cost", [t.nlp["x"], t.nlp["p"]], [t.nlp["f"]])(s.z, s.p)
    return replace(s, transcription=t, objective=t.problem.objective.cost(float(cost)))


def _settled_bounds(s: NlpSolution, enforced: Enforced) -> Bounds:
    """The bounds that the settled solution kept, of the rows that are enforced between the nodes too."""
    t, on, b = s.transcription, enforced.touched, s.bounds
    lam, g = enforced.multipliers(s.lam_g), enforced.M @ s.g
    least = BARRIER * t.problem.objective.scale  # a smaller multiplier times its distance is Ipopt's own
    with np.errstate(invalid="ignore"):
        up, down = lam * (t.ubg - g) > least, -lam * (g - t.lbg) > least
    high = np.where(on, np.where(up & np.isfinite(t.ubg), g, t.ubg), b.high_g)
    low = np.where(on, np.where(down & np.isfinite(t.lbg), g, t.lbg), b.low_g)
    return Bounds(b.low_z, b.high_z, low, high)


def _scatter(S: Triplets, count: int, rows: int, points: int) -> Matrix:
    return together([blocks(S, np.eye(count), count, count)], (rows * count, points * count))


def _local(t: Transcription, stage: Stage, quantities: Quantities) -> Local:
    """The quantities at one point, of the same inputs as the phase's right-hand sides."""
    problem, phase = t.problem, stage.phase
    x, u, p = symbols(phase.states), symbols(phase.controls), symbols(problem.parameters)
    time, T = ca.SX.sym("t"), ca.SX.sym("T")
    free, fixed = (stack(p, [q for q in problem.parameters if q.free is kind]) for kind in (True, False))
    y = ca.vertcat(stack(x, phase.states), stack(u, phase.controls), time, free, T)
    return Local(f"smooth_{phase.name}", y, fixed, ca.densify(quantities(phase.name, Instant(t=time, p=p, **x, **u))))


def _slopes(scheme: Scheme, lengths: list[np.ndarray]) -> tuple[list[Triplets], np.ndarray]:
    """For phases with intervals of these lengths [s], one after another: the matrices that take the values of a quantity at each
    phase's points, and whose sum is its slopes; and the measure of each slope."""
    total, n, rows = sum(float(h.sum()) for h in lengths), len(scheme.c), 0
    within, share = _within(scheme)
    begin, end = (lagrange(scheme.c, s) for s in (0.0, 1.0))
    found, measure = [list[Triplets]() for _ in lengths], list[np.ndarray]()
    for own, h in zip(found, lengths, strict=True):
        every = np.arange(len(h))
        own.append(blocks((total / h, every, every), within, len(within), n, rows))
        measure.append(np.outer(h / total, share).ravel())
        rows += len(within) * len(h)
    edges = [(k, i) for k, h in enumerate(lengths) for i in range(len(h))]
    for (a, i), (b, j) in pairwise(edges):
        width = (lengths[a][i] + lengths[b][j]) / (2 * JUMP * total)
        found[a].append(blocks((np.array([-1 / width]), np.array([0]), np.array([i])), end, 1, n, rows))
        found[b].append(blocks((np.array([1 / width]), np.array([0]), np.array([j])), begin, 1, n, rows))
        measure.append(np.array([width]))
        rows += 1
    return [stacked(own) for own in found], np.concatenate(measure)


def _within(scheme: Scheme) -> tuple[np.ndarray, np.ndarray]:
    """Slopes at as many Gauss points of [0, 1] as make the integral of their squares exact, from values at the abscissae; and the
    points' weights."""
    n = len(scheme.c)
    s, w = legendre.leggauss(n - 1)
    powers = np.arange(1, n) * ((s[:, None] + 1) / 2) ** np.arange(n - 1)
    return powers @ np.linalg.inv(np.vander(scheme.c, n, increasing=True))[1:], w / 2


def _stricter(s: NlpSolution, errors: Errors, chosen: Chosen, bounds: Bounds, excess: float) -> tuple[Chosen, Bounds]:
    """What is to be enforced between the nodes, and the bounds, after a solution that passes limits there."""
    if not holds(s.transcription):
        return chosen, tightened(bounds, s.transcription, {name: passed(e, excess) for name, e in errors.items()})
    close, amounts, enforced = coming_close(s, errors, excess), {}, {}
    for name, e in errors.items():
        smooth, over = s.transcription.layouts[name].stage.smooth, passed(e, excess)
        fresh = np.zeros(e.below.shape, dtype=bool)
        fresh[:, : len(smooth)] = ~chosen[name] & smooth
        amounts[name] = np.where(fresh, 0.0, over)
        enforced[name] = chosen[name] | (close[name] & smooth)
    return enforced, tightened(bounds, s.transcription, amounts)
