"""The hop that a stated share of legs reaches: a plan found in two ways on drawn legs, and a promise on fresh ones.

What the share reaches is stated on legs that the search (comparison/robust/robust_search.py) never saw, by an order statistic.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from hopopt.amounts import check
from hopopt.comparison.compare import on_ideal_ground
from hopopt.comparison.robust.robust_search import BY_PROGRAM, BY_RESERVE, TRACKER, TUNING_DRAWS, PlanSearch, PlanTrial
from hopopt.comparison.robust.robustness import OTHER_LEGS, Reached, drawn, rank, reached, surest
from hopopt.control.closed_loop import make_plant
from hopopt.design import Design, refuse_landed
from hopopt.errors import UsageError
from hopopt.leg.kinematics import two_joints
from hopopt.nlp.deadline import NEVER
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve

SECONDS_OF_SEARCH = 900.0  # [s] for bounds and plans; the runs on fresh legs come on top
PD = ("force_tuck", "position_tuck")  # the paper's strategies where they clear most


@dataclass(frozen=True)
class RobustHop:
    """What a share of the drawn legs reaches, and the bounds beside it.

    best: the plan that is tracked, and the problem with its reserve
    lowest: by way, the best that its plans reached on the draws of the search [m]
    bound: verified optimum on this ground
    ideal_bound: verified optimum on ground that grips without limit
    tracked: runs of the tracker on the fresh draws
    pd: runs on the fresh draws by PD strategy
    pd_best: the surest of those, chosen on the draws of the search; None without PD
    share: of all legs, that the promise is for
    confidence: of the promise
    evaluations: plans that were tried
    """

    best: PlanTrial
    lowest: dict[str, float | None]
    bound: Solution
    ideal_bound: Solution
    tracked: Reached
    pd: dict[str, Reached]
    pd_best: str | None
    share: float
    confidence: float
    evaluations: int

    def __repr__(self) -> str:
        height = self.tracked.promised(self.share, self.confidence)
        return f"<RobustHop of {self.best.design.name}: {self.share:g} of the legs reach {height:.4f} m>"

    @property
    def reached(self) -> dict[str, Reached]:
        """By strategy, what the fresh draws reach: the tracker first."""
        return {TRACKER: self.tracked, **self.pd}

    @property
    def feedback(self) -> dict[str, list[float]] | None:
        """Gains k_p [N m/rad] and k_d [N m s/rad] of every joint, if one program chose them."""
        if self.best.reference.feedback is None:
            return None
        k_p, k_d = np.hsplit(self.best.reference.feedback, 2)  # both diagonal
        return {"k_p": np.diag(k_p).tolist(), "k_d": np.diag(k_d).tolist()}

    @property
    def exit_code(self) -> int:
        """0 if both bounds and the plan are verified, else 3."""
        return 0 if self.bound.verified and self.ideal_bound.verified and self.best.verified else 3

    def as_dict(self) -> dict[str, Any]:
        """One object, for ``--json``."""
        draws = len(self.tracked.clearances)
        return {
            "problem": self.best.design.name,
            "clearance_m": self.tracked.promised(self.share, self.confidence),
            "share": self.share,
            "confidence": self.confidence,
            "draws": draws,
            "rank": rank(draws, self.share, self.confidence),
            "fell": self.tracked.fell,
            "median_m": float(np.median(self.tracked.clearances)),
            "lowest_m": float(self.tracked.clearances.min()),
            "bound_m": self.bound.clearance if self.bound.verified else None,
            "ideal_bound_m": self.ideal_bound.clearance if self.ideal_bound.verified else None,
            "plan_m": self.best.reference.clearance,
            "plan_verified": self.best.verified,
            "against": self.best.against or None,
            "tracker": TRACKER,
            "way": self.best.way,
            "lowest_by_way_m": self.lowest,
            "reserve": self.best.design.reserve.model_dump(),
            "feedback": self.feedback,
            "evaluations": self.evaluations,
            "pd": {name: found.promised(self.share, self.confidence) for name, found in self.pd.items()},
            "pd_best": self.pd_best,
            "pd_fell": {name: found.fell for name, found in self.pd.items()},
            "clearances_m": {name: found.clearances.tolist() for name, found in self.reached.items()},
            "exit_code": self.exit_code,
        }


def robust(
    design: Design,
    *,
    share: float = 0.95,
    confidence: float = 0.95,
    draws: int = 200,
    evaluations: int = 8,
    seed: int = 0,
    starts: int | None = None,
    seconds: float = SECONDS_OF_SEARCH,
    processes: int = 1,
    bound: Solution | None = None,
    progress: Callable[[str], None] | None = None,
) -> RobustHop:
    """The plan and its reserve with the greatest clearance that this share of drawn legs reaches.

    draws: fresh legs for the promise; evaluations: reserves that are tried beside the problem's own, and programs at most; starts: of each bound's
    solve; seconds: for bounds and plans, of which the bounds may take half; bound: the highest hop of this problem, if it is
    known. Raises UsageError for a problem without uncertainty and for promises that so few draws cannot make, NotSolvedError,
    with what stands against it, if no plan is found.
    """
    say = progress or (lambda text: None)
    refuse_landed(design, "the search for a reserve")
    make_plant(design)  # what cannot be simulated is said before the work
    rank(draws, share, confidence)
    if design.uncertainty.known:
        raise UsageError(f"{design.name}: [uncertainty] is zero throughout, so there is nothing to be robust against")
    check("draws", draws)
    check("seed", seed, 0)
    check("starts", starts)
    check("evaluations", evaluations, 0)
    if evaluations < 1:
        raise UsageError(f"{evaluations} evaluations: at least 1 reserve must be tried")
    if not 1 <= seconds < np.inf:
        raise UsageError(f"--seconds {seconds:g}: give at least 1")
    until, how = NEVER.within(seconds), {"starts": starts, "processes": processes, "time_limit": seconds / 4}
    if bound is None:
        say("solving for the bound on this ground")
        bound = solve(design, **how)  # type: ignore[arg-type]
    ideal_bound = on_ideal_ground(bound, say, **how)
    draw = partial(drawn, design, design.uncertainty)
    search = PlanSearch(bound, draw(TUNING_DRAWS, seed), draw(TUNING_DRAWS, seed, corners=True), processes, say, until)
    search.by_own_reserve()
    search.by_program(evaluations)
    search.by_reserve(evaluations)
    best, lowest = search.best, {way: search.best_by(way) for way in (BY_RESERVE, BY_PROGRAM)}
    say(f"judging the better one on {draws} fresh legs")
    fresh = draw(draws, seed + OTHER_LEGS)
    tracked = reached(best.design, TRACKER, best.reference, fresh, processes)
    pd, on_search = dict[str, Reached](), dict[str, Reached]()
    for name in PD if two_joints(design.leg) else ():
        say(f"simulating {name} on the same legs")
        pd[name], on_search[name] = (reached(design, name, None, legs, processes) for legs in (fresh, search.draws))
    pd_best = surest(on_search) if pd else None
    return RobustHop(best, lowest, bound, ideal_bound, tracked, pd, pd_best, share, confidence, len(search.trials))
