"""Pontryagin's conditions along one phase, for the objective J as it is stated and its multipliers' signs:

    p' = -dH/dx,   dH/du = 0,   H = p' f + w' l - nu' (c - limit),   p + atoms' dc/dx = dPhi/dx at the end

with densities nu (and atoms at the end) of the limits c, integrands l and Phi the objective less the boundary
constraints times their multipliers. State constraints have measures as multipliers; on an interval a measure is
replaced by the polynomial density of the same moments, so that the costate is compared over whole intervals: its
difference against the integral of -dH/dx. (Hartl, Sethi and Vickson, A survey of the maximum principles for optimal
control problems with state constraints, SIAM Review 1995: direct adjoining.)
"""

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from hopopt.nlp.refinement.continuous_limits import bernstein_at
from hopopt.nlp.schemes import radau
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.optimality.minimum_principle.arcs import Arc, limits_of
from hopopt.optimality.minimum_principle.costates import PhaseMultipliers, sign
from hopopt.optimality.minimum_principle.phase_functions import Along

LITTLE_PHASE = (
    1e-3  # share of the objective: of a phase that is worth less over its duration, H is measured against this
)
FINE_SCHEME = radau(6)  # where the conditions are evaluated in every interval, and what integrates the costates
Slopes = Mapping[str, np.ndarray]


class PhaseCertificate:
    """One phase at FINE_SCHEME places of its N intervals: ``costate`` (N + 1, nx) at the edges, from the multipliers, the
    last from the end's conditions; ``p`` (N, K, nx), each interval integrated from the costate at its beginning;
    ``hamiltonian`` (N, K); ``density`` (N, K, m) of the limits."""

    def __init__(
        self, solution: NlpSolution, name: str, slopes: Slopes, along: Along, nodes: Along, m: PhaseMultipliers
    ):
        self.solution, self.name, self.slopes, self.along, self.multipliers = solution, name, slopes, along, m
        self.layout, self.trajectory = solution.transcription.layouts[name], solution.phases[name]
        self.objective, self.h = solution.magnitude, self.trajectory.lengths
        self.weights = slopes["integrals"]
        self.scale = self.layout.phase.columns(self.layout.phase.states, "scale")
        self.density = np.einsum("kj,ijm->ikm", self.layout.scheme.control_weights(np.array(FINE_SCHEME.c)), m.density)
        self.costate = self._edges(nodes)
        self.p = self._integrated()
        self.hamiltonian = along.hamiltonian(self.p, self.weights)

    def _edges(self, nodes: Along) -> np.ndarray:
        """Costates at the edges; the last is what the end of the phase and its atoms ask for."""
        m, nx = self.multipliers, self.along.x.shape[2]
        begin = m.costate.copy()
        if self.layout.scheme.starts_at_node:
            slope = nodes.gradient(nodes.by_x, m.inner, self.weights, m.density)[:, 0]
            begin += self.h[:, None] * self.layout.scheme.b[0] * slope
        at_end = nodes.by_x[-1, -1, nx : nx + len(m.atom)]
        self.atom_on_controls = nodes.by_u[-1, -1, nx : nx + len(m.atom)].T @ m.atom
        self.atom_by_free = nodes.by_free[-1, -1, nx : nx + len(m.atom)].T @ m.atom
        self.final_limits = nodes.c[-1, -1]
        return np.vstack([begin, self.slopes["final"] - at_end.T @ m.atom])

    def _integrated(self) -> np.ndarray:
        """p' = -dH/dx over every interval, linear in p: Radau IIA of order 11, all intervals at once."""
        along, (N, K, nx) = self.along, self.along.x.shape
        M = -np.swapaxes(along.by_x[:, :, :nx], 2, 3)
        r = -along.gradient(along.by_x, np.zeros((N, K, nx)), self.weights, self.density)
        step = np.einsum("i,kj,ijxy->ikxjy", self.h, FINE_SCHEME.A, M).reshape(N, K * nx, K * nx)
        known = self.costate[:-1, None] + np.einsum("i,kj,ijx->ikx", self.h, FINE_SCHEME.A, r)
        return np.linalg.solve(np.eye(K * nx) - step, known.reshape(N, K * nx, 1)).reshape(N, K, nx)

    def _integral(self, values: np.ndarray) -> np.ndarray:
        """Over the phase, of values (N, K, ...)."""
        return np.einsum("i,k,ik...->...", self.h, FINE_SCHEME.b, values)

    def _when(self, interval: int) -> str:
        return f"{self.trajectory.edges[interval]:.4f} s after {self.name} began"

    # ---- costates --------------------------------------------------------------------------------------

    @cached_property
    def _steps(self) -> np.ndarray:
        """How far each interval's integrated costate misses the next edge's, scaled, (N,)."""
        return np.abs((self.p[:, -1] - self.costate[1:]) * self.scale).max(axis=1)

    @cached_property
    def _sizes(self) -> np.ndarray:
        """Size of the costate at the edges, scaled, (N + 1,)."""
        return np.abs(self.costate * self.scale).max(axis=1)

    def _size_about(self, edge: int) -> float:
        """Size of the costate there, or on average over the phase: beside a limit that is met for an instant it may be
        thousands of times larger."""
        return max(self._sizes[edge], self._average((self._sizes[:-1] + self._sizes[1:]) / 2), 1e-300)

    def _average(self, values: np.ndarray) -> float:
        """Over the time of the phase, of values (N,)."""
        return float(values @ self.h / self.h.sum())

    def costate_residual(self, found: Sequence[Arc]) -> tuple[float, str]:
        """Largest of ``costate_misses``; and where."""
        relative = self.costate_misses(found)
        return float(relative.max()), self._when(int(relative.argmax()))

    def costate_misses(self, found: Sequence[Arc]) -> np.ndarray:
        """By how much the costate integrated over each interval misses the next edge's, relative to it on its arc, (N,)."""
        floor, relative = 1e-9 * self._sizes.max() + 1e-300, np.zeros(len(self.h))
        for arc in found:
            own = slice(arc.first, arc.last + 1)
            relative[own] = self._steps[own] / max(self._sizes[arc.first : arc.last + 2].max(), floor)
        return relative

    def start_residual(self) -> float:
        """Costate at the beginning against what the boundary constraints and the initial state's bounds ask for."""
        wrong = (self.costate[0] + self.slopes["initial"] - self.multipliers.start) * self.scale
        return float(np.abs(wrong).max() / self._size_about(0))

    def end_residual(self) -> float:
        """Costate integrated to the end against what the boundary constraints and limits met there ask for."""
        return float(self._steps[-1] / self._size_about(-1))

    # ---- controls and limits ---------------------------------------------------------------------------

    def stationarity(self) -> float:
        """What the controls could still gain, to first order, relative to the objective: ``gains``, and at limits met at the end."""
        atom = np.abs(self.atom_on_controls) @ self._control_sizes if self.along.u.shape[2] else 0.0
        return float(self.gains().sum() + atom / self.objective)

    def gains(self) -> np.ndarray:
        """Integral of |dH/du| times the controls' size over each interval, relative to the objective, (N,)."""
        slope = np.abs(self.along.gradient(self.along.by_u, self.p, self.weights, self.density))
        return self.h * np.einsum("k,iku,u->i", FINE_SCHEME.b, slope, self._control_sizes) / self.objective

    @cached_property
    def _control_sizes(self) -> np.ndarray:
        return np.abs(self.along.u).max(axis=(0, 1))

    @cached_property
    def _bounds(self) -> list[np.ndarray]:
        """Lower and upper limits of the problem, and their scales, (m,) each."""
        phase, stage = self.layout.phase, self.layout.stage
        variables = (*phase.states, *phase.controls)
        sides = ("lower", "upper", "scale")
        return [np.concatenate([stage.path_column(side), phase.columns(variables, side)]) for side in sides]

    def limits_residual(self) -> tuple[float, str]:
        """Integral of each multiplier times the distance to the limit it belongs to by its sign; and the worst limit.

        The limits are those of the problem: where they were tightened, what that costs is part of it.
        """
        s, (lower, upper, scale) = sign(self.solution), self._bounds
        moments, scheme, pushed = self.multipliers.moments(self.h, self.layout.scheme), self.layout.scheme, 0.0
        for nu, polynomial in zip(moments.swapaxes(0, 1), bernstein_at(FINE_SCHEME.c, len(scheme.c)).T, strict=True):
            weights = FINE_SCHEME.b * polynomial * len(scheme.c)  # of the mean where this moment lies
            distance = missed(nu[:, None], self.along.c, lower, upper, s, scale)
            pushed = pushed + np.einsum("k,ikm,im->m", weights, distance, np.abs(nu))
        given = [state.end_bounds("final") for state in self.layout.phase.states]
        first, count = len(self.layout.stage.path_column("lower")), self.along.x.shape[2]
        low, high = lower.copy(), upper.copy()
        low[first : first + count], high[first : first + count] = (
            np.concatenate(side) for side in zip(*given, strict=True)
        )
        atom = self.multipliers.atom
        pushed = pushed + np.abs(atom) * missed(atom, self.final_limits, low, high, s, scale)
        worst = str(self.multipliers.limits[int(pushed.argmax())]) if pushed.size else ""
        return float(pushed.sum()) / self.objective, worst

    # ---- Hamiltonian -----------------------------------------------------------------------------------

    @property
    def mean_hamiltonian(self) -> np.ndarray:
        """H on average over each interval, (N,)."""
        return self.hamiltonian @ FINE_SCHEME.b

    @cached_property
    def _by_time(self) -> np.ndarray:
        """Partial derivative of H by time, (N, K)."""
        return self.along.gradient(self.along.by_t, self.p, self.weights, self.density)[..., 0]

    @cached_property
    def steady(self) -> np.ndarray:
        """H less the integral of its partial derivative by time, (N, K): constant along an optimum.

        Where a limit was tightened, H is less by its multiplier times the amount, which is added here.
        """
        inner = self.h[:, None] * np.einsum("kj,ij->ik", FINE_SCHEME.A, self._by_time)
        before = np.concatenate([[0.0], np.cumsum(inner[:-1, -1])])
        lower, upper = self._drawn_in
        amount = np.where(-sign(self.solution) * self.density > 0, upper[:, None], -lower[:, None])
        return self.hamiltonian + (self.density * amount).sum(axis=2) - before[:, None] - inner

    @cached_property
    def _drawn_in(self) -> tuple[np.ndarray, np.ndarray]:
        """By how much the lower and upper limits were tightened at all nodes of each interval, (N, m) each."""
        (lower, upper, scale), N, found = self._bounds, len(self.h), []
        groups = [
            [side.reshape(N, -1, len(names)) for side in (low, high)]
            for _, _, low, high, names in limits_of(self.solution, self.name)
        ]
        low, high = (np.concatenate(sides, axis=2) * scale for sides in zip(*groups, strict=True))
        with np.errstate(invalid="ignore"):  # inf - inf: no limit in either
            differences = low - lower, upper - high
        for drawn in differences:
            amount = np.nan_to_num(drawn, nan=0.0, posinf=0.0, neginf=0.0).min(axis=1)
            found.append(np.where((low == high).all(axis=1), 0.0, amount))  # held as an equation, not tightened
        return found[0], found[1]

    @cached_property
    def _power(self) -> np.ndarray:
        """Size of the terms that make up H, (N, K)."""
        return np.abs(self.p * self.along.f).sum(axis=2)

    @property
    def _little(self) -> float:
        """LITTLE of the objective over the duration: a Hamiltonian that is small."""
        return LITTLE_PHASE * self.objective / float(self.h.sum())

    def hamiltonian_within(self, found: Sequence[Arc]) -> tuple[float, str]:
        """Largest spread of the intervals' H along an arc, relative to the size of its terms on that arc and on average
        over the phase, and to what the phase's duration gains, or to LITTLE_PHASE of the objective; and where."""
        mean, changed = self.steady @ FINE_SCHEME.b, [0.0] * len(found)
        typical = self._average(self._power @ FINE_SCHEME.b) + np.abs(self.slopes["duration"]).max(initial=0.0)
        typical = max(typical, self._little)
        for k, arc in enumerate(found):
            own = slice(arc.first, arc.last + 1)
            changed[k] = np.ptp(mean[own]) / (self._power[own].max() + typical) if arc.steady else 0.0
        worst = int(np.argmax(changed))
        return changed[worst], self._when(found[worst].first)

    def hamiltonian_across(self) -> tuple[float, str]:
        """Sum over the edges of the jump of H times how far an edge may move: what switching elsewhere could gain."""
        if len(self.h) == 1:
            return 0.0, ""
        jump = np.abs(np.diff(self.steady @ FINE_SCHEME.b))
        gain = jump * np.minimum(self.h[:-1], self.h[1:])
        return float(gain.sum()) / self.objective, self._when(int(gain.argmax()) + 1)

    def duration_residual(self) -> float:
        """Mean H of each arc of the mesh (with what later times gain) against its duration's multipliers."""
        mesh, m = self.layout.mesh, self.multipliers
        own = np.eye(mesh.arcs)[mesh.arc]
        spans = own.T @ self.h
        mean = (own.T @ (self.h * self.mean_hamiltonian)) / spans
        interval, place = (
            np.repeat(np.arange(mesh.intervals), len(FINE_SCHEME.c)),
            np.tile(FINE_SCHEME.c, mesh.intervals),
        )
        moved = self.layout.times_of(interval, place).reshape(mesh.intervals, len(FINE_SCHEME.c), -1)
        later = self._integral(self._by_time[..., None] * moved)
        wrong = self.slopes["duration"] + mean + later - m.duration
        size = np.abs(self.slopes["duration"]) + np.abs(m.duration).max() + self._average(self._power @ FINE_SCHEME.b)
        return float(np.abs(wrong).max() / max(size.max(), self._little))

    def by_free(self) -> np.ndarray:
        """Derivative of what is integrated by the free parameters, less that of the limits met at the end, (f,)."""
        along = self._integral(self.along.gradient(self.along.by_free, self.p, self.weights, self.density))
        return along - self.atom_by_free


def missed(
    nu: np.ndarray, value: np.ndarray, lower: np.ndarray, upper: np.ndarray, s: float, scale: object
) -> np.ndarray:
    """Distance to the limit that a multiplier belongs to by its sign: the upper one where -s nu > 0; ``scale`` where
    there is none."""
    slack = np.abs(np.where(-s * nu > 0, upper - value, value - lower))
    return np.where(np.isfinite(slack), slack, np.broadcast_to(np.asarray(scale, dtype=float), slack.shape))
