"""Which points of a map are solved again, and from which around them."""

from collections.abc import Collection, Mapping

import numpy as np

from hopopt.ocp.objectives.registry import find
from hopopt.studies.maps.pieces import neighbours
from hopopt.studies.maps.warm import MapPoint
from hopopt.studies.sweep.definition import Definition
from hopopt.studies.sweep.order import below_trend
from hopopt.studies.sweep.point_file import IMPOSSIBLE

AROUND = 3  # points that a doubtful one is solved from, at most


def doubtful(
    definition: Definition, points: Mapping[int, MapPoint], all_doubts: bool, besides: Collection[int] = ()
) -> dict[int, list[int]]:
    """The points to be solved again, each with those to begin from: those ``besides``, and those next to a family that was
    never followed to them; with ``all_doubts`` also those without a hop, and those that lie below the parabola through the
    hops around them."""
    solved = [k for k, p in sorted(points.items()) if p.solved]
    if not solved:
        return {}
    around, jobs = neighbours(definition, solved), dict[int, list[int]]()
    weak = {*besides, *(_weak(definition, points, solved) if all_doubts else ())}
    for k, p in sorted(points.items()):
        if p.outcome != IMPOSSIBLE:
            seen = () if k in weak else p.seen
            near = [g for g in around[k] if points[g].family not in seen]
            families = [points[g].family for g in near]
            first = [g for n, g in enumerate(near) if families[n] not in families[:n]]
            chosen = [*first, *(g for g in near if g not in first)][:AROUND] if k in weak else first[:AROUND]
            if chosen:
                jobs[k] = chosen
    return jobs


def _weak(definition: Definition, points: Mapping[int, MapPoint], solved: list[int]) -> set[int]:
    """Possible points without a hop, and those below the trend."""
    value = find(definition.objective).sign * np.array([points[k].objective_value or 0.0 for k in solved])
    low = below_trend(definition.normalized[solved], value)
    failed = {k for k, p in points.items() if not p.solved and p.outcome != IMPOSSIBLE}
    return failed | {k for k, below in zip(solved, low, strict=True) if below}
