"""Contact of the foot with rough ground, compiled: stick, slip, flight, and what changes one into another.

The ground's law is ``coulomb``. An impact is plastic across the ground and keeps to the cone along it (the impact law of Moreau's
time stepping with restitution zero: Stewart, Rigid-body dynamics with friction and impact, SIAM Review 42, 2000).
It never adds energy: the impulse works on the mean of the foot's velocity before and after.
"""

from typing import Any

import numpy as np

from hopopt.compiled.kernel import kernel
from hopopt.drivetrain import kernels as drives
from hopopt.sim.ground import stops
from hopopt.sim.ground.coulomb import (
    BACKWARD,
    FLIGHT,
    FORWARD,
    STICK,
    contact_force,
    grips,
    held,
    of_foot,
    slip_direction,
    slipping,
)
from hopopt.sim.ground.loads import given, loads, rates
from hopopt.sim.ground.planar import chain, foot_jacobian, lowest_watched, mass_matrix, solved

STAYS, LIFTS, LANDS, SLIPS, STICKS, JAMS, STRIKES = 0, 1, 2, 3, 4, 5, 6  # what happens
CHANGE_PAUSE = 1e-5  # [s] after a change within which no further one is looked for
FRESH = 1e-9  # [m, m/s or N] of margin below which a mode has just begun
WITHIN = 1e-12  # [s] to which a change is located
RESTS = 1e-9  # [m/s] below which a foot that slowed down rests
STOP_STEPS = 32  # of a step where a joint touches its end stop: they are stiff


@kernel
def settled(leg: Any, mode: int, foot: float, q: np.ndarray, v: np.ndarray) -> None:
    """Put the body where the foot is on the ground: it stands at x = foot [m] if it sticks."""
    if mode == FLIGHT:
        return
    joints, _, _ = chain(leg, q, v)
    J, n = foot_jacobian(leg, joints), len(q) - 2
    q[1] -= joints[n, 1]
    v[1] = 0.0
    for k in range(2, n + 2):
        v[1] -= J[1, k] * v[k]
    if mode == STICK:
        q[0] += foot - joints[n, 0]
        v[0] = 0.0
        for k in range(2, n + 2):
            v[0] -= J[0, k] * v[k]


@kernel
def parts_of(leg: Any, q: np.ndarray, v: np.ndarray, command: np.ndarray, h: float) -> int:
    """Into how many parts a step of h [s] is cut: more where a joint meets its end stop, or gear friction turns round."""
    T = drives.drive_jacobian(leg, q[2:]) if leg.turned else np.zeros((0, 0))
    motor = given(leg, T, drives.drive_speeds(T, v[2:]) if leg.turned else v[2:], command)
    parts = STOP_STEPS if stops.near(q[2:], v[2:], leg.stop_lower, leg.stop_upper, h) else 1
    return max(parts, drives.rubbing_parts(leg, motor, leg.armature, h)) * leg.finer


@kernel
def step(
    leg: Any, mode: int, foot: float, q: np.ndarray, v: np.ndarray, work: np.ndarray, command: np.ndarray, h: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q, v, work after h [s] in one mode, by Runge-Kutta steps of fourth order."""
    parts = parts_of(leg, q, v, command, h)
    d = h / parts
    for _ in range(parts):
        a1, w1 = rates(leg, mode, q, v, command)
        v2 = v + d / 2 * a1
        a2, w2 = rates(leg, mode, q + d / 2 * v, v2, command)
        v3 = v + d / 2 * a2
        a3, w3 = rates(leg, mode, q + d / 2 * v2, v3, command)
        v4 = v + d * a3
        a4, w4 = rates(leg, mode, q + d * v3, v4, command)
        q = q + d / 6 * (v + 2 * v2 + 2 * v3 + v4)
        v = v + d / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        work = work + d / 6 * (w1 + 2 * w2 + 2 * w3 + w4)
        settled(leg, mode, foot, q, v)
    return q, v, work


@kernel
def holds(leg: Any, mode: int, q: np.ndarray, v: np.ndarray, command: np.ndarray) -> float:
    """Below zero where the ground cannot hold the mode: force outside the cone, or none that presses [N]."""
    _, c, G, _, _, _, _ = loads(leg, mode, q, v, command)
    return held(leg, mode, c, G)


@kernel
def struck(leg: Any, q: np.ndarray, joints: np.ndarray) -> float:
    """Below zero where what is watched is underground [m]; ideal ground takes no notice."""
    return lowest_watched(leg, q, joints)[0] if leg.mu < np.inf else np.inf


@kernel
def margin(leg: Any, mode: int, q: np.ndarray, v: np.ndarray, command: np.ndarray) -> float:
    """Below zero where the mode has ended: ``holds``, a slipping foot that turned round, a foot or what is watched underground."""
    joints, _, _ = chain(leg, q, v)
    n = len(q) - 2
    found = struck(leg, q, joints)
    if mode == FLIGHT:
        return min(found, joints[n, 1])
    if mode != STICK:
        J, along = foot_jacobian(leg, joints), 0.0
        for k in range(n + 2):
            along += J[0, k] * v[k]
        found = min(found, mode * along)
    _, c, G, _, _, _, _ = loads(
        leg, mode, q, v, command
    )  # not by ``holds``: each function that has them takes two seconds to compile
    return min(found, held(leg, mode, c, G))


@kernel
def advance(
    leg: Any, mode: int, foot: float, q: np.ndarray, v: np.ndarray, work: np.ndarray, command: np.ndarray, h: float
) -> tuple[Any, ...]:
    """A step of at most h [s], cut short where the mode ends: q, v, work, how long [s], and whether it ended."""
    last = step(leg, mode, foot, q, v, work, command, h)
    if margin(leg, mode, last[0], last[1], command) >= 0:
        return last[0], last[1], last[2], h, False
    low, high = 0.0, h
    if margin(leg, mode, q, v, command) < FRESH:  # the foot has just come off, or begun to slip: it is still there
        low = min(CHANGE_PAUSE, h)
        early = step(leg, mode, foot, q, v, work, command, low)
        if low == h or margin(leg, mode, early[0], early[1], command) < 0:
            return early[0], early[1], early[2], low, True
    while high - low > WITHIN:
        middle = 0.5 * (low + high)
        half = step(leg, mode, foot, q, v, work, command, middle)
        if margin(leg, mode, half[0], half[1], command) < 0:
            high, last = middle, half
        else:
            low = middle
    return last[0], last[1], last[2], high, True


@kernel
def noted_step(
    legs: Any, mode: int, foot: float, q: np.ndarray, v: np.ndarray, work: np.ndarray, command: np.ndarray, h: float
) -> tuple[Any, ...]:
    """Whether the ground holds the mode, then ``advance`` if it does; here, torques (n) [N m] of motors and
    joints and the force (x, z) [N] on the foot. legs: a leg as ``argument``."""
    leg = legs[0]
    _, c, G, _, _, motor, tau = loads(leg, mode, q, v, command)
    force, stays, lasted, ended = np.array(contact_force(mode, leg.mu, c, G)), held(leg, mode, c, G) >= 0, 0.0, False
    if stays:
        q, v, work, lasted, ended = advance(leg, mode, foot, q, v, work, command, h)
    return stays, q, v, work, lasted, ended, motor, tau, force


@kernel
def at_rest(mu: float, c: np.ndarray, G: np.ndarray) -> int:
    """The mode into which a foot goes that rests on the ground, by what ``loads`` says of it where it sticks."""
    fx, fz = contact_force(STICK, mu, c, G)
    if grips(mu, fx, fz, G) >= 0:
        return STICK
    if mu == np.inf:
        return FLIGHT
    return slip_direction(BACKWARD if fx > 0 else FORWARD, mu, c, G)[0]


@kernel
def impact(leg: Any, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, float, int]:
    """Speeds after the foot has met the ground, the energy that took [J], and the mode it leaves."""
    joints, centres, _ = chain(leg, q, v)
    J = foot_jacobian(leg, joints)
    X = solved(mass_matrix(leg, q, joints, centres), J.T.copy())
    before, G = of_foot(J, v, X)
    px, pz = contact_force(STICK, leg.mu, before, G)
    mode = STICK
    if leg.mu < np.inf and leg.mu * pz < abs(px):
        way, p = slip_direction(FORWARD if before[0] > 0 else BACKWARD, leg.mu, before, G)
        if way != FLIGHT:
            px, pz, mode = -way * leg.mu * p, p, way
    after = v + px * X[:, 0] + pz * X[:, 1]
    x = before[0] + 0.5 * (G[0, 0] * px + G[0, 1] * pz)  # mean velocity of the foot
    z = before[1] + 0.5 * (G[1, 0] * px + G[1, 1] * pz)
    return after, -(px * x + pz * z), mode


@kernel
def changed(
    leg: Any, mode: int, q: np.ndarray, v: np.ndarray, command: np.ndarray
) -> tuple[np.ndarray, np.ndarray, int, int, float]:
    """q, v and mode after the change at the end of a mode, what happened, and the energy [J] it took."""
    joints, _, _ = chain(leg, q, v)
    lost = 0.0
    if struck(leg, q, joints) < 0:
        return q, v, mode, STRIKES, lost
    q, v = q.copy(), v.copy()
    _, c, G, velocity, _, _, _ = loads(leg, mode, q, v, command)
    if mode == FLIGHT:
        v, lost, now = impact(leg, q, v)
        settled(leg, BACKWARD, 0.0, q, v)
        return q, v, now, LANDS, lost  # if the ground cannot hold it so, that is a change of its own
    what = STAYS
    if mode == STICK or mode * velocity[0] <= RESTS:
        _, stuck_c, stuck_G, _, _, _, _ = loads(leg, STICK, q, v, command)
        now = at_rest(leg.mu, stuck_c, stuck_G)
    elif c[1] > 0:
        now = FLIGHT
    elif slipping(mode, leg.mu, c, G)[1] > 0:
        now = mode
    else:  # Painleve: the ground grips the slipping foot at once
        v, lost, now = impact(leg, q, v)
        what = JAMS
    if what == STAYS and now != mode:
        what = LIFTS if now == FLIGHT else STICKS if now == STICK else SLIPS
    return q, v, now, what, lost
