"""Does the leg meet the body, or itself? Least distances over a plan's table, by coal, which no planner uses."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hopopt.design import Design, Leg
from hopopt.leg.geometry.distance import Distances, distances_of
from hopopt.leg.geometry.smooth import Clearances, clearances, kept, margin_of
from hopopt.leg.geometry.solids import has_shape
from hopopt.leg.kinematics import reach
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
    without_solids: tuple[str, ...] = if_any("cranks and rods, which have no solids and are not looked at", default=())


LAST = 8  # measurements that are kept
_last: dict[tuple[object, ...], "Nearest"] = {}


@dataclass(frozen=True)
class Nearest:
    """Where pairs of solids come nearest: their distance [m], which pair, and when [s]."""

    distance: float
    pair: tuple[int, int]
    time: float

    def named(self, found: Distances) -> tuple[str, str]:
        """What the two are called."""
        return found.names(self.pair)


def collision(design: Design, tables: Mapping[str, Table]) -> Collision | None:
    """How near the leg comes to the body or to itself; None for a leg without shapes, or whose solids never meet."""
    if not has_shape(design.leg) or not (found := distances_of(design)).pairs:
        return None
    near, planned = nearest(found, found.pairs, tables, reach(design.leg)), clearances(design)
    promised = _promised(design, planned, found, near.pair)
    return Collision(
        near.distance, near.named(found), near.time, margin_m=promised and promised[0], error_m=promised and promised[1],
        left_out=tuple(" and ".join(found.names(pair)) for pair in found.left_out),
        without_solids=_without_solids(design.leg),
    )  # fmt: skip


def _without_solids(leg: Leg) -> tuple[str, ...]:
    """The parts of transmissions that move beside the links, in words."""
    parts = {"rod": "rod", "four_bar": "crank and rod", "five_bar": "crank and rod"}
    between = {joint: leg.joint[joint].transmission for joint in leg.joints}
    return tuple(
        f"{words} of the {joint}"
        for joint, t in between.items()
        for law, words in parts.items()
        if t and getattr(t, law)
    )


def _promised(
    design: Design, planned: Clearances | None, found: Distances, pair: tuple[int, int]
) -> tuple[float, float] | None:
    """What the plan keeps between a pair, and by how much the smooth distance errs that it keeps it by [m]; None of a pair that
    can never come near, or need not be kept apart."""
    if planned is None or pair in found.beside:
        return None
    other, joint = (found.solids[k].joint for k in pair)
    each = zip(planned.links, kept(design, planned), strict=True)
    own = [(least, link.error) for link, least in each if (link.joint, link.other) == (joint, other)]
    return own[0] if own else None


def nearest(found: Distances, pairs: Sequence[tuple[int, int]], tables: Mapping[str, Table], size: float) -> Nearest:
    """Where these pairs come nearest in a plan of a leg of that reach [m]; kept for the plan that was last asked for."""
    t, q = (np.concatenate([_rows(table, part) for table in tables.values()]) for part in ("t", "q"))
    key = found, tuple(pairs), t.tobytes(), q.tobytes()
    if key not in _last:
        while len(_last) >= LAST:
            del _last[next(iter(_last))]
        _last[key] = _closest(found, pairs, t, q[..., BASE:], size)
    return _last[key]


def _closest(found: Distances, pairs: Sequence[tuple[int, int]], t: np.ndarray, q: np.ndarray, size: float) -> Nearest:
    """The same of times (N, K) and angles (N, K, n) of all intervals."""
    least = found.all(q.reshape(-1, q.shape[-1]), pairs).reshape(*t.shape, -1).min(axis=(1, 2))
    near = np.flatnonzero(least <= least.min() + NEAR * size)
    looked = [_looked_at(found, pairs, q[k], EVENLY) for k in near]
    closest = min(distance for _, _, distance in looked) + CLOSEST * size
    looked = [
        (_zoomed(found, pairs, q[k], place), k)
        for k, (place, _, distance) in zip(near, looked, strict=True)
        if distance <= closest
    ]
    (place, pair, distance), k = min(looked, key=lambda one: one[0][-1])
    begin, end = t[k, [0, -1]]
    return Nearest(distance, pairs[pair], float(begin + place * (end - begin)))


def _looked_at(
    found: Distances, pairs: Sequence[tuple[int, int]], q: np.ndarray, at: np.ndarray
) -> tuple[float, int, float]:
    """Where an interval of angles q (K, n) comes nearest, of normalised times ``at`` (m,): the normalised time, the number of the
    pair of solids, and their distance [m]."""
    distances = found.all(dense(NORMALISED_TIMES, q[None], at)[0], pairs)
    place, pair = np.unravel_index(int(distances.argmin()), distances.shape)
    return float(at[place]), int(pair), float(distances.min())


def _zoomed(
    found: Distances, pairs: Sequence[tuple[int, int]], q: np.ndarray, place: float
) -> tuple[float, int, float]:
    """The same about a normalised time ``place``, more and more closely."""
    closest = place, 0, np.inf
    for zoom in range(1, ZOOMS + 1):
        about = np.linspace(-1, 1, len(EVENLY)) * (2 * EVENLY[1]) ** zoom
        closest = _looked_at(found, pairs, q, np.clip(closest[0] + about, 0.0, 1.0))
    return closest


def _rows(table: Table, part: str) -> np.ndarray:
    """Times (N, K) or poses (N, K, 2 + n) of a phase."""
    return np.asarray(getattr(table, part))


def collision_checks(design: Design, tables: Mapping[str, Table]) -> Iterator[Check]:
    """That no solid of the leg meets another, unless they may (hop.may_collide), and every link keeps what its plan keeps."""
    if design.hop.may_collide or not has_shape(design.leg) or not (found := distances_of(design)).pairs:
        return
    size = reach(design.leg)
    near = nearest(found, found.pairs, tables, size)
    missing = [(max(-near.distance, 0.0), near)]
    if near.distance < margin_of(design) and (planned := clearances(design)) is not None:
        for link, least in zip(planned.links, kept(design, planned), strict=True):
            own = nearest(found, found.between(link.joint, link.other), tables, size)
            missing.append((max(least - own.distance, 0.0), own))
    most, where = max(missing, key=lambda one: (one[0], -one[1].distance))
    words = f"{' and '.join(where.named(found))} at {where.time:.4f} s"
    yield Check("collision", most, LIMIT * size, "m", words)
