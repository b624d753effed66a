"""The highest box that a plan's leg clears, by the lower edge of the area that its links and shapes sweep.

The box stands on the ground, so a link enters it if and only if the part of the link above the box's width comes lower
than its height. No line between leg and box, as the planner has it, and no optimiser of the planner: forward kinematics of
the plan's table, each link and each side of a solid cut off at both sides of the box, the lowest point of all instants.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from hopopt.design import HopSettings
from hopopt.leg.geometry.outlines import seen
from hopopt.sim.machine import Machine
from hopopt.verify.table import DESCENT, LANDING, NORMALISED_TIMES, Table, dense

AT = np.linspace(0.0, 1.0, 61)  # normalised times of an interval that are looked at
PLACES, REFINED = 401, 3  # of the box: on a first grid, and how many of the best of them are refined
UPRIGHT = 1e-12  # m: extent along x below which a link counts as upright

Links = tuple[np.ndarray, np.ndarray]  # both ends of every link at every instant, (k, 2) x, z [m]


def highest_box(machine: Machine, hop: HopSettings, tables: Mapping[str, Table]) -> tuple[float, float]:
    """Height of the highest box of width ``hop.obstacle.width`` that the leg clears between where its foot stands and where
    it lands, and where along x it begins [m]."""
    links, width = swept(machine, hop, tables), float(hop.obstacle.width or 0.0)
    last = step(machine, tables) - width
    if last <= 0:
        return 0.0, 0.0  # the foot does not come to the other side
    places = np.linspace(0.0, last, PLACES)
    heights = np.concatenate([_heights(links, some, width) for some in _beside(places, width)])
    best = [(float(heights.max()), float(places[heights.argmax()]))]
    for x in places[np.argsort(-heights)[:REFINED]]:
        near = (max(x - places[1], 0.0), min(x + places[1], last))
        own = _in_the_way(links, *near, width)
        found: Any = minimize_scalar(
            lambda x, own=own: -height_over(own, x, width), bounds=near, method="bounded", options={"xatol": 1e-9}
        )
        best.append((-float(found.fun), float(found.x)))
    return max(best)


def _beside(places: np.ndarray, width: float) -> list[np.ndarray]:
    """Places one after another, in groups that are no wider than half a box."""
    at_once = max(1, int(width / 2 / places[1]))
    return np.split(places, range(at_once, len(places), at_once))


def _heights(links: Links, places: np.ndarray, width: float) -> np.ndarray:
    """``height_over`` for boxes that begin at each of the places (k,) [m]."""
    own = _in_the_way(links, places[0], places[-1], width)
    return np.array([height_over(own, x, width) for x in places])


def _in_the_way(links: Links, first: float, last: float, width: float) -> Links:
    """Of all links those that can be lowest over a box that begins between two places [m]: they reach there, and come lower than
    the lowest over what all such boxes share."""
    a, b = links
    shared = first + width - last
    lowest = height_over(links, last, shared) if shared >= 0 else np.inf
    there = (np.maximum(a[:, 0], b[:, 0]) >= first) & (np.minimum(a[:, 0], b[:, 0]) <= last + width)
    matter = there & (np.minimum(a[:, 1], b[:, 1]) <= lowest)
    return a[matter], b[matter]


def step(machine: Machine, tables: Mapping[str, Table]) -> float:
    """How far ahead of where it stood the foot lands [m]."""
    return float(machine.points(tables[DESCENT].q[-1, -1])["foot"][0])


def swept(machine: Machine, hop: HopSettings, tables: Mapping[str, Table]) -> Links:
    """Every link at every instant, and every side of shapes that count; of a periodic hop, those of the hops before and after too, as far as they reach here."""
    ahead, begins, ends = step(machine, tables), [], []
    for name, table in tables.items():
        q = dense(NORMALISED_TIMES, table.q, AT).reshape(-1, table.q.shape[-1])
        beside = np.array([ahead if name == LANDING else 0.0, 0.0])
        paths = machine.paths(q)
        chain = [paths[point] + beside for point in machine.robot.leg.chain]
        shapes = [corners + beside for corners in seen(machine.leg, q)]
        begins += [*chain[:-1], *(corners.reshape(-1, 2) for corners in shapes)]
        ends += [*chain[1:], *(np.roll(corners, -1, axis=1).reshape(-1, 2) for corners in shapes)]
    A, B = np.concatenate(begins), np.concatenate(ends)
    if not hop.periodic:
        return A, B
    moved = [np.array([k * ahead, 0.0]) for k in (-1, 0, 1)]
    return np.concatenate([A + by for by in moved]), np.concatenate([B + by for by in moved])


def height_over(links: Links, begin: float, width: float) -> float:
    """The lowest that any link comes between x = ``begin`` and that plus ``width`` [m]; infinite where none comes."""
    (xa, za), (xb, zb) = (end.T for end in links)
    low, high = np.maximum(np.minimum(xa, xb), begin), np.minimum(np.maximum(xa, xb), begin + width)
    along = xb - xa
    slope = np.divide(zb - za, along, out=np.zeros_like(along), where=np.abs(along) > UPRIGHT)
    lowest = np.minimum(za + slope * (low - xa), za + slope * (high - xa))
    lowest = np.where(np.abs(along) > UPRIGHT, lowest, np.minimum(za, zb))
    return float(lowest[low <= high].min(initial=np.inf))
