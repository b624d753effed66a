"""The benchmark's problems in YAPSS."""

# pyright: reportMissingImports=false

import time
from importlib.metadata import version
from typing import Any

import numpy as np
import yapss
import yapss.math as ym
from posed import DEGREE, MOST_ITERATIONS, TOLERANCE, Posed, Run, main
from yapss._private import solver

NOTE = "LGR degree 3, which collocates the left end of an interval and leaves the right one free; callbacks in Python"


class Symbols:
    """What posed.py asks of a package's symbols."""

    sin, cos = staticmethod(ym.sin), staticmethod(ym.cos)


def pose(posed: Posed) -> yapss.Problem:
    """The problem in YAPSS's terms."""
    phases = posed.phases
    problem: Any = yapss.Problem(
        name=posed.name, nx=[len(p.x) for p in phases], nu=[len(p.u) for p in phases], nh=[len(p.path) for p in phases],
        nq=[1] * len(phases), nd=len(posed.constraints), ns=len(posed.parameters),
    )  # fmt: skip

    def continuous(arg: Any) -> None:
        for k in arg.phase_list:
            rates, path, cost = phases[k].at(list(arg.phase[k].state), list(arg.phase[k].control), Symbols)
            arg.phase[k].dynamics[:] = rates
            if phases[k].path:
                arg.phase[k].path[:] = path
            zero = 0.0 * arg.phase[k].state[0]
            arg.phase[k].integrand[:] = [cost + zero]

    def ends(arg: Any) -> Any:
        first, last = ([list(getattr(q, name)) for q in arg.phase] for name in ("initial_state", "final_state"))
        durations = [q.final_time - q.initial_time for q in arg.phase]
        return posed.ends(first, last, durations, list(arg.parameter), Symbols)

    def objective(arg: Any) -> None:
        arg.objective = ends(arg)[0] + sum(q.integral[0] for q in arg.phase)

    def discrete(arg: Any) -> None:
        arg.discrete[:] = ends(arg)[1]

    problem.functions.continuous, problem.functions.objective = continuous, objective
    if posed.constraints:
        problem.functions.discrete = discrete
        set_bounds(problem.bounds.discrete, posed.constraints)
    if posed.parameters:
        set_bounds(problem.bounds.parameter, posed.parameters)
        problem.guess.parameter = posed.parameter_guess
    for k, p in enumerate(phases):
        set_phase(problem, k, p)
    problem.derivatives.method, problem.derivatives.order = "auto", "second"
    problem.spectral_method = "lgr"
    o = problem.ipopt_options
    o.tol, o.max_iter, o.print_level, o.sb = TOLERANCE, MOST_ITERATIONS, 0, "yes"
    return problem


def set_bounds(bounds: Any, pairs: Any) -> None:
    """Lower and upper bounds of a group."""
    bounds.lower[:], bounds.upper[:] = [a for a, _ in pairs], [b for _, b in pairs]


def set_phase(problem: yapss.Problem, k: int, p: Any) -> None:
    """Bounds, mesh and guess of a phase; each has a clock of its own."""
    bounds = problem.bounds.phase[k]
    for group, pairs in (
        (bounds.state, p.x), (bounds.control, p.u), (bounds.initial_state, p.start), (bounds.final_state, p.end)
    ):  # fmt: skip
        set_bounds(group, pairs)
    if p.path:
        set_bounds(bounds.path, p.path)
    bounds.initial_time.lower = bounds.initial_time.upper = 0.0
    bounds.final_time.lower, bounds.final_time.upper = p.duration
    problem.mesh.phase[k].collocation_points = (DEGREE,) * p.intervals
    problem.mesh.phase[k].fraction = (1.0 / p.intervals,) * p.intervals
    fraction, x, u, duration = p.guess
    guess = problem.guess.phase[k]
    guess.time, guess.state, guess.control = np.array(fraction) * duration, np.array(x).T, np.array(u).T


def run(posed: Posed) -> Run:
    """Pose and solve once; the time in Ipopt, callbacks included, is the solve."""
    inside, last = [0.0], [0]
    plain = solver._solve_ipopt_problem

    def timed(ipopt: Any, *more: Any) -> Any:
        began = time.perf_counter()
        found = plain(ipopt, *more)
        inside[0] = time.perf_counter() - began
        return found

    solver._solve_ipopt_problem = timed
    try:
        began = time.perf_counter()
        problem = pose(posed)

        def count(*args: Any) -> bool:
            last[0] = int(args[1])
            return True

        object.__setattr__(problem, "_intermediate_cb", count)
        found = problem.solve()
        total = time.perf_counter() - began
    finally:
        solver._solve_ipopt_problem = plain
    return Run(total - inside[0], inside[0], last[0], float(found.objective), str(found.nlp_info.ipopt_status_message))


if __name__ == "__main__":
    main(version("yapss"), NOTE, run)
