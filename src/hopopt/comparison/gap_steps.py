"""How much of the gap to the bound is feedback, and how much is the reference: hops from the optimum down to the paper's control.

The bound is followed by the plan that holds the [reserve] back, that by its hop in simulation, under feedback. From there on
the reference knows nothing of the optimum: a counter-movement first, then the paper's. Each step gives up one thing more.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from hopopt.control.strategies import BUILT_IN
from hopopt.planner.solution import Solution
from hopopt.sim.hop_metrics import HopFigures

RESERVE, FEEDBACK = "reserve", "feedback"
REFERENCE, COUNTER_MOVEMENT = "reference", "counter-movement"
TRACKED = ("track_pd", "track", "track_mpc")  # the first that is there: plain PD, as that of the strategies below it
SINKS = "counter_movement"
PLAN = "plan"


@dataclass(frozen=True)
class GapStep:
    """One thing that is given up on the way down from the bound.

    gives_up: reserve, feedback, reference or counter-movement
    reaches: the strategy that hops without it, or plan
    clearance_m: of that hop [m]
    costs_m: how much lower that is than the hop before it [m], negative where it is higher
    """

    gives_up: str
    reaches: str
    clearance_m: float
    costs_m: float


def gap_steps(bound: Solution, plan: Solution | None, figures: Mapping[str, HopFigures]) -> list[GapStep]:
    """The steps from the bound down to the best of the paper's strategies; their costs sum to its gap. None where the bound is not
    verified, or no tracked plan or no strategy without one hops within every limit.

    plan: what was tracked; figures: of strategies by name, those that do not keep every limit left out
    """
    kept = {name: f.clearance for name, f in figures.items() if not f.no_hop and not f.limits_exceeded}
    hops = list(_hops(plan, kept)) if bound.verified and plan is not None and plan.verified else []
    if {FEEDBACK, REFERENCE} - {gives_up for gives_up, _, _ in hops}:
        return []
    before = [bound.clearance, *(clearance for _, _, clearance in hops)]
    return [GapStep(*hop, above - hop[-1]) for hop, above in zip(hops, before, strict=False)]


def _hops(plan: Solution, kept: Mapping[str, float]) -> Iterator[tuple[str, str, float]]:
    """What is given up, the strategy that hops without it, and its clearance [m], from the top."""
    yield RESERVE, PLAN, plan.clearance
    for name in [name for name in TRACKED if name in kept][:1]:
        yield FEEDBACK, name, kept[name]
    papers = {name: kept[name] for name in kept if name in BUILT_IN and name != SINKS and not BUILT_IN[name].needs_plan}
    if SINKS in kept:
        yield REFERENCE, SINKS, kept[SINKS]
    if papers:
        best = max(papers, key=lambda name: papers[name])
        yield COUNTER_MOVEMENT if SINKS in kept else REFERENCE, best, papers[best]
