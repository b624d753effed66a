"""The benchmark's five problems, in terms that every package can be given; nothing of hopopt is needed to read them.

A phase's right-hand sides are one function of lists of states x and controls u, and of a namespace ``m`` with the
``sin`` and ``cos`` of the package's own symbols. The hop's are lists of elementary steps, which any symbols can follow;
a package may follow them once, inside a function of its own kind, with an ``m.apply(formulas, *lists)``.
"""

import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import exp, inf
from pathlib import Path
from typing import Any

DEGREE, TOLERANCE, MOST_ITERATIONS = 3, 1e-8, 1000  # Radau points an interval, Ipopt's tol and max_iter
Pairs = Sequence[tuple[float, float]]  # (lower, upper) of each component
SHORT, LONG = 3.0, 60.0  # [s]: repeated at least, and at most, so long


@dataclass(frozen=True)
class Phase:
    """x' = rates, lower <= path <= upper, from ``start`` to ``end``; at(x, u, m) gives (rates, path, running cost).

    guess: fractions of the phase, states and controls there (one row each), duration [s].
    """

    intervals: int
    at: Callable[[Any, Any, Any], tuple[Any, Any, Any]]
    x: Pairs
    u: Pairs
    start: Pairs
    end: Pairs
    duration: tuple[float, float]
    guess: tuple[Sequence[float], Sequence[Sequence[float]], Sequence[Sequence[float]], float]
    path: Pairs = ()


@dataclass(frozen=True)
class Posed:
    """Phases in their order, free parameters p, and ends(first, last, T, p, m), which gives (cost, constraints), from
    each phase's first and last states and duration. Least cost plus running costs; ``optimum`` is what it must be."""

    name: str
    phases: tuple[Phase, ...]
    optimum: float
    ends: Callable[[Any, Any, Any, Any, Any], tuple[Any, Any]] = lambda first, last, T, p, m: (0.0, [])
    constraints: Pairs = ()
    parameters: Pairs = ()
    parameter_guess: Sequence[float] = field(default=())


def points(*values: float) -> Pairs:
    """Values that are given, as pairs of equal bounds."""
    return [(v, v) for v in values]


def straight(first: Sequence[float], last: Sequence[float], controls: int, duration: float) -> Any:
    """A guess that goes straight from one state to another, the controls zero."""
    return ([0.0, 1.0], [list(first), list(last)], [[0.0] * controls] * 2, duration)


def effort() -> Posed:
    """A mass moved by 1 in time 1 from rest to rest with the least integral of u^2: u = 6 - 12 t, 12."""
    move = Phase(
        12, lambda x, u, m: ([x[1], u[0]], [], u[0] ** 2), [(-inf, inf)] * 2, [(-inf, inf)], points(0, 0), points(1, 0),
        (1.0, 1.0), straight([0, 0], [1, 0], 1, 1.0),
    )  # fmt: skip
    return Posed("effort", (move,), 12.0)


def denham() -> Posed:
    """Bryson and Denham: 4 / (9 l) where the height is at most l <= 1/6 (Bryson and Ho, Applied Optimal Control, 3.11)."""
    height = 1 / 9
    move = Phase(
        18, lambda x, u, m: ([x[1], u[0]], [], u[0] ** 2 / 2), [(-inf, height), (-inf, inf)], [(-inf, inf)],
        points(0, 1), points(0, -1), (1.0, 1.0), straight([0, 1], [0, -1], 1, 1.0),
    )  # fmt: skip
    return Posed("denham", (move,), 4 / (9 * height))


def arm_rates(x: Any, u: Any, m: Any) -> list[Any]:
    """Angular speeds of both links, the angle between them, the first angle (Luus, Iterative Dynamic Programming)."""
    w1, w2, bend, _ = x
    c, s, u1, u2 = m.cos(bend), m.sin(bend), u[0], u[1]
    whole = 31 / 36 + 9 / 4 * s * s
    w1_rate = (s * (9 / 4 * c * w1 * w1 + 2 * w2 * w2) + 4 / 3 * (u1 - u2) - 3 / 2 * c * u2) / whole
    w2_rate = -(s * (7 / 2 * w1 * w1 + 9 / 4 * c * w2 * w2) - 7 / 3 * u2 + 3 / 2 * c * (u1 - u2)) / whole
    return [w1_rate, w2_rate, w2 - w1, w1]


def arm() -> Posed:
    """A two-link arm in the least time; both torques are bang-bang. The optimum comes from shooting at its three
    switches (tests/test_benchmarks.py repeats that)."""
    first, last = (0.0, 0.0, 0.5, 0.0), (0.0, 0.0, 0.5, 0.522)
    move = Phase(
        20, lambda x, u, m: (arm_rates(x, u, m), [], 0.0), [(-inf, inf)] * 4, [(-1.0, 1.0)] * 2, points(*first),
        points(*last), (0.1, 10.0), straight(first, last, 2, 3.0),
    )  # fmt: skip
    return Posed("arm", (move,), 2.98227994, lambda first, last, T, p, m: (T[0], []))


MASS, FORCE, SPEED, STROKE, GRAVITY = 8.27, 500.0, 6.0, 0.2, 9.81
HASTE = 10.0  # [m/s^2]: pushing at once must be worth something, or waiting costs nothing


def jump() -> Posed:
    """A mass pushed up with F <= F0 (1 - v / v0) over a stroke: the highest speed at its end, less HASTE times the
    duration. Full force throughout; units of x and v are the stroke and v0, of the force F0."""

    def at(x: Any, u: Any, m: Any) -> tuple[Any, Any, Any]:
        return [x[1] * (SPEED / STROKE), (u[0] * (FORCE / MASS) - GRAVITY) / SPEED], [u[0] + x[1]], 0.0

    push = Phase(
        10, at, [(0.0, 1.0), (0.0, inf)], [(0.0, inf)], points(0, 0), [(1.0, 1.0), (0.0, inf)], (0.01, 1.0),
        straight([0, 0], [1, 0.5], 1, 0.1), [(-inf, 1.0)],
    )  # fmt: skip
    return Posed("jump", (push,), jump_optimum(), lambda first, last, T, p, m: (HASTE * T[0] - SPEED * last[0][1], []))


def jump_optimum() -> float:
    """x(t) = (a / b) t - (a / b^2) (1 - exp(-b t)) solved for the stroke by Newton's method."""
    a, b, t = FORCE / MASS - GRAVITY, FORCE / (MASS * SPEED), 0.1
    for _ in range(50):
        t -= (a / b * t - a / b**2 * (1 - exp(-b * t)) - STROKE) / (a / b * (1 - exp(-b * t)))
    return HASTE * t - a / b * (1 - exp(-b * t))


BODY, THIGH, SHANK, LINK = 5.6, 1.87, 0.8, 0.37  # [kg], and the length [m] of both links, uniform rods
TORQUE, RATE, ROTOR = 200.0, 12.57, 0.119  # at the joint: [N m], [rad/s], [kg m^2]
WHOLE, ROD = BODY + THIGH + SHANK, LINK**2 / 12
P, R = (THIGH / 2 + SHANK) * LINK, SHANK * LINK / 2  # how far each link carries the centre of mass down, times the mass


def rail() -> Posed:
    """A leg posed by hand, its hip and its foot on one vertical line: stance has one degree of freedom, flight the links'
    two and the centre of mass, which falls. The height of the foot at the end, with |torque| + |rate| <= 1 at hip and knee.

    Angles from straight down of thigh (a) and shank (b), a = -b in stance; rates in units of RATE, torques of TORQUE.
    """
    infinite, links = (-inf, inf), [(-0.6, 1.3), (-2.4, 1.0)]

    def region(torque: Any, rate: Any) -> list[Any]:
        return [torque + rate, torque - rate, rate - torque, -torque - rate]

    def stance(x: Any, u: Any, m: Any) -> tuple[Any, Any, Any]:
        (_, w), (hip, knee), s, c = x, u, m.sin(x[0]), m.cos(x[0])
        arm = (4 * BODY + 9 / 4 * THIGH + SHANK / 4) * LINK**2  # of what moves up and down
        mass = arm * s * s + (THIGH + SHANK) * LINK**2 / 4 * c * c + (THIGH + SHANK) * ROD + 5 * ROTOR
        bent = (arm - (THIGH + SHANK) * LINK**2 / 4) * s * c * w * w * RATE**2
        weight = (
            2 * BODY + 3 / 2 * THIGH + SHANK / 2
        ) * LINK  # times 1 / WHOLE: height of the centre of mass over cos(a)
        rate = ((hip - 2 * knee) * TORQUE + GRAVITY * weight * s - bent) / mass
        force = 1 - (s * rate + c * w * w * RATE**2) * (weight / (WHOLE * GRAVITY))  # of the ground, by weight
        return [w * RATE, rate / RATE], [*region(hip, w), *region(knee, -2 * w), force], 0.0

    def flight(x: Any, u: Any, m: Any) -> tuple[Any, Any, Any]:
        (a, b, v, w, _, fall), (hip, knee) = x, u
        sa, ca, sb, cb = m.sin(a), m.cos(a), m.sin(b), m.cos(b)
        aa = (THIGH / 4 + SHANK) * LINK**2 + THIGH * ROD + 2 * ROTOR - sa * sa * (P * P / WHOLE)
        bb = SHANK * LINK**2 / 4 + SHANK * ROD + ROTOR - sb * sb * (R * R / WHOLE)
        ab = (ca * cb + sa * sb) * (LINK * R) - sa * sb * (P * R / WHOLE) - ROTOR
        by_a = (cb * sa - sb * ca) * (LINK * R)  # - d(ab)/da without the centre of mass, d(ab)/db likewise
        up = (hip - knee) * TORQUE - (
            (by_a - sa * cb * (P * R / WHOLE)) * w * w - sa * ca * (P * P / WHOLE) * v * v
        ) * RATE**2
        low = (
            knee * TORQUE - ((-by_a - ca * sb * (P * R / WHOLE)) * v * v - sb * cb * (R * R / WHOLE) * w * w) * RATE**2
        )
        whole = aa * bb - ab * ab
        rates = [(bb * up - ab * low) / whole, (aa * low - ab * up) / whole]
        path = [*region(hip, v), *region(knee, w - v), b - a]
        return [v * RATE, w * RATE, *(r / RATE for r in rates), fall, -GRAVITY + 0.0 * fall], path, 0.0

    def ends(first: Any, last: Any, T: Any, p: Any, m: Any) -> tuple[Any, Any]:
        (a, w), up = last[0], (2 * BODY + 3 / 2 * THIGH + SHANK / 2) * LINK / WHOLE
        landed = [a, -a, w, -w, up * m.cos(a), -up * m.sin(a) * w * RATE]
        foot = last[1][4] - (LINK - P / WHOLE) * m.cos(last[1][0]) - (LINK - R / WHOLE) * m.cos(last[1][1])
        return -foot, [x - y for x, y in zip(first[1], landed, strict=True)]

    low, bounds = 1.2, [(-inf, 1.0)] * 4
    first = [low, -low, -0.1, 0.1, 0.3, 2.0]
    phases = (
        Phase(20, stance, [(0.075, 1.2), infinite], [infinite] * 2, points(low, 0), [(0.075, 1.2), infinite], (0.01, 0.5),
              straight([low, 0], [0.3, -0.4], 2, 0.2), [*bounds, *bounds, (0.0, inf)]),
        Phase(20, flight, [*links, *[infinite] * 4], [infinite] * 2, [*links, *[infinite] * 4], [*links, *[infinite] * 4],
              (0.01, 1.0), straight([0.3, -0.3, -0.4, 0.4, 0.6, 2.5], [1.0, -1.2, 0, 0, 0.9, 0], 2, 0.3),
              [*bounds, *bounds, (-2.4, -0.15)]),
    )  # fmt: skip
    return Posed("rail", phases, RAIL, ends, [(0.0, 0.0)] * len(first))


RAIL = -0.9312189  # [m], on 320 + 320 intervals; 160 + 160 differ by 1.3e-7


@dataclass(frozen=True)
class Formulas:
    """A function as elementary steps [operation, result, arguments ...] on numbered registers; sizes of its outputs."""

    name: str
    outputs: Sequence[int]
    steps: Sequence[Any]

    def __call__(self, columns: Sequence[Any], m: Any) -> list[list[Any]]:
        """Follow the steps with any symbols."""
        w: dict[int, Any] = {}
        out: list[list[Any]] = [[None] * n for n in self.outputs]
        for operation, to, *given in self.steps:
            if operation == "input":
                w[to] = columns[given[0]][given[1]]
            elif operation == "output":
                out[given[0]][given[1]] = w[to]
            elif operation == "const":
                w[to] = given[0]
            else:
                w[to] = OPERATIONS[operation](m, *(w[k] for k in given))
        return out


OPERATIONS: dict[str, Callable[..., Any]] = {
    "add": lambda m, a, b: a + b,
    "sub": lambda m, a, b: a - b,
    "mul": lambda m, a, b: a * b,
    "div": lambda m, a, b: a / b,
    "sq": lambda m, a: a * a,
    "neg": lambda m, a: -a,
    "sin": lambda m, a: m.sin(a),
    "cos": lambda m, a: m.cos(a),
}


def follow(f: Formulas, m: Any, *columns: Any) -> list[list[Any]]:
    """The formulas' values, in the package's own way if it has one."""
    return m.apply(f, *columns) if hasattr(m, "apply") else f(columns, m)


def hop(folder: Path) -> Posed:
    """The hop of a leg, from the formulas and numbers that store_hop.py wrote; variables scaled to order 1."""
    numbers = json.loads((folder / "hop.json").read_text())
    f = {name: Formulas(name, **numbers[name]) for name in ("stance_formulas", "flight_formulas", "lift_off", "top")}

    def phase(name: str) -> Phase:
        def at(x: Any, u: Any, m: Any) -> tuple[Any, Any, Any]:
            rates, path, (cost,) = follow(f[f"{name}_formulas"], m, x, u)
            return rates, path, cost

        return Phase(at=at, **numbers[name])

    def ends(first: Any, last: Any, T: Any, p: Any, m: Any) -> tuple[Any, Any]:
        (landed,), (top,) = follow(f["lift_off"], m, last[0]), follow(f["top"], m, last[1], p)
        return -p[0], [*(a - b for a, b in zip(first[1], landed, strict=True)), *top]

    return Posed(
        "hop",
        (phase("stance"), phase("flight")),
        numbers["optimum"],
        ends,
        numbers["ends"],
        numbers["parameters"],
        [0.3],
    )


def posed(name: str, folder: Path) -> Posed:
    """The problem of that name; KeyError if there is none."""
    return {"effort": effort, "denham": denham, "arm": arm, "jump": jump, "rail": rail, "hop": lambda: hop(folder)}[
        name
    ]()


@dataclass(frozen=True)
class Run:
    """One solve: seconds of making the program and of solving it, and what came out."""

    build: float
    solve: float
    iterations: int
    objective: float
    status: str

    @property
    def total(self) -> float:
        """Seconds of both."""
        return self.build + self.solve


def main(version: str, note: str, *variants: Callable[[Posed], Run]) -> None:
    """Solve the problem named on the command line and print one line of JSON.

    Each variant is run once; the fastest is repeated, short solves more often, long ones no more once a minute has
    passed, and its best run counts.
    """
    imports = time.time() - float(sys.argv[4])  # since the interpreter was started
    name, folder, repeats = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])
    began = time.perf_counter()
    first = [run(posed(name, folder)) for run in variants]
    fastest = min(range(len(variants)), key=lambda k: first[k].total)
    runs = [first[fastest]]
    while (spent := time.perf_counter() - began) < SHORT or (len(runs) < repeats and spent < LONG):
        runs.append(variants[fastest](posed(name, folder)))
    best = min(runs, key=lambda r: r.total)
    print(json.dumps({"version": version, "note": note, "imports": imports, "total": best.total, **best.__dict__}))
