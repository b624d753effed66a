"""Every limit of a program as one thing: which rows or variables it became, in which phase, and when they are."""

from collections.abc import Hashable, Iterator
from dataclasses import dataclass

import numpy as np

from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.nlp.transcription import Rows
from hopopt.ocp.problem import Component, State


@dataclass(frozen=True)
class Limit:
    """One side of a limit at all its places.

    kind: path, boundary, duration, state, final (of a state), control or parameter; ``places`` where it stands in
    (g, z), (n,); ``times`` [s] since the phase began, (n,), NaN if it has none; ``bound`` and ``scale`` in ``unit``.
    Limits of one ``group`` are one constraint to whoever stated it: all components and both sides of a path or boundary
    constraint; every side of a variable is a group of its own.
    """

    kind: str
    phase: str
    name: Component
    upper: bool
    places: np.ndarray
    times: np.ndarray
    bound: float
    scale: float
    unit: str
    constraint: Hashable = ""

    @property
    def group(self) -> tuple[Hashable, ...]:
        """What limits of one group have in common, and no others."""
        return self.kind, self.phase, self.constraint or (self.name, self.upper)


def limits(solution: NlpSolution) -> list[Limit]:
    """All limits with a finite bound; what the dynamics, the joints between phases and the initial state fix is none."""
    return [limit for sides in (_of_rows(solution), _of_variables(solution)) for limit in sides]


def _of_rows(solution: NlpSolution) -> Iterator[Limit]:
    t = solution.transcription
    joined = {c.name for c in t.problem.boundary if c.joins}
    for rows in t.rows:
        if rows.kind == "defect" or (rows.kind == "boundary" and rows.name in joined):
            continue
        for k, label in enumerate(rows.labels):
            places = np.arange(rows.start + k, rows.stop, len(rows.labels))
            who, about = (rows.kind, rows.phase, label), (rows.scale[k], rows.unit)
            together = rows.name if rows.kind != "duration" else ""
            yield from _sides(who, places, _times(solution, rows), (t.lbg, t.ubg), *about, together)


def _times(solution: NlpSolution, rows: Rows) -> np.ndarray:
    if not len(rows.interval):
        return np.array([np.nan])
    trajectory = solution.phases[rows.phase]
    return trajectory.edges[rows.interval] + rows.place * trajectory.lengths[rows.interval]


def _of_variables(solution: NlpSolution) -> Iterator[Limit]:
    t, offset = solution.transcription, len(solution.transcription.lbg)
    low, high = t.bounds(t.guess_from(solution.phases))
    sides = tuple(np.concatenate([np.full(offset, np.nan), side]) for side in (low, high))
    for name, layout in t.layouts.items():
        where, phase, trajectory = t.variables[name], layout.phase, solution.phases[name]
        interval, place = layout.control_place
        nodes = layout.node_fraction * trajectory.duration
        times = {"x": nodes, "u": trajectory.edges[interval] + place * trajectory.lengths[interval]}
        for group, block, variables in (("x", where.x, phase.states), ("u", where.u, phase.controls)):
            at = offset + np.arange(block.start, block.stop).reshape(len(times[group]), -1)
            components = [(v, label, k) for v in variables for k, label in enumerate(v.components())]
            for column, (v, label, k) in enumerate(components):
                about = (float(v.column("scale")[k]), v.unit)
                if not isinstance(v, State):
                    yield from _sides(("control", name, label), at[:, column], times["u"], sides, *about)
                    continue
                own = slice(1, None if v.final is None else -1)
                yield from _sides(("state", name, label), at[own, column], nodes[own], sides, *about)
                if v.final is not None:
                    yield from _sides(("final", name, label), at[-1:, column], nodes[-1:], sides, *about)
        if layout.mesh.arcs == 1:
            at = offset + np.arange(where.durations.start, where.durations.stop)
            scale = float(t.scale[where.durations][0])
            yield from _sides(("duration", name, Component("duration")), at, np.array([np.nan]), sides, scale, "s")
    first = offset + t.parameters.start
    for p in t.free:
        for k, label in enumerate(p.components()):
            scale = float(p.column("scale")[k])
            yield from _sides(("parameter", "", label), np.array([first + k]), np.array([np.nan]), sides, scale, p.unit)
        first += p.size


def _sides(
    who: tuple[str, str, Component], places: np.ndarray, times: np.ndarray, sides: tuple[np.ndarray, ...], scale: float, unit: str,
    constraint: Hashable = "",
) -> Iterator[Limit]:  # fmt: skip
    for upper, side in enumerate(sides):
        if len(places) and np.isfinite(side[places[0]]):
            yield Limit(
                *who, bool(upper), places, times, float(side[places[0]] * scale), float(scale), unit, constraint
            )
