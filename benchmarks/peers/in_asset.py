"""The benchmark's problems in ASSET."""

# pyright: reportMissingImports=false

import time
from importlib.metadata import version
from typing import Any

import asset_asrl as asset
import numpy as np
from posed import MOST_ITERATIONS, TOLERANCE, Phase, Posed, Run, main

NOTE = "LGL5 (Lobatto), controls without continuity of slope; its own interior-point solver, not Ipopt, one thread"
vf, oc = asset.VectorFunctions, asset.OptimalControl


class Symbols:
    """What posed.py asks of a package's symbols."""

    sin, cos = staticmethod(vf.sin), staticmethod(vf.cos)


def bound(target: Any, what: str, place: str, pair: tuple[float, float], *which: Any) -> None:
    """A lower bound, an upper bound, or both; ``what`` is Var or Func."""
    lower, upper = pair
    if np.isfinite(lower) and np.isfinite(upper):
        getattr(target, f"addLU{what}Bound")(place, *which, lower, upper)
    elif np.isfinite(lower):
        getattr(target, f"addLower{what}Bound")(place, *which, lower)
    elif np.isfinite(upper):
        getattr(target, f"addUpper{what}Bound")(place, *which, upper)


def hold(phase: Any, place: str, k: int, pair: tuple[float, float]) -> None:
    """A value, or bounds, of variable k."""
    if pair[0] == pair[1]:
        phase.addBoundaryValue(place, [k], [pair[0]])
    else:
        bound(phase, "Var", place, pair, k)


def make_phase(p: Phase) -> Any:
    """A phase with a clock of its own; its variables are the states, the time, the controls."""
    nx, nu = len(p.x), len(p.u)
    args = oc.ODEArguments(nx, nu)
    rates, path, cost = p.at([args.XVar(k) for k in range(nx)], [args.UVar(k) for k in range(nu)], Symbols)
    fraction, x, u, duration = p.guess
    guess = [np.array([*a, s * duration, *b], dtype=float) for s, a, b in zip(fraction, x, u, strict=True)]
    rates = [args.XVar(0) * 0.0 + rate if isinstance(rate, float) else rate for rate in rates]
    phase = oc.ODEBase(vf.stack(rates), nx, nu).phase("LGL5", guess, p.intervals)
    phase.setControlMode("NoSpline")
    every = range(nx + 1 + nu)
    for place, pairs, first in (("InnerPath", p.x, 0), ("Path", p.u, nx + 1)):  # no bound at an end that is given
        for k, pair in enumerate(pairs):
            bound(phase, "Var", place, pair, first + k)
    for value, pair in zip(path, p.path, strict=True):
        bound(phase, "Func", "Path", pair, value, every)
    for place, pairs in (("Front", p.start), ("Back", p.end)):
        for k, pair in enumerate(pairs):
            hold(phase, place, k, pair)
    phase.addBoundaryValue("Front", [nx], [0.0])
    hold(phase, "Back", nx, p.duration)
    if not isinstance(cost, float):
        phase.addIntegralObjective(cost, every)
    return phase


def add_ends(posed: Posed, phases: list[Any], program: Any) -> None:
    """What the end of the last phase costs, and what must hold between phases and there."""
    if len(phases) > 1:
        add_link(posed, phases, program)
    if posed.name == "hop":
        return add_hop_top(posed, phases[1])
    nx = len(posed.phases[-1].x)
    args = vf.Arguments(nx + 1)
    last = [args[k] for k in range(nx)]
    unused = [[args[0]] * len(p.x) for p in posed.phases[:-1]]  # their rows are the link's
    cost, _ = posed.ends([last] * len(phases), [*unused, last], [args[nx]] * len(phases), [], Symbols)
    if not isinstance(cost, float):
        phases[-1].addStateObjective("Back", cost, range(nx + 1))


def add_link(posed: Posed, phases: list[Any], program: Any) -> None:
    """The state at lift-off is that of both phases."""
    n0, n1 = (len(p.x) for p in posed.phases)
    args = vf.Arguments(n0 + n1)
    last, first = [args[k] for k in range(n0)], [args[n0 + k] for k in range(n1)]
    gap = posed.ends([None, first], [last, first], [], [args[0]], Symbols)[1][:n1]
    program.addLinkEqualCon(vf.stack(gap), phases[0], "Back", range(n0), [], [], phases[1], "Front", range(n1), [], [])


def add_hop_top(posed: Posed, flight: Any) -> None:
    """The heights at the end, which are at least a static parameter of flight."""
    n0, n1 = (len(p.x) for p in posed.phases)
    args = vf.Arguments(n1 + 1)
    top, clearance = [args[k] for k in range(n1)], args[n1]
    rows = posed.ends([None, top], [[args[k] for k in range(n0)], top], [], [clearance], Symbols)[1][n1:]
    flight.setStaticParams(np.array(posed.parameter_guess))
    for row, pair in zip(rows, posed.constraints[n1:], strict=True):
        bound(flight, "Func", "Back", pair, row, range(n1), [], [0])
    flight.addValueObjective("StaticParams", 0, -1.0)


def run(posed: Posed) -> Run:
    """Pose and solve once."""
    began = time.perf_counter()
    phases = [make_phase(p) for p in posed.phases]
    program = oc.OptimalControlProblem()
    for phase in phases:
        program.addPhase(phase)
    add_ends(posed, phases, program)
    program.setThreads(1, 1)
    o = program.optimizer
    o.set_tols(TOLERANCE, TOLERANCE, TOLERANCE, TOLERANCE)
    o.set_MaxIters(MOST_ITERATIONS)
    o.set_OptLSMode("L1")
    o.PrintLevel = 3
    flag = str(program.optimize()).split(".")[-1]
    total, solve = time.perf_counter() - began, float(o.LastTotalTime)
    return Run(total - solve, solve, int(o.LastIterNum), float(o.LastObjVal), flag)


if __name__ == "__main__":
    main(version("asset_asrl"), NOTE, run)
