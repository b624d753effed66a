"""The benchmark's problems in hopopt's own transcription layer."""

import time
from importlib.metadata import version
from typing import Any

import casadi as ca
import numpy as np
from posed import DEGREE, MOST_ITERATIONS, TOLERANCE, Posed, Run, main
from posed import Phase as PosedPhase

from hopopt.nlp.mesh import uniform
from hopopt.nlp.schemes import radau
from hopopt.nlp.solver.ipopt import NlpSolver
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.guesses.guess import Guess
from hopopt.ocp.problem import BoundaryConstraint, Control, Objective, Parameter, PathConstraint, Phase, Problem, State

NOTE = "Radau degree 3, the right end of an interval collocated; controls with a value at every point"


class Symbols:
    """What posed.py asks of a package's symbols: these are CasADi's."""

    sin, cos = staticmethod(ca.sin), staticmethod(ca.cos)


def column(values: Any) -> ca.SX:
    """A list of expressions and numbers as a column."""
    return ca.vertcat(*[ca.SX(v) for v in values])


def sides(pairs: Any) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper bounds."""
    table = np.array(pairs, dtype=float).reshape(-1, 2)
    return table[:, 0], table[:, 1]


def make_phase(name: str, p: PosedPhase) -> Phase:
    """A phase of one state vector and one control vector."""

    def at(s: Any) -> tuple[ca.SX, ca.SX, ca.SX]:
        def make() -> tuple[ca.SX, ca.SX, ca.SX]:
            rates, path, cost = p.at(ca.vertsplit(s.x), ca.vertsplit(s.u), Symbols)
            return column(rates), column(path), column([cost])

        return s.once("at", make)

    (low, high), (least, most) = sides(p.x), sides(p.u)
    state = State("x", len(p.x), low, high, initial=sides(p.start), final=sides(p.end))
    path = (PathConstraint("path", lambda s: at(s)[1], *sides(p.path), labels=tuple(map(str, range(len(p.path))))),)
    integrand = {"cost": lambda s: at(s)[2]}
    control = Control("u", len(p.u), least, most)
    return Phase(
        name, (state,), (control,), lambda s: {"x": at(s)[0]}, p.duration, path if p.path else (), integrand
    )  # fmt: skip


def make_problem(posed: Posed) -> Problem:
    """The whole problem."""
    names = [f"phase{k}" for k in range(len(posed.phases))]

    def ends(e: Any) -> tuple[Any, Any]:
        first, last = ([ca.vertsplit(group[n].x) for n in names] for group in (e.initial, e.final))
        p = ca.vertsplit(e.p["p"]) if posed.parameters else []
        return posed.ends(first, last, [e.duration[n] for n in names], p, Symbols)

    def cost(e: Any) -> ca.SX:
        return ends(e)[0] + sum(e.integral[n]["cost"] for n in names)

    boundary = BoundaryConstraint("ends", lambda e: column(ends(e)[1]), *sides(posed.constraints))
    low, high = sides(posed.parameters)
    p = Parameter("p", len(low), low, high, value=np.array(posed.parameter_guess), free=True)
    return Problem(
        posed.name,
        tuple(make_phase(n, phase) for n, phase in zip(names, posed.phases, strict=True)),
        Objective("cost", cost),
        (p,) if posed.parameters else (),
        (boundary,) if posed.constraints else (),
    )


def run(posed: Posed) -> Run:
    """Transcribe and solve once."""
    began = time.perf_counter()
    problem = make_problem(posed)
    named = dict(zip((p.name for p in problem.phases), posed.phases, strict=True))
    mesh = {name: uniform(p.intervals) for name, p in named.items()}
    options = {"ipopt.tol": TOLERANCE, "ipopt.max_iter": MOST_ITERATIONS}
    solver = NlpSolver(Transcription(problem, radau(DEGREE), mesh), options)
    guess = {n: Guess(p.guess[3], *(np.array(table, dtype=float) for table in p.guess[:3])) for n, p in named.items()}
    built = time.perf_counter()
    s = solver(guess)
    return Run(built - began, time.perf_counter() - built, s.iterations, s.objective, s.status)


if __name__ == "__main__":
    main(version("hopopt"), NOTE, run)
