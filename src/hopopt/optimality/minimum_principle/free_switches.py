"""An optimum solved again with the switches of its drives at free times, so that torques jump exactly there.

1. Mesh edges are moved to the switches and set free, the drives' lines beside them held as equations: one program
   finds the times (optimality/minimum_principle/switch_times.py says which may move). Limits are enforced between the nodes there too (nlp/refinement/continuous_limits.py), or
   the times would serve to pass them.
2. The times found are edges of an ordinary mesh; the problem itself, all limits inequalities again, is solved and
   refined there.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hopopt.nlp.deadline import Deadline
from hopopt.nlp.mesh import PhaseMesh
from hopopt.nlp.refinement.continuous_limits import Chosen, enforcing, holds, nothing_enforced
from hopopt.nlp.refinement.interval_errors import IntervalErrors, interval_errors
from hopopt.nlp.refinement.mesh_refinement import Refinement
from hopopt.nlp.refinement.mesh_step import MeshStep, Report, relative
from hopopt.nlp.refinement.next_mesh import Aims
from hopopt.nlp.solver.ipopt import WARM, Bounds, NlpSolution, NlpSolver
from hopopt.nlp.trajectory import PhaseTrajectory
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.problem import Component
from hopopt.optimality.minimum_principle.arcs import activity
from hopopt.optimality.minimum_principle.switch_times import Pin, SwitchPlan, plan
from hopopt.optimality.minimum_principle.torque_jumps import jumps

SLIVER = 8e-4  # share of the phase: shorter intervals beside a switch are joined with their neighbours
BESIDE = 0.05  # share of the phase: how far beside a switch lines are held
LEAST_ARC = 0.3  # share of an arc's duration that must remain
MOST_ITERATIONS = 200  # iterations
Line = tuple[Component, str, np.ndarray]  # limit, side and the intervals in which it is held


@dataclass(frozen=True)
class Resolved:
    """A solution with its switches at edges of the mesh; its history of refinement, by phase the times found for the
    switches and those of them at which a torque jumps [s], the relative change of the objective, and how refinement
    ended."""

    solution: NlpSolution
    history: tuple[MeshStep, ...]
    switches: Mapping[str, tuple[float, ...]]
    jumps: Mapping[str, tuple[float, ...]]
    change: float
    ended: str

    @property
    def errors(self) -> dict[str, IntervalErrors]:
        """What is wrong between the nodes, by phase."""
        return errors_of(self.solution)


def errors_of(solution: NlpSolution) -> dict[str, IntervalErrors]:
    """Errors of every interval, by phase."""
    return {name: interval_errors(solution, name) for name in solution.phases}


def resolve(refined: NlpSolution, settled: MeshStep, aims: Aims, report: Report = lambda step: None) -> Resolved | str:
    """``refined`` solved again, or in a sentence why not; ``settled`` is its step of refinement, to compare with."""
    plans = {name: plan(activity(refined, name), p.duration, refined.objective) for name, p in refined.phases.items()}
    if not any(any(p.free) for p in plans.values()):
        return "no switch of a drive is far enough from limits of heights and angles to be moved"
    timed = _with_free_times(refined, plans, aims.until)
    if timed is not None and (vanished := _vanished(refined, timed)):
        plans = {n: SwitchPlan((), (), ()) if n in vanished else p for n, p in plans.items()}
        timed = _with_free_times(refined, plans, aims.until) if any(any(p.free) for p in plans.values()) else None
        if timed is None or _vanished(refined, timed):
            return "an arc vanished when the switching times were free"
    if timed is None:
        return "the program with free switching times was not solved"
    refinement = _refined(timed, settled, aims, report)
    if refinement is None:
        return "the problem was not solved on the mesh with the switches at its edges"
    switches = {n: _free_times(timed, n) for n in plans}
    final = refinement.solution
    change = relative(final.objective, refined.objective)
    found = {n: jumps(final, n, times) for n, times in switches.items()}
    return Resolved(final, tuple(refinement.history[1:]), switches, found, change, refinement.ended)


# ---- free times ---------------------------------------------------------------------------------------------


def _with_free_times(refined: NlpSolution, plans: Mapping[str, SwitchPlan], until: Deadline) -> NlpSolution | None:
    old = refined.transcription
    mesh = {name: switched_mesh(refined.phases[name], p) for name, p in plans.items()}
    t = Transcription(old.problem, old.scheme, mesh)
    guess = t.guess_from(refined.phases)
    bounds = Bounds(*t.bounds(guess), t.lbg, t.ubg)
    for name, p in plans.items():
        edges = np.array(mesh[name].edges) * refined.phases[name].duration
        bounds = held(t, bounds, name, _beside(edges, mesh[name].free, p.pins))
    between, z = enforcing(t, enforced_at_first(t)), t.pack(guess, t.free_from(refined.parameters))
    start = replace(refined, z=z, lam_g=np.zeros(len(t.lbg)), lam_x=np.zeros(len(z)))
    found = NlpSolver(between.transcription, WARM | {"ipopt.max_iter": MOST_ITERATIONS}, until=until).again(
        start, bounds
    )
    return between.at_nodes(found) if found.success else None


def enforced_at_first(t: Transcription) -> Chosen:
    """Path limits that are enforced between the nodes from the beginning: all, if enforcing pays."""
    return {name: none | holds(t) for name, none in nothing_enforced(t).items()}


def switched_mesh(trajectory: PhaseTrajectory, p: SwitchPlan) -> PhaseMesh:
    """The phase's mesh with the nearest edges moved to the switches, those that may move free, slivers joined."""
    edges, T = trajectory.edges.copy(), trajectory.duration
    at = [int(np.argmin(np.abs(edges[1:-1] - t))) + 1 for t in p.switches]
    edges[at] = p.switches
    kept = [0]
    for k in range(1, len(edges)):
        fixed = k in at or k == len(edges) - 1
        while fixed and kept[-1] not in (0, *at) and edges[k] - edges[kept[-1]] < SLIVER * T:
            kept.pop()
        if fixed or edges[k] - edges[kept[-1]] >= SLIVER * T:
            kept.append(k)
    free = sorted({kept.index(k) for k, moves in zip(at, p.free, strict=True) if moves})
    return PhaseMesh(tuple((edges[kept] / T).tolist()), tuple(free))


def _beside(edges: np.ndarray, free: Sequence[int], pins: Sequence[Pin]) -> list[Line]:
    """Limit, side and the intervals (indices) in which it is held: those that begin or end close to an edge that is free.

    Enforced throughout, lines that are not quite met elsewhere would move the times.
    """
    middle, times = (edges[1:] + edges[:-1]) / 2, edges[list(free)]
    close = (np.abs(edges[:, None] - times) <= BESIDE * edges[-1]).any(axis=1)
    near = close[1:] | close[:-1]
    return [(p.limit, p.side, np.flatnonzero(near & (middle > p.begin) & (middle < p.end))) for p in pins]


def held(t: Transcription, b: Bounds, phase: str, lines: Sequence[Line]) -> Bounds:
    """The bounds with lines held as equations in some intervals."""
    low, high = b.low_g.copy(), b.high_g.copy()
    for rows in t.rows:
        for limit, side, intervals in lines:
            if rows.kind == "path" and rows.phase == phase and limit in rows.labels:
                places = np.flatnonzero(np.isin(rows.interval, intervals))
                at = rows.start + places * len(rows.labels) + rows.labels.index(limit)
                low[at] = high[at] = (b.high_g if side == "upper" else b.low_g)[at]
    return Bounds(b.low_z, b.high_z, low, high)


def _vanished(before: NlpSolution, timed: NlpSolution) -> list[str]:
    """Phases in which an arc has lost most of its duration."""
    found = []
    for name, mesh in timed.transcription.mesh.items():
        p = timed.phases[name]
        spans = np.bincount(p.arc, p.lengths)
        if (spans < LEAST_ARC * mesh.spans * before.phases[name].duration).any():
            found.append(name)
    return found


def _free_times(solution: NlpSolution, phase: str) -> tuple[float, ...]:
    at = list(solution.transcription.mesh[phase].free)
    return tuple(float(t) for t in solution.phases[phase].edges[at])


# ---- the problem itself --------------------------------------------------------------------------------------


def _refined(timed: NlpSolution, settled: MeshStep, aims: Aims, report: Report) -> Refinement | None:
    """The problem solved and refined on the mesh of ``timed``, all its edges fixed."""
    old = timed.transcription
    mesh = {name: PhaseMesh(tuple(p.normalised_edges.tolist())) for name, p in timed.phases.items()}
    t = Transcription(old.problem, old.scheme, mesh)
    guess, free = t.guess_from(timed.phases), t.free_from(timed.parameters)
    chosen = enforced_at_first(t)
    between = enforcing(t, chosen)
    first = NlpSolver(between.transcription, WARM | {"ipopt.max_iter": MOST_ITERATIONS}, until=aims.until)(guess, free)
    if not first.success:
        first = NlpSolver(between.transcription, {"ipopt.max_iter": aims.iterations}, until=aims.until)(guess, free)
    if not first.success:
        return None
    brief = replace(aims, restarts=0.0)  # there is an answer already: not for minutes
    refinement = Refinement(between.at_nodes(first), brief, report, chosen)
    refinement.history.insert(0, settled)
    return refinement.run()
