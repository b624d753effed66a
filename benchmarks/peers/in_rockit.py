"""The benchmark's problems in rockit."""

# pyright: reportMissingImports=false

from importlib.metadata import version
from typing import Any

import casadi as ca
import numpy as np
from opti import Symbols, timed, variants
from posed import DEGREE, Phase, Posed, Run, main
from rockit import DirectCollocation, FreeTime, Ocp

NOTE = "Radau degree 3 for the states, controls constant in an interval (rockit offers no others in collocation)"


def hold(stage: Any, value: Any, pairs: Any, **where: Any) -> None:
    """lower <= value <= upper, component by component where there is a bound."""
    for k, (lower, upper) in enumerate(pairs):
        if lower == upper:
            stage.subject_to(value[k] == lower, **where)
        elif np.isfinite(lower) and np.isfinite(upper):
            stage.subject_to(lower <= (value[k] <= upper), **where)
        elif np.isfinite(lower):
            stage.subject_to(value[k] >= lower, **where)
        elif np.isfinite(upper):
            stage.subject_to(value[k] <= upper, **where)


def make_stage(ocp: Ocp, p: Phase) -> tuple[Any, Any]:
    """A phase with a clock of its own, and its states."""
    fraction, x_guess, u_guess, duration = p.guess
    fixed = p.duration[0] == p.duration[1]
    stage = ocp.stage(t0=0, T=p.duration[0] if fixed else FreeTime(duration))
    if not fixed:
        stage.subject_to(p.duration[0] <= (p.duration[1] >= stage.T))
    x, u = stage.state(len(p.x)), stage.control(len(p.u))
    rates, path, cost = p.at(ca.vertsplit(x), ca.vertsplit(u), Symbols)
    stage.set_der(x, ca.vertcat(*rates))
    at_roots: dict[str, Any] = {"grid": "integrator_roots"}
    hold(stage, x, p.x, **at_roots)
    hold(stage, u, p.u, include_last=False)
    hold(stage, path, p.path, **at_roots)
    hold(stage, stage.at_t0(x), p.start)
    hold(stage, stage.at_tf(x), p.end)
    if not isinstance(cost, float):
        stage.add_objective(stage.integral(cost))
    for symbol, table in ((x, x_guess), (u, u_guess)):
        line = ca.interpolant("guess", "linear", [list(fraction)], np.array(table, dtype=float).ravel().tolist())
        stage.set_initial(symbol, line(stage.t / duration))
    stage.method(DirectCollocation(N=p.intervals, M=1, degree=DEGREE, scheme="radau"))
    return stage, x


def run(posed: Posed, expand: bool) -> Run:
    """Pose and solve once."""

    def pose_and_solve(options: dict[str, Any]) -> None:
        ocp = Ocp()
        stages = [make_stage(ocp, p) for p in posed.phases]
        free = [ocp.variable() for _ in posed.parameters]
        for symbol, guess in zip(free, posed.parameter_guess, strict=True):
            ocp.set_initial(symbol, guess)
        hold(ocp, free, posed.parameters)
        first = [ca.vertsplit(s.at_t0(x)) for s, x in stages]
        last = [ca.vertsplit(s.at_tf(x)) for s, x in stages]
        cost, rows = posed.ends(first, last, [s.T for s, _ in stages], free, Symbols)
        ocp.add_objective(cost)
        hold(ocp, rows, posed.constraints)
        ocp.solver("ipopt", options)
        ocp.solve()

    return timed(pose_and_solve, expand)


if __name__ == "__main__":
    main(version("rockit-meco"), NOTE, *variants(run))
