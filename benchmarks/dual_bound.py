"""A true upper bound on the hop of the paper's leg, from the dual of its optimal control problem.

    python benchmarks/dual_bound.py [DEGREE] [ROUNDS] [FLOW] [PAYOFF]

A polynomial W of time, joint angles and joint rates is sought by linear programming on samples, then checked on boxes
that cover all states: flow (dW/dt along every motion, at most FLOW m/s) and payoff (height of the centre of mass after
lift-off less W, at most PAYOFF m). No hop then passes W(start) + longest stance * FLOW + PAYOFF less the least height of
the centre of mass above the lowest point. docs/bound.md says what came out. Only for ground on which the foot does not
slip, links without offset, and torques within |tau| + slope |w| <= most, as in problems/paper.toml.
"""

import itertools
import sys
import time
from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog

from hopopt import load
from hopopt.compiled.kernel import kernel
from hopopt.global_search.constants import stance_constants, start_state, to_joint_angles
from hopopt.verify.upper_bound import upper_bound

ROWS, ADDED, POOL = 1500, 400, 50_000  # samples at first, added in a round, among which violated ones are looked for
FLAT = 1e-3  # weight of W's mean, which keeps W small where the start does not see it
FINEST = 1 / 300  # half-width of a box, in the scaled variables, at which the check gives up
POSES = 4000  # of each joint, on which the least height of the centre of mass above the lowest point is taken


class Hop(NamedTuple):
    """Of the paper's leg: moments of mass [kg m], mass matrix [kg m^2], drives, links [m], energies; scaling of the
    variables t, q1, q2, w1, w2."""

    first: float
    second: float
    mass: float
    gravity: float
    m11: float
    m22: float
    coupling: float
    rotor: float
    most_torque: float
    fastest: float
    energy: float  # at the start [J]
    power: float  # of all drives at most [W]
    thigh: float
    shank: float
    middle: np.ndarray
    half: np.ndarray


def posed() -> tuple[Hop, np.ndarray]:
    """The paper's hop, and the scaled variables (5,) at its start."""
    design = load("paper")
    c = stance_constants(design)
    phi, longest = start_state(c, design)[:2], design.hop.stance_duration[1]
    most, fastest = float(c.most1[0, 0]), float(-c.most1[0, 0] / c.most1[0, 1])
    low = np.array([0, c.lower1, c.lower2, -fastest, -fastest])
    high = np.array([longest, c.upper1, c.upper2, fastest, fastest])
    energy = c.gravity * (c.first_across * np.cos(phi[0]) + c.second_across * np.cos(phi[1]))
    hop = Hop(
        c.first_across, c.second_across, c.mass, c.gravity, c.m11, c.m22, c.coupling, c.rotor, most, fastest,
        float(energy), upper_bound(design).power_W, -c.thigh_z, -c.shank_z, (low + high) / 2, (high - low) / 2,
    )  # fmt: skip
    return hop, (np.array([0.0, *to_joint_angles(c, phi), 0.0, 0.0]) - hop.middle) / hop.half


def least_tuck(hop: Hop) -> float:
    """What the centre of mass is above the lowest of foot, knee and hip at least [m]: a grid less what it can miss."""
    q1, q2 = (hop.middle[k] + hop.half[k] * np.linspace(-1, 1, POSES) for k in (1, 2))
    least = np.inf
    for angle in q1:
        knee = hop.shank * np.cos(angle + q2)
        com = (hop.first * np.cos(angle) + hop.second * np.cos(angle + q2)) / hop.mass
        least = min(least, float(np.min(com - np.minimum(np.minimum(knee, 0), knee + hop.thigh * np.cos(angle)))))
    by_second = hop.second / hop.mass + hop.shank  # by how much a radian changes it at most
    by_first = by_second + hop.first / hop.mass + hop.thigh
    return least - (by_first * hop.half[1] + by_second * hop.half[2]) / (POSES - 1)


# The linear program on samples


def exponents(degree: int) -> np.ndarray:
    """Of the monomials in five variables, by degree."""
    every = [e for e in itertools.product(range(degree + 1), repeat=5) if sum(e) <= degree]
    return np.array(sorted(every, key=lambda e: (sum(e), e)), dtype=np.int64)


@kernel
def monomials(powers, x, out):
    """Monomials and their derivatives by the five scaled variables, into (6, n)."""
    for n in range(len(powers)):
        for d in range(6):
            value = 1.0
            for i in range(5):
                k = powers[n, i]
                value *= x[i] ** k if i != d - 1 else (k * x[i] ** max(k - 1, 0))
            out[d, n] = value


@kernel
def terms(hop, y):
    """Of the stance at (t, q1, q2, w1, w2): m12, h1, h2, x1, x2, f_z without acceleration, height and rise of the
    centre of mass, energy; as in hopopt.global_search.equations.dynamics."""
    a, b, r1, r2 = y[1], y[1] + y[2], y[3], y[3] + y[4]
    s1, c1, s2, c2 = np.sin(a), np.cos(a), np.sin(b), np.cos(b)
    m12, slope = hop.coupling * np.cos(b - a) + hop.rotor, -hop.coupling * np.sin(b - a)
    x1, x2 = -hop.first * s1, -hop.second * s2
    height, rise = (hop.first * c1 + hop.second * c2) / hop.mass, (x1 * r1 + x2 * r2) / hop.mass
    energy = hop.gravity * hop.mass * height + (hop.m11 * r1 * r1 + hop.m22 * r2 * r2) / 2 + m12 * r1 * r2
    force = hop.mass * hop.gravity - hop.first * c1 * r1 * r1 - hop.second * c2 * r2 * r2
    h1, h2 = hop.gravity * x1 - slope * r2 * r2, slope * r1 * r1 + hop.gravity * x2
    return m12, h1, h2, x1, x2, force, height, rise, energy


@kernel
def motions(hop, y, out):
    """Extreme joint accelerations, into (8, 2); returns how many: corners of the torques, cut where the ground pulls."""
    m12, h1, h2, x1, x2, force, _, _, _ = terms(hop, y)
    det, n = hop.m11 * hop.m22 - m12 * m12, 0
    tau1, tau2 = hop.most_torque * (1 - abs(y[3]) / hop.fastest), hop.most_torque * (1 - abs(y[4]) / hop.fastest)
    corner = np.empty((4, 3))
    for i in range(4):
        a, b = tau1 if i in (1, 2) else -tau1, tau2 if i >= 2 else -tau2
        a1 = (hop.m22 * (a - b - h1) - m12 * (b - h2)) / det
        a2 = (hop.m11 * (b - h2) - m12 * (a - b - h1)) / det
        corner[i, 0], corner[i, 1], corner[i, 2] = a1, a2 - a1, force + x1 * a1 + x2 * a2
    for i in range(4):
        one, two = corner[i], corner[(i + 1) % 4]
        if one[2] >= 0:
            out[n] = one[:2]
            n += 1
        if (one[2] >= 0) != (two[2] >= 0):
            out[n] = one[:2] + one[2] / (one[2] - two[2]) * (two[:2] - one[:2])
            n += 1
    return n


@kernel
def rows(powers, hop, points):
    """dW/dt along every extreme motion, the point of each, W and payoff at the points: all linear in W's coefficients."""
    flow, owner, n = np.empty((8 * len(points), len(powers))), np.empty(8 * len(points), np.int64), 0
    value, payoff = np.empty((len(points), len(powers))), np.empty(len(points))
    D, ends, inside = np.empty((6, len(powers))), np.empty((8, 2)), np.empty(len(points), np.bool_)
    for k in range(len(points)):
        y = hop.middle + hop.half * points[k]
        monomials(powers, points[k], D)
        _, _, _, _, _, _, height, rise, energy = terms(hop, y)
        inside[k] = y[1] + y[2] >= -np.pi / 2 and energy <= hop.energy + hop.power * y[0]
        value[k], payoff[k] = D[0], height + max(rise, 0.0) ** 2 / (2 * hop.gravity)
        for i in range(motions(hop, y, ends)):
            flow[n] = D[1] / hop.half[0] + D[2] * (y[3] / hop.half[1]) + D[3] * (y[4] / hop.half[2])
            flow[n] += D[4] * (ends[i, 0] / hop.half[3]) + D[5] * (ends[i, 1] / hop.half[4])
            owner[n] = k
            n += 1
    return flow[:n], owner[:n], value, payoff, inside


def drawn(powers: np.ndarray, hop: Hop, rng: np.random.Generator, count: int) -> np.ndarray:
    """Scaled states that the hop can be in, many of them on the faces of the box and slow."""
    kept: list[np.ndarray] = []
    while sum(map(len, kept)) < count:
        x = rng.uniform(-1, 1, (1000, 5))
        x = np.where(rng.random(x.shape) < 0.15, np.sign(x), x)
        x[:, 3:] *= np.where(rng.random((1000, 1)) < 0.4, rng.random((1000, 1)), 1.0)
        kept.append(x[rows(powers, hop, x)[4]])
    return np.concatenate(kept)[:count]


def fitted(hop: Hop, start: np.ndarray, degree: int, rounds: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Powers and coefficients of W, and W at the start [m], after so many rounds of adding violated samples."""
    powers, rng = exponents(degree), np.random.default_rng(0)
    at_start = rows(powers, hop, start[None])[2][0]
    points = drawn(powers, hop, rng, ROWS)
    mean, w = rows(powers, hop, drawn(powers, hop, rng, 4000))[2].mean(axis=0), np.zeros(len(powers))
    for k in range(rounds):
        flow, _, value, payoff, _ = rows(powers, hop, points)
        A, b = np.vstack([flow, -value]), np.concatenate([np.zeros(len(flow)), -payoff])
        size = np.abs(A).max(axis=1)
        found = linprog(at_start + FLAT * mean, A / size[:, None], b / size, bounds=(-1e3, 1e3), method="highs-ipm")
        w, worst, fresh = found.x, [], drawn(powers, hop, rng, POOL)
        excess = np.full((2, POOL), -np.inf)
        for part in np.array_split(np.arange(POOL), 50):
            flow, owner, value, payoff, _ = rows(powers, hop, fresh[part])
            np.maximum.at(excess[0], part[owner], flow @ w)
            excess[1, part] = payoff - value @ w
        for kind in excess:
            order = np.argsort(-kind)[: 10 * ADDED]
            order = order[kind[order] > 1e-6]
            worst += [order[:ADDED], rng.permutation(order)[:ADDED]]
        print(f"round {k + 1}: {len(b)} rows, W {at_start @ w:.4f} m, flow to {excess[0].max():.2f} m/s, "
              f"payoff to {excess[1].max():.3f} m beyond it among {POOL} states", flush=True)  # fmt: skip
        points = np.concatenate([points, fresh[np.unique(np.concatenate(worst))]])
    return powers, w, float(at_start @ w)


# The check on boxes: a number there is its value in the middle [0], slopes by the five variables in half-widths of the
# box [1:6], and by how much it may differ from that [6]


@kernel
def spread(a):
    """By how much a number varies in the box at most."""
    return a[6] + np.abs(a[1:6]).sum()


@kernel
def added(a, by_a, b, by_b):
    """by_a a + by_b b."""
    out = by_a * a + by_b * b
    out[6] = abs(by_a) * a[6] + abs(by_b) * b[6]
    return out


@kernel
def times(a, b):
    """a b."""
    out, one, two = a[0] * b + b[0] * a, np.abs(a[1:6]).sum(), np.abs(b[1:6]).sum()
    out[0] = a[0] * b[0]
    out[6] = one * two + (abs(a[0]) + one) * b[6] + (abs(b[0]) + two) * a[6] + a[6] * b[6]
    return out


@kernel
def of(a, value, slope, bend):
    """A function of a: its value and slope in the middle, and its second derivative at most."""
    out = slope * a
    out[0], out[6] = value, bend / 2 * spread(a) ** 2 + abs(slope) * a[6]
    return out


@kernel
def box_terms(hop, y):
    """``terms`` on a box, and the inverse determinant of the mass matrix."""
    a, r1 = y[1], y[3]
    b, r2 = added(a, 1.0, y[2], 1.0), added(r1, 1.0, y[4], 1.0)
    d = added(b, 1.0, a, -1.0)
    s1, c1 = of(a, np.sin(a[0]), np.cos(a[0]), 1.0), of(a, np.cos(a[0]), -np.sin(a[0]), 1.0)
    s2, c2 = of(b, np.sin(b[0]), np.cos(b[0]), 1.0), of(b, np.cos(b[0]), -np.sin(b[0]), 1.0)
    m12, slope = hop.coupling * of(d, np.cos(d[0]), -np.sin(d[0]), 1.0), of(d, np.sin(d[0]), np.cos(d[0]), 1.0)
    m12[0] += hop.rotor
    m12[6], slope = abs(m12[6]), added(slope, -hop.coupling, slope, 0.0)
    r11, r22 = times(r1, r1), times(r2, r2)
    x1, x2 = added(s1, -hop.first, s1, 0.0), added(s2, -hop.second, s2, 0.0)
    height = added(c1, hop.first / hop.mass, c2, hop.second / hop.mass)
    rise = added(times(x1, r1), 1 / hop.mass, times(x2, r2), 1 / hop.mass)
    energy = added(added(r11, hop.m11 / 2, r22, hop.m22 / 2), 1.0, times(m12, times(r1, r2)), 1.0)
    energy = added(energy, 1.0, height, hop.gravity * hop.mass)
    force = added(times(c1, r11), -hop.first, times(c2, r22), -hop.second)
    force[0] += hop.mass * hop.gravity
    det = added(times(m12, m12), -1.0, m12, 0.0)
    det[0] += hop.m11 * hop.m22
    least = max(det[0] - spread(det), 1e-9)
    inverse = of(det, 1 / det[0], -1 / det[0] ** 2, 2 / least**3)
    h1, h2 = added(x1, hop.gravity, times(slope, r22), -1.0), added(x2, hop.gravity, times(slope, r11), 1.0)
    return m12, h1, h2, x1, x2, force, height, rise, energy, inverse


@kernel
def along(hop, y, p1, p2, rest, m12, h1, h2, inverse):
    """rest + p1 alpha1 + p2 alpha2 on a box at most, over all torques; and which of its slopes and errors count."""
    y1 = times(inverse, added(p1, hop.m22, times(m12, p2), -1.0))
    y2 = times(inverse, added(p2, hop.m11, times(m12, p1), -1.0))
    rest = added(rest, 1.0, added(times(y1, h1), -1.0, times(y2, h2), -1.0), 1.0)
    per = -hop.most_torque / hop.fastest
    tau1, tau2 = added(y[3], per * np.sign(y[3, 0]), y[3], 0.0), added(y[4], per * np.sign(y[4, 0]), y[4], 0.0)
    tau1[0] += hop.most_torque
    tau2[0] += hop.most_torque
    by1, by2 = times(y1, tau1), times(added(y2, 1.0, y1, -1.0), tau2)
    top, best = -np.inf, rest
    for i in range(4):
        total = added(rest, 1.0, added(by1, 1.0 if i < 2 else -1.0, by2, 1.0 if i % 2 else -1.0), 1.0)
        if total[0] + spread(total) > top:
            top, best = total[0] + spread(total), total
    return top, best


@kernel
def multiplier(hop, y, p1, p2, m12, h1, h2, x1, x2, force, inverse):
    """Of the condition that the ground does not pull, the best in the middle of a box; and whether no torque meets it."""
    tau1 = hop.most_torque * (1 - abs(y[3, 0]) / hop.fastest)
    tau2 = hop.most_torque * (1 - abs(y[4, 0]) / hop.fastest)
    a1, a2 = inverse[0] * (hop.m22 * p1[0] - m12[0] * p2[0]), inverse[0] * (hop.m11 * p2[0] - m12[0] * p1[0])
    b1, b2 = inverse[0] * (hop.m22 * x1[0] - m12[0] * x2[0]), inverse[0] * (hop.m11 * x2[0] - m12[0] * x1[0])
    fixed, grows = -a1 * h1[0] - a2 * h2[0], force[0] - b1 * h1[0] - b2 * h2[0]
    a2, b2 = a2 - a1, b2 - b1
    best, at, largest = fixed + abs(a1) * tau1 + abs(a2) * tau2, 0.0, 0.0
    for a, b in ((a1, b1), (a2, b2)):
        if abs(b) > 1e-3 and -a / b > 0:
            k = -a / b
            value, largest = fixed + grows * k + abs(a1 + b1 * k) * tau1 + abs(a2 + b2 * k) * tau2, max(largest, k)
            if value < best:
                best, at = value, k
    if grows + abs(b1) * tau1 + abs(b2) * tau2 < 0:
        return 3 * largest + abs(fixed) / (abs(grows) + 1), True
    return at, False


@kernel
def on_box(powers, shifts, w, local, hop, middle, half, flow):
    """dW/dt (``flow``) or payoff - W on a box at most, -inf where the hop cannot be; and along which variable to halve."""
    y = np.zeros((5, 7))
    for i in range(5):
        y[i, 0], y[i, 1 + i] = hop.middle[i] + hop.half[i] * middle[i], hop.half[i] * half[i]
    if y[1, 0] + y[2, 0] + spread(y[1]) + spread(y[2]) < -np.pi / 2:  # the knee is in the ground
        return -np.inf, 0
    m12, h1, h2, x1, x2, force, height, rise, energy, inverse = box_terms(hop, y)
    energy = added(energy, 1.0, y[0], -hop.power)
    if energy[0] - spread(energy) > hop.energy:
        return -np.inf, 0
    local[:] = w
    for k in range(len(shifts)):  # W about the middle of the box: Horner's scheme along each variable
        local[shifts[k, 1]] += middle[shifts[k, 0]] * local[shifts[k, 2]]
    D = np.zeros((6, 7))
    for n in range(len(powers)):
        e, total = powers[n], powers[n].sum()
        for i in range(5):
            local[n] *= half[i] ** e[i]
        for d in range(6):
            if d > 0 and e[d - 1] == 0:
                continue
            c = local[n] if d == 0 else e[d - 1] * local[n] / (half[d - 1] * hop.half[d - 1])
            left = total - (d > 0)
            if left == 0:
                D[d, 0] += c
            elif left > 1:
                D[d, 6] += abs(c)
            else:
                for i in range(5):
                    if e[i] - (i == d - 1) == 1:
                        D[d, 1 + i] += c
    if flow:
        p1, p2 = added(D[4], 1.0, D[5], -1.0), D[5]
        k, pulls = multiplier(hop, y, p1, p2, m12, h1, h2, x1, x2, force, inverse)
        if pulls and along(hop, y, x1, x2, force, m12, h1, h2, inverse)[0] < 0:
            return -np.inf, 0
        rest = added(added(D[1], 1.0, times(D[2], y[3]), 1.0), 1.0, added(times(D[3], y[4]), 1.0, force, k), 1.0)
        p1, p2 = added(p1, 1.0, x1, k), added(p2, 1.0, x2, k)
        top, best = along(hop, y, p1, p2, rest, m12, h1, h2, inverse)
    else:
        best = added(height, 1.0, D[0], -1.0)
        if rise[0] + spread(rise) > 0:
            best = added(best, 1.0, times(rise, rise), 1 / (2 * hop.gravity))
        top = best[0] + spread(best)
    return top, np.argmax(np.abs(best[1:6]) + best[6] * half**2 / (half**2).sum())


@kernel
def boxes_to_prove(powers, shifts, w, hop, flow, most, finest):
    """How many boxes show that nothing exceeds ``most``; 0 if one as small as ``finest`` does not."""
    local, middles, halves = np.empty(len(w)), np.empty((2000, 5)), np.empty((2000, 5))
    for n in range(32):
        for i in range(5):
            middles[n, i], halves[n, i] = (0.5 if (n >> i) % 2 else -0.5), 0.5
    n, count = 32, 0
    while n > 0:
        n, count = n - 1, count + 1
        middle, half = middles[n].copy(), halves[n].copy()
        top, i = on_box(powers, shifts, w, local, hop, middle, half, flow)
        if top <= most:
            continue
        if half.max() < finest or n > 1900:
            return 0
        half[i] /= 2
        for side in (-1, 1):
            middles[n], halves[n] = middle, half
            middles[n, i] += side * half[i]
            n += 1
    return count


def shift_steps(powers: np.ndarray) -> np.ndarray:
    """Variable, changed monomial and added monomial of each step that moves the origin of a polynomial."""
    index, steps = {tuple(e): n for n, e in enumerate(powers.tolist())}, []
    for i in range(5):
        for e in powers[powers[:, i] == 0].tolist():
            line = [index[(*e[:i], k, *e[i + 1 :])] for k in range(powers.sum(axis=1).max() - sum(e) + 1)]
            steps += [(i, line[m], line[m + 1]) for k in range(len(line) - 1) for m in range(len(line) - 2, k - 1, -1)]
    return np.array(steps)


def main(degree: float = 4, rounds: float = 7, flow: float = 8.0, payoff: float = 0.05) -> None:
    hop, start = posed()
    powers, w, at_start = fitted(hop, start, int(degree), int(rounds))
    shifts, tuck, proved = shift_steps(powers), least_tuck(hop), True
    print(f"sampled: {at_start - tuck:.3f} m, which bounds nothing yet")
    for most, is_flow, name in ((payoff, False, "payoff"), (flow, True, "flow")):
        began, count = time.perf_counter(), boxes_to_prove(powers, shifts, w, hop, is_flow, most, FINEST)
        proved &= count > 0
        print(f"{name} at most {most:g}: " + (f"proved with {count} boxes" if count else "not proved"), end="")
        print(f", {time.perf_counter() - began:.0f} s", flush=True)
    if proved:
        print(f"no hop passes {at_start + 2 * hop.half[0] * flow + payoff - tuck:.3f} m")


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
