"""The nonlinear program that a solution is the answer of, made again from what the solution holds."""

from dataclasses import fields

import casadi as ca
import numpy as np

from hopopt.errors import ResultError, UsageError
from hopopt.nlp.mesh import PhaseMesh
from hopopt.nlp.schemes import scheme
from hopopt.nlp.solver.ipopt import Bounds, NlpSolution
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.custom import Custom
from hopopt.ocp.hop import Hop
from hopopt.ocp.objectives.objective import HopObjective
from hopopt.ocp.objectives.registry import find
from hopopt.ocp.problem import Problem
from hopopt.ocp.rules import added_rules
from hopopt.planner.solution import Solution


def has_multipliers(solution: Solution) -> bool:
    """Whether the program's point and multipliers were stored."""
    return {"z", "lam_g", "lam_x"} <= solution.kkt.keys()


def own_functions(solution: Solution) -> tuple[HopObjective, tuple[Custom, ...]]:
    """What the solution was found with; UsageError if it takes functions that were not given again: files name code,
    they do not run it."""
    objective, constraints = solution.summary.functions.objective, solution.summary.functions.constraints
    goal, own = solution.own
    _check_rules(solution)
    if (goal.name if goal else None) != objective or sorted(c.name for c in own) != sorted(constraints):
        options = [f"--objective {objective}"] * bool(objective) + [f"--constraint {name}" for name in constraints]
        what = "was found without user-defined functions: give none"
        if options:
            what = f"was found with user-defined functions and needs their module: add {' '.join(options)}"
        raise UsageError(f"{solution.result_dir} {what}")
    return goal or find(solution.objective), own


def _check_rules(solution: Solution) -> None:
    """UsageError unless the limits that were added to RULES are those that the solution was found with."""
    stored, present = solution.summary.functions.rules, added_rules()
    where = solution.result_dir or solution.design.name
    if missing := [name for name in stored if name not in present]:
        modules = ", ".join(dict.fromkeys(name.partition(":")[0] for name in missing))
        example = f"python -c \"import {modules}; from hopopt.cli.main import main; main(['verify', '{where}'])\""
        raise UsageError(
            f"{where} was found with limits added to RULES ({', '.join(missing)}) and needs their module: {example}"
        )
    if more := [name for name in present if name not in stored]:
        raise UsageError(f"{where} was found without the limits that RULES has now ({', '.join(more)}): take them out")


def hop_of(solution: Solution) -> Hop:
    """The hop that the solution is of."""
    goal, constraints = own_functions(solution)
    return Hop(solution.design, goal, constraints=constraints)


def stored_nlp(solution: Solution, problem: Problem | None = None) -> NlpSolution:
    """The nonlinear program of the last mesh with its stored point, multipliers and bounds; ``problem``: the solution's,
    if it is made already, or one that differs in its objective."""
    problem, mesh, kkt = problem or hop_of(solution).problem, {}, dict(solution.kkt)
    for name, trajectory in solution.phases.items():
        edges = trajectory.edges / trajectory.duration
        free = np.flatnonzero(np.diff(trajectory.arc)) + 1
        mesh[name] = PhaseMesh(tuple(edges.tolist()), tuple(free.tolist()))
    t = Transcription(problem, scheme(next(iter(solution.phases.values())).scheme.name), mesh)
    if len(kkt["z"]) != len(t.scale):
        raise ResultError(f"{solution.result_dir}: mesh and NLP vectors do not belong together")
    bounds = Bounds(*(kkt.pop(side.name) for side in fields(Bounds)))
    phases, values = t.unpack(kkt["z"], kkt["p"])
    f, g = ca.Function("fg", [t.nlp["x"], t.nlp["p"]], [t.nlp["f"], t.nlp["g"]])(kkt["z"], kkt["p"])
    kkt["g"], objective = np.array(g).ravel(), t.problem.objective.cost(float(f))
    return NlpSolution(t, phases, values, objective, "stored", True, 0, **kkt, bounds=bounds)


def without_tie_break(solution: Solution, hop: Hop | None = None) -> NlpSolution:
    """The program of a hop and its solution, the tie-break taken off the objective; ``hop``: it, if it is made already."""
    return stored_nlp(solution, (hop or hop_of(solution)).tied(0.0))
