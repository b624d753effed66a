"""Does the leg meet the body, or itself? Least distances over a plan's table, by coal, which no planner uses."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from hopopt.design import Design
from hopopt.leg.geometry.distance import Distances
from hopopt.leg.geometry.smooth import clearances, kept
from hopopt.leg.geometry.solids import has_shape
from hopopt.leg.kinematics import reach, start_angles
from hopopt.leg.robot import BASE
from hopopt.record import Strict, if_any, stated
from hopopt.verify.check import LIMIT, Check
from hopopt.verify.table import NORMALISED_TIMES, Table, dense

EVENLY = np.linspace(0.0, 1.0, 21)  # normalised times of the intervals that are looked at closely
ZOOMS = 3  # how often the least distance is looked for again between the two nearest times
NEAR, CLOSEST = (
    0.01,
    1e-3,
)  # of the leg's reach above the least distance: intervals that are looked at closely, more closely


@dataclass(frozen=True)
class Collision(Strict):
    """How near the leg comes to the body, or to itself."""

    least_distance_m: float = stated(
        "least distance between solids that move against each other; negative: overlap [m]"
    )
    between: tuple[str, str] = stated("which two")
    time_s: float = stated("when, since stance began [s]")
    margin_m: float | None = if_any(
        "what the plan keeps: hop.collision_margin, or less where the hop starts nearer [m]"
    )
    error_m: float | None = if_any("by how much the smooth distance may err that the plan keeps it by [m]")
    left_out: tuple[str, ...] = if_any("neighbours at a joint that touch where the hop starts", default=())


def collision(design: Design, tables: Mapping[str, Table]) -> Collision | None:
    """How near the leg comes to the body or to itself; None for a leg without shapes, or whose solids never meet."""
    if not has_shape(design.leg):
        return None
    found = Distances(design.leg, start_angles(design))
    if not found.pairs:
        return None
    t, q = (np.concatenate([_rows(table, part) for table in tables.values()]) for part in ("t", "q"))
    least = found.all(q[..., BASE:].reshape(-1, q.shape[-1] - BASE)).reshape(*t.shape, -1).min(axis=(1, 2))
    size = reach(design.leg)
    near = np.flatnonzero(least <= least.min() + NEAR * size)
    looked = [_nearest(found, q[k], EVENLY) for k in near]
    closest = min(distance for _, _, distance in looked) + CLOSEST * size
    looked = [
        (_zoomed(found, q[k], place), k)
        for k, (place, _, distance) in zip(near, looked, strict=True)
        if distance <= closest
    ]
    (place, pair, distance), k = min(looked, key=lambda one: one[0][-1])
    begin, end = t[k, [0, -1]]
    planned, margin = clearances(design), None
    if planned is not None:
        margin = kept(design, planned, found)
    return Collision(
        distance, found.names(found.pairs[pair]), float(begin + place * (end - begin)),
        margin_m=margin, error_m=planned and planned.error, left_out=tuple(" and ".join(found.names(pair)) for pair in found.left_out),
    )  # fmt: skip


def _nearest(found: Distances, q: np.ndarray, at: np.ndarray) -> tuple[float, int, float]:
    """Where an interval q (K, 2 + n) comes nearest, of normalised times ``at`` (m,): the normalised time, the pair of solids,
    and their distance [m]."""
    distances = found.all(dense(NORMALISED_TIMES, q[None, :, BASE:], at)[0])
    place, pair = np.unravel_index(int(distances.argmin()), distances.shape)
    return float(at[place]), int(pair), float(distances.min())


def _zoomed(found: Distances, q: np.ndarray, place: float) -> tuple[float, int, float]:
    """The same about a normalised time ``place``, more and more closely."""
    nearest = place, 0, np.inf
    for zoom in range(1, ZOOMS + 1):
        about = np.linspace(-1, 1, len(EVENLY)) * (2 * EVENLY[1]) ** zoom
        nearest = _nearest(found, q, np.clip(nearest[0] + about, 0.0, 1.0))
    return nearest


def _rows(table: Table, part: str) -> np.ndarray:
    """Times (N, K) or poses (N, K, 2 + n) of a phase."""
    return np.asarray(getattr(table, part))


def collision_checks(design: Design, tables: Mapping[str, Table]) -> Iterator[Check]:
    """That no solid of the leg meets another, unless they may (hop.may_collide)."""
    found = None if design.hop.may_collide else collision(design, tables)
    if found is not None:
        where = f"{' and '.join(found.between)} at {found.time_s:.4f} s"
        allowed = LIMIT * reach(design.leg)
        yield Check("collision", max((found.margin_m or 0.0) - found.least_distance_m, 0.0), allowed, "m", where)
