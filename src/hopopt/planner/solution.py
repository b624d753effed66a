"""A solved hop as the user holds it: the motion with every figure that is printed of it, and the program that it answers."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from hopopt.design.names import names_in
from hopopt.errors import ResultError, UsageError
from hopopt.extensions import absent, doubts, function, known, needs, used
from hopopt.nlp.mesh import PhaseMesh
from hopopt.nlp.refinement.mesh_refinement import Refinement
from hopopt.nlp.solver.ipopt import Bounds, NlpSolution
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.custom import Custom, custom
from hopopt.ocp.hop import Hop
from hopopt.ocp.objectives.objective import HopObjective
from hopopt.ocp.objectives.registry import find
from hopopt.ocp.problem import Problem
from hopopt.optimality.minimum_principle.free_switches import Resolved
from hopopt.planner.answer.extras import Functions
from hopopt.planner.answer.program_figures import FigureSource, figures
from hopopt.planner.answer.starts import start_figures
from hopopt.planner.answer.summary import VERSION, Summary
from hopopt.planner.checks.verdict import Multipliers, Verdict
from hopopt.planner.motion import Motion
from hopopt.planner.search.multistart import StartOutcome
from hopopt.planner.stopwatch import Stopwatch


@dataclass(frozen=True, repr=False)
class Solution(Motion):
    """The best hop found.

    summary: every figure that is printed of it
    kkt: the nonlinear program's vectors, by name
    result_dir: the folder that it lies in
    multipliers: of the certificate, by phase (planner/checks/verdict.py)
    verdict: what the checks said; None for one that was read (storage/seal/recheck.py makes it)
    doubts: why its files are not to be trusted, a sentence each; such a solution is not verified
    """

    summary: Summary
    kkt: dict[str, np.ndarray] = field(default_factory=dict)
    result_dir: Path | None = None
    multipliers: dict[str, Multipliers] = field(default_factory=dict)
    verdict: Verdict | None = None
    doubts: tuple[str, ...] = ()

    def __repr__(self) -> str:
        s = self.summary
        reached = f"{s.objective_figure} {s.reached:.6g} {s.objective_unit}, {s.status}"
        return f"<Solution of {self.design.name}, objective {self.objective}: {reached}>"

    def noted(self, **changes: Any) -> "Solution":
        """The same hop with another summary, folder or multipliers; what was derived of its motion is kept."""
        return _as_derived(replace(self, **changes), self)

    def with_summary(self, **entries: Any) -> "Solution":
        """The same hop with other entries of its summary."""
        return self.noted(summary=replace(self.summary, **entries))

    @property
    def clearance(self) -> float:
        """Height of the leg's lowest point at the end of flight [m]."""
        return self.summary.clearance_m

    @property
    def verified(self) -> bool:
        """Whether every check of the verification passed, and the files it was read from are as they were written."""
        return self.summary.verified and not self.doubts

    @property
    def shown(self) -> Summary:
        """The summary as it may be shown: of files that are in doubt nothing is called verified."""
        needed = tuple(doubts(self.summary.extensions))
        if not self.doubts:
            return replace(self.summary, notes=(*needed, *self.summary.notes)) if needed else self.summary
        note = f"{'; '.join(self.doubts)}: hopopt verify {self.result_dir} says what still stands"
        notes, reported = (
            (note, *needed, *self.summary.notes),
            {"verified": False, "status": "changed after it was stored"},
        )
        return replace(
            self.summary, **reported, exit_code=3, failed_checks=("files as they were written",), notes=notes
        )


def _as_derived(solution: Solution, motion: Motion) -> Solution:
    """The solution with what was derived of the same motion."""
    kept = motion.__dict__.keys() & {"robot", "_evaluate", "tables"}
    solution.__dict__.update({name: motion.__dict__[name] for name in kept})
    return solution


def summarize(
    hop: Hop,
    plan: Motion,
    refinement: Refinement | Resolved,
    verdict: Verdict,
    outcomes: Sequence[StartOutcome],
    chosen: StartOutcome,
    clock: Stopwatch,
) -> Solution:
    """The plan with its summary: what ``--json`` prints and ``summary.json`` keeps."""
    solution, goal = refinement.solution, hop.objective
    names = tuple(c.name for c in hop.constraints)
    summary = Summary(
        version=VERSION,
        functions=Functions(goal.name if goal.is_function else None, names),
        extensions=used(
            [
                *((kind, name) for _, kind, name in names_in(hop.design)),
                ("objective", goal.name),
                *(("constraint", n) for n in names),
            ]
        ),
        **figures(FigureSource(hop, plan, solution, verdict)),
        mesh=tuple(refinement.history),
        refinement_ended=refinement.ended,
        starts=start_figures(outcomes, chosen),
        timings_s=dict(clock.stages),
        wall_s=clock.last - clock.begin,
        result_dir=None,
    )
    kkt = {name: getattr(solution, name) for name in ("z", "p", "g", "lam_g", "lam_x")} | asdict(solution.bounds)
    found = Solution(
        plan.design, plan.objective, plan.phases, summary, kkt, multipliers=dict(verdict.multipliers), verdict=verdict,
        stated=plan.stated, own=plan.own,
    )  # fmt: skip
    return _as_derived(found, plan)


# ---- the nonlinear program that it is the answer of --------------------------------------------------------------


def has_multipliers(solution: Solution) -> bool:
    """Whether the program's point and multipliers were stored."""
    return {"z", "lam_g", "lam_x"} <= solution.kkt.keys()


def own_functions(solution: Solution) -> tuple[HopObjective, tuple[Custom, ...]]:
    """What the solution was found with; UsageError if it takes functions that were not given again: files name code,
    they do not run it."""
    objective, constraints = solution.summary.functions.objective, solution.summary.functions.constraints
    goal, own = solution.own
    goal = goal or (find(objective) if objective and known("objective", objective) else None)
    own = own or tuple(custom(function(name), name) for name in constraints if known("constraint", name))
    if wanted := absent([e.module for e in solution.summary.extensions]):
        raise UsageError(f"{solution.result_dir or solution.design.name} {needs(wanted)}")
    if (goal.name if goal else None) != objective or sorted(c.name for c in own) != sorted(constraints):
        options = [f"--objective {objective}"] * bool(objective) + [f"--constraint {name}" for name in constraints]
        what = "was found without user-defined functions: give none"
        if options:
            what = f"was found with user-defined functions and needs their module: add {' '.join(options)}"
        raise UsageError(f"{solution.result_dir} {what}")
    return goal or find(solution.objective), own


def hop_of(solution: Solution) -> Hop:
    """The hop that the solution is of."""
    goal, constraints = own_functions(solution)
    return Hop(solution.design, goal, constraints=constraints)


def stored_nlp(solution: Solution, problem: Problem | None = None) -> NlpSolution:
    """The nonlinear program of the last mesh with its stored point, multipliers and bounds; ``problem``: the solution's,
    if it is made already, or one that differs in its objective."""
    problem, mesh, kkt = problem or hop_of(solution).problem, {}, dict(solution.kkt)
    for name, trajectory in solution.phases.items():
        edges = trajectory.normalised_edges
        free = np.flatnonzero(np.diff(trajectory.arc)) + 1
        mesh[name] = PhaseMesh(tuple(edges.tolist()), tuple(free.tolist()))
    t = Transcription(problem, next(iter(solution.phases.values())).scheme, mesh)
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
