"""The least reserve with which a plan is tracked on drawn legs: ``--reserve auto``.

Where the foot hardly presses on the ground, legs that differ a little from the believed one leave it early. So plans that hold
ever more of the leg's weight back are tracked on drawn legs, until none of them falls. Where that is not enough, drives are at
their limits: then shares of torque and speed are held back as well.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hopopt.comparison.robust.robust_search import TRACKER, TUNING_DRAWS, stands_against
from hopopt.comparison.robust.robustness import FAILED_SHARE, drawn, reached
from hopopt.design import Design
from hopopt.errors import NotSolvedError, UsageError
from hopopt.leg.robot import build_robot
from hopopt.leg.scales import weight
from hopopt.nlp.deadline import NEVER
from hopopt.ocp.hop import Hop
from hopopt.planner.reserve import reference_of, reserved
from hopopt.planner.search.from_known import solved_from_known
from hopopt.planner.solution import Solution

WEIGHT_SHARES = (0.02, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6)  # of the leg's weight, tried in turn
ENOUGH_WEIGHT, FEW_FALLS = (
    0.3,
    0.25,
)  # of the weight: where more than a few legs fall with it, weight alone is not enough
# Of the weight, and of torque and speed of all drives, tried after that
WITH_DRIVES = ((0.3, 0.06), (0.45, 0.08), (0.6, 0.1), (0.8, 0.12), (1.0, 0.12), (1.0, 0.16))
SECONDS_OF_PLANS = 300.0  # [s] for all plans


@dataclass(frozen=True)
class LeastReserve:
    """design: the problem with the reserve. plan: what it leads to. share: of the leg's weight that is held back. draws: legs of
    which none fell. cost: what the plan clears less than the bound [m]. held: share of torque and speed of all drives that is
    held back for the drawn legs; 0 where the weight is enough."""

    design: Design
    plan: Solution
    share: float
    draws: int
    cost: float
    held: float = 0.0

    @property
    def words(self) -> str:
        """The reserve, and what it costs, in a sentence."""
        force = self.design.reserve.ground_force
        return (
            f"reserve.ground_force = {force:.4g} N, {self.share:.0%} of the weight{_drives(self.held)}, is the least of those tried "
            f"with which none of {self.draws} drawn legs falls; the whole [reserve] costs {100 * self.cost:.1f} cm of the bound"
        )


def least_reserve(
    bound: Solution,
    *,
    draws: int = TUNING_DRAWS,
    seed: int = 0,
    seconds: float = SECONDS_OF_PLANS,
    processes: int = 1,
    progress: Callable[[str], None] | None = None,
) -> LeastReserve:
    """The least share of the weight that keeps all drawn legs hopping, and its plan; the rest of [reserve] stays as it is, but
    for torque and speed where weight is not enough.

    bound: the highest hop of the problem. draws: legs within [uncertainty]. seconds: for the plans. Raises NotSolvedError, with
    what stands against it, if there is no such reserve.
    """
    say, asked, until = progress or (lambda text: None), bound.design, NEVER.within(seconds)
    legs, heavy = drawn(asked, asked.uncertainty, draws, seed), weight(build_robot(asked.leg).model)
    known, against, enough = bound, "nothing was tried", True
    for share, drives in (*((share, 0.0) for share in WEIGHT_SHARES), *WITH_DRIVES):
        if until.passed:
            against = f"{against}; then the time was up"
            break
        if not (enough or drives):
            continue
        kept, own = f"{share:.0%} of the weight{_drives(drives)} held back", asked.reserve
        more = {"torque": max(own.torque, drives), "speed": max(own.speed, drives)}
        reserve = own.model_copy(update={"ground_force": share * heavy, **more})
        design = asked.model_copy(update={"reserve": reserve})
        try:
            known = plan = solved_from_known(Hop(reserved(design)), known, until=until)
        except (NotSolvedError, UsageError) as error:
            against = f"with {kept}: {stands_against(error)}"
            continue
        found = reached(design, TRACKER, reference_of(plan), legs, processes).clearances
        fell = int(np.sum(found < FAILED_SHARE * plan.clearance))
        say(f"{kept}: {fell} of {draws} drawn legs fall")
        if not fell and plan.verified:
            return LeastReserve(design, plan, share, draws, bound.clearance - plan.clearance, drives)
        against = f"with {kept}, {fell} of {draws} drawn legs fall"
        enough = share < ENOUGH_WEIGHT or fell <= FEW_FALLS * draws
    raise NotSolvedError(
        f"{asked.name}: no reserve was found with which the plan is tracked on all drawn legs ({against})"
    )


def _drives(held: float) -> str:
    """What is held back of the drives, in words after the weight's."""
    return f" and {held:.0%} of torque and speed" if held else ""
