"""A phase's right-hand sides as one function, and where on its mesh they are evaluated; what depends on the ends."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from hopopt.nlp.mesh import PhaseMesh
from hopopt.nlp.schemes import Scheme, lagrange
from hopopt.nlp.terms import Local, Matrix, Triplets, blocks, entries, stacked, together
from hopopt.ocp.problem import Component, Ends, Instant, Parameter, Phase, Problem, components, stack, symbols


@dataclass(frozen=True)
class Stage:
    """A phase's right-hand sides at one instant as one SX function (x, u, t, p) -> (x', path, integrands)."""

    phase: Phase
    function: ca.Function
    path_labels: tuple[tuple[Component, ...], ...]

    @property
    def path_sizes(self) -> tuple[int, ...]:
        """Components of each path constraint."""
        return tuple(len(labels) for labels in self.path_labels)

    def path_column(self, what: str) -> np.ndarray:
        """``lower``, ``upper`` or ``scale`` of all components of the path constraints, stacked."""
        sides = [np.asarray(getattr(c, what), dtype=float) for c in self.phase.path]
        return np.concatenate(
            [np.zeros(0), *(np.broadcast_to(*pair) for pair in zip(sides, self.path_sizes, strict=True))]
        )

    @property
    def smooth(self) -> np.ndarray:
        """Which components of the path constraints may be enforced between the nodes."""
        return np.repeat([c.smooth for c in self.phase.path], self.path_sizes).astype(bool)

    @property
    def row_outputs(self) -> int:
        """Outputs that enter rows of the NLP: x' and path."""
        return self.function.size1_out(0) + self.function.size1_out(1)

    @property
    def outputs(self) -> int:
        """All outputs."""
        return self.row_outputs + self.function.size1_out(2)

    def over_arc(self, parameters: Sequence[Parameter]) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Variables (x, u, t, free parameters, T), fixed parameters, and outputs (T x', path, T integrands).

        T is the duration of the arc [s]; times it, derivatives and integrands are taken per fraction of the arc.
        """
        sizes = [self.function.size1_in(k) for k in range(2)]
        x, u, t, T = (ca.SX.sym(n, k) for n, k in zip("xutT", [*sizes, 1, 1], strict=True))
        p = symbols(parameters)
        xdot, path, integrands = self.function(x, u, t, stack(p, parameters))
        free, fixed = (stack(p, [q for q in parameters if q.free is kind]) for kind in (True, False))
        return ca.vertcat(x, u, t, free, T), fixed, ca.vertcat(T * xdot, path, T * integrands)


def stage_of(problem: Problem, phase: Phase) -> Stage:
    """The stage of a phase, made once for all meshes of the problem."""
    return problem.once(("stage", phase.name), lambda: make_stage(phase, problem.parameters))


def make_stage(phase: Phase, parameters: Sequence[Parameter]) -> Stage:
    """Evaluate the phase's functions on symbols, once."""
    x, u, p = symbols(phase.states), symbols(phase.controls), symbols(parameters)
    t = ca.SX.sym("t")
    instant = Instant(t=t, p=p, **x, **u)
    path = [ca.vec(ca.SX(c.value(instant))) for c in phase.path]
    integrands = [ca.SX(f(instant)) for f in phase.integrands.values()]
    inputs = [stack(x, phase.states), stack(u, phase.controls), t, stack(p, parameters)]
    outputs = [stack(phase.dynamics(instant), phase.states), ca.vertcat(*path), ca.vertcat(*integrands)]
    labels = tuple(components(c.name, int(v.numel()), c.labels) for c, v in zip(phase.path, path, strict=True))
    function = ca.Function(
        f"stage_{phase.name}".replace("-", "_").replace(" ", "_"), inputs, [ca.densify(o) for o in outputs]
    )
    return Stage(phase, function, labels)


def ends_of(problem: Problem) -> tuple[Local, list[int]]:
    """The objective (less is better) and the boundary constraints as one function of the ends of all phases, made once
    for all meshes of the problem, and how many values each constraint has."""
    return problem.once("ends", lambda: _make_ends(problem))


def _make_ends(problem: Problem) -> tuple[Local, list[int]]:
    goal, at = problem.objective, EndSymbols(problem)
    values = [ca.vec(ca.SX(c.value(at.ends))) for c in problem.boundary]
    outputs = ca.vertcat(goal.cost(ca.SX(goal.value(at.ends))), *values)
    free, fixed = (stack(at.p, [q for q in problem.parameters if q.free is kind]) for kind in (True, False))
    y = [symbol for parts in at.parts.values() for symbol in parts[:3]]
    extra = [parts[3] for parts in at.parts.values()]
    return Local("ends", ca.vertcat(*y, free), ca.vertcat(*extra, fixed), outputs), [int(v.numel()) for v in values]


class EndSymbols:
    """Symbols for the ends of all phases: ``ends``, made of the parameters ``p`` and, by phase, of ``parts``: initial
    and final state, duration, integrals."""

    def __init__(self, problem: Problem):
        self.p, self.parts = symbols(problem.parameters), dict[str, tuple[ca.SX, ca.SX, ca.SX, ca.SX]]()
        initial, final, duration, integral = {}, {}, {}, {}
        for phase in problem.phases:
            first, last, T = symbols(phase.states), symbols(phase.states), ca.SX.sym("T")
            total, name = ca.SX.sym("I", len(phase.integrands)), phase.name
            self.parts[name] = (stack(first, phase.states), stack(last, phase.states), T, total)
            initial[name], final[name] = Instant(t=ca.SX(0), p=self.p, **first), Instant(t=T, p=self.p, **last)
            duration[name] = T
            integral[name] = {n: total[k] for k, n in enumerate(phase.integrands)}
        self.ends = Ends(initial, final, duration, integral, self.p)


@dataclass(frozen=True)
class PhaseVariables:
    """Index ranges of one phase's variables in the NLP vector."""

    x: slice
    u: slice
    durations: slice


class PhaseLayout:
    """Where one phase's nodes lie, and where its right-hand sides are evaluated.

    Points are the abscissae of every interval, interval by interval: an edge that two intervals collocate is two
    points, for each has controls of its own, which may jump there. Path constraints hold at those points that are
    control abscissae too, as many as there are controls to meet them. State nodes, control nodes and points are
    counted from the phase's beginning.
    """

    def __init__(self, stage: Stage, scheme: Scheme, mesh: PhaseMesh):
        self.stage, self.scheme, self.mesh, self.phase = stage, scheme, mesh, stage.phase
        N, n, steps = mesh.intervals, len(scheme.c), scheme.steps
        self.points, self.state_nodes, self.control_nodes = N * n, N * steps + 1, N * len(scheme.control_c)
        self.interval, self.place = np.repeat(np.arange(N), n), np.tile(scheme.c, N)
        self.state_at = self.states_of[:, steps + 1 - n :].ravel()
        self.constrained = np.isin(self.place, scheme.control_c)
        self.arc_at = mesh.arc[self.interval]
        # time since the phase began = duration of earlier arcs + share of its own: t = time_matrix @ durations
        self.time_matrix = self.times_of(self.interval, self.place)

    @cached_property
    def states_of(self) -> np.ndarray:
        """State nodes of every interval, both ends included, (N, steps + 1)."""
        return np.arange(self.mesh.intervals)[:, None] * self.scheme.steps + np.arange(self.scheme.steps + 1)

    @cached_property
    def controls_of(self) -> np.ndarray:
        """Control nodes of every interval, (N, controls)."""
        return np.arange(self.control_nodes).reshape(self.mesh.intervals, -1)

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
        N, places = self.mesh.intervals, self.scheme.control_c
        return np.repeat(np.arange(N), len(places)), np.tile(places, N)

    @cached_property
    def control_matrix(self) -> Matrix:
        """C with controls at the points = U C, shape (control_nodes, points)."""
        weights = lagrange(self.scheme.control_c, np.array(self.scheme.c)).T
        weights, every = np.where(np.abs(weights) < 1e-14, 0, weights), np.arange(self.mesh.intervals)
        parts = blocks((np.ones(len(every)), every, every), weights, *weights.shape)
        return together([parts], (self.control_nodes, self.points))

    def defect_matrices(self) -> tuple[Triplets, Triplets]:
        """S' and Q' with defects = X S - (X' times arc duration) Q, one column for each new state node."""
        steps, columns = self.scheme.steps, np.arange(self.state_nodes - 1)
        signs, first = np.repeat([1.0, -1.0], len(columns)), columns // steps * steps
        S = signs, np.tile(columns, 2), np.concatenate([columns + 1, first])
        every = np.arange(self.mesh.intervals)
        return S, blocks((self.mesh.shares, every, every), self.scheme.A, *self.scheme.A.shape)

    def gather(self, where: PhaseVariables, parameters: slice) -> Triplets:
        """Each point's (x, u, t, free parameters, T), stacked, from the NLP vector."""
        nx, nu, free = *(self.stage.function.size1_in(k) for k in range(2)), parameters.stop - parameters.start
        every, one, size = np.arange(self.points), np.ones(self.points), nx + nu + 2 + free
        value, node, point = entries(self.control_matrix)
        pieces = [
            ((one, every, self.state_at), nx, where.x.start),
            ((value, point, node), nu, where.u.start),
            (entries(self.time_matrix), 1, where.durations.start),
            ((one, every, np.zeros(self.points, dtype=int)), free, parameters.start),
            ((one, every, self.arc_at), 1, where.durations.start),
        ]
        found, row = list[Triplets](), 0
        for places, count, start in pieces:
            found.append(blocks(places, np.eye(count), size, count, row, start))
            row += count
        return stacked(found)

    def quadrature(self) -> np.ndarray:
        """Weight of each point in an integral, per duration of its arc, shape (points,)."""
        return np.outer(self.mesh.shares, self.scheme.b).ravel()
