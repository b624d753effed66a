"""The summary of an answer: what ``--json`` prints and ``summary.json`` holds, typed and versioned.

Each field says its meaning and unit, which the JSON schema repeats (``hopopt schema summary``). Fields made by ``if_any``
are left out of the file where there is nothing to say. SI units throughout.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from hopopt.planner.answer.summary_entry import if_any, stated
from hopopt.planner.answer.summary_extras import (
    CanBeHad,
    CoDesign,
    CrossCheck,
    FlatDirection,
    Functions,
    GlobalMethod,
    HopFamily,
    PaperStrategy,
    SecondOrder,
    Structure,
)
from hopopt.planner.answer.summary_parts import (
    Condition,
    Error,
    IdleLimit,
    Landing,
    LeansOn,
    LiftOff,
    Measures,
    Mesh,
    NamedCheck,
    Obstacle,
    Orbit,
    Parts,
    PhaseFigures,
    Starts,
    UpperBound,
)

VERSION, OLDEST = 2, 1  # of the summary's keys: this one, and the first that is read
LATE = "the time limit was reached: with more time (--time-limit) the search may find a better hop, or verify this one"
SUM = 1e-9  # m: by which the clearance may differ from the sum of its parts
FORMER = {"tightening cost": "price of drawing in the limits"}  # names of checks in results stored earlier


@dataclass(frozen=True)
class Summary(Measures):
    """Every figure that is printed of an answer."""

    version: int = stated("of these keys", ge=OLDEST, le=VERSION)
    problem: str = stated("name of the problem")
    title: str = stated("its title")
    hop: Literal["single", "landing", "periodic"] = stated(
        "from rest to the apex, from rest to rest, or a cycle that repeats itself (hop.kind)"
    )
    objective: str = stated("name of the objective")
    objective_meaning: str = stated("what it is")
    objective_unit: str = stated("its unit (SI; 1 for none)")
    objective_figure: str = stated("key of this summary that states it")
    maximized: bool = stated("whether more is better")
    functions: Functions = stated("user-defined functions that it was found with")
    clearance_asked_for_m: float | None = stated("hop.clearance, for objectives that ask for one [m]")
    status: str = stated("in words")
    verified: bool = stated("whether every check passed")
    exit_code: int = stated("0 verified, 3 not verified or contradicted")
    clearance_m: float = stated("height of the leg's lowest point when flight ends [m]")
    objective_error: Error = stated("how far the objective may be off")
    objective_value: float = stated("what the hop was made for, without the tie-break [its unit]")
    tie_break_weighs: float = stated(
        "what the tie-break weighs beside it: by so much may the optimum be better, as gentle torques are preferred [its unit]"
    )
    upper_bound: UpperBound = stated("what no hop within the drives' limits and the longest stance can pass")
    parts: Parts = stated("what the clearance is the sum of")
    lowest_point: str = stated("foot or joint that the clearance is of")
    phases: Mapping[str, PhaseFigures] = stated("each phase")
    lift_off: LiftOff = stated("lift-off")
    vertical_at_end_of_flight_m_s: float = stated("upward velocity of the centre of mass [m/s]")
    peak_ground_force_N: float = stated("largest ground force [N]")
    peak_vertical_force_N: float = stated("its largest vertical part [N]")
    friction: float | None = stated("coefficient; null: the foot never slips")
    grip_without_load_N: float = stated("largest horizontal force on an unloaded foot [N]")
    leans_on: LeansOn = stated("what the hop needs of the ground and of the time that it is allowed")
    saturation_mean: Mapping[str, float] = stated("mean use of the operating region in stance, by joint")
    energy: Mapping[str, float] = stated("work of the joints, by phase, net and positive [J]")
    active_limits: Mapping[str, float] = stated("share of stance in which each limit acts")
    idle_limits: Mapping[str, IdleLimit] = stated("limits that never act")
    verification: tuple[NamedCheck, ...] = stated("every check")
    failed_checks: tuple[str, ...] = stated("names of those that failed, worst first")
    mesh: tuple[Mesh, ...] = stated("every solve of the refinement")
    refinement_ended: str = stated("why refinement ended")
    scheme: str = stated("transcription scheme")
    starts: Starts = stated("where the starts ended")
    seed: int = stated("of the starts")
    timings_s: Mapping[str, float] = stated("wall time by stage [s]")
    wall_s: float = stated("wall time in all [s]")
    result_dir: str | None = stated("folder that it lies in")
    certified: bool = stated("whether first-order optimality is certified")
    certificate: Mapping[str, Condition] = stated("its conditions")
    structure: Structure = stated("switching structure")
    tie_break_bias_m: float | None = if_any("bound on the tie-break's bias [m]")
    tie_break_bias: float | None = if_any("the same for objectives that are no lengths [the objective's unit]")
    gain_per_percent_m: Mapping[str, float] | None = if_any("what 1 % more of each limit's range gives [m]")
    gain_per_percent: Mapping[str, float] | None = if_any("the same for objectives that are no lengths [its unit]")
    orbit: Orbit | None = if_any("the cycle of a periodic hop")
    obstacle: Obstacle | None = if_any("the box that the leg clears, if it was made to")
    landing: Landing | None = if_any("the touchdown of a hop that is landed, and how it comes to rest")
    notes: tuple[str, ...] = if_any("what the answer does not say by itself", default=())
    flat: tuple[FlatDirection, ...] | None = if_any("what the objective is insensitive to")
    second_order: SecondOrder | None = if_any("the second-order test, on the last mesh")
    time_limit_s: float | None = if_any("time after which the search ends with the best hop so far [s]")
    overrides: tuple[str, ...] | None = if_any("entries that were set on the command line")
    paper_strategy: PaperStrategy | None = if_any("the paper's control on the same leg")
    can_be_had: CanBeHad | None = if_any("what controllers make of it on drawn legs")
    second_opinions: tuple[CrossCheck, ...] = if_any("cross-checks by other solvers and schemes", default=())
    codesign: CoDesign | None = if_any("what was free in a co-design")
    searched: bool | None = if_any("whether enough starts were asked for to search for the best hop (two or more)")
    families: tuple[HopFamily, ...] | None = if_any("kinds of hops that were found")
    global_: GlobalMethod | None = if_any("what a global method says", alias="global")

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

    def check(self, name: str) -> NamedCheck:
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
