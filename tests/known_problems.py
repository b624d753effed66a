"""Optimal control problems whose answers are known in closed form, and their solution from a straight line."""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import brentq

from hopopt.nlp.mesh import PhaseMesh, uniform
from hopopt.nlp.schemes import HERMITE_SIMPSON, TRAPEZOIDAL, Scheme, radau
from hopopt.nlp.solver.ipopt import NlpSolution, NlpSolver
from hopopt.nlp.transcription import Guess, Transcription
from hopopt.ocp.problem import (
    BoundaryConstraint,
    Control,
    Objective,
    Parameter,
    PathConstraint,
    Phase,
    Problem,
    State,
    linkage,
)

G = 9.81  # m/s^2
SCHEMES = (radau(2), radau(3), radau(5), HERMITE_SIMPSON, TRAPEZOIDAL)
ALL = frozenset(s.name for s in SCHEMES)
Ends2 = tuple[list[float], list[float], float]  # states at both ends of a phase's guess, and its control


@dataclass(frozen=True)
class Known:
    """A problem, its optimum, a straight-line guess and duration [s] for each phase, and a number of intervals N."""

    problem: Problem
    optimum: float
    guess: dict[str, tuple[float, Ends2]]
    intervals: int = 6
    exact: frozenset[str] = frozenset()  # schemes that solve it exactly, by the degree of the solution


def moved(bounds: tuple[float, float], distance: float, duration: tuple[float, float], **more: Any) -> Phase:
    """x'' = u from rest to rest."""
    states = (State("x", initial=0.0, final=distance), State("v", initial=0.0, final=0.0))
    return Phase("move", states, (Control("u", lower=bounds[0], upper=bounds[1]),), double_integrator, duration, **more)


def double_integrator(s: Any) -> dict[str, ca.SX]:
    return {"x": s.v, "v": s.u}


def minimum_effort() -> Known:
    """u = 6 - 12 t, integral of u^2 = 12."""
    effort = {"effort": lambda s: s.u**2}
    phase = moved((-np.inf, np.inf), 1.0, (1.0, 1.0), integrands=effort)
    problem = Problem("effort", (phase,), Objective("effort", lambda e: e.integral["move"]["effort"]))
    return Known(problem, 12.0, {"move": (1.0, ([0, 0], [1, 0], 0.0))}, 12, exact=ALL - {"trapezoidal"})


def bryson_denham(limit: float = 1 / 9, path: bool = False) -> Known:
    """Bryson and Ho, Applied Optimal Control, 3.11: 4 / (9 l) for l <= 1/6, touching from 3 l to 1 - 3 l."""
    upper = np.inf if path else limit
    states = (State("x", upper=upper, scale=0.5, initial=0.0, final=0.0), State("v", initial=1.0, final=-1.0))
    constraint = (PathConstraint("height", lambda s: s.x, upper=limit, scale=0.25),) if path else ()
    effort = {"effort": lambda s: s.u**2 / 2}
    phase = Phase("move", states, (Control("u"),), double_integrator, (1.0, 1.0), constraint, effort)
    problem = Problem("wall", (phase,), Objective("effort", lambda e: e.integral["move"]["effort"]))
    return Known(problem, 4 / (9 * limit), {"move": (1.0, ([0, 1], [0, -1], 0.0))}, 18)


def brachistochrone() -> Known:
    """A cycloid x = r (a - sin a), depth = r (1 - cos a), at time a sqrt(r / g)."""
    x, depth, g = 1.0, 0.6, 9.81
    angle: Any = brentq(lambda a: (a - np.sin(a)) / (1 - np.cos(a)) - x / depth, 0.1, 6.0)
    radius = depth / (1 - np.cos(angle))
    states = (
        State("x", initial=0.0, final=x), State("z", initial=0.0, final=depth), State("v", scale=3.0, initial=0.0)
    )  # fmt: skip
    slope = Control("a", lower=0.0, upper=np.pi)
    phase = Phase(
        "slide", states, (slope,),
        lambda s: {"x": s.v * ca.sin(s.a), "z": s.v * ca.cos(s.a), "v": g * ca.cos(s.a)}, (0.1, 3.0),
    )  # fmt: skip
    problem = Problem("brachistochrone", (phase,), Objective("time", lambda e: e.duration["slide"]))
    return Known(problem, angle * np.sqrt(radius / g), {"slide": (0.6, ([0, 0, 0], [x, depth, 3.0], 0.8))})


def growth() -> Known:
    """x' = a x, then y' = x, within T in all: switch at T - 1/a, y = x0 exp(a T - 1) / a."""
    a, T, x0 = 1.5, 2.0, 0.4
    grow = Phase("grow", (State("x", initial=x0),), (), lambda s: {"x": a * s.x}, (0.01, T))
    states = (State("x"), State("y", initial=0.0))
    reap = Phase("reap", states, (), lambda s: {"x": 0 * s.x, "y": s.x}, (0.01, T))
    boundary = (
        linkage("x", lambda e: e.initial["reap"].x - e.final["grow"].x),
        BoundaryConstraint("total", lambda e: e.duration["grow"] + e.duration["reap"], T, T),
    )
    goal = Objective("yield", lambda e: e.final["reap"].y, maximize=True)
    guess = {"grow": (1.0, ([x0], [1.0], 0.0)), "reap": (1.0, ([1.0, 0.0], [1.0, 1.0], 0.0))}
    return Known(Problem("growth", (grow, reap), goal, (), boundary), x0 * np.exp(a * T - 1) / a, guess)


def two_prices() -> Known:
    """Distance d in time 1; integral of u^2 + 1 in the first phase, 4 u^2 in the second.

    Speeds are 4 to 1, d = L (1 + 3 s) / 8 with the multiplier L, cost 4 d^2 / (1 + 3 s) + s: least at
    1 + 3 s = sqrt(12) d, where it is 4 d / sqrt(3) - 1/3.
    """
    d = 0.7
    kinds = {"cheap": ({"initial": 0.0}, 1.0, 1.0), "dear": ({"final": d}, 4.0, 0.0)}
    phases = tuple(two_prices_phase(name, *kind) for name, kind in kinds.items())
    boundary = (
        linkage("x", lambda e: e.initial["dear"].x - e.final["cheap"].x),
        BoundaryConstraint("total", lambda e: e.duration["cheap"] + e.duration["dear"], 1.0, 1.0),
    )
    goal = Objective("price", lambda e: e.integral["cheap"]["price"] + e.integral["dear"]["price"])
    guess = {"cheap": (0.5, ([0.0], [0.4], 0.7)), "dear": (0.5, ([0.4], [d], 0.7))}
    return Known(Problem("prices", phases, goal, (), boundary), 4 * d / np.sqrt(3) - 1 / 3, guess, exact=ALL)


def two_prices_phase(name: str, end: dict[str, Any], weight: float, rent: float) -> Phase:
    price = {"price": lambda s: weight * s.u**2 + rent}
    return Phase(name, (State("x", **end),), (Control("u"),), lambda s: {"x": s.u}, (0.05, 1.0), integrands=price)


def throw() -> Known:
    """Range v^2 / g, at 45 degrees: a free parameter and the time, both in the dynamics."""
    v, g = 3.0, 9.81
    states = (State("x", initial=0.0), State("z", initial=0.0, final=0.0))
    phase = Phase(
        "flight", states, (),
        lambda s: {"x": v * ca.cos(s.p["angle"]), "z": v * ca.sin(s.p["angle"]) - g * s.t}, (0.1, 2.0),
    )  # fmt: skip
    angle = Parameter("angle", lower=0.1, upper=1.5, value=0.5, scale=2.0, free=True, unit="rad")
    goal = Objective("range", lambda e: e.final["flight"].x, maximize=True)
    return Known(
        Problem("throw", (phase,), goal, (angle,)), v**2 / g, {"flight": (0.4, ([0, 0], [1, 0], 0))}, exact=ALL
    )


def terminal_and_integral() -> Known:
    """x' = u, w x(T)^2 + integral of u^2: u constant, w x0^2 / (1 + w T)."""
    w, T, x0 = 5.0, 2.0, 3.0
    effort = {"effort": lambda s: s.u**2}
    phase = Phase("run", (State("x", initial=x0),), (Control("u"),), lambda s: {"x": s.u}, (T, T), integrands=effort)
    goal = Objective("sum", lambda e: w * e.final["run"].x ** 2 + e.integral["run"]["effort"])
    return Known(Problem("lq", (phase,), goal), w * x0**2 / (1 + w * T), {"run": (T, ([x0], [0], 0.0))}, exact=ALL)


def timed() -> Known:
    """x' = u cos 3t from 0 to 1: u = cos 3t / integral of cos^2 3t, whose inverse is the cost."""
    effort = {"effort": lambda s: s.u**2}
    states = (State("x", initial=0.0, final=1.0),)
    phase = Phase("run", states, (Control("u"),), lambda s: {"x": s.u * ca.cos(3 * s.t)}, (1.0, 1.0), integrands=effort)
    problem = Problem("timed", (phase,), Objective("effort", lambda e: e.integral["run"]["effort"]))
    return Known(problem, 1 / (0.5 + np.sin(6) / 12), {"run": (1.0, ([0], [1], 0.0))})


def lift_off_of_hopper(m: float, F0: float, v0: float, s: float) -> tuple[float, float]:
    """A hopper of one dimension at full force: time [s] and speed [m/s] at the end of the stroke.

    x = (a/b) t - (a/b^2) (1 - exp(-b t)).
    """
    a, b = F0 / m - G, F0 / (m * v0)

    def x(t: float) -> float:
        return a / b * t - a / b**2 * -np.expm1(-b * t)

    t: Any = brentq(lambda t: x(t) - s, 1e-6, 100.0, xtol=1e-15, rtol=1e-14)  # pyright: ignore[reportArgumentType]
    return t, -a / b * np.expm1(-b * t)


def push(m: float, F0: float, v0: float, s: float) -> Phase:
    """Its push: mass [kg], force at standstill [N], speed without force [m/s], stroke [m]."""
    place = State("x", lower=0.0, upper=s, scale=s, initial=0.0, final=s)
    states = (place, State("v", lower=0.0, scale=v0, initial=0.0))
    path = (
        PathConstraint("motor", lambda i: i.F / F0 + i.v / v0, upper=1.0),
        PathConstraint("only pushes", lambda i: i.F, lower=0.0, scale=F0, unit="N"),
    )
    return Phase("push", states, (Control("F", scale=F0),), lambda i: {"x": i.v, "v": i.F / m - G}, (1e-3, 5.0), path)


PROBLEMS = (
    minimum_effort, bryson_denham, brachistochrone, growth, two_prices, throw, terminal_and_integral, timed
)  # fmt: skip


def guesses(known: Known) -> dict[str, Guess]:
    """Straight lines."""
    lines = {}
    for name, (duration, (first, last, u)) in known.guess.items():
        controls = np.full((2, sum(c.size for c in known.problem.phase(name).controls)), u)
        lines[name] = Guess(duration, np.array([0.0, 1.0]), np.array([first, last]), controls)
    return lines


def solve(known: Known, method: Scheme, mesh: PhaseMesh | None = None, factor: int = 1) -> NlpSolution:
    """The solution on uniform meshes of factor * N intervals, or on the mesh given."""
    meshes = {phase.name: mesh or uniform(factor * known.intervals) for phase in known.problem.phases}
    solution = NlpSolver(Transcription(known.problem, method, meshes))(guesses(known))
    assert solution.success, solution.status
    return solution
