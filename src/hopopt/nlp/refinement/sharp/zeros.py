"""Mesh edges at the instants at which a state passes zero, where what depends on it changes sharply.

Within an interval such a change is no polynomial: limits are passed there, and where it falls between the nodes decides
how much. So an edge is set at each zero and is free: the state is zero there, whenever that is. Intervals beside it are as
short as the change asks for. Where a state passes zero no more, its edge is one like any other on the next mesh. Between
its free zeros a state keeps its sign at the nodes, unless that holds it from something better: a node that goes to the other
side and back costs Newton's method most of its iterations.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from hopopt.nlp.mesh import PhaseMesh
from hopopt.nlp.solver.ipopt import Bounds, NlpSolution
from hopopt.nlp.trajectory import PhaseTrajectory
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.problem import Problem

SAMPLES = 33  # in each interval, where zeros are looked for
BEYOND = 2.0  # times the range of the sharp change, which a state must leave on both sides
LINGERS = 2 * BEYOND  # widths within which a zero is that of an edge: it takes as long through its range
APART = 0.01  # share of the phase: nearer to another, or to an end, a zero's edge is not free
GRADES = (0.0, 1.0, 2.0, 4.0, 8.0)  # edges beside a zero, by how long the state takes through the range
LONG = 1.5  # times as long as it is to be: a longer interval is cut
HELD = 1e-8  # of the objective's scale: a multiplier below is the barrier's
SAME = 0.35  # share of what an interval is to be, by which another edge may be away


@dataclass(frozen=True)
class Zero:
    """Where a state passes zero, and how long it takes through the range of its sharp change, as shares of the phase."""

    place: float
    component: int
    width: float


def sharp_states(problem: Problem) -> bool:
    """Whether anything changes sharply where a state of the problem is zero."""
    return any(phase.columns(phase.states, "sharp").any() for phase in problem.phases)


def zeros(solution: NlpSolution, phase: str) -> list[Zero]:
    """All of a phase that are passed from well below to well above, or the other way, or stand at its ends, in order of time."""
    layout, trajectory = solution.transcription.layouts[phase], solution.phases[phase]
    sharp = layout.phase.columns(layout.phase.states, "sharp")
    t, x, _ = trajectory.everywhere(np.linspace(0.0, 1.0, SAMPLES))
    place = t.ravel() / trajectory.duration
    found = [zero for k in np.flatnonzero(sharp) for zero in _passed(place, x[:, :, k].ravel(), int(k), sharp[k])]
    return sorted(found, key=lambda zero: zero.place)


def _passed(t: np.ndarray, x: np.ndarray, component: int, sharp: float) -> Iterator[Zero]:
    """Those of one component, from its values x at times t, as shares of the phase."""
    beyond = np.flatnonzero(np.abs(x) > BEYOND * sharp)
    for end, first in ((0, beyond[:1]), (-1, beyond[-1:])):
        if abs(x[end]) < sharp and first.size:  # it begins or ends there
            slope = (np.abs(x[first[0]]) - abs(x[end])) / max(abs(t[first[0]] - t[end]), 1e-300)
            yield Zero(float(t[end]), component, float(sharp / slope))
    for a, b in pairwise(beyond):
        if x[a] * x[b] > 0:
            continue
        inside = slice(a, b + 1)
        ts, xs = t[inside], np.sign(x[b]) * x[inside]
        last = int(np.flatnonzero(xs <= 0)[-1])  # the last that is not yet on the other side
        rise = xs[last + 1] - xs[last]
        at = ts[last] - xs[last] / rise * (ts[last + 1] - ts[last])
        slope = (xs[-1] - xs[0]) / max(ts[-1] - ts[0], 1e-300)
        yield Zero(float(at), component, float(sharp / slope))


def keeps_zeros(solution: NlpSolution) -> bool:
    """Whether states pass zero at all edges that are free for that. One that touches zero there and goes back is of another,
    worse optimum, which finer meshes do not leave."""
    for name, mesh in solution.transcription.mesh.items():
        if not mesh.zeros:
            continue
        places, found = solution.phases[name].normalised_edges, zeros(solution, name)
        for k, component in _free_zeros(mesh):
            if not any(z.component == component and abs(z.place - places[k]) <= LINGERS * z.width for z in found):
                return False
    return True


def keeping_signs(
    t: Transcription, guess: Mapping[str, Any], bounds: Bounds, same: Mapping[str, PhaseMesh] | None = None
) -> Bounds:
    """The bounds and zero as another, at nodes at which sharp states are to keep the sign that a guess has there: beside free
    zeros.

    same: the guess's meshes, if they have the same intervals. Then all states that are well beyond their sharp change keep their
        sign, and those at zero at an edge that was free stay there: as its place was best, that holds them from nothing.
    """
    low, high, z = bounds.low_z.copy(), bounds.high_z.copy(), t.pack(guess)
    for name, layout in t.layouts.items():
        sharp = layout.phase.columns(layout.phase.states, "sharp")
        # not the phase's, where its numbers are another leg's
        scale = t.scale[t.variables[name].x].reshape(layout.state_nodes, -1)[0]
        low_x, high_x, x = (side[t.variables[name].x].reshape(layout.state_nodes, -1) for side in (low, high, z))
        for component in np.flatnonzero(sharp):
            edges = [k * t.scheme.steps for k, c in _free_zeros(layout.mesh) if c == component]
            speeds = scale[component] * x[:, component]
            kept = _kept(edges, speeds, float(sharp[component]), everywhere=same is not None)
            up, down = (kept & (side * x[:, component] > 0) for side in (1, -1))
            low_x[up, component] = np.maximum(low_x[up, component], 0.0)
            high_x[down, component] = np.minimum(high_x[down, component], 0.0)
        for k, component in _free_zeros(same[name]) if same else ():
            low_x[k * t.scheme.steps, component] = high_x[k * t.scheme.steps, component] = 0.0
    return replace(bounds, low_z=low, high_z=high)


def _free_zeros(mesh: PhaseMesh) -> list[tuple[int, int]]:
    """Edges that are free where a state is zero, with its component."""
    return list(zip(mesh.free, mesh.zeros, strict=True)) if mesh.zeros else []


def _kept(edges: Sequence[int], x: np.ndarray, sharp: float, everywhere: bool) -> np.ndarray:
    """At which nodes a state keeps the sign of x, (nodes,); edges: nodes at which it is zero."""
    beyond = np.flatnonzero(np.abs(x) > BEYOND * sharp)
    kept = np.zeros(len(x), dtype=bool)
    kept[beyond] = everywhere
    for first, last in pairwise([-1, *edges, len(x)]) if edges else ():
        far = beyond[(beyond > first) & (beyond < last)]
        if not far.size or np.ptp(np.sign(x[far])):  # it has no sign there, or both
            continue
        begins = far[0] if first < 0 else first + 1  # at the phase's ends it may still be on either side
        ends = far[-1] + 1 if last == len(x) else last
        kept[begins:ends] |= np.sign(x[begins:ends]) == np.sign(x[far[0]])
    return kept


def without_signs(s: NlpSolution, bounds: Bounds) -> tuple[NlpSolution, bool]:
    """A solution within the bounds that ``keeping_signs`` was given, and whether a zero that it added held it from something better."""
    below = (s.bounds.low_z != bounds.low_z) & (s.lam_x < 0)
    above = (s.bounds.high_z != bounds.high_z) & (s.lam_x > 0)
    held = np.abs(s.lam_x[below | above]) > HELD * s.transcription.problem.objective.scale
    return replace(s, bounds=bounds, lam_x=np.where(below | above, 0.0, s.lam_x)), bool(held.any())


def cut_at_zeros(p: PhaseTrajectory, normalised_times: list[np.ndarray], passed: Sequence[Zero]) -> list[np.ndarray]:
    """The normalised times at which each interval of a phase is to be cut, with those that its zeros ask for."""
    if not passed:
        return normalised_times
    edges = p.normalised_edges
    cuts = np.concatenate([a + (b - a) * s for (a, b), s in zip(pairwise(edges), normalised_times, strict=True)])
    for zero in passed:
        for offset, length in _beside(zero.width):
            cuts = _with(edges, cuts, zero.place + offset, length)
    return [(np.sort(cuts[(cuts > a) & (cuts < b)]) - a) / (b - a) for a, b in pairwise(edges)]


def _beside(width: float) -> Iterator[tuple[float, float]]:
    """Where edges are wanted about a zero, and how long the intervals there are to be."""
    yield 0.0, width
    for near, far in pairwise(GRADES):
        yield from ((side * far * width, (far - near) * width) for side in (-1, 1))


def _with(edges: np.ndarray, cuts: np.ndarray, place: float, length: float) -> np.ndarray:
    """The cuts with one more at ``place``, in place of those close by; as they are where an edge is close, or none is needed."""
    here = np.sort(np.concatenate([edges, cuts]))
    k = int(np.clip(np.searchsorted(here, place), 1, len(here) - 1))
    fine = here[k] - here[k - 1] <= LONG * length
    if not 0.0 < place < 1.0 or fine or np.abs(edges - place).min() < SAME * length:
        return cuts
    return np.append(cuts[np.abs(cuts - place) >= SAME * length], place)


def free_at_zeros(mesh: PhaseMesh, passed: Sequence[Zero]) -> PhaseMesh:
    """The mesh with its edges at zeros free, those far enough from each other and from its ends."""
    if not passed:
        return mesh
    edges, free, components = np.array(mesh.edges), list[int](), list[int]()
    for zero in passed:
        k = int(np.argmin(np.abs(edges - zero.place)))
        if min(edges[k] - edges[free[-1] if free else 0], 1 - edges[k]) >= APART:
            free.append(k)
            components.append(zero.component)
    return PhaseMesh(mesh.edges, tuple(free), tuple(components))
