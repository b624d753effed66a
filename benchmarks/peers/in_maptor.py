"""The benchmark's problems in MAPTOR."""

# pyright: reportMissingImports=false

from typing import Any

import casadi as ca
import maptor
import numpy as np
from maptor.radau import _compute_legendre_gauss_radau_nodes_and_weights as radau
from opti import Symbols, timed, variants
from posed import DEGREE, Phase, Posed, Run, main

NOTE = "LGR degree 3, which collocates the left end of an interval and leaves the right one free"


def side(pair: tuple[float, float]) -> Any:
    """A pair of bounds as MAPTOR writes it."""
    lower, upper = (float(b) if np.isfinite(b) else None for b in pair)
    if lower is None and upper is None:
        return None
    return lower if lower == upper else (lower, upper)


def rows(value: Any, pairs: Any) -> list[Any]:
    """Constraints, component by component where there is a bound."""
    found = []
    for v, (lower, upper) in zip(value, pairs, strict=True):
        if lower == upper:
            found.append(v == lower)
            continue
        found += [v >= lower] if np.isfinite(lower) else []
        found += [v <= upper] if np.isfinite(upper) else []
    return found


def add_phase(problem: Any, k: int, p: Phase) -> tuple[Any, Any, Any, Any]:
    """A phase with a clock of its own: itself, its time, its states and its integral."""
    phase = problem.set_phase(k + 1)
    t = phase.time(initial=0.0, final=side(p.duration))
    x = [
        phase.state(f"x{i}", initial=side(p.start[i]), final=side(p.end[i]), boundary=side(p.x[i]))
        for i in range(len(p.x))
    ]
    u = [phase.control(f"u{i}", boundary=side(pair)) for i, pair in enumerate(p.u)]
    symbols = [s.__casadi_MX__() for s in x]
    rates, path, cost = p.at(symbols, u, Symbols)
    phase.dynamics(dict(zip(x, rates, strict=True)))
    if p.path:
        phase.path_constraints(*rows(path, p.path))
    integral = None if isinstance(cost, float) else phase.add_integral(cost)
    phase.mesh([DEGREE] * p.intervals, np.linspace(-1.0, 1.0, p.intervals + 1))
    set_guess(phase, p, integral is not None)
    return phase, t, x, integral


def set_guess(phase: Any, p: Phase, integral: bool) -> None:
    """The guess at MAPTOR's own nodes."""
    nodes = radau(DEGREE)
    fraction, *tables, duration = p.guess

    def sampled(table: Any, places: np.ndarray) -> list[np.ndarray]:
        starts = np.arange(p.intervals)[:, None]
        at = (starts + (places + 1) / 2) / p.intervals
        return [np.array([np.interp(row, fraction, column) for column in np.array(table).T]) for row in at]

    states, controls = (
        sampled(table, places)
        for table, places in zip(tables, (nodes.state_approximation_nodes, nodes.collocation_nodes), strict=True)
    )
    more = {"integrals": 0.0} if integral else {}
    phase.guess(states=states, controls=controls, initial_time=0.0, terminal_time=duration, **more)


def run(posed: Posed, expand: bool) -> Run:
    """Pose and solve once."""

    def pose_and_solve(options: dict[str, Any]) -> None:
        problem = maptor.Problem(posed.name)
        made = [add_phase(problem, k, p) for k, p in enumerate(posed.phases)]
        free = [problem.parameter(f"p{k}", boundary=side(pair)) for k, pair in enumerate(posed.parameters)]
        if free:
            problem.parameter_guess(**{f"p{k}": value for k, value in enumerate(posed.parameter_guess)})
        first, last = ([[getattr(s, end) for s in x] for _, _, x, _ in made] for end in ("initial", "final"))
        cost, held = posed.ends(first, last, [t.final for _, t, _, _ in made], free, Symbols)
        if posed.constraints:
            made[-1][0].event_constraints(*rows(held, posed.constraints))
        integrals = [integral for *_, integral in made if integral is not None]
        problem.minimize(sum(integrals, ca.MX(cost)))
        maptor.solve_fixed_mesh(problem, nlp_options=options, show_summary=False)

    return timed(pose_and_solve, expand)


if __name__ == "__main__":
    main(maptor.__version__, NOTE, *variants(run))
