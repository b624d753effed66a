"""Which point of a study begins from which, and which points are to be doubted."""

from collections.abc import Mapping, Sequence

import numpy as np

from hopopt.studies.consistency import contradicted
from hopopt.studies.sweep.definition import Definition
from hopopt.studies.sweep.point_file import IMPOSSIBLE, VERIFIED, Point

SEED_FOR = 24  # points that one seed may lead to
UNLIKE = 0.3  # of the scaled states: farther apart are optima of different kinds
SPOTS = 2  # points at least that are searched to check what their neighbours led to
DOUBT = 5e-4  # relative: how far below its neighbours' trend a point may lie


def tree(points: np.ndarray, chosen: Sequence[int], first: int | None = None) -> tuple[list[int], dict[int, int]]:
    """An order of the chosen points (n, d), and of all but the seeds the point before it that is nearest (Prim);
    ``first``: the only seed, if it is given."""
    x = points[list(chosen)]
    n = len(x)
    order = [int(np.argmin(np.linalg.norm(x - x.mean(axis=0), axis=1))) if first is None else list(chosen).index(first)]
    if first is None:
        order += farthest(x, order, n // SEED_FOR)
    away, parent, parents = np.full(n, np.inf), np.full(n, -1), dict[int, int]()
    for s in order:
        _attach(s, x, away, parent)
    away[order] = np.inf
    while len(order) < n:
        k = int(np.argmin(away))
        parents[k] = int(parent[k])
        order.append(k)
        _attach(k, x, away, parent)
        away[order] = np.inf
    return [chosen[k] for k in order], {chosen[k]: chosen[p] for k, p in parents.items()}


def farthest(x: np.ndarray, known: Sequence[int], count: int) -> list[int]:
    """So many of the points (n, d), each the farthest from those that are known and those before it."""
    found = list(known)
    while len(found) < min(len(known) + count, len(x)):
        found.append(int(np.argmax(np.min([np.linalg.norm(x - x[s], axis=1) for s in found], axis=0))))
    return found[len(known) :]


def to_search(definition: Definition, finished: Mapping[int, Point], number: int, last: bool = False) -> list[int]:
    """The points that are searched as a single solve is, in a pass after the first: as a spot check, those that are far from
    all that were. Where that finds better hops, the points beside them follow, and as many spots; in the ``last`` pass all."""
    possible = [k for k, p in sorted(finished.items()) if p.solved]
    left = {k for k in possible if not finished[k].searched}
    better = [k for k in possible if finished[k].found_by_search and finished[k].solved_in == number - 1 > 0]
    if last and better:
        return sorted(left)
    count = len(better) if number > 1 else max(SPOTS, 1 + len(possible) // SEED_FOR)
    searched = [place for place, k in enumerate(possible) if k not in left]
    spots = farthest(definition.normalized[possible], searched, count) if searched else []
    beside = {g for k in better for g in _next_to(k, possible, definition.spaced)}
    return sorted(left & {*beside, *(possible[place] for place in spots)})


def _attach(k: int, x: np.ndarray, away: np.ndarray, parent: np.ndarray) -> None:
    distance = np.linalg.norm(x - x[k], axis=1)
    nearer = distance < away - 1e-12
    away[nearer], parent[nearer] = distance[nearer], k


def sources(definition: Definition, chosen: Sequence[int]) -> tuple[list[int], dict[int, list[int]]]:
    """An order of the chosen points, and for all but the seeds those before them to begin from, the nearest first:
    the one that the tree leads from, and all that are next to them."""
    order, parents = tree(definition.normalized, chosen)
    found: dict[int, list[int]] = {}
    for place, k in enumerate(order):
        if k in parents:
            next_to = set(_next_to(k, chosen, definition.spaced))
            found[k] = [parents[k], *(g for g in order[:place] if g in next_to and g != parents[k])]
    return order, found


def doubtful(
    definition: Definition, finished: Mapping[int, Point], shapes: Mapping[int, np.ndarray], sign: float = 1.0
) -> dict[int, list[int]]:
    """The points to be solved again, and from which verified neighbours: those that failed or lie below the trend, from
    their nearest; those that do worse than a point with tighter limits, from that; and where another kind of optimum
    begins, each side from the other.

    shapes: of the verified points' optima (any numbers that tell them apart); sign: -1 if less is better.
    """
    x = definition.normalized
    good = [k for k, p in sorted(finished.items()) if p.verified]
    value = sign * np.array([finished[k].objective_value or 0.0 for k in good])
    below = below_trend(x[good], value)
    suspects = {k for k, low in zip(good, below, strict=True) if low}
    suspects |= {k for k, p in finished.items() if p.outcome not in (VERIFIED, IMPOSSIBLE)}
    worse = _contradicted(definition, finished, sign)
    jobs: dict[int, list[int]] = {}
    for k, p in sorted(finished.items()):
        if p.outcome == IMPOSSIBLE:
            continue
        around = sorted((g for g in good if g != k), key=lambda g: float(np.linalg.norm(x[g] - x[k])))
        near = [g for g in around[: 2 * x.shape[1]] if (g, finished[g].solved_in) not in p.tried]
        chosen = near[:2] if k in suspects else []
        tighter = [g for g in worse.get(k, ()) if (g, finished[g].solved_in) not in p.tried]
        chosen += [g for g in tighter[:1] if g not in chosen]
        if p.verified:
            beside = [g for g in _next_to(k, good, definition.spaced) if (g, finished[g].solved_in) not in p.tried]
            chosen += [g for g in beside if g not in chosen and unlike(shapes[k], shapes[g])]
        if chosen:
            jobs[k] = chosen
    return jobs


def _contradicted(definition: Definition, finished: Mapping[int, Point], sign: float) -> dict[int, list[int]]:
    """Points that do worse than verified points with tighter limits, and those."""
    order = sorted(k for k, p in finished.items() if p.outcome != IMPOSSIBLE)
    signed_value = [sign * (p.objective_value or 0.0) if (p := finished[k]).verified else np.nan for k in order]
    entries = [axis.entry for axis in definition.axes]
    found = contradicted(entries, definition.points[order], np.array(signed_value), definition.objective)
    return {order[k]: [order[g] for g in better] for k, better in found.items()}


def unlike(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two optima's shapes are so far apart that they are of different kinds, or may be."""
    return len(a) != len(b) or float(np.abs(a - b).max(initial=0.0)) > UNLIKE


def _next_to(k: int, good: Sequence[int], x: np.ndarray) -> list[int]:
    """The points around k: two for each axis, and those that are as near."""
    distance = np.linalg.norm(x[list(good)] - x[k], axis=1)
    count = min(2 * x.shape[1], len(good) - 1)
    return [g for g, d in zip(good, distance, strict=True) if g != k and d <= np.sort(distance)[count] + 1e-9]


def below_trend(x: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Which values lie below the parabola through their nearest neighbours, by more than such parabolas are wrong."""
    n, d = x.shape
    unknowns = 1 + 2 * d
    if n <= unknowns + 1:
        return np.zeros(n, dtype=bool)
    wrong = np.zeros(n)
    for k in range(n):
        away = x - x[k]
        distance = np.linalg.norm(away, axis=1)
        distance[k] = np.inf
        near = np.argsort(distance, kind="stable")[: min(2 * unknowns, n - 1)]
        weight = 1.0 / np.maximum(distance[near], 1e-9)
        parabola = np.column_stack([np.ones(len(near)), away[near], away[near] ** 2])
        wrong[k] = value[k] - np.linalg.lstsq(parabola * weight[:, None], value[near] * weight, rcond=None)[0][0]
    middle = float(np.median(wrong))
    spread = 1.4826 * float(np.median(np.abs(wrong - middle)))
    return wrong < min(middle, 0.0) - 3 * spread - DOUBT * np.abs(value)
