"""What flight makes of a lift-off: how far the clearance stays below the ballistic apex of a leg that is folded in no time.

In flight both joints turn towards the best tucked pose with all that their drives give, and each stays where it arrives. A leg
that would meet the body on that way is held as it was before.
A hop can do at least nearly that; where the drives are quick it costs nothing, and where they are slow it decides.
"""

from typing import NamedTuple

import numpy as np

from hopopt.compiled.kernel import kernel, packed
from hopopt.drivetrain.kernels import passed_torque
from hopopt.global_search.constants import StanceConstants
from hopopt.global_search.equations.dynamics import apex_height, room, sprung, torque_range, way_is_free
from hopopt.global_search.grid import OFF_GRID_VALUE, Grid, interpolate
from hopopt.global_search.posture import best_tuck

FLIGHT_STEPS = 32  # of time in a flight
LATER = 1.5  # times the time to the ballistic apex: a leg that folds slowly clears most after it
ARRIVED = 1e-9  # rad from the tucked pose


class Flight(NamedTuple):
    """What the compiled functions need of a flight, besides ``StanceConstants``.

    m11, m22, coupling, coupling_across: those of the mass matrix, less what the free centre of mass takes [kg m^2]
    target1, target2: joint angles of the best tucked pose [rad]
    tuck: centre of mass above the lowest point in it [m]
    window: foot from the hip's plumb line at most [m]
    fastest1, fastest2: fastest speed of each drive [rad/s]
    """

    m11: float
    m22: float
    coupling: float
    coupling_across: float
    target1: float
    target2: float
    tuck: float
    window: float
    fastest1: float
    fastest2: float


def flight_of(c: StanceConstants, window: float, fastest: np.ndarray) -> Flight:
    """The flight of a leg on free guides, for a foot window [m] and the fastest speed of each drive (2,) [rad/s]."""
    tuck, pose = best_tuck(c, window)
    first, second = complex(c.first, c.first_across), complex(c.second, c.second_across)
    cross = complex(c.coupling, c.coupling_across) - first * second.conjugate() / c.mass
    return Flight(
        c.m11 - abs(first) ** 2 / c.mass, c.m22 - abs(second) ** 2 / c.mass, cross.real, cross.imag,
        float(pose[0]), float(pose[1]), tuck, window, float(fastest[0]), float(fastest[1]),
    )  # fmt: skip


@kernel
def _felt(gear, motor, w):
    """Joint torque [N m] of a motor's at speed w [rad/s], as if no rotor had to be spun up: a little less than there is."""
    return passed_torque(motor, w, gear[0], gear[1], gear[2], gear[3], gear[4])[0]


@kernel
def _accelerations(c, f, q1, q2, w1, w2, way1, way2):
    """Joint accelerations [rad/s^2] with each drive at its most in its way (1 or -1), or its joint held (0)."""
    least1, most1 = torque_range(c.most1, c.least1, c.fastest1, w1)
    least2, most2 = torque_range(c.most2, c.least2, c.fastest2, w2)
    tau1 = 0.0 if least1 > most1 else _felt(c.gear1, most1 if way1 > 0 else least1, w1)
    tau2 = 0.0 if least2 > most2 else _felt(c.gear2, most2 if way2 > 0 else least2, w2)
    d, r1 = -c.turn2 * q2, c.turn1 * w1  # of the thigh against the shank
    r2 = r1 + c.turn2 * w2
    cd, sd = np.cos(d), np.sin(d)
    m12 = f.coupling * cd - f.coupling_across * sd + c.rotor
    slope = -f.coupling * sd - f.coupling_across * cd
    spring1, spring2 = sprung(c, q1, q2)
    h1, h2 = -slope * r2 * r2 - spring1, slope * r1 * r1 - spring2
    Q1, Q2 = c.turn1 * tau1 - c.turn2 * tau2 - h1, c.turn2 * tau2 - h2
    if way1 == 0:
        return 0.0, c.turn2 * Q2 / f.m22
    if way2 == 0:
        return c.turn1 * (c.turn1 * tau1 - h1 - h2) / (f.m11 + 2 * m12 + f.m22), 0.0
    det = f.m11 * f.m22 - m12 * m12
    a1, a2 = (f.m22 * Q1 - m12 * Q2) / det, (f.m11 * Q2 - m12 * Q1) / det
    return c.turn1 * a1, c.turn2 * (a2 - a1)


@kernel
def _turned(q, w, a, dt, fastest, lower, upper, target, way):
    """Angle and speed of a joint after dt [s]; no faster than its drive, within its limits, and no further than its target."""
    then = min(max(w + a * dt, -fastest), fastest)
    q = min(max(q + 0.5 * (w + then) * dt, lower), upper)
    if way * (target - q) <= ARRIVED:
        return target, 0.0
    return q, 0.0 if q in (lower, upper) else then


@kernel
def _tucked(c, f, q1, q2):
    """Centre of mass above the leg's lowest point [m], and by what the foot is outside its window [m]."""
    phi1 = c.turn1 * q1
    phi2 = phi1 + c.turn2 * q2
    c1, s1, c2, s2 = np.cos(phi1), np.sin(phi1), np.cos(phi2), np.sin(phi2)
    com = (c.first * s1 + c.first_across * c1 + c.second * s2 + c.second_across * c2) / c.mass
    knee = -(c.shank_x * s2 + c.shank_z * c2)
    hip = knee - (c.thigh_x * s1 + c.thigh_z * c1)
    away = c.shank_x * c2 - c.shank_z * s2 + c.thigh_x * c1 - c.thigh_z * s1
    lowest = min(0.0, min(knee, hip + min(0.0, c.trunk)))
    for k in range(c.corners.shape[0]):
        lowest = min(lowest, hip + c.corners[k, 0] * s1 + c.corners[k, 1] * c1)
    return com - lowest, max(abs(away) - f.window, 0.0)


@kernel
def fold_loss(c, f, phi1, phi2, r1, r2):
    """By how much [m] the clearance of a hop that leaves the ground now stays below its ballistic apex less the tuck."""
    q1, q2, w1, w2 = c.turn1 * phi1, c.turn2 * (phi2 - phi1), c.turn1 * r1, c.turn2 * (r2 - r1)
    apex = apex_height(c, phi1, phi2, r1, r2)
    height = apex_height(c, phi1, phi2, 0.0, 0.0)
    time = np.sqrt(2 * max(apex - height, 0.0) / c.gravity)
    least, dt = apex - f.tuck, LATER * time / FLIGHT_STEPS  # with the foot still on the ground
    start = room(c, q1, q2)
    for k in range(1, FLIGHT_STEPS + 1):
        way1, way2 = np.sign(f.target1 - q1), np.sign(f.target2 - q2)
        a1, a2 = _accelerations(c, f, q1, q2, w1, w2, way1, way2)
        then1, w1 = _turned(q1, w1, a1, dt, f.fastest1, c.lower1, c.upper1, f.target1, way1)
        then2, w2 = _turned(q2, w2, a2, dt, f.fastest2, c.lower2, c.upper2, f.target2, way2)
        if not way_is_free(c, q1, q2, then1, then2, start):
            if (k - 1) * dt < time:  # held from there on, it is highest at the apex
                below, outside = _tucked(c, f, q1, q2)
                least = min(least, below - f.tuck + outside)
            break
        q1, q2 = then1, then2
        below, outside = _tucked(c, f, q1, q2)
        past = k * dt - time
        if q1 == f.target1 and q2 == f.target2 and past <= 0:
            return 0.0
        least = min(least, below - f.tuck + outside + 0.5 * c.gravity * past * past)
    return max(least, 0.0)


@kernel
def _losses(c, f, axes, active, out, first, last):
    angles1, angles2, rates1, rates2 = axes
    n1, n2, n3 = len(angles2), len(rates1), len(rates2)
    for k in range(first, last):
        if active[k]:
            i0, rest = k // (n1 * n2 * n3), k % (n1 * n2 * n3)
            i1, i2, i3 = rest // (n2 * n3), (rest % (n2 * n3)) // n3, rest % n3
            out[k] = fold_loss(c, f, angles1[i0], angles2[i1], rates1[i2], rates2[i3])


def losses(c: StanceConstants, f: Flight, grid: Grid, active: np.ndarray) -> np.ndarray:
    """``fold_loss`` at the nodes that matter, (grid.size,) [m]."""
    out = np.zeros(grid.size, dtype=np.float32)
    _losses(packed(c), packed(f), tuple(grid.axes()), active, out, 0, grid.size)
    return out


@kernel
def _highest(c, f, states, apex, order, known):
    best, index = known, -1
    for i in order:
        if apex[i] - f.tuck <= best:  # as all that follow, even with no loss
            break
        clearance = apex[i] - f.tuck - fold_loss(c, f, states[i, 0], states[i, 1], states[i, 2], states[i, 3])
        if clearance > best:
            best, index = clearance, i
    return best, index


def highest(c: StanceConstants, f: Flight, states: np.ndarray, apex: np.ndarray, known: float) -> tuple[float, int]:
    """Greatest clearance [m] of hops that leave the ground at ``states`` (k, 4) with ballistic apexes (k,) [m], and at which
    of them; ``known`` and -1 if none passes that clearance."""
    best, index = _highest(packed(c), packed(f), states, apex, np.argsort(-apex, kind="stable"), known)
    return float(best), int(index)


@kernel
def after_flight(c, grid, loss, none, phi1, phi2, r1, r2):
    """Clearance and tuck [m] of a hop that leaves the ground now, by the losses at the nodes; OFF_GRID_VALUE off the grid."""
    lost = interpolate(grid, loss, none, phi1, phi2, r1, r2)
    return OFF_GRID_VALUE if lost <= OFF_GRID_VALUE else apex_height(c, phi1, phi2, r1, r2) - lost
