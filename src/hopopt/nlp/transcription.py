"""A multi-phase problem on a mesh as one nonlinear program, for any collocation scheme.

Variables (all scaled to order 1): the states at every node, the controls at every abscissa, the duration of
every arc, the free parameters. Constraints: the collocation defects, the path constraints at every abscissa,
the boundary constraints. Each phase's right-hand sides are one SX function, mapped over its abscissae.
"""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from hopopt.nlp.layout import PhaseLayout, PhaseVariables, ends_of, stage_of
from hopopt.nlp.mesh import PhaseMesh
from hopopt.nlp.program import Program
from hopopt.nlp.schemes import Scheme
from hopopt.nlp.terms import Local, Matrix, Term, Triplets, blocks, csc, entries, stacked, together
from hopopt.nlp.trajectory import FromTrajectory, PhaseTrajectory
from hopopt.ocp.guesses.guess import Guess as Guess
from hopopt.ocp.problem import Component, Parameter, Problem, components, split

SHORTEST_ARC = 1e-4  # of the phase's guessed duration: an arc that shrinks to this is spurious
SHRINKS = 0.7  # an arc between zeros of states lasts at least this share of its guessed duration: else it moves to other zeros


@dataclass(frozen=True)
class Rows:
    """Which rows of the NLP a constraint became: kind, phase, name, components (``labels``) and where in the phase.

    Rows are component-major within a place: row = start + place * len(labels) + component. ``interval`` and
    ``place`` (0 to 1 within it) tell where; both are empty for boundary constraints.
    """

    kind: str
    phase: str
    name: Hashable
    labels: tuple[Component, ...]
    start: int
    interval: np.ndarray
    place: np.ndarray
    scale: np.ndarray
    unit: str = ""

    @property
    def stop(self) -> int:
        return self.start + len(self.labels) * max(1, len(self.interval))


class Transcription:
    """The nonlinear program of a problem on a mesh: ``nlp`` (CasADi x, p, f, g), bounds, scales and names."""

    def __init__(self, problem: Problem, scheme: Scheme, mesh: Mapping[str, PhaseMesh]):
        self.problem, self.scheme, self.mesh = problem, scheme, dict(mesh)
        self.free = tuple(p for p in problem.parameters if p.free)
        self.fixed = tuple(p for p in problem.parameters if not p.free)
        self.layouts = {
            phase.name: PhaseLayout(stage_of(problem, phase), scheme, mesh[phase.name]) for phase in problem.phases
        }
        self._rows: list[Rows] = []
        self._linear: list[Triplets] = []  # what the variables add to the rows
        self._scattered: dict[str, list[Triplets]] = {name: [] for name in ("", *self.layouts)}  # outputs, by owner
        self._lbg: list[np.ndarray] = []
        self._ubg: list[np.ndarray] = []
        self._place_variables()
        self._build()

    @property
    def nlp(self) -> dict[str, ca.MX]:
        """x, p, f, g for CasADi's nlpsol."""
        return self.program.nlp

    def nodes_of(self, phase: str, name: str, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A state at the nodes of a phase in scaled variables (n_z,), as a view (nodes, size), and its scales (size,)."""
        layout = self.layouts[phase]
        states = layout.phase.states
        k = [s.name for s in states].index(name)
        at, nodes = sum(s.size for s in states[:k]), z[self.variables[phase].x].reshape(layout.state_nodes, -1)
        return nodes[:, at : at + states[k].size], states[k].column("scale")

    def tie_break(self, z: np.ndarray, p: np.ndarray) -> float:
        """What the objective's tie-break weighs at NLP vectors [the objective's unit]."""
        weights = [self.problem.objective.tie_break.get(n, 0.0) for q in self.problem.phases for n in q.integrands]
        return float(np.array(self._integrals(z, p)).ravel() @ weights) if any(weights) else 0.0

    @cached_property
    def _integrals(self) -> ca.Function:
        z, p = self.program.symbols()
        return ca.Function("integrals", [z, p], [self.program.integral(z, p)])

    # ---- variables -------------------------------------------------------------------------------------

    def _place_variables(self) -> None:
        self.variables: dict[str, PhaseVariables] = {}
        scales, at = list[np.ndarray](), 0
        for name, layout in self.layouts.items():
            phase, pieces = layout.phase, []
            nodes = ((phase.states, layout.state_nodes), (phase.controls, layout.control_nodes))
            scales += [np.tile(phase.columns(group, "scale"), count) for group, count in nodes]
            scales.append(np.full(layout.mesh.arcs, phase.duration_scale))
            for block in scales[-3:]:
                pieces.append(slice(at, at + len(block)))
                at += len(block)
            self.variables[name] = PhaseVariables(*pieces)
        self.scale = np.concatenate([*scales, *(p.column("scale") for p in self.free)])
        self.parameters = slice(at, len(self.scale))

    def bounds(self, guess: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds of the scaled variables; arcs may not shrink to nothing."""
        low, high = np.zeros(len(self.scale)), np.zeros(len(self.scale))
        for name, layout in self.layouts.items():
            phase, where = layout.phase, self.variables[name]
            for side, out in (("lower", low), ("upper", high)):
                x = np.tile(phase.columns(phase.states, side), (layout.state_nodes, 1))
                for node, end in ((0, "initial"), (-1, "final")):
                    x[node] = np.concatenate([s.end_bounds(end)[side == "upper"] for s in phase.states])
                zeros = layout.mesh.zeros
                for edge, component in zip(layout.mesh.free, zeros, strict=True) if zeros else ():
                    x[edge * self.scheme.steps, component] = 0.0
                out[where.x] = x.ravel()
                out[where.u] = np.tile(phase.columns(phase.controls, side), layout.control_nodes)
            one_arc = layout.mesh.arcs == 1
            shortest = SHRINKS * layout.mesh.spans if layout.mesh.zeros else SHORTEST_ARC
            low[where.durations] = phase.duration[0] if one_arc else shortest * guess[name].duration
            high[where.durations] = phase.duration[1]
        for side, out in (("lower", low), ("upper", high)):
            out[self.parameters] = np.concatenate([np.zeros(0), *(p.column(side) for p in self.free)])
        return low / self.scale, high / self.scale

    # ---- constraints -----------------------------------------------------------------------------------

    def _build(self) -> None:
        for layout in self.layouts.values():
            self._add_phase(layout)
        ends = self._add_boundary()
        self.lbg, self.ubg = np.concatenate(self._lbg), np.concatenate(self._ubg)
        self.rows = tuple(self._rows)
        self.row_scale = np.concatenate([np.tile(r.scale, max(1, len(r.interval))) for r in self.rows])
        linear = self._by_variables(stacked(self._linear), self._count)
        terms = tuple(self._phase_term(layout) for layout in self.layouts.values())
        rows = tuple(layout.stage.row_outputs for layout in self.layouts.values())
        integrals = sum(len(phase.integrands) for phase in self.problem.phases)
        self.program = Program(linear, terms, rows, ends, integrals)

    def _add_phase(self, layout: PhaseLayout) -> None:
        phase, where = layout.phase, self.variables[layout.phase.name]
        self._add_defects(layout, where.x.start)
        self._add_path(layout)
        if layout.mesh.arcs > 1:
            scale, label = np.array([phase.duration_scale]), (Component("duration"),)
            linear = blocks(np.ones((1, layout.mesh.arcs)) / scale, np.ones((1, 1)), 1, 1, 0, where.durations.start)
            self._add("duration", phase.name, "duration", label, phase.duration, scale, linear, unit="s")

    def _add_defects(self, layout: PhaseLayout, start: int) -> None:
        """x_ik - x_i0 - sum_j A_kj h_i T_a f_ij = 0 for every interval i and every new state node k of it, scaled.

        x_i0: the state where the interval begins; x_ik: at its abscissa c_k; f_ij = f(x_ij, u_ij, t_ij, p): the
        right-hand side at its abscissa c_j; h_i: its share of its arc a; T_a: the arc's duration; A: the scheme's
        integration matrix (nlp/schemes.py). For all nodes at once that is X S - (T F) Q, with S and Q of
        ``PhaseLayout.defect_matrices``.
        """
        phase, steps, N = layout.phase, self.scheme.steps, layout.mesh.intervals
        labels, scale = tuple(c for s in phase.states for c in s.components()), phase.columns(phase.states, "scale")
        S, Q = layout.defect_matrices()
        linear = blocks(S, np.diag(1 / scale), len(scale), len(scale), 0, start)
        scatter = blocks(Q, np.diag(-1 / scale), len(scale), layout.stage.outputs)
        interval, place = np.repeat(np.arange(N), steps), np.tile(np.array(self.scheme.c)[-steps:], N)
        self._add("defect", phase.name, "defect", labels, (0.0, 0.0), scale, linear, scatter, interval, place)

    def _add_path(self, layout: PhaseLayout) -> None:
        phase, output = layout.phase, layout.stage.function.size1_in(0)
        at = np.flatnonzero(layout.constrained)
        chosen = np.ones(len(at)), np.arange(len(at)), at
        for constraint, labels in zip(phase.path, layout.stage.path_labels, strict=True):
            scale = np.broadcast_to(np.asarray(constraint.scale, dtype=float), (len(labels),))
            scatter = blocks(chosen, np.diag(1 / scale), len(scale), layout.stage.outputs, 0, output)
            self._add(
                "path", phase.name, constraint.name, labels, (constraint.lower, constraint.upper), scale, None,
                scatter, layout.interval[at], layout.place[at], constraint.unit,
            )  # fmt: skip
            output += len(labels)

    def _phase_term(self, layout: PhaseLayout) -> Term:
        """The phase's right-hand sides at its points, times the duration of their arc if they are integrated."""
        stage, name = layout.stage, layout.phase.name
        local = self.problem.once(("term", name), lambda: Local(name, *stage.over_arc(self.problem.parameters)))
        inputs = layout.gather(self.variables[name], self.parameters)
        gather = self._by_variables(inputs, layout.points * local.y.numel())
        counts = [len(p.integrands) for p in self.problem.phases]
        own, w = self.problem.phases.index(layout.phase), layout.quadrature()
        places, first = (w, np.zeros(len(w), dtype=int), np.arange(len(w))), self._count + sum(counts[:own])
        integrals = blocks(places, np.eye(counts[own]), 0, stage.outputs, first, stage.row_outputs)
        shape = self._count + sum(counts), layout.points * stage.outputs
        return Term(local, gather, together([*self._scattered[name], integrals], shape))

    def _by_variables(self, found: Triplets, rows: int) -> Matrix:
        """A matrix of the physical variables as one of the scaled ones."""
        value, row, column = found
        return csc((value * self.scale[column], (row, column)), (rows, len(self.scale)))

    @property
    def _count(self) -> int:
        """Rows so far."""
        return self._rows[-1].stop if self._rows else 0

    def _add_boundary(self) -> Term:
        """The objective and the boundary constraints: functions of the ends of all phases."""
        local, sizes = ends_of(self.problem)
        output, width = 1, local.outputs.numel()
        for constraint, size in zip(self.problem.boundary, sizes, strict=True):
            scale = np.broadcast_to(np.asarray(constraint.scale, dtype=float), (size,))
            bounds, labels = (constraint.lower, constraint.upper), components(constraint.name, size, constraint.labels)
            scatter = blocks(np.ones((1, 1)), np.diag(1 / scale), 0, 0, 0, output)
            self._add("boundary", "", constraint.name, labels, bounds, scale, None, scatter, unit=constraint.unit)
            output += size
        value, row, column = stacked([entries(np.ones((1, 1))), *self._scattered[""]])
        row[1:] += 1  # the objective comes first
        return Term(local, self._gather_ends(), csc((value, (row, column)), (1 + self._count, width)))

    def _gather_ends(self) -> Matrix:
        """Initial states, final states and duration of each phase, then the free parameters, from the variables."""
        found, row, one = list[Triplets](), 0, np.ones((1, 1))
        for name, where in self.variables.items():
            nx, arcs = self.layouts[name].stage.function.size1_in(0), self.layouts[name].mesh.arcs
            for start in (where.x.start, where.x.stop - nx):
                found.append(blocks(one, np.eye(nx), 0, 0, row, start))
                row += nx
            found.append(blocks(one, np.ones((1, arcs)), 0, 0, row, where.durations.start))
            row += 1
        free = len(self.scale) - self.parameters.start
        found.append(blocks(one, np.eye(free), 0, 0, row, self.parameters.start))
        return self._by_variables(stacked(found), row + free)

    def _add(
        self, kind: str, phase: str, name: Hashable, labels: tuple[Component, ...], bounds: tuple[Any, Any], scale: np.ndarray,
        linear: Triplets | None, scatter: Triplets | None = None, interval: np.ndarray | None = None,
        place: np.ndarray | None = None, unit: str = "",
    ) -> None:  # fmt: skip
        start, empty = self._count, np.zeros(0)
        interval = empty.astype(int) if interval is None else interval
        rows = Rows(kind, phase, name, labels, start, interval, empty if place is None else place, scale, unit)
        self._rows.append(rows)
        for given, out in ((linear, self._linear), (scatter, self._scattered[phase])):
            if given is not None:
                value, row, column = given
                out.append((value, row + start, column))
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
        z[self.parameters] = _values(self.free, parameters)
        return z / self.scale

    def guess_from(self, phases: Mapping[str, PhaseTrajectory]) -> dict[str, FromTrajectory]:
        """Trajectories of an earlier solve as a guess."""
        return {name: FromTrajectory(trajectory) for name, trajectory in phases.items()}

    def free_from(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """The free ones among the parameters of an earlier solve: without them its trajectories are half a guess."""
        return {q.name: parameters[q.name] for q in self.free if q.name in parameters}

    def parameter_values(self, parameters: Mapping[str, Any] | None = None) -> np.ndarray:
        """The NLP's fixed parameters, from their own values and the overrides given."""
        return _values(self.fixed, parameters)

    def unpack(self, z: np.ndarray, p: np.ndarray) -> tuple[dict[str, PhaseTrajectory], dict[str, np.ndarray]]:
        """Trajectories by phase and the values of all parameters from a scaled NLP vector."""
        physical = z * self.scale
        values = {**split(self.fixed, p), **split(self.free, physical[self.parameters])}
        p = _values(self.problem.parameters, values)
        phases = {name: self._trajectory(layout, physical, p) for name, layout in self.layouts.items()}
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
        by_interval = (len(intervals), len(self.scheme.c), -1)
        return PhaseTrajectory(
            self.scheme, edges, starts, xdot.reshape(by_interval), controls.reshape(by_interval), layout.mesh.arc
        )


def _values(chosen: Sequence[Parameter], given: Mapping[str, Any] | None) -> np.ndarray:
    """The parameters' own values, or those given by name, one after another."""
    values = {q.name: q.value for q in chosen} | dict(given or {})
    return np.concatenate([np.zeros(0), *(np.broadcast_to(values[q.name], (q.size,)) for q in chosen)])
