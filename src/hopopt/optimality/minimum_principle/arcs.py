"""Arcs: stretches of a phase along which the same limits act, told from the multipliers and the limits' slack."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from hopopt.nlp.layout import PhaseLayout
from hopopt.nlp.refinement.continuous_limits import bernstein
from hopopt.nlp.solver.ipopt import Bounds, NlpSolution
from hopopt.ocp.problem import Component

AT_LIMIT = 2e-4  # share of its range by which a limit may be missed and still hold
LEAST_ACTING_DENSITY = 1e-6  # share of the phase's largest multiplier density, scaled, below which a limit does not act


@dataclass(frozen=True)
class Activity:
    """At the n abscissae of N intervals: t (N, n) [s] since the phase began; ``upper`` and ``lower`` (N, n, m), which
    side of each limit acts; ``push`` (N, n, 2 m), what one range of either side gains by the node's multiplier, and
    ``met``, whether the problem's limit is met, whatever it gains;
    names of the limits (path constraints, then states, then controls), and which depend on the controls, (m,)."""

    t: np.ndarray
    upper: np.ndarray
    lower: np.ndarray
    push: np.ndarray
    met: np.ndarray
    limits: tuple[Component, ...]
    on_controls: np.ndarray

    @property
    def sides(self) -> np.ndarray:
        """Both sides side by side, (N, n, 2 m)."""
        return np.concatenate([self.upper, self.lower], axis=2)

    @property
    def switching(self) -> np.ndarray:
        """Intervals in which what acts changes, (N,)."""
        return (self.sides != self.sides[:, :1]).any(axis=(1, 2))


@dataclass(frozen=True)
class Arc:
    """Intervals first .. last (included) of a phase in which the same limits act: (name, "upper" or "lower")."""

    first: int
    last: int
    limits: tuple[tuple[Component, str], ...]

    @property
    def steady(self) -> bool:
        """Whether it is more than the interval of a switch."""
        return self.last > self.first


def activity(solution: NlpSolution, phase: str) -> Activity:
    """Where the limits of one phase act: they are met, and their multiplier pushes."""
    layout, trajectory = solution.transcription.layouts[phase], solution.phases[phase]
    scheme, N = layout.scheme, layout.mesh.intervals
    weight = (trajectory.lengths[:, None] * scheme.b).clip(1e-300)[..., None]
    pieces, names, to_moments = [], list[Component](), bernstein(scheme.c)
    t = solution.transcription
    given = replace(solution, bounds=Bounds(*t.bounds(t.guess_from(solution.phases)), t.lbg, t.ubg))
    met = [np.array([h - v, v - w]).reshape(2, N, -1, len(k)) < AT_LIMIT for _, v, w, h, k in limits_of(given, phase)]
    for lam, value, low, high, labels in limits_of(solution, phase):
        lam, value, low, high = (a.reshape(N, -1, len(labels)) for a in (lam, value, low, high))
        lam = np.einsum("inm,nk->ikm", lam, to_moments)  # none of them of the wrong sign
        pieces.append([np.maximum(lam, 0) / weight, np.maximum(-lam, 0) / weight, high - value, value - low])
        names += labels
    up, down, over, under = (np.concatenate(parts, axis=2) for parts in zip(*pieces, strict=True))
    least = LEAST_ACTING_DENSITY * max(up.max(initial=0.0), down.max(initial=0.0))
    at = trajectory.edges[:-1, None] + trajectory.lengths[:, None] * np.array(scheme.c)
    acts = (up > least) & (over < AT_LIMIT), (down > least) & (under < AT_LIMIT)
    push = np.concatenate([up, down], axis=2) * weight
    both = np.concatenate([np.concatenate(side, axis=2) for side in zip(*met, strict=True)], axis=2)
    return Activity(at, *acts, push, both, tuple(names), _on_controls(layout))


def _on_controls(layout: PhaseLayout) -> np.ndarray:
    """Which limits depend on the controls, (m,): path constraints by their derivatives, then states, then controls."""
    path = np.zeros((layout.stage.function.size1_out(1), layout.stage.function.size1_in(1)), dtype=bool)
    pattern = layout.stage.function.jac_sparsity(1, 1)
    path[tuple(np.array(part, dtype=int) for part in pattern.get_triplet())] = True
    sizes = (layout.stage.function.size1_in(k) for k in (0, 1))
    return np.concatenate([path.any(axis=1), *(np.full(n, k == 1) for k, n in enumerate(sizes))])


def limits_of(
    solution: NlpSolution, phase: str
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, tuple[Component, ...]]]:
    """Multipliers, values, lower and upper bounds, scaled, of groups of limits at all abscissae (path constraints,
    then states, then controls), and the components' names."""
    t, b = solution.transcription, solution.bounds
    layout, where = t.layouts[phase], t.variables[phase]
    n = len(layout.scheme.c)
    for rows in t.rows:
        if rows.kind == "path" and rows.phase == phase:
            own = slice(rows.start, rows.stop)
            yield solution.lam_g[own], solution.g[own], b.low_g[own], b.high_g[own], rows.labels
    for block, variables, nodes in (
        (where.x, layout.phase.states, layout.states_of[:, -n:]),
        (where.u, layout.phase.controls, layout.controls_of),
    ):
        labels = tuple(name for v in variables for name in v.components())
        if labels:
            at = block.start + nodes[..., None] * len(labels) + np.arange(len(labels))
            yield solution.lam_x[at], solution.z[at], b.low_z[at], b.high_z[at], labels


def arcs(act: Activity) -> list[Arc]:
    """Runs of intervals in which the same limits act throughout; an interval in which that changes is a run of its
    own, with what acts in most of its nodes."""
    found: list[Arc] = []
    switching, m = act.switching, len(act.limits)
    for i, sides in enumerate(act.sides):
        acting = np.flatnonzero(sides.mean(axis=0) > 0.5)
        limits = tuple((act.limits[k % m], "upper" if k < m else "lower") for k in acting)
        last = found[-1] if found else None
        if last and last.limits == limits and not switching[i] and not switching[last.last]:
            found[-1] = Arc(last.first, i, limits)
        else:
            found.append(Arc(i, i, limits))
    return found
