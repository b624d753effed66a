"""A multi-phase problem on a mesh as one nonlinear program, for any collocation scheme.

Variables (all scaled to order 1): the states at every node, the controls at every abscissa, the duration of
every arc, the free parameters. Constraints: the collocation defects, the path constraints at every abscissa,
the boundary constraints. Each phase's right-hand sides are one SX function, mapped over its abscissae.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from scipy import sparse

from hopopt.nlp.mesh import PhaseMesh
from hopopt.nlp.schemes import Scheme, lagrange
from hopopt.nlp.trajectory import PhaseTrajectory
from hopopt.ocp.problem import (
    Ends,
    Instant,
    Parameter,
    Phase,
    Problem,
    split,
    stack,
    symbols,
)

SHORTEST_ARC = 1e-4  # of the phase's guessed duration: an arc that shrinks to this is spurious


@dataclass(frozen=True)
class Rows:
    """Which rows of the NLP a constraint became: kind, phase, name, component labels and where in the phase.

    Rows are component-major within a place: row = start + place * len(labels) + component. ``interval`` and
    ``place`` (0 to 1 within it) tell where; both are empty for boundary constraints.
    """

    kind: str
    phase: str
    name: str
    labels: tuple[str, ...]
    start: int
    interval: np.ndarray
    place: np.ndarray
    scale: np.ndarray
    unit: str = ""

    @property
    def stop(self) -> int:
        return self.start + len(self.labels) * max(1, len(self.interval))


@dataclass(frozen=True)
class Guess:
    """Where the solver starts in one phase: interpolants over the fraction of the phase, and its duration [s].

    x (m, nx) and u (m, nu) at ``fraction`` (m,); or a trajectory of an earlier mesh.
    """

    duration: float
    fraction: np.ndarray
    x: np.ndarray
    u: np.ndarray

    def sample(self, fraction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States (k, nx) and controls (k, nu), linear between the points."""
        return tuple(
            np.stack([np.interp(fraction, self.fraction, column) for column in table.T], axis=1)
            if table.shape[1]
            else np.zeros((len(fraction), 0))
            for table in (self.x, self.u)
        )  # type: ignore[return-value]


@dataclass(frozen=True)
class Stage:
    """A phase's right-hand sides at one instant as one SX function (x, u, t, p) -> (x', path, integrands)."""

    phase: Phase
    function: ca.Function
    path_labels: tuple[tuple[str, ...], ...]
    path_sizes: tuple[int, ...]


def make_stage(phase: Phase, parameters: Sequence[Parameter]) -> Stage:
    """Evaluate the phase's functions on symbols, once."""
    x, u, p = symbols(phase.states), symbols(phase.controls), symbols(parameters)
    t = ca.SX.sym("t")
    instant = Instant(t=t, p=p, **x, **u)
    path = [ca.vec(ca.SX(c.value(instant))) for c in phase.path]
    integrands = [ca.SX(f(instant)) for f in phase.integrands.values()]
    inputs = [stack(x, phase.states), stack(u, phase.controls), t, stack(p, parameters)]
    outputs = [stack(phase.dynamics(instant), phase.states), ca.vertcat(*path), ca.vertcat(*integrands)]
    sizes = tuple(int(c.numel()) for c in path)
    labels = tuple(_labels(c, n) for c, n in zip(phase.path, sizes, strict=True))
    function = ca.Function(f"stage_{phase.name}".replace("-", "_"), inputs, [ca.densify(o) for o in outputs])
    return Stage(phase, function, labels, sizes)


def _labels(constraint: Any, size: int) -> tuple[str, ...]:
    if size == 1 and not constraint.labels:
        return (constraint.name,)
    labels = constraint.labels or tuple(str(k) for k in range(size))
    return tuple(f"{constraint.name}[{label}]" for label in labels)


class PhaseLayout:
    """Where one phase's nodes lie, and where its right-hand sides are evaluated.

    Points are the abscissae of every interval, and the left end of a ramp; path constraints hold at those that
    are control abscissae too, as many as there are controls to meet them. State nodes, control nodes and points are counted from the
    phase's beginning.
    """

    def __init__(self, stage: Stage, scheme: Scheme, mesh: PhaseMesh):
        self.stage, self.scheme, self.mesh, self.phase = stage, scheme, mesh, stage.phase
        N, n, steps, shared = mesh.intervals, len(scheme.c), scheme.steps, scheme.starts_at_node
        ramps = np.zeros(N, dtype=bool) if shared else mesh.is_ramp  # Lobatto controls are continuous already
        self.control_places = [np.array((0.0, 1.0) if ramp else scheme.control_c) for ramp in ramps]
        starts_arc = np.concatenate([[True], np.diff(mesh.arc) > 0])
        self.controls_of = _numbering([len(c) for c in self.control_places], shared, starts_arc)
        self.point_of = np.array(_numbering([n] * N, shared, starts_arc))  # (N, n) point of each abscissa
        first = np.unique(self.point_of, return_index=True)[1]
        state_of = np.arange(N)[:, None] * steps + np.arange(n) + (0 if shared else 1)
        at = np.flatnonzero(ramps)  # a ramp is evaluated at its left end too
        self.interval = np.concatenate([first // n, at])
        self.place = np.concatenate([np.array(scheme.c)[first % n], np.zeros(len(at))])
        self.state_at = np.concatenate([state_of.ravel()[first], at * steps])
        self.points, self.state_nodes = len(self.interval), N * steps + 1
        self.control_nodes = int(self.controls_of[-1][-1]) + 1
        on_control = np.isin(self.place, scheme.control_c)
        self.constrained = np.where(ramps[self.interval], np.isin(self.place, (0.0, 1.0)), on_control)
        self.arc_at = mesh.arc[self.interval]
        # time since the phase began = duration of earlier arcs + share of its own: t = time_matrix @ durations
        self.time_matrix = self.times_of(self.interval, self.place)

    def times_of(self, interval: np.ndarray, place: np.ndarray) -> np.ndarray:
        """Weights (k, arcs) that give times from arc durations."""
        mesh = self.mesh
        starts = np.array([mesh.shares[:i][mesh.arc[:i] == mesh.arc[i]].sum() for i in range(mesh.intervals)])
        share = starts[interval] + place * mesh.shares[interval]
        arcs = np.arange(mesh.arcs)
        own = mesh.arc[interval][:, None]
        return np.where(arcs < own, 1.0, np.where(arcs == own, share[:, None], 0.0))

    @cached_property
    def node_fraction(self) -> np.ndarray:
        """Each state node's fraction of the phase, with arcs at their guessed spans, shape (state_nodes,)."""
        edges, c = np.array(self.mesh.edges), np.array(self.scheme.c)[-self.scheme.steps :]
        inner = edges[:-1, None] + np.diff(edges)[:, None] * c
        return np.concatenate([[0.0], inner.ravel()])

    @cached_property
    def control_place(self) -> tuple[np.ndarray, np.ndarray]:
        """Interval and place of every control node, (control_nodes,) each."""
        first = np.unique(np.concatenate(self.controls_of), return_index=True)[1]
        interval = np.repeat(np.arange(self.mesh.intervals), [len(c) for c in self.control_places])
        return interval[first], np.concatenate(self.control_places)[first]

    @cached_property
    def control_matrix(self) -> sparse.csc_matrix:
        """C with controls at the points = U C, shape (control_nodes, points)."""
        weights = [lagrange(self.control_places[i], s)[0] for i, s in zip(self.interval, self.place, strict=True)]
        rows = np.concatenate([self.controls_of[i] for i in self.interval])
        cols = np.repeat(np.arange(self.points), [len(w) for w in weights])
        return _sparse(np.concatenate(weights), rows, cols, (self.control_nodes, self.points))

    def defect_matrices(self) -> tuple[sparse.csc_matrix, sparse.csc_matrix]:
        """S and Q with defects = X S - (X' times arc duration) Q, one column for each new state node."""
        N, n, steps = self.mesh.intervals, len(self.scheme.c), self.scheme.steps
        column = np.arange(N * steps).reshape(N, steps)
        flat, first = column.ravel(), np.repeat(np.arange(N) * steps, steps)
        signs = np.concatenate([np.ones(N * steps), -np.ones(N * steps)])
        S = _sparse(signs, np.concatenate([flat + 1, first]), np.concatenate([flat, flat]), (self.state_nodes, N * steps))
        weights = self.mesh.shares[:, None, None] * self.scheme.A[None]  # (N, steps, n)
        rows = np.broadcast_to(self.point_of[:, None, :], (N, steps, n))
        cols = np.broadcast_to(column[:, :, None], (N, steps, n))
        return S, _sparse(weights, rows, cols, (self.points, N * steps))

    def quadrature(self) -> np.ndarray:
        """Weight of each point in an integral, per duration of its arc, shape (points,)."""
        weights = self.mesh.shares[:, None] * self.scheme.b
        return np.bincount(self.point_of.ravel(), weights.ravel(), self.points)


def _numbering(counts: Sequence[int], shared: bool, starts_arc: np.ndarray) -> list[np.ndarray]:
    """Consecutive numbers for each interval; if ``shared``, neighbours in an arc share their common end."""
    numbers, at = [], 0
    for count, new_arc in zip(counts, starts_arc, strict=True):
        at -= int(shared and not new_arc)
        numbers.append(np.arange(at, at + count))
        at += count
    return numbers


def _sparse(values: np.ndarray, rows: np.ndarray, cols: np.ndarray, shape: tuple[int, int]) -> sparse.csc_matrix:
    matrix = sparse.coo_matrix((values.ravel(), (rows.ravel(), cols.ravel())), shape).tocsc()
    matrix.eliminate_zeros()
    matrix.sort_indices()
    return matrix


def _dm(matrix: sparse.csc_matrix) -> ca.DM:
    return ca.DM(ca.Sparsity(*matrix.shape, matrix.indptr.tolist(), matrix.indices.tolist()), matrix.data)


@dataclass(frozen=True)
class PhaseVariables:
    """Index ranges of one phase's variables in the NLP vector."""

    x: slice
    u: slice
    durations: slice


class Transcription:
    """The nonlinear program of a problem on a mesh: ``nlp`` (CasADi x, p, f, g), bounds, scales and names."""

    def __init__(self, problem: Problem, scheme: Scheme, mesh: Mapping[str, PhaseMesh]):
        self.problem, self.scheme, self.mesh = problem, scheme, dict(mesh)
        self.free = tuple(p for p in problem.parameters if p.free)
        self.fixed = tuple(p for p in problem.parameters if not p.free)
        self.layouts = {
            phase.name: PhaseLayout(make_stage(phase, problem.parameters), scheme, mesh[phase.name])
            for phase in problem.phases
        }
        self._rows: list[Rows] = []
        self._g: list[ca.MX] = []
        self._lbg: list[np.ndarray] = []
        self._ubg: list[np.ndarray] = []
        self._place_variables()
        self._build()

    # ---- variables -------------------------------------------------------------------------------------

    def _place_variables(self) -> None:
        self.variables: dict[str, PhaseVariables] = {}
        scales, at = [], 0
        for name, layout in self.layouts.items():
            phase, pieces = layout.phase, []
            nodes = ((phase.states, layout.state_nodes), (phase.controls, layout.control_nodes))
            for group, count in nodes:
                scales.append(np.tile(phase.columns(group, "scale"), count))
            scales.append(np.full(layout.mesh.arcs, min(phase.duration[1], 1.0)))
            for block in scales[-3:]:
                pieces.append(slice(at, at + len(block)))
                at += len(block)
            self.variables[name] = PhaseVariables(*pieces)
        scales.append(np.concatenate([p.column("scale") for p in self.free]) if self.free else np.zeros(0))
        self.parameters = slice(at, at + len(scales[-1]))
        self.scale = np.concatenate(scales)

    def bounds(self, guess: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds of the scaled variables; arcs may not shrink to nothing."""
        low, high = np.zeros(len(self.scale)), np.zeros(len(self.scale))
        for name, layout in self.layouts.items():
            phase, where = layout.phase, self.variables[name]
            for side, out in (("lower", low), ("upper", high)):
                x = np.tile(phase.columns(phase.states, side), (layout.state_nodes, 1))
                for node, end in ((0, "initial"), (-1, "final")):
                    ends = [s.end_bounds(end)[side == "upper"] for s in phase.states]
                    x[node] = np.concatenate(ends)
                out[where.x] = x.ravel()
                out[where.u] = np.tile(phase.columns(phase.controls, side), layout.control_nodes)
            one_arc = layout.mesh.arcs == 1
            low[where.durations] = phase.duration[0] if one_arc else SHORTEST_ARC * guess[name].duration
            high[where.durations] = phase.duration[1]
        if self.free:
            low[self.parameters] = np.concatenate([p.column("lower") for p in self.free])
            high[self.parameters] = np.concatenate([p.column("upper") for p in self.free])
        return low / self.scale, high / self.scale

    # ---- constraints -----------------------------------------------------------------------------------

    def _build(self) -> None:
        z = ca.MX.sym("z", len(self.scale))
        fixed_size = sum(p.size for p in self.fixed)
        fixed = ca.MX.sym("p", fixed_size)
        physical = z * ca.DM(self.scale)
        parts = {**split(self.fixed, fixed), **split(self.free, physical[self.parameters])}
        p = ca.vertcat(*[parts[q.name] for q in self.problem.parameters])
        ends: list[ca.MX] = []
        for name in self.layouts:
            ends += self._add_phase(name, physical, p)
        f = self._add_boundary(ends, p)
        self.nlp = {"x": z, "p": fixed, "f": f, "g": ca.vertcat(*self._g)}
        self.lbg, self.ubg = np.concatenate(self._lbg), np.concatenate(self._ubg)
        self.rows = tuple(self._rows)
        self.row_scale = np.concatenate([np.tile(r.scale, max(1, len(r.interval))) for r in self.rows])

    def _add_phase(self, name: str, physical: ca.MX, p: ca.MX) -> list[ca.MX]:
        layout, where = self.layouts[name], self.variables[name]
        phase, nx, nu = layout.phase, layout.stage.function.size1_in(0), layout.stage.function.size1_in(1)
        X = ca.reshape(physical[where.x], nx, layout.state_nodes)
        U = ca.reshape(physical[where.u], nu, layout.control_nodes)
        durations = physical[where.durations]
        controls, t = U @ _dm(layout.control_matrix), ca.DM(layout.time_matrix) @ durations
        stage = layout.stage.function.map(layout.points)
        xdot, path, integrands = stage(X[:, layout.state_at.tolist()], controls, t.T, p)
        arc_time = (ca.DM(np.eye(layout.mesh.arcs)[layout.arc_at]) @ durations).T  # (1, points)
        S, Q = layout.defect_matrices()
        defects = X @ _dm(S) - (xdot * ca.repmat(arc_time, nx, 1)) @ _dm(Q)
        self._add_defects(layout, defects)
        self._add_path(layout, path)
        if layout.mesh.arcs > 1:
            scale = np.array([min(phase.duration[1], 1.0)])
            self._add("duration", name, "duration", ("duration",), ca.sum1(durations), phase.duration, scale, unit="s")
        weights = ca.DM(layout.quadrature()).T * arc_time
        integrals = integrands @ weights.T if integrands.numel() else ca.MX(0, 1)
        return [X[:, 0], X[:, -1], ca.sum1(durations), integrals]

    def _add_defects(self, layout: PhaseLayout, defects: ca.MX) -> None:
        phase, steps = layout.phase, self.scheme.steps
        labels = tuple(name for s in phase.states for name in s.component_names())
        interval = np.repeat(np.arange(layout.mesh.intervals), steps)
        place = np.tile(np.array(self.scheme.c)[-steps:], layout.mesh.intervals)
        scale = phase.columns(phase.states, "scale")
        self._add("defect", phase.name, "defect", labels, defects, (0.0, 0.0), scale, interval, place)

    def _add_path(self, layout: PhaseLayout, path: ca.MX) -> None:
        row = 0
        for constraint, size, labels in zip(
            layout.phase.path, layout.stage.path_sizes, layout.stage.path_labels, strict=True
        ):
            scale = np.broadcast_to(np.asarray(constraint.scale, dtype=float), (size,))
            at = np.flatnonzero(layout.constrained)
            bounds, value = (constraint.lower, constraint.upper), path[row : row + size, at.tolist()]
            self._add(
                "path", layout.phase.name, constraint.name, labels, value, bounds, scale,
                layout.interval[at], layout.place[at], constraint.unit,
            )  # fmt: skip
            row += size

    def _add_boundary(self, ends: list[ca.MX], p: ca.MX) -> ca.MX:
        phases = self.problem.phases
        p_sx = symbols(self.problem.parameters)
        inputs, initial, final, duration, integral = [], {}, {}, {}, {}
        for phase in phases:
            first, last = symbols(phase.states), symbols(phase.states)
            T, I = ca.SX.sym("T"), ca.SX.sym("I", len(phase.integrands))
            initial[phase.name], final[phase.name] = Instant(t=ca.SX(0), p=p_sx, **first), Instant(t=T, p=p_sx, **last)
            duration[phase.name] = T
            integral[phase.name] = {n: I[k] for k, n in enumerate(phase.integrands)}
            inputs += [stack(first, phase.states), stack(last, phase.states), T, I]
        at = Ends(initial, final, duration, integral, p_sx)
        goal = self.problem.objective
        values = [ca.vec(ca.SX(c.value(at))) for c in self.problem.boundary]
        cost = (-1.0 if goal.maximize else 1.0) * ca.SX(goal.value(at))
        inputs.append(stack(p_sx, self.problem.parameters))
        results = ca.Function("ends", inputs, [cost, *values])(*ends, p)
        cost, *values = results if isinstance(results, (list, tuple)) else [results]
        for constraint, value in zip(self.problem.boundary, values, strict=True):
            size = int(value.numel())
            scale = np.broadcast_to(np.asarray(constraint.scale, dtype=float), (size,))
            bounds, labels = (constraint.lower, constraint.upper), _labels(constraint, size)
            self._add("boundary", "", constraint.name, labels, value, bounds, scale, unit=constraint.unit)
        return cost

    def _add(
        self, kind: str, phase: str, name: str, labels: tuple[str, ...], value: ca.MX, bounds: tuple[Any, Any],
        scale: np.ndarray, interval: np.ndarray | None = None, place: np.ndarray | None = None, unit: str = "",
    ) -> None:  # fmt: skip
        start = self._rows[-1].stop if self._rows else 0
        empty = np.zeros(0)
        interval = empty.astype(int) if interval is None else interval
        self._rows.append(Rows(kind, phase, name, labels, start, interval, empty if place is None else place, scale, unit))
        self._g.append(ca.vec(value / ca.repmat(ca.DM(scale), 1, value.shape[1])))
        for side, out in zip(bounds, (self._lbg, self._ubg), strict=True):
            column = np.broadcast_to(np.asarray(side, dtype=float), (len(labels),)) / scale
            out.append(np.tile(column, max(1, len(interval))))

    # ---- values ----------------------------------------------------------------------------------------

    def pack(self, guess: Mapping[str, Any], parameters: Mapping[str, Any] | None = None) -> np.ndarray:
        """The scaled NLP vector of a guess (phase name -> ``Guess`` or anything with duration and sample)."""
        z = np.zeros(len(self.scale))
        for name, layout in self.layouts.items():
            g, where = guess[name], self.variables[name]
            interval, place = layout.control_place
            edges, inner = np.array(layout.mesh.edges), np.clip(place, 1e-9, 1 - 1e-9)  # keep to the interval's side
            z[where.x] = g.sample(layout.node_fraction)[0].ravel()
            z[where.u] = g.sample(edges[interval] + inner * np.diff(edges)[interval])[1].ravel()
            z[where.durations] = layout.mesh.spans * g.duration
        values = {q.name: q.value for q in self.free} | dict(parameters or {})
        if self.free:
            z[self.parameters] = np.concatenate([np.broadcast_to(values[q.name], (q.size,)) for q in self.free])
        return z / self.scale

    def parameter_values(self, parameters: Mapping[str, Any] | None = None) -> np.ndarray:
        """The NLP's fixed parameters, from their own values and the overrides given."""
        values = {q.name: q.value for q in self.fixed} | dict(parameters or {})
        return np.concatenate([np.broadcast_to(values[q.name], (q.size,)) for q in self.fixed] or [np.zeros(0)])

    def unpack(self, z: np.ndarray, p: np.ndarray) -> tuple[dict[str, PhaseTrajectory], dict[str, np.ndarray]]:
        """Trajectories by phase and the values of all parameters from a scaled NLP vector."""
        physical = z * self.scale
        values = {**split(self.fixed, p), **split(self.free, physical[self.parameters])}
        stacked = np.concatenate([values[q.name] for q in self.problem.parameters] or [np.zeros(0)])
        phases = {name: self._trajectory(layout, physical, stacked) for name, layout in self.layouts.items()}
        return phases, values

    def _trajectory(self, layout: PhaseLayout, physical: np.ndarray, p: np.ndarray) -> PhaseTrajectory:
        where, function = self.variables[layout.phase.name], layout.stage.function
        X = physical[where.x].reshape(layout.state_nodes, -1)
        U = physical[where.u].reshape(layout.control_nodes, -1)
        durations = physical[where.durations]
        t, controls = layout.time_matrix @ durations, layout.control_matrix.T @ U
        xdot = np.array(function.map(layout.points)(X[layout.state_at].T, controls.T, t[None], p)[0]).T
        intervals = np.arange(layout.mesh.intervals)
        edges = np.append(layout.times_of(intervals, np.zeros(len(intervals))) @ durations, durations.sum())
        starts = X[intervals * self.scheme.steps]
        return PhaseTrajectory(self.scheme, edges, starts, xdot[layout.point_of], controls[layout.point_of], layout.mesh.arc)
