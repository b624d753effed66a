"""What the losses of gears and supply cost PD control, and what they cost the optimum: both once more without any."""

from collections.abc import Callable
from dataclasses import dataclass

from hopopt.comparison.compare import Comparison, Run
from hopopt.control.closed_loop import simulate
from hopopt.design import Design, physical_parameters
from hopopt.drivetrain.gear import ENTRIES, LOSSLESS, lossless_entries
from hopopt.drivetrain.motor import own_voltage
from hopopt.errors import NotSolvedError
from hopopt.nlp.deadline import NEVER
from hopopt.ocp.hop import Hop
from hopopt.planner.search.from_known import solved_from_known
from hopopt.planner.solution import Solution
from hopopt.planner.solve import TIME_LIMIT, solve
from hopopt.problem.load import changed


@dataclass(frozen=True)
class CostOfLosses:
    """Clearances [m] of a PD strategy and of the optimum with gears that lose nothing and a supply that never sags, and
    how much lower each is with them [m]; whether that optimum is verified."""

    strategy_m: float
    strategy_loses_m: float
    bound_m: float
    bound_loses_m: float
    verified: bool


def without_losses(design: Design) -> Design | None:
    """The problem with gears that lose nothing and a supply that never sags; None if it is such a problem."""
    machine = {f"simulation.gear_{name}": value for name, value in zip(ENTRIES, LOSSLESS, strict=True)}
    entries = lossless_entries(physical_parameters(design.leg))
    rubs = any(getattr(design.simulation, path.rpartition(".")[2]) != value for path, value in machine.items())
    if not (entries or rubs or design.leg.supply):
        return None
    lossless = changed(design, {**entries, **machine, **own_voltage(design.leg)})
    return lossless.model_copy(update={"leg": lossless.leg.model_copy(update={"supply": None})})


def cost_of_losses(comparison: Comparison, name: str, say: Callable[[str], None]) -> CostOfLosses | None:
    """What losses cost the strategy of this name and the bound; None where nothing is lost."""
    bound, design = comparison.solution, without_losses(comparison.solution.design)
    if design is None:
        return None
    run: Run = comparison.runs[name]
    say("ladder: the optimum and PD control without losses of gears and supply")
    pd = simulate(design, run.strategy).figures.clearance
    try:
        found = _bound(design, bound, say)
    except NotSolvedError as error:  # all else of the ladder is there
        say(f"ladder: no optimum without losses: {error}")
        return None
    with_losses = run.figures.clearance
    return CostOfLosses(pd, pd - with_losses, found.clearance, found.clearance - bound.clearance, found.verified)


def _bound(design: Design, known: Solution, say: Callable[[str], None]) -> Solution:
    """The optimum of a problem that loses nothing; no lower than what the hop that is known leads to."""
    found = solve(design, progress=say)
    if found.clearance >= known.clearance:
        return found
    again = solved_from_known(Hop(design), known, say, NEVER.within(TIME_LIMIT))
    return again if again.verified and again.clearance > found.clearance else found
