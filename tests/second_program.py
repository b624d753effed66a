"""A second program for the highest hop of a leg of two joints, which shares no code with hopopt: equations of motion by
Lagrange from energies, torques as controls, the implicit midpoint rule, and starts drawn at random.

It is coarse. What it finds is solved once more on finer steps before it is compared with anything.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

G = 9.81
COARSE = (20, 8)  # steps of stance and of flight
TRIES = 3  # of the best hops on coarse steps, until one is found on the finest
FINER = ((40, 16), (80, 32), (160, 64))  # torques are constant in a step, so that heights err in proportion to it
QUIET = {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes", "ipopt.max_iter": 250, "ipopt.tol": 1e-7}


@dataclass(frozen=True)
class Leg:
    """Numbers of a leg and its hop, in SI units: links (thigh, shank) as slender rods, drives alike in both joints.

    torque, speed: of a drive at the joint, at standstill and without torque; rotor: inertia at the joint
    window: foot from the hip's plumb line at most when flight ends; friction: None where the foot cannot slip
    """

    lengths: tuple[float, float]
    masses: tuple[float, float]
    body: float
    rotor: float
    torque: float
    speed: float
    low: tuple[float, float]
    high: tuple[float, float]
    height: float
    stance: tuple[float, float]
    window: float
    friction: float | None

    @classmethod
    def of(cls, entries: Mapping[str, Any]) -> "Leg":
        """From the tables of a problem file, whose motor has the law of the paper and whose foot starts under the hip."""
        leg, hop, gear = entries["leg"], entries["hop"], entries["leg"]["gear"]["ratio"]
        motor = leg["motor"]
        return cls(
            (leg["thigh"]["length"], leg["shank"]["length"]), (leg["thigh"]["mass"], leg["shank"]["mass"]),
            leg["body"]["mass"], gear**2 * motor["rotor_inertia"], gear * motor["max_torque"], motor["max_speed"] / gear,
            (leg["hip"]["lower"], leg["knee"]["lower"]), (leg["hip"]["upper"], leg["knee"]["upper"]),
            entries["start"]["hip_height"], tuple(hop["stance_duration"]), hop["foot_window"],
            entries["contact"].get("friction"),
        )  # fmt: skip

    def start(self) -> np.ndarray:
        """Joint angles (2,) [rad] with the foot under the hip, the knee bent back."""
        (a, b), h = self.lengths, self.height
        knee = np.pi - np.arccos((a**2 + b**2 - h**2) / (2 * a * b))
        hip = np.arctan2(b * np.sin(knee), a + b * np.cos(knee))
        return np.array([hip, -knee])


def points(leg: Leg, x: Any, z: Any, q: Any) -> list[tuple[Any, Any]]:
    """Hip, knee, foot, and the middles of thigh and shank, for the hip at (x, z)."""
    a, b = leg.lengths
    places, angle = [(x, z)], 0
    for length, turn in ((a, q[0]), (b, q[1])):
        angle = angle + turn
        x0, z0 = places[-1]
        places.append((x0 + length * ca.sin(angle), z0 - length * ca.cos(angle)))
    middles = [((p[0] + r[0]) / 2, (p[1] + r[1]) / 2) for p, r in pairwise(places)]
    return [*places, *middles]


def dynamics(leg: Leg) -> tuple[ca.Function, ca.Function]:
    """Residuals of stance, with the force on the foot, and of flight, from y = (x, z, q1, q2), its rates and accelerations,
    and the torques: Lagrange's equations of one energy."""
    y, v, a, tau = (ca.SX.sym(name, n) for name, n in (("y", 4), ("v", 4), ("a", 4), ("tau", 2)))
    hip, _, foot, thigh, shank = (ca.vertcat(*p) for p in points(leg, y[0], y[1], y[2:]))
    energy, height = ca.SX(0), ca.SX(0)
    for mass, place in ((leg.body, hip), (leg.masses[0], thigh), (leg.masses[1], shank)):
        energy += mass * ca.sumsqr(ca.jtimes(place, y, v)) / 2
        height += mass * place[1]
    turns = v[2], v[2] + v[3]
    for mass, length, w in zip(leg.masses, leg.lengths, turns, strict=True):
        energy += mass * length**2 / 12 * w**2 / 2
    energy += leg.rotor * (v[2] ** 2 + v[3] ** 2) / 2
    momentum = ca.gradient(energy, v)
    left = ca.jtimes(momentum, v, a) + ca.jtimes(momentum, y, v) - ca.gradient(energy - G * height, y)
    left -= ca.vertcat(0, 0, tau)
    J = ca.jacobian(foot, y)
    force = left[:2]  # the guides are free, so that the ground alone moves hip and all: J has the identity there
    pinned = ca.vertcat(left - J.T @ force, ca.jtimes(ca.jtimes(foot, y, v), ca.vertcat(y, v), ca.vertcat(v, a)))
    return ca.Function("stance", [y, v, a, tau], [pinned[2:], force]), ca.Function("flight", [y, v, a, tau], [left])


class Program:
    """The hop on so many steps of stance and of flight, to be solved from any guess."""

    def __init__(self, leg: Leg, steps: tuple[int, int]):
        self.leg, self.steps = leg, steps
        self.z, self.low, self.high = list[ca.SX](), list[np.ndarray](), list[np.ndarray]()
        self.g, self.low_g, self.high_g = list[ca.SX](), list[np.ndarray](), list[np.ndarray]()
        q0 = leg.start()
        begin = np.array([0.0, leg.height, *q0])
        stance, flight = dynamics(leg)
        T1, T2 = self._new(1, *leg.stance), self._new(1, 0.03, 1.5)
        y, v = self._new(4, begin, begin), self._new(4, 0, 0)
        for count, T, law in ((steps[0], T1, stance), (steps[1], T2, flight)):
            for _ in range(count):
                y, v = self._step(y, v, T / count, law, law is stance)
        places = points(leg, y[0], y[1], y[2:])[:3]
        top = self._new(1, -1, 9)
        for p in places:
            self._row(p[1] - top, 0, np.inf)
        self._row(places[2][0] - y[0], -leg.window, leg.window)
        nlp = {"x": ca.vertcat(*self.z), "g": ca.vertcat(*self.g), "f": -top}
        self.solver = ca.nlpsol("second", "ipopt", nlp, QUIET)

    def _new(self, n: int, low: Any, high: Any) -> ca.SX:
        self.z.append(ca.SX.sym(f"z{len(self.z)}", n))
        self.low.append(np.broadcast_to(low, n))
        self.high.append(np.broadcast_to(high, n))
        return self.z[-1]

    def _row(self, value: Any, low: Any, high: Any) -> None:
        self.g.append(ca.vertcat(value))
        n = self.g[-1].shape[0]
        self.low_g.append(np.broadcast_to(low, n))
        self.high_g.append(np.broadcast_to(high, n))

    def _step(self, y: ca.SX, v: ca.SX, h: ca.SX, law: ca.Function, stands: bool) -> tuple[ca.SX, ca.SX]:
        leg, tau = self.leg, self._new(2, -self.leg.torque, self.leg.torque)
        limits = np.concatenate([[-9, 0], leg.low]), np.concatenate([[9, 9], leg.high])
        fastest = np.array([99, 99, leg.speed, leg.speed])  # as long as there is a torque that a drive may have
        then, fast = self._new(4, *limits), self._new(4, -fastest, fastest)
        self._row(then - y - h * (v + fast) / 2, 0, 0)
        middle, rate, push = (y + then) / 2, (v + fast) / 2, (fast - v) / h
        if stands:
            left, force = law(middle, rate, push, tau)
            self._row(left, 0, 0)
            self._row(force[1], 0, np.inf)
            if leg.friction is not None:
                self._row(leg.friction * force[1] - force[0], 0, np.inf)
                self._row(leg.friction * force[1] + force[0], 0, np.inf)
        else:
            self._row(law(middle, rate, push, tau), 0, 0)
        for w in (rate[2:], -rate[2:]):  # |tau| <= torque (1 - |w| / speed)
            self._row(tau / leg.torque + w / leg.speed, -1, 1)
        _, knee, foot, *_ = points(leg, then[0], then[1], then[2:])
        self._row(ca.vertcat(knee[1], *([] if stands else [foot[1]])), 0, np.inf)
        return then, fast

    def solve(self, guess: np.ndarray) -> tuple[float, np.ndarray] | None:
        """Height [m] and point that a guess leads to; None if to no hop."""
        b = {"lbx": self.low, "ubx": self.high, "lbg": self.low_g, "ubg": self.high_g}
        found = self.solver(x0=guess, **{name: np.concatenate(parts) for name, parts in b.items()})
        return (-float(found["f"]), np.array(found["x"]).ravel()) if self.solver.stats()["success"] else None

    def pack(self, times: np.ndarray, y: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Durations (2,), states at the nodes (n + 1, 4) each, and torques of the steps (n, 2), as a guess."""
        parts = [times, y[0], v[0]]
        for k in range(len(tau)):
            parts += [tau[k], y[k + 1], v[k + 1]]
        return np.concatenate([*parts, [max(y[-1, 1] - 0.3, 0.0)]])

    def unpack(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """What ``pack`` takes."""
        rows = z[10:-1].reshape(-1, 10)
        y, v = np.vstack([z[2:6], rows[:, 2:6]]), np.vstack([z[6:10], rows[:, 6:]])
        return z[:2], y, v, rows[:, :2]

    def drawn(self, rng: np.random.Generator) -> np.ndarray:
        """A guess: to a pose and from there to the tucked one, the joints moving evenly, with torques drawn at random."""
        leg, (n, m) = self.leg, self.steps
        low, high, q0 = np.array(leg.low), np.array(leg.high), leg.start()
        knots = np.array([q0, rng.uniform(low, high), rng.uniform(low, high), [0.8 * high[0], low[1]]])
        at = np.concatenate([np.linspace(0, 2, n + 1), np.linspace(2, 3, m + 1)[1:]])
        q = np.stack([np.interp(at, range(4), column) for column in knots.T], axis=1)
        foot = np.array([points(leg, 0.0, 0.0, row)[2] for row in q], dtype=float)
        lifted = np.concatenate([np.zeros(n + 1), np.linspace(0, rng.uniform(0.1, 0.8), m + 1)[1:]])
        y = np.column_stack([-foot[:, 0], lifted - foot[:, 1], q])
        times = np.array([rng.uniform(*leg.stance), rng.uniform(0.1, 0.4)])
        h = np.concatenate([np.full(n, times[0] / n), np.full(m, times[1] / m)])
        v = np.vstack([np.zeros(4), np.diff(y, axis=0) / h[:, None]])
        return self.pack(times, y, v, leg.torque * rng.uniform(-0.3, 0.3, (n + m, 2)))


def resampled(coarse: Program, fine: Program, z: np.ndarray) -> np.ndarray:
    """A coarse program's point as a guess of a finer one."""
    (n, m), (N, M) = coarse.steps, fine.steps
    times, y, v, tau = coarse.unpack(z)
    nodes = np.concatenate([np.linspace(0, n, N + 1), n + np.linspace(0, m, M + 1)[1:]])
    y, v = (np.stack([np.interp(nodes, range(n + m + 1), c) for c in x.T], axis=1) for x in (y, v))
    steps = np.minimum((nodes[:-1] + nodes[1:]) / 2, n + m - 1e-9).astype(int)
    return fine.pack(times, y, v, tau[steps])


Stance = tuple[
    np.ndarray, np.ndarray, np.ndarray, np.ndarray
]  # times (n,) and joint angles, speeds, accelerations (n, 2)


def refined(program: Program, z: np.ndarray) -> tuple[float, Stance] | None:
    """Height [m] of a coarse program's hop on ever finer steps, carried on to none, and its stance; None if it is lost."""
    heights = list[float]()
    for steps in FINER:
        finer = Program(program.leg, steps)
        if (end := finer.solve(resampled(program, finer, z))) is None:
            return None
        program, (height, z) = finer, end
        heights.append(height)
    times, y, v, _ = program.unpack(z)
    n = program.steps[0]
    t, speeds = np.linspace(0, times[0], n + 1), v[: n + 1, 2:]
    a = np.diff(speeds, axis=0) / t[1]
    return 2 * heights[-1] - heights[-2], (t, y[: n + 1, 2:], speeds, np.vstack([a, a[-1:]]))


def best_hop(leg: Leg, starts: int, seed: int) -> tuple[float, Stance] | None:
    """The highest hop [m] from so many random starts, on the finest steps, with its stance; where that is lost, one of the
    next best; None if there is none."""
    coarse, rng = Program(leg, COARSE), np.random.default_rng(seed)
    found = [end for _ in range(starts) if (end := coarse.solve(coarse.drawn(rng)))]
    ranked = sorted(found, key=lambda end: -end[0])[:TRIES]
    return next((end for _, z in ranked if (end := refined(coarse, z))), None)
