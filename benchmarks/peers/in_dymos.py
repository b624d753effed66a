"""The benchmark's problems of one phase in dymos."""

# pyright: reportMissingImports=false

import contextlib
import io
import time
import warnings
from importlib.metadata import version
from typing import Any

import numpy as np

warnings.simplefilter("ignore")
import dymos as dm  # noqa: E402
import openmdao.api as om  # noqa: E402
from posed import DEGREE, HASTE, MOST_ITERATIONS, SPEED, TOLERANCE, Phase, Posed, Run, main  # noqa: E402

NOTE = "LGR degree 3, its left end collocated; SciPy's dense SLSQP, not Ipopt (no Ipopt for OpenMDAO in the package index); complex-step rates"
OBJECTIVES = {"effort": "J", "denham": "J", "arm": "time", "jump": f"goal = {HASTE} * time - {SPEED} * x1"}


class Rates(om.ExplicitComponent):
    """Right-hand sides at all nodes."""

    def initialize(self) -> None:
        """Options."""
        self.options.declare("num_nodes", types=int)
        self.options.declare("phase", types=Phase, recordable=False)

    def setup(self) -> None:
        """Inputs, outputs and their derivatives, node by node."""
        nodes, p = self.options["num_nodes"], self.options["phase"]
        for name, count in (("x", len(p.x)), ("u", len(p.u))):
            for k in range(count):
                self.add_input(f"{name}{k}", shape=(nodes,))
        for name in self.names():
            self.add_output(name, shape=(nodes,))
        self.declare_coloring(wrt="*", method="cs", show_summary=False)

    def names(self) -> list[str]:
        """Of the outputs."""
        p = self.options["phase"]
        return [*(f"rate{k}" for k in range(len(p.x))), *(f"path{k}" for k in range(len(p.path))), "cost"]

    def compute(self, inputs: Any, outputs: Any) -> None:
        """The phase's own function on arrays."""
        p = self.options["phase"]
        x, u = ([inputs[f"{n}{k}"] for k in range(len(pairs))] for n, pairs in (("x", p.x), ("u", p.u)))
        rates, path, cost = p.at(x, u, np)
        for name, value in zip(self.names(), [*rates, *path, cost], strict=True):
            outputs[name] = value


def limits(pair: tuple[float, float]) -> dict[str, float]:
    """The finite bounds of a pair."""
    return {name: b for name, b in zip(("lower", "upper"), pair, strict=True) if np.isfinite(b)}


def pose(posed: Posed) -> tuple[om.Problem, Any]:
    """The problem in dymos's terms, set up."""
    (p,) = posed.phases
    problem = om.Problem()
    problem.driver = om.ScipyOptimizeDriver(optimizer="SLSQP", tol=TOLERANCE, maxiter=MOST_ITERATIONS, disp=False)
    problem.driver.declare_coloring(show_summary=False)
    radau = dm.Radau(num_segments=p.intervals, order=DEGREE, compressed=True)
    phase = dm.Phase(ode_class=Rates, ode_init_kwargs={"phase": p}, transcription=radau)
    trajectory = problem.model.add_subsystem("trajectory", dm.Trajectory())
    trajectory.add_phase("phase", phase)
    fixed = p.duration[0] == p.duration[1]
    phase.set_time_options(fix_initial=True, fix_duration=fixed, **({} if fixed else {"duration_bounds": p.duration}))
    for k in range(len(p.x)):
        ends = {f"fix_{end}": pairs[k][0] == pairs[k][1] for end, pairs in (("initial", p.start), ("final", p.end))}
        phase.add_state(f"x{k}", rate_source=f"rate{k}", targets=[f"x{k}"], **ends, **limits(p.x[k]))
    phase.add_state("J", rate_source="cost", fix_initial=True)
    for k, pair in enumerate(p.u):
        phase.add_control(f"u{k}", targets=[f"u{k}"], continuity=False, rate_continuity=False, **limits(pair))
    for k, pair in enumerate(p.path):
        phase.add_path_constraint(f"path{k}", **limits(pair))
    phase.add_objective(OBJECTIVES[posed.name], loc="final")
    problem.setup(force_alloc_complex=True)
    _, x, u, duration = p.guess
    phase.set_time_val(initial=0.0, duration=duration)
    for name, table in (("state", x), ("control", u)):
        for k, column in enumerate(np.array(table, dtype=float).T):
            getattr(phase, f"set_{name}_val")(f"{name.replace('state', 'x').replace('control', 'u')}{k}", list(column))
    phase.set_state_val("J", [0.0, 1.0])
    problem.final_setup()
    return problem, phase


def run(posed: Posed) -> Run:
    """Pose and solve once; what dymos prints is dropped."""
    if posed.name not in OBJECTIVES:
        raise SystemExit("not posed: SLSQP factors dense matrices, of some 900 unknowns here")
    with contextlib.redirect_stdout(io.StringIO()):
        began = time.perf_counter()
        problem, phase = pose(posed)
        built = time.perf_counter()
        result = problem.run_driver()
        solved = time.perf_counter()
    T, last = phase.get_val("timeseries.time")[-1, 0], [phase.get_val("timeseries.x1")[-1, 0]]
    value = {"arm": T, "jump": HASTE * T - SPEED * last[0]}.get(posed.name)
    objective = float(phase.get_val("timeseries.J")[-1, 0] if value is None else value)
    return Run(
        built - began,
        solved - built,
        int(result.iter_count),
        objective,
        "converged" if result.success else str(result.exit_status),
    )


if __name__ == "__main__":
    main(version("dymos"), NOTE, run)
