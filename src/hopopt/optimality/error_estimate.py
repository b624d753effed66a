"""How far a claimed optimum may lie above (be better than) the true one: what its own faults gained.

The interpolated solution solves another problem exactly: its dynamics are perturbed by d = x_h' - f(x_h, u_h), its
limits are wider by what it passes them between the nodes. What that gained is, to first order, the integral of the
costate times d and of the limits' multipliers times the excess (dual-weighted residuals: Becker and Rannacher, An
optimal control approach to a posteriori error estimation, Acta Numerica 2001). Every interval counts with its absolute
value, so nothing cancels. Where limits of the controls are passed, the costate weighs what controls within
them would do instead: there multipliers of single nodes say too little. docs/certificate.md tells where it
fails.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pydantic import computed_field
from scipy.integrate import cumulative_trapezoid

from hopopt.nlp.layout import PhaseLayout
from hopopt.nlp.schemes import lagrange
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.optimality.minimum_principle.costates import phase_multipliers
from hopopt.optimality.minimum_principle.transversality import TransversalityConditions, transversality_conditions
from hopopt.record import Derived, Real, stated
from hopopt.verify.check import Check

STATED = 1e-4  # relative: the largest error a verified claim may have; figures are printed to about that
PANELS, POINTS = 4, 4  # of an interval, and Gauss points of each: controls have kinks where a limit takes over
PASSED = 1e-8  # scaled: an excess for which controls are brought back; less than that counts by its multiplier
CONTROL_STEP = 1e-6  # of a control's scale, for differences of limits, which are all but linear in the controls
MOST_ROUNDS = 60  # of bringing controls back to the limit that they pass most
ROUNDING = 1e-12  # relative
CURVATURE = 20.0  # of the objective, by the share of its scale that a limit of the states moves: a tenth makes a fifth

_gauss, _weights = np.polynomial.legendre.leggauss(POINTS)
NORMALISED_TIMES = np.array([0.0, *((np.arange(PANELS)[:, None] + (_gauss + 1) / 2) / PANELS).ravel(), 1.0])
WEIGHTS = np.array([0.0, *np.tile(_weights / 2 / PANELS, PANELS), 0.0])


@dataclass(frozen=True)
class ObjectiveError(Derived):
    """What each fault of the trajectories may have gained [the objective's unit].

    dynamics: states and integrals that differ from their right-hand sides between the nodes
    program: residuals of the program's equations, and a claim that the trajectories do not bear out
    second_order: by the squares of shares: those of all the above in the objective, and of the states' drift in the
        states' scales, had the controls kept their limits. To these comes CURVATURE times the square for the excess over
        limits of the states, which may be touched between the nodes.
    """

    dynamics: Real = stated("dynamics between the nodes")
    controls: Real = stated("controls beyond their limits between the nodes")
    limits: Real = stated("limits of the states that are passed")
    program: Real = stated("residuals of the nonlinear program")
    second_order: Real = stated("faults that no multiplier shows")
    size: Real = stated("what the error is relative to")

    @computed_field(description="their sum")
    @property
    def too_high_by(self) -> Real:
        """By how much the claim may be better than the true optimum [objective's unit]."""
        return self.dynamics + self.controls + self.limits + self.program + self.second_order

    @property
    def relative(self) -> float:
        """The same, relative to the objective."""
        return self.too_high_by / self.size

    def check(self) -> Check:
        """That it is small enough for the digits that are printed."""
        return Check("stated error of the objective", self.relative, STATED, "relative")


def objective_error(solution: NlpSolution) -> ObjectiveError:
    """The error of a solution's objective, from its trajectories and multipliers."""
    nodes, scheme = dict[str, np.ndarray](), solution.transcription.scheme
    for name, trajectory in solution.phases.items():
        l = solution.right_hand_sides(name, *trajectory.everywhere(np.array(scheme.c)))[2]  # noqa: E741
        nodes[name] = trajectory.lengths[:, None] * np.einsum("k,ikl->il", scheme.b, l)
    ends = transversality_conditions(solution, {name: total.sum(axis=0) for name, total in nodes.items()})
    parts = sum((_phase_gap(solution, name, ends, nodes[name]) for name in nodes), np.zeros(5))
    size = solution.magnitude
    dynamics, controls, limits, jumps, squared = (float(part) for part in parts)
    program = jumps + _program_gap(solution, ends) + ROUNDING * size
    second = (dynamics + controls + limits + program) ** 2 / size + squared * size
    return ObjectiveError(dynamics, controls, limits, program, second, size)


def _phase_gap(solution: NlpSolution, name: str, ends: TransversalityConditions, quadrature: np.ndarray) -> np.ndarray:
    """Gain by dynamics, controls, limits and jumps between intervals in one phase, and the sum of its faults' squares,
    relative to the objective, (5,)."""
    layout, trajectory = solution.transcription.layouts[name], solution.phases[name]
    m, h, weights = phase_multipliers(solution, name), trajectory.lengths, ends.phases[name]["integrals"]
    t, x, u = trajectory.everywhere(NORMALISED_TIMES)
    f, path, l = solution.right_hand_sides(name, t, x, u)  # noqa: E741
    bounds = _Limits(layout)
    inside = bounds.inside(solution, t, x, u, path)
    f_inside, path_inside, l_inside = (values.copy() for values in (f, path, l))
    if (at := np.nonzero((inside != u).any(axis=2)))[0].size:
        for old, new in zip(
            (f_inside, path_inside, l_inside), solution.right_hand_sides(name, t[at], x[at], inside[at]), strict=True
        ):
            old[at] = new
    basis = lagrange(trajectory.scheme.c, NORMALISED_TIMES)
    p, xdot = (np.einsum("kj,ijx->ikx", basis, values) for values in (m.inner, trajectory.xdot))

    def integral(by_state: np.ndarray, by_integral: np.ndarray) -> np.ndarray:
        return h * np.einsum("k,ik->i", WEIGHTS, (p * by_state).sum(axis=2) + by_integral @ weights)

    dynamics = integral(xdot - f, -l) + quadrature @ weights
    controls = integral(f - f_inside, l - l_inside)
    drift = h[:, None, None] * cumulative_trapezoid(xdot - f_inside, NORMALISED_TIMES, axis=1, initial=0.0)
    followed = solution.right_hand_sides(name, t, x - drift, inside)[
        1
    ]  # where the controls lead from the interval's start
    excess = np.maximum(
        bounds.largest_excess(x, inside, path_inside), bounds.largest_excess(x - drift, inside, followed)
    )
    mass = np.abs(m.moments(h, trajectory.scheme)).sum(axis=1)
    mass[-1] += np.abs(m.atom)
    beside = np.pad(excess, ((1, 1), (0, 0)))  # a limit's multiplier may lie one interval off
    limits = mass * np.maximum(excess, np.maximum(beside[:-2], beside[2:]))
    last = trajectory.at(np.arange(len(h)), np.ones(len(h)))[0]
    jumps = m.costate[1:] * (trajectory.x_start[1:] - last[:-1])
    whole = np.abs(h[:, None] * np.einsum("k,ikx->ix", WEIGHTS, xdot - f_inside)).sum(axis=0)
    touched = (excess.max(axis=0) / bounds.scale)[bounds.of_states]
    squared = CURVATURE * touched**2, (whole / layout.phase.columns(layout.phase.states, "scale")).max() ** 2
    return np.array([np.abs(part).sum() for part in (dynamics, controls, limits, jumps, np.hstack(squared))])


def _program_gap(solution: NlpSolution, ends: TransversalityConditions) -> float:
    """Residuals of the program times its multipliers; what the claim has beyond the trajectories."""
    b = solution.bounds
    gain = np.abs(solution.lam_g) @ _outside(solution.g, b.low_g, b.high_g)
    gain += np.abs(solution.lam_x) @ _outside(solution.z, b.low_z, b.high_z)
    gain += np.abs(ends.multiplier) @ _outside(ends.value, ends.lower, ends.upper)
    return float(gain) + abs(solution.objective - ends.objective)


class _Limits:
    """Path constraints, then bounds of states and controls, of one phase."""

    def __init__(self, layout: PhaseLayout):
        self.layout, phase = layout, layout.phase
        variables = (*phase.states, *phase.controls)
        self.lower, self.upper, self.scale = (
            np.concatenate([layout.stage.path_column(side), phase.columns(variables, side)])
            for side in ("lower", "upper", "scale")
        )
        self.control_scale = phase.columns(phase.controls, "scale")

    def excess(self, x: np.ndarray, u: np.ndarray, path: np.ndarray) -> np.ndarray:
        """How far each limit is passed [its unit], (..., m)."""
        return _outside(np.concatenate([path, x, u], axis=-1), self.lower, self.upper)

    @cached_property
    def of_states(self) -> np.ndarray:
        """Which limits no control enters, (m,)."""
        function = self.layout.stage.function
        by_control = np.array(function.jac_sparsity(1, 1).get_triplet()[0], dtype=int)
        path = ~np.isin(np.arange(function.size1_out(1)), by_control)
        return np.repeat([*path, True, False], [*np.ones(len(path), dtype=int), *map(function.size1_in, range(2))])

    def largest_excess(self, x: np.ndarray, u: np.ndarray, path: np.ndarray) -> np.ndarray:
        """The largest excess in each interval from values at NORMALISED_TIMES, (N, m); of limits of the states also between
        them, by parabolas through neighbours."""
        value = np.concatenate([path, x, u], axis=2)
        over = np.array([self.lower - value, value - self.upper])
        found = over.max(axis=2)
        found[..., self.of_states] = np.maximum(found, _peaks(over))[..., self.of_states]
        return np.maximum(found, 0.0).max(axis=0)

    def inside(
        self, solution: NlpSolution, t: np.ndarray, x: np.ndarray, u: np.ndarray, path: np.ndarray
    ) -> np.ndarray:
        """Controls (N, K, nu) near u within the limits, where controls can keep them."""
        over = self.excess(x, u, path) > PASSED * self.scale
        at, found = np.nonzero(over.any(axis=2)), u.copy()
        if u.shape[2] and at[0].size:
            slopes = self._slopes(solution, t[at], x[at], u[at], path[at])
            value = np.concatenate([path, x, u], axis=2)[at] / self.scale
            found[at] += self._steps(slopes, value) * self.control_scale
        return found

    def _slopes(
        self, solution: NlpSolution, t: np.ndarray, x: np.ndarray, u: np.ndarray, path: np.ndarray
    ) -> np.ndarray:
        """Derivatives of the scaled limits by the scaled controls, (k, m, nu), by differences."""
        count, nu = u.shape
        found = np.zeros((count, len(self.scale), nu))
        for k in range(nu):
            moved = u.copy()
            moved[:, k] += CONTROL_STEP * self.control_scale[k]
            found[:, : path.shape[1], k] = (
                solution.right_hand_sides(self.layout.phase.name, t, x, moved)[1] - path
            ) / CONTROL_STEP
            found[:, path.shape[1] + x.shape[1] + k, k] = self.control_scale[k]
        return found / self.scale[:, None]

    def _steps(self, A: np.ndarray, value: np.ndarray) -> np.ndarray:
        """Steps w (k, nu) for which value + A w passes no limit that w can change: to the worst, again and again."""
        low, high, size = self.lower / self.scale, self.upper / self.scale, (A**2).sum(axis=2)
        w, rows = np.zeros((len(A), A.shape[2])), np.arange(len(A))
        for _ in range(MOST_ROUNDS):
            now = value + np.einsum("kmu,ku->km", A, w)
            missing = np.where(size > CONTROL_STEP**2, np.clip(now, low, high) - now, 0.0)
            worst = np.abs(missing).argmax(axis=1)
            gap = missing[rows, worst]
            if np.abs(gap).max() <= PASSED:
                break
            w += (gap / np.maximum(size[rows, worst], CONTROL_STEP**2))[:, None] * A[rows, worst]
        return w


def _peaks(values: np.ndarray) -> np.ndarray:
    """Largest extremum of the parabolas through three neighbouring NORMALISED_TIMES each, values (..., K, m) to (..., m)."""
    a, b, c = (values[..., k : len(NORMALISED_TIMES) - 2 + k, :] for k in range(3))
    step, following = (np.diff(NORMALISED_TIMES)[k : len(NORMALISED_TIMES) - 2 + k, None] for k in range(2))
    with np.errstate(invalid="ignore", divide="ignore"):  # a limit that is infinite, a straight line
        slope = (b - a) / step
        bend = ((c - b) / following - slope) / (step + following)
        at = np.clip(0.5 * step - slope / (2 * bend), 0.0, step + following)
        peak = np.where(bend < 0, a + slope * at + bend * at * (at - step), -np.inf)
    return peak.max(axis=-2)


def _outside(value: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    return np.maximum(np.maximum(low - value, value - high), 0.0)
