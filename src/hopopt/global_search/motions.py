"""What follows a state: one motion for each extreme acceleration, over a step of time, compiled.

A motion keeps the pair of limits active that its vertex is named by, in substeps by the midpoint rule: with the
accelerations of the step's beginning alone torque would not fall with speed, and hops would be too high.
"""

from typing import Any, NamedTuple

import numpy as np

from hopopt.compiled.kernel import kernel, packed
from hopopt.global_search.equations.accelerations import VERTICES, polygon, possible, with_limits
from hopopt.global_search.equations.dynamics import MARGINS, state_margins, way_is_free
from hopopt.global_search.equations.flight import after_flight
from hopopt.global_search.grid import on_grid

EDGE_HALVINGS = 8  # of an edge, to find where a state limit is just kept
NONE, PASSES, KEEPS = 0, 1, 2  # what a motion is: the leg cannot go on; it passes a state limit; it keeps them all
CUTS = 5  # halvings of the time of a motion that ends in lift-off within a step
NO_MOTION = -1e3  # m: height of a motion that cannot begin
LIMIT_TOLERANCE = 1e-9  # rad, m, m/s: by which a state limit may be passed


class Workspace(NamedTuple):
    """Arrays that one thread uses again at every state.

    x, y, edge, and two more sets: polygons (VERTICES,)
    end: state after each motion (VERTICES, 4)
    kind: of each motion: NONE, PASSES or KEEPS (VERTICES,)
    corners: how many motions there are (1,)
    here, there: state margins (MARGINS,)
    """

    x: np.ndarray
    y: np.ndarray
    edge: np.ndarray
    near_x: np.ndarray
    near_y: np.ndarray
    near_edge: np.ndarray
    spare_x: np.ndarray
    spare_y: np.ndarray
    spare_edge: np.ndarray
    end: np.ndarray
    kind: np.ndarray
    corners: np.ndarray
    here: np.ndarray
    there: np.ndarray


def workspace() -> Any:
    """Fresh arrays, packed."""
    arrays: dict[str, np.ndarray] = {}
    for kind in ("", "near_", "spare_"):
        arrays |= {kind + "x": np.zeros(VERTICES), kind + "y": np.zeros(VERTICES)}
        arrays[kind + "edge"] = np.zeros(VERTICES, dtype=np.int64)
    margins = {name: np.zeros(MARGINS) for name in ("here", "there")}
    integers = {"kind": np.zeros(VERTICES, dtype=np.int8), "corners": np.zeros(1, dtype=np.int64)}
    return packed(Workspace(**arrays, **integers, **margins, end=np.zeros((VERTICES, 4))))


@kernel
def keeps_limits(c, w, from1, from2, phi1, phi2, r1, r2):
    """Whether a state keeps its limits, or comes no further beyond them than the state before it (``w.here``), at the link
    angles ``from1`` and ``from2``; and whether links pass nothing on the way."""
    state_margins(c, phi1, phi2, r1, r2, w.there)
    for k in range(MARGINS):
        if w.there[k] < min(0.0, w.here[k]) - LIMIT_TOLERANCE:
            return False
    q1, q2, then1, then2 = c.turn1 * from1, c.turn2 * (from2 - from1), c.turn1 * phi1, c.turn2 * (phi2 - phi1)
    return way_is_free(c, q1, q2, then1, then2, w.here[MARGINS - 1])


@kernel
def _at_midpoint(c, w, phi1, phi2, r1, r2, one, two):
    """Accelerations with two limits active or, where that passes another, of the nearest vertex; and whether any."""
    a1, a2, ok = with_limits(c, phi1, phi2, r1, r2, one, two)
    if ok:
        return a1, a2, True
    count = polygon(c, phi1, phi2, r1, r2, w.near_x, w.near_y, w.near_edge, w.spare_x, w.spare_y, w.spare_edge)
    nearest, least = 0, 1e300
    for i in range(count):
        away = (w.near_x[i] - a1) ** 2 + (w.near_y[i] - a2) ** 2
        if away < least:
            nearest, least = i, away
    return w.near_x[nearest], w.near_y[nearest], count > 0


@kernel
def _move(c, w, i, one, two, phi1, phi2, r1, r2, dt, substeps):
    """Writes the end of motion i into w.end; False if the leg cannot go on."""
    h = dt / substeps
    a1, a2, ok = w.x[i], w.y[i], True
    for k in range(substeps):
        if k > 0:
            a1, a2, ok = _at_midpoint(c, w, phi1, phi2, r1, r2, one, two)
            if not ok:
                return False
        f1, f2 = phi1 + 0.5 * h * (r1 + 0.25 * h * a1), phi2 + 0.5 * h * (r2 + 0.25 * h * a2)
        a1, a2, ok = _at_midpoint(c, w, f1, f2, r1 + 0.5 * h * a1, r2 + 0.5 * h * a2, one, two)
        if not ok:
            return False
        phi1, phi2 = phi1 + h * (r1 + 0.5 * h * a1), phi2 + h * (r2 + 0.5 * h * a2)
        r1, r2 = r1 + h * a1, r2 + h * a2
    w.end[i, 0], w.end[i, 1], w.end[i, 2], w.end[i, 3] = phi1, phi2, r1, r2
    return True


@kernel
def _ends_well(c, w, i, phi1, phi2):
    """``keeps_limits`` at the end of motion i from link angles phi1, phi2 [rad]."""
    return keeps_limits(c, w, phi1, phi2, w.end[i, 0], w.end[i, 1], w.end[i, 2], w.end[i, 3])


@kernel
def extreme_motions(c, w, phi1, phi2, r1, r2, dt, substeps):
    """Fills w.end and w.kind with the motions over dt [s]; returns how many there are."""
    count = polygon(c, phi1, phi2, r1, r2, w.x, w.y, w.edge, w.spare_x, w.spare_y, w.spare_edge)
    if count == 0:
        return 0
    state_margins(c, phi1, phi2, r1, r2, w.here)
    w.corners[0] = count
    for i in range(count):
        one, two = w.edge[i - 1 if i > 0 else count - 1], w.edge[i]
        w.kind[i] = NONE
        if _move(c, w, i, one, two, phi1, phi2, r1, r2, dt, substeps):
            w.kind[i] = KEEPS if _ends_well(c, w, i, phi1, phi2) else PASSES
        else:  # where it would end if its first acceleration stayed: only motions on the way there may be possible
            w.end[i, 0], w.end[i, 1] = phi1 + dt * (r1 + 0.5 * dt * w.x[i]), phi2 + dt * (r2 + 0.5 * dt * w.y[i])
            w.end[i, 2], w.end[i, 3] = r1 + dt * w.x[i], r2 + dt * w.y[i]
    return count


@kernel
def leaving(c, w, grid, loss, none, i, phi1, phi2, r1, r2, dt):
    """Greatest clearance and tuck [m] if motion i, which passes a limit within dt [s], ends in lift-off just before; NO_MOTION
    if it cannot even begin. ``loss``: of the flight, at the nodes."""
    one, two = w.edge[i - 1 if i > 0 else w.corners[0] - 1], w.edge[i]
    low, high, apex = 0.0, 1.0, NO_MOTION
    for _ in range(CUTS):
        t = 0.5 * (low + high)
        kept = _move(c, w, i, one, two, phi1, phi2, r1, r2, t * dt, 1)
        if kept and _ends_well(c, w, i, phi1, phi2):
            low = t
            apex = max(apex, after_flight(c, grid, loss, none, w.end[i, 0], w.end[i, 1], w.end[i, 2], w.end[i, 3]))
        else:
            high = t
    return apex


@kernel
def between(w, i, j, t):
    """State a share t on from the end of motion i to that of j."""
    a, b = w.end[i], w.end[j]
    return (
        a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2]), a[3] + t * (b[3] - a[3])
    )  # fmt: skip


@kernel
def last_kept(c, w, grid, i, j, phi1, phi2, r1, r2, dt):
    """How far one can go from the end of motion i, which keeps the state limits, towards that of j, which does not.

    A share of the way: the largest that keeps them, stays on the grid and has accelerations possible halfway.
    """
    low, high = 0.0, 1.0
    for _ in range(EDGE_HALVINGS):
        t = 0.5 * (low + high)
        f1, f2, u1, u2 = between(w, i, j, t)
        kept = on_grid(grid, f1, f2, u1, u2) and keeps_limits(c, w, phi1, phi2, f1, f2, u1, u2)
        if kept and w.kind[j] == NONE:
            a1, a2 = (u1 - r1) / dt, (u2 - r2) / dt
            m1, m2 = phi1 + 0.5 * dt * (r1 + 0.25 * dt * a1), phi2 + 0.5 * dt * (r2 + 0.25 * dt * a2)
            kept = possible(c, m1, m2, 0.5 * (r1 + u1), 0.5 * (r2 + u2), a1, a2)
        if kept:
            low = t
        else:
            high = t
    return low
