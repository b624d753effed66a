"""What the paper's control makes of a leg, as an answer says it: its force control, simulated with the paper's gains."""

from dataclasses import dataclass

import numpy as np

from hopopt.comparison.compare import COMPARED_OBJECTIVE, unbeaten
from hopopt.control.closed_loop import simulate
from hopopt.control.strategies import find
from hopopt.design import Design
from hopopt.errors import UsageError
from hopopt.planner.answer.extras import PaperControlResult
from hopopt.planner.solution import Solution
from hopopt.sim.plant import PAST_APEX

PAPERS = "force"  # of the paper's two the one that saturates its drives


@dataclass(frozen=True)
class PaperHop:
    """One simulated hop of a leg under the paper's force control.

    clearance: [m], None where it does not hop within the problem's limits
    fault: why not, in words, or empty
    overshoot: of its reference [m], as ``Run.overshoot``
    """

    clearance: float | None
    fault: str
    overshoot: float | None


def paper_hop(design: Design) -> PaperHop | None:
    """The paper's force control, a PD law clamped to what the drives can give (eqs. 10 and 14) with the paper's gains; None
    where the leg is not of two joints or cannot be simulated."""
    try:
        run = simulate(design, find(PAPERS), past_apex=True)
        f = run.figures
    except (UsageError, ArithmeticError, np.linalg.LinAlgError):  # nothing that the answer needs
        return None
    fault = "" if f.trace.outcome == PAST_APEX else f.trace.outcome
    if fault := f.no_hop or "; ".join(f.limits_exceeded) or fault:
        return PaperHop(None, fault, None)
    return PaperHop(f.clearance, "", run.overshoot)


def paper_strategy(solution: Solution, hop: PaperHop | None = None) -> PaperControlResult | None:
    """The hop of the paper's control beside a verified optimum: what share of it, and whether it is ``beyond_bound``, which
    then is wrong.

    hop: of this leg, if it was simulated before

    None where the optimum is no bound on clearance (another objective, user-defined constraints), and where there is no hop.
    """
    own = solution.summary.functions.constraints or solution.design.hop.constraints
    if not solution.verified or solution.objective != COMPARED_OBJECTIVE or own:
        return None
    hop = hop or paper_hop(solution.design)
    if hop is None:
        return None
    reached = hop.clearance
    share = None if reached is None else reached / solution.clearance
    beyond = reached is not None and reached > unbeaten(solution)
    return PaperControlResult(PAPERS, reached, share, hop.fault, beyond_bound=beyond, overshoot_m=hop.overshoot)
