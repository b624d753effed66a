"""The summary of an answer: what ``--json`` prints and ``summary.json`` holds, typed and versioned.

A figure is a field beside what computes it: of the motion (motion_figures.py), of the program's solution and the verdict
(program_figures.py, checks/verdict.py); what only the search knows is given. Each field says its meaning and unit, which the JSON
schema repeats (``hopopt schema summary``). SI units throughout.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from hopopt.extensions import Extension
from hopopt.nlp.refinement.mesh_step import MeshStep
from hopopt.optimality.directions.flat_directions import Flat
from hopopt.optimality.second_order import Curvature
from hopopt.planner.answer.extras import (
    CanBeHad,
    CoDesign,
    CrossCheck,
    Functions,
    GlobalMethod,
    HopFamily,
    PaperControlResult,
)
from hopopt.planner.answer.motion_figures import MotionFigures
from hopopt.planner.answer.program_figures import ProgramFigures
from hopopt.planner.answer.starts import Starts
from hopopt.planner.checks.verdict import Verification
from hopopt.record import if_any, stated
from hopopt.verify.check import Check
from hopopt.verify.measures import Measures

VERSION, OLDEST = 2, 1  # of the summary's keys: this one, and the first that is read
LATE = "the time limit was reached: with more time (--time-limit) the search may find a better hop, or verify this one"
SUM = 1e-9  # m: by which the clearance may differ from the sum of its parts
FORMER = {"tightening cost": "price of drawing in the limits"}  # names of checks in results stored earlier


@dataclass(frozen=True, kw_only=True)
class Summary(Measures, MotionFigures, ProgramFigures, Verification):
    """Every figure that is printed of an answer."""

    version: int = stated("of these keys", ge=OLDEST, le=VERSION)
    functions: Functions = stated("user-defined functions that it was found with")
    extensions: tuple[Extension, ...] = if_any("modules of the user's own that names in it come from", default=())
    mesh: tuple[MeshStep, ...] = stated("every solve of the refinement")
    refinement_ended: str = stated("why refinement ended")
    starts: Starts = stated("where the starts ended")
    timings_s: Mapping[str, float] = stated("wall time by stage [s]")
    wall_s: float = stated("wall time in all [s]")
    result_dir: str | None = stated("folder that it lies in")
    notes: tuple[str, ...] = if_any("what the answer does not say by itself", default=())
    flat: tuple[Flat, ...] | None = if_any("what the objective is insensitive to")
    second_order: Curvature | None = if_any("the second-order test, on the last mesh")
    time_limit_s: float | None = if_any("time after which the search ends with the best hop so far [s]")
    overrides: tuple[str, ...] | None = if_any("entries that were set on the command line")
    paper_strategy: PaperControlResult | None = if_any("the paper's control on the same leg")
    can_be_had: CanBeHad | None = if_any("what controllers make of it on drawn legs")
    second_opinions: tuple[CrossCheck, ...] = if_any("cross-checks by other solvers and schemes", default=())
    codesign: CoDesign | None = if_any("what was free in a co-design")
    searched: bool | None = if_any("whether enough starts were asked for to search for the best hop (two or more)")
    families: tuple[HopFamily, ...] | None = if_any("kinds of hops that were found")
    global_: GlobalMethod | None = if_any("what a global method says", alias="global")

    @property
    def own_limits(self) -> tuple[str, ...]:
        """Names of the user's own constraints that it was found with."""
        kinds = [entry.partition(" ") for module in self.extensions for entry in module.entries]
        return (*self.functions.constraints, *(name for kind, _, name in kinds if kind == "constraint"))

    def figure(self, name: str) -> float | None:
        """A figure by its key, such as ``objective_figure`` [the figure's unit]; None where it is not stated."""
        return getattr(self, name)

    @property
    def late(self) -> bool:
        """Whether the time limit ended the search."""
        return LATE in self.notes

    @property
    def reached(self) -> float:
        """What the hop was made for [the objective's unit]."""
        value = self.figure(self.objective_figure)
        return self.objective_value if value is None else value

    @property
    def gains(self) -> Mapping[str, float]:
        """What one per cent more of each limit's range gives [the objective's unit], the most first."""
        return (self.gain_per_percent_m if self.objective_unit == "m" else self.gain_per_percent) or {}

    @property
    def bias(self) -> float:
        """Bound on the tie-break's bias [the objective's unit]."""
        return (self.tie_break_bias_m if self.objective_unit == "m" else self.tie_break_bias) or 0.0

    def check(self, name: str) -> Check:
        """A check by its name; KeyError if it was not made."""
        found = {c.name: c for c in self.verification}
        return found[name] if name in found else found[FORMER.get(name, name)]

    def contradictions(self) -> list[str]:
        """What in it contradicts itself, a sentence each."""
        found = []
        if not abs(self.clearance_m - self.parts.sum) <= SUM:
            found.append(f"clearance_m is {self.clearance_m:.6g} m, but its parts sum to {self.parts.sum:.6g} m")
        if self.verified and not (all(c.passed for c in self.verification) and not self.failed_checks):
            found.append("verified is true, but a check failed")
        return found
