"""Parts of a summary that say what else was asked of an answer: of the search, of other solvers, of controllers."""

from collections.abc import Mapping
from dataclasses import dataclass

from hopopt.problem.checking.mass_law import MassLaw
from hopopt.record import Strict, if_any, stated


@dataclass(frozen=True)
class Functions(Strict):
    """User-defined functions by name; files name code, they do not run it."""

    objective: str | None = stated("module:function, or null")
    constraints: tuple[str, ...] = stated("module:function of each")


@dataclass(frozen=True)
class PaperControlResult(Strict):
    """What the paper's force control reaches on the same leg, in simulation."""

    name: str = stated("of the strategy")
    clearance_m: float | None = stated("[m]; null where it does not hop within the limits")
    share_of_bound: float | None = stated("of the optimum's clearance")
    fault: str = stated("why it does not; empty if it does")
    beyond_bound: bool = stated("whether it passes the optimum, which then is wrong")
    overshoot_m: float | None = if_any("how much shorter the leg is at the clearance than its reference [m]")


@dataclass(frozen=True)
class Attained(Strict):
    """What a share of drawn legs reaches with a strategy."""

    strategy: str = stated("its name")
    clearance_m: float = stated("[m]")


@dataclass(frozen=True)
class CanBeHad(Strict):
    """What can be had of the optimum: bounds, and what a share of the legs drawn about this one reaches in simulation."""

    ideal_bound_m: float | None = stated("bound on ground that grips without limit [m]; null if it was not verified")
    bound_m: float | None = stated("bound on this ground [m]; null if it was not verified")
    share: float = stated("of the legs that is spoken of")
    confidence: float = stated("with which that share reaches it, whatever the distribution")
    draws: int = stated("legs that were drawn")
    seed: int = stated("of the draws")
    tracked: Attained | None = stated("with the best strategy that tracks a plan; null without one")
    pd: Attained | None = stated("with the best PD strategy; null without one")


@dataclass(frozen=True)
class CrossCheck(Strict):
    """What another way of solving says."""

    name: str = stated("which way")
    objective: float | None = stated("[its unit]; null if it failed")
    compared_with: float = stated("the answer's objective [its unit]")
    difference: float | None = stated("relative; positive: better than the answer")
    allowed: float = stated("relative")
    agrees: bool = stated("whether it confirms the answer")
    contradicts: bool = stated("whether it is better")
    seconds: float = stated("[s]")
    reason: str = stated("why there is none, or what it falls short of")


@dataclass(frozen=True)
class WithoutLimit(Strict):
    """The co-design's optimum without one of the limits that it sits between."""

    limit: str = stated("which one is left out")
    objective_value: float = stated("of the optimum without it, on the same mesh [its unit]")
    optimal: float = stated("the entry's best value then [its unit]")


@dataclass(frozen=True)
class Between(Strict):
    """The limits that a free entry's best value sits between, where they trade places."""

    gain_per_unit_more: float = stated("slope of the objective towards more of the entry [objective/unit]")
    gain_per_unit_less: float = stated("slope of the objective towards less of the entry [objective/unit]")
    limits: tuple[str, ...] = stated("which limits trade places")
    without: tuple[WithoutLimit, ...] = stated("the optimum without each of them, the lesser limit first")


@dataclass(frozen=True)
class FreeEntry(Strict):
    """A number of the leg that was optimised too."""

    entry: str = stated("its entry of the problem file")
    unit: str = stated("of its values")
    was: float = stated("before [unit]")
    lower: float = stated("lower bound [unit]")
    upper: float = stated("upper bound [unit]")
    optimal: float = stated("now [unit]")
    at_bound: str | None = stated("lower or upper, if it is at one")
    gain_per_unit_of_the_bound: float = stated("what moving it gains [objective/unit]")
    between: Between | None = if_any("the limits that it sits between, if it does")


@dataclass(frozen=True)
class CouplingHeld(Strict):
    """A relation between entries that had to hold."""

    coupling: str = stated("as it was given, or that a table keeps falling or rising")
    equation: str = stated("written out")
    active: bool = stated("whether it acts")


@dataclass(frozen=True)
class CoDesign(Strict):
    """What was free in a co-design, and what came of it."""

    objective_value: float = stated("the co-design's, which the fixed design must reach [its unit]")
    parameters: tuple[FreeEntry, ...] = stated("the free entries")
    couplings: tuple[CouplingHeld, ...] = stated("relations between them")
    mass_laws: Mapping[str, MassLaw] = stated("of motor and gear, if the couplings use them")


@dataclass(frozen=True)
class HopFamily(Strict):
    """Hops of one kind that a search found."""

    clearance_m: float = stated("of the best, refined or of the first mesh [m]")
    objective_value: float = stated("of the best [its unit]")
    refined: bool = stated("whether it was refined and verified")
    found_by: tuple[str, ...] = stated("the starts, relaxed problems or motions that led to it, the best first")
    count: int = stated("how many those are")
    words: str = stated("what such a hop does")
    stopped: tuple[str, ...] = if_any("those that were stopped near it, as it was known", default=())


@dataclass(frozen=True)
class GlobalMethod(Strict):
    """What a global method says of the answer."""

    method: str | None = stated("which; null where none was used")
    grid: tuple[int, ...] | None = stated("nodes along each axis of the states")
    value_m: float | None = stated("clearance that the grid promises at the start [m]")
    alarm: bool = stated("whether it finds over 1 % more than the answer, which then is not called the best")
    verdict: str | None = if_any("what the highest of its clearances says of the answer")
    solved_m: float | None = if_any("clearance of the best hop that its motions led to [m]")
    steps: int | None = if_any("steps of time")
    motion_m: float | None = if_any("clearance that its best motion from the start reaches, its flight counted [m]")
    seconds: float | None = if_any("[s]")
    left_out: str | None = if_any(
        "what of the problem its motions do not know, so that only hops solved from them count"
    )
    reason: str | None = if_any("why no global method was used")
