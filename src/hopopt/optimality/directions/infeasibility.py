"""Which limits cannot hold together: the same program with every limit loosened by as little as it takes.

    least sum of s_k   with   low_k - s_k <= value <= high_k + s_k   at all places of constraint k at once,

scaled. The dynamics, what the phases hand over and the initial state are kept. This is an elastic program (Chinneck,
Feasibility and Infeasibility in Optimization, 2008, chapter 6). Where s_k > 0, the limit has to give. A limit that
pushes against those (its multiplier) cannot hold together with them.
"""

from collections.abc import Hashable
from dataclasses import dataclass
from itertools import pairwise

import casadi as ca
import numpy as np

from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.solver.casadi_solver import CasadiSolver
from hopopt.nlp.solver.ipopt import OPTIONS, NlpSolution, time_given
from hopopt.nlp.terms import csc, to_dm
from hopopt.optimality.limits import Limit, limits

GIVES = 1e-5  # scaled amount below which a limit counts as kept
LEAST_CONFLICT_SHARE = (
    1e-2  # least share in the others' giving for a limit to be named: 1 range of it equals 1 % of their range
)
NEAR_WEIGHT = 1e-6  # weight that keeps the point where it began in directions that no limit depends on
SHORTEST_DURATION = 1e-2  # of its own lower bound: what a duration may be loosened to
LEAST_ROOM = 1e-2  # scaled amount by which the first point has more room than it needs
CONFLICT_ITERATIONS = 300


@dataclass(frozen=True)
class ConflictPart:
    """What one limit has to do with a conflict.

    gives: by how much it has to be loosened, in its unit, 0 if it is kept; share: by how much of a scale the others
    would have to give less if it were loosened by one of its own; when: (first, last) time [s] at which it pushes.
    """

    limit: Limit
    gives: float
    share: float
    when: tuple[float, float]


@dataclass(frozen=True)
class Conflict:
    """The limits that cannot hold together.

    parts: those that have to give first; none if all hold at a point nearby.
    helps: by which share of it all giving would shrink if a parameter of the program grew to (1 + share) of its size.
    z: the scaled variables where limits give least (n,).
    """

    parts: tuple[ConflictPart, ...]
    helps: dict[str, float]
    z: np.ndarray


def conflict(solution: NlpSolution, until: Deadline = NEVER) -> Conflict | None:
    """What cannot hold together near the solution's point; None if that cannot be told, or not in time."""
    found = limits(solution)
    loose = _Loosened(solution, found)
    z, s, lam = loose.solve(time_given(until))
    if lam is None:
        return None
    if s.max(initial=0.0) <= GIVES:
        return Conflict((), {}, z)
    push = _net(found, [lam[loose.owner == k] for k in range(len(found))])
    parts = [_part(limit, float(s[loose.group[k]]), push[k]) for k, limit in enumerate(found)]
    order = sorted(_named(parts), key=lambda p: (not p.gives, -max(p.gives / p.limit.scale, p.share)))
    helps = _helps(solution, z, loose.Q[:, : len(solution.g)].T @ lam, float(s.sum()))
    return Conflict(tuple(order), helps, z)


def _net(found: list[Limit], lam: list[np.ndarray]) -> list[np.ndarray]:
    """Multipliers of every limit; where both sides of one press on each other, as an equation's do, what is left."""
    for k, (lower, upper) in enumerate(pairwise(found)):
        if upper.upper and not lower.upper and np.array_equal(lower.places, upper.places):
            both = lam[k] + lam[k + 1]
            lam[k], lam[k + 1] = np.minimum(both, 0.0), np.maximum(both, 0.0)
    return lam


def _named(parts: list[ConflictPart]) -> list[ConflictPart]:
    """What pushes enough to be told, and of every constraint that has to give at least what pushes most."""
    most: dict[tuple[Hashable, ...], float] = {}
    for p in parts:
        most[p.limit.group] = max(most.get(p.limit.group, 0.0), p.share)
    return [p for p in parts if p.share > LEAST_CONFLICT_SHARE or (p.gives and p.share == most[p.limit.group])]


def _part(limit: Limit, s: float, lam: np.ndarray) -> ConflictPart:
    push = np.abs(lam)
    times = limit.times[push >= 0.1 * push.max()]
    when = float(times.min()), float(times.max())
    return ConflictPart(limit, s * limit.scale if s > GIVES else 0.0, float(push.sum()), when)


def _helps(solution: NlpSolution, z: np.ndarray, lam_g: np.ndarray, total: float) -> dict[str, float]:
    """- d ln(total) / d ln(p) of each fixed parameter, from the multipliers of the rows."""
    t = solution.transcription
    slope = ca.gradient(ca.dot(ca.DM(lam_g), t.nlp["g"]), t.nlp["p"])
    by_p = np.array(ca.Function("slope", [t.nlp["x"], t.nlp["p"]], [slope])(z, solution.p)).ravel()
    shares, at = -by_p * solution.p / total, 0
    found = {}
    for p in t.fixed:
        found[p.name] = float(shares[at : at + p.size].sum())
        at += p.size
    return dict(sorted(found.items(), key=lambda pair: -abs(pair[1])))


class _Loosened:
    """The elastic program: variables (z, s), rows Q (g, z) + S s; ``owner`` (rows,): a row's limit, -1 if it is kept;
    ``group``: which s loosens each limit."""

    def __init__(self, solution: NlpSolution, found: list[Limit]):
        self.solution, self.limits, t = solution, found, solution.transcription
        rows, n = len(t.lbg), len(t.scale)
        soft = np.unique(np.concatenate([limit.places for limit in found]))
        given = np.isfinite(t.lbg) | np.isfinite(t.ubg)
        kept = np.setdiff1d(np.flatnonzero(given), soft)
        self.place = np.concatenate([kept, *(limit.places for limit in found)])
        self.owner = np.concatenate([np.full(len(kept), -1), *(np.full(len(f.places), k) for k, f in enumerate(found))])
        self.loose_z = soft[soft >= rows] - rows
        at, own = np.arange(len(self.place)), self.owner >= 0
        self.Q = csc((np.ones(len(at)), (at, self.place)), (len(at), rows + n))
        groups = list(dict.fromkeys(f.group for f in found))
        self.group, self.slacks = np.array([groups.index(f.group) for f in found]), len(groups)
        sign = np.array([-1.0 if f.upper else 1.0 for f in found])[self.owner[own]]
        self.S = csc((sign, (at[own], self.group[self.owner[own]])), (len(at), len(groups)))

    def solve(self, seconds: float) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """z, s and the rows' multipliers; none if the solver gave up or had no more time."""
        last, n = self.solution, len(self.solution.z)
        low_z, high_z, low, high = self._bounds()
        values = np.concatenate([last.g, last.z])[self.place]
        over = np.maximum(np.maximum(low - values, values - high), 0.0)
        s, own = np.full(self.slacks, LEAST_ROOM), self.owner >= 0
        np.maximum.at(s, self.group[self.owner[own]], over[own] + LEAST_ROOM)
        solver, none, endless = self._solver(seconds), np.zeros(len(s)), np.full(len(s), np.inf)
        bounds = {"lbx": np.r_[low_z, none], "ubx": np.r_[high_z, endless], "lbg": low, "ubg": high}
        result = solver(x0=np.r_[last.z, s], p=last.p, **bounds)
        x, lam = (np.array(result[k]).ravel() for k in ("x", "lam_g"))
        return x[:n], x[n:], lam if solver.stats()["success"] else None

    def _bounds(self) -> tuple[np.ndarray, ...]:
        """low and high of z (open where a limit is loosened; a duration stays positive) and of the rows."""
        t = self.solution.transcription
        low_z, high_z = t.bounds(t.guess_from(self.solution.phases))
        low, high = (np.concatenate(side)[self.place] for side in ((t.lbg, low_z), (t.ubg, high_z)))
        upper, own = np.array([f.upper for f in self.limits]), self.owner >= 0
        low[own & upper[self.owner]], high[own & ~upper[self.owner]] = -np.inf, np.inf
        shortest = SHORTEST_DURATION * low_z
        low_z[self.loose_z], high_z[self.loose_z] = -np.inf, np.inf
        for where in t.variables.values():
            low_z[where.durations] = np.maximum(low_z[where.durations], shortest[where.durations])
        return low_z, high_z, low, high

    def _solver(self, seconds: float) -> CasadiSolver:
        t, near, n, m = self.solution.transcription, self.solution.z, len(self.solution.z), self.slacks
        x, p = ca.MX.sym("x", n + m), ca.MX.sym("p", t.nlp["p"].numel())
        z, s = x[:n], x[n:]
        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", self.Q.shape[0])
        Qg, Qz, S = (to_dm(part) for part in (self.Q[:, : len(t.lbg)], self.Q[:, len(t.lbg) :], self.S))
        g = ca.Function("g", [t.nlp["x"], t.nlp["p"]], [t.nlp["g"]])(z, p)  # may be differentiated by p
        _, slope = t.program.jac_g()(z, p)
        away = z - ca.DM(near)
        f, rows = ca.sum1(s) + NEAR_WEIGHT / 2 * ca.dot(away, away), Qg @ g + Qz @ z + S @ s
        gradient, jacobian = ca.vertcat(NEAR_WEIGHT * away, ca.DM.ones(m)), ca.horzcat(Qg @ slope + Qz, S)
        bend = t.program.hess_lag()(z, p, 0, Qg.T @ lam_g) + lam_f * NEAR_WEIGHT * ca.MX(ca.DM.eye(n))
        hessian = ca.triu(ca.diagcat(bend, ca.MX(m, m)))
        more = {"ipopt.tol": 1e-7, "ipopt.max_iter": CONFLICT_ITERATIONS, "ipopt.max_wall_time": seconds}
        derivatives = {
            "grad_f": ca.Function("nlp_grad_f", [x, p], [f, gradient], ["x", "p"], ["f", "grad"]),
            "jac_g": ca.Function("nlp_jac_g", [x, p], [rows, jacobian], ["x", "p"], ["g", "jac"]),
            "hess_lag": ca.Function(
                "nlp_hess_l", [x, p, lam_f, lam_g], [hessian], ["x", "p", "lam_f", "lam_g"], ["hess"]
            ),
        }
        options = OPTIONS | more | {"expand": False} | derivatives
        return CasadiSolver("ipopt", {"x": x, "p": p, "f": f, "g": rows}, options)
