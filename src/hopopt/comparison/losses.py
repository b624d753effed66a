"""What collisions and the losses of drives cost PD control, and what they cost the optimum: rungs above the bound.

Neither PD control nor the optimum is free of them, so they are no freedoms that PD lacks. Each is lifted in turn, with those before it,
for both. So the gap is told with and without them.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from hopopt.comparison.compare import Comparison
from hopopt.control.closed_loop import simulate
from hopopt.design import Design, physical_parameters
from hopopt.drivetrain.gear import ENTRIES, LOSSLESS, NO_LOAD, SCALE, lossless_entries
from hopopt.drivetrain.motor import own_voltage
from hopopt.errors import NotSolvedError
from hopopt.leg.geometry.smooth import clearances
from hopopt.nlp.deadline import NEVER
from hopopt.ocp.hop import Hop
from hopopt.planner.search.from_known import solved_from_known
from hopopt.planner.solution import Solution
from hopopt.planner.solve import TIME_LIMIT, solve
from hopopt.problem.load import changed

TEETH, RUBBING = ("efficiency", SCALE), ("friction", "damping", NO_LOAD)  # entries of drives, by what takes the torque


@dataclass(frozen=True)
class Lifted:
    """Something that holds down PD control and the optimum alike, lifted together with those before it.

    lifts: what, in words
    strategy_m: clearance of the PD strategy without it [m]; strategy_gains_m: by how much that is higher [m]
    bound_m: clearance of the optimum without it [m]; bound_gains_m: by how much that is higher [m]
    verified: whether that optimum is
    limits_exceeded: limits that the strategy does not keep without it, in words
    no_hop: why the strategy does not hop without it, in words; empty where it does
    """

    lifts: str
    strategy_m: float
    strategy_gains_m: float
    bound_m: float
    bound_gains_m: float
    verified: bool
    limits_exceeded: tuple[str, ...] = ()
    no_hop: str = ""


def lifted_in_turn(design: Design) -> Iterator[tuple[str, Design]]:
    """What holds both down, in words, and the problem without it and those before it; only what counts in this problem."""
    if (near := clearances(design)) is not None and near.links:
        design = changed(design, {"hop.may_collide": True})
        yield "links that may collide", design
    for words, names in (("gears that pass on all torque", TEETH), ("drives without friction", RUBBING)):
        without = _lossless(design, names)
        if without != design:
            design = without
            yield words, design
    if design.leg.supply:
        fed = changed(design, own_voltage(design.leg))
        yield "a supply that never sags", fed.model_copy(update={"leg": fed.leg.model_copy(update={"supply": None})})


def _lossless(design: Design, names: tuple[str, ...]) -> Design:
    """The problem with which these entries of its drives, and of its simulated machine, lose nothing; as it is where they do not."""
    own = lossless_entries(physical_parameters(design.leg))
    found = {path: value for path, value in own.items() if path.rpartition(".")[2] in names}
    machine = ((f"gear_{name}", value) for name, value in zip(ENTRIES, LOSSLESS, strict=True) if name in names)
    rubs = {f"simulation.{name}": value for name, value in machine if getattr(design.simulation, name) != value}
    return changed(design, found | rubs) if found or rubs else design


def beyond_the_bound(comparison: Comparison, name: str, say: Callable[[str], None]) -> tuple[tuple[Lifted, ...], str]:
    """What each of these costs the strategy of this name and the bound, up to the first whose optimum is not found; and what that
    lifts, empty where all were."""
    pd, bound, found = comparison.runs[name].figures.clearance, comparison.solution, list[Lifted]()
    for words, design in lifted_in_turn(bound.design):
        say(f"ladder: the optimum and PD control with {words}")
        run = simulate(design, comparison.runs[name].strategy).figures
        try:
            best = _bound(design, bound, say)
        except NotSolvedError as error:  # all else of the ladder is there
            say(f"ladder: no optimum with {words}: {error}")
            return tuple(found), words
        gains, faults = (run.clearance - pd, best.clearance - bound.clearance), (tuple(run.limits_exceeded), run.no_hop)
        found.append(Lifted(words, run.clearance, gains[0], best.clearance, gains[1], best.verified, *faults))
        pd, bound = run.clearance, best
    return tuple(found), ""


def _bound(design: Design, known: Solution, say: Callable[[str], None]) -> Solution:
    """The optimum of a problem without it; no lower than what the hop that is known leads to."""
    found = solve(design, progress=say)
    if found.clearance >= known.clearance:
        return found
    again = solved_from_known(Hop(design), known, say, NEVER.within(TIME_LIMIT))
    return again if again.verified and again.clearance > found.clearance else found
