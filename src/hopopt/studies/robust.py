"""The hop that a stated share of legs reaches: a reserve tuned on the simulator, and a promise on fresh draws.

The plan keeps a reserve from every limit, whose numbers a derivative-free optimiser chooses. It maximises the lowest
clearance of drawn legs that track the plan, the same legs for every reserve (common random numbers). What the share
reaches is then stated on legs that the tuning never saw, by an order statistic.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import minimize

from hopopt.design import Design, Reserve
from hopopt.errors import NotSolvedError, UsageError
from hopopt.leg.kinematics import two_joints
from hopopt.leg.robot import build_robot
from hopopt.leg.scales import weight
from hopopt.ocp.hop import Hop
from hopopt.planner.from_known import solved_from_known
from hopopt.planner.reserve import reserved
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.studies.compare import on_ideal_ground, reference_of
from hopopt.studies.robustness import FAILED, Draw, Reached, drawn, rank, reached

TRACKER = "track"
PD = ("force_tuck", "position_tuck")  # the paper's strategies where they clear most
TUNING_DRAWS = 16  # legs that every reserve is judged on
# torque, speed [shares], ground force [of the weight], height [m]: where the search begins, its first steps, its ends
FIRST, STEPS = np.array([0.0, 0.03, 0.6, 0.005]), np.array([0.03, 0.03, -0.1, 0.003])
LOWEST, HIGHEST = np.zeros(4), np.array([0.4, 0.3, 2.0, 0.05])


@dataclass(frozen=True)
class RobustHop:
    """What a share of the drawn legs reaches, and the bounds beside it.

    design: the problem with the reserve found. plan: what is tracked. bound, ideal_bound: verified optima on this ground
    and on ground that grips without limit. tracked, pd: runs on the fresh draws, of the tracker and by PD strategy.
    """

    design: Design
    plan: Solution
    bound: Solution
    ideal_bound: Solution
    tracked: Reached
    pd: dict[str, Reached]
    share: float
    confidence: float
    evaluations: int

    @property
    def exit_code(self) -> int:
        """0 if both bounds and the plan are verified, else 3."""
        return 0 if self.bound.verified and self.ideal_bound.verified and self.plan.verified else 3

    def as_dict(self) -> dict[str, Any]:
        """One object, for ``--json``."""
        draws = len(self.tracked.clearances)
        return {
            "problem": self.design.name,
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
            "plan_m": self.plan.clearance,
            "plan_verified": self.plan.verified,
            "tracker": TRACKER,
            "reserve": self.design.reserve.model_dump(),
            "evaluations": self.evaluations,
            "pd": {name: found.promised(self.share, self.confidence) for name, found in self.pd.items()},
            "pd_fell": {name: found.fell for name, found in self.pd.items()},
            "clearances_m": {
                name: found.clearances.tolist() for name, found in {TRACKER: self.tracked, **self.pd}.items()
            },
            "exit_code": self.exit_code,
        }


def robust(
    design: Design,
    *,
    share: float = 0.95,
    confidence: float = 0.95,
    draws: int = 200,
    evaluations: int = 16,
    seed: int = 0,
    starts: int | None = None,
    processes: int = 1,
    progress: Callable[[str], None] | None = None,
) -> RobustHop:
    """The plan and its reserve with the greatest clearance that this share of drawn legs reaches.

    draws: fresh legs for the promise; evaluations: reserves that are tried; starts: of each bound's solve. Raises
    UsageError for a problem without uncertainty and for promises that so few draws cannot make, NotSolvedError if no
    reserve leaves a plan.
    """
    say = progress or (lambda text: None)
    rank(draws, share, confidence)
    if design.uncertainty.known:
        raise UsageError(f"{design.name}: [uncertainty] is zero throughout, so there is nothing to be robust against")
    if evaluations < 1:
        raise UsageError(f"{evaluations} evaluations: at least 1 reserve must be tried")
    say("solving for the bound on this ground")
    bound = solve(design, starts=starts, processes=processes)
    ideal_bound = on_ideal_ground(bound, say, starts=starts, processes=processes)
    spread = design.uncertainty
    legs = drawn(design, spread, TUNING_DRAWS, seed), drawn(design, spread, TUNING_DRAWS, seed, corners=True)
    search = Search(bound, *legs, evaluations, processes, say)
    best = search.best()
    say(f"judging it on {draws} fresh legs")
    fresh = drawn(design, design.uncertainty, draws, seed + 1_000_003)
    tracked = reached(best.design, TRACKER, reference_of(best.plan), fresh, processes)
    pd = {}
    for name in PD if two_joints(design.leg) else ():
        say(f"simulating {name} on the same legs")
        pd[name] = reached(design, name, None, fresh, processes)
    return RobustHop(best.design, best.plan, bound, ideal_bound, tracked, pd, share, confidence, len(search.trials))


@dataclass(frozen=True)
class Trial:
    """A reserve that was tried: the problem with it, its plan, and the lowest clearance of the draws [m]."""

    design: Design
    plan: Solution
    lowest: float


@dataclass
class Search:
    """The search for the reserve: every trial is kept, and the best verified plan wins.

    bound: the hop that every plan begins from. draws: legs whose lowest clearance counts. corners: legs at the ends of all
    spreads, none of which may fall: few draws hardly meet them, many do.
    """

    bound: Solution
    draws: list[Draw]
    corners: list[Draw]
    evaluations: int
    processes: int
    say: Callable[[str], None]
    trials: list[Trial | None] = field(default_factory=list)

    def best(self) -> Trial:
        """Nelder and Mead's simplex within bounds; NotSolvedError if no reserve leaves a plan."""
        simplex = np.array([FIRST, *(FIRST + np.diag(STEPS))])
        options = {"maxfev": self.evaluations, "initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-4}
        bounds = list(zip(LOWEST, HIGHEST, strict=True))
        minimize(lambda x: -self.judged(x), FIRST, method="Nelder-Mead", bounds=bounds, options=options)
        found = [trial for trial in self.trials if trial is not None]
        if not found:
            raise NotSolvedError(f"{self.bound.design.name}: no reserve that was tried leaves a plan.", [])
        return max(found, key=lambda trial: (trial.plan.verified, trial.lowest))

    def judged(self, x: np.ndarray) -> float:
        """Lowest clearance [m] of the draws with a reserve x; below zero where no plan is left."""
        (torque, speed, force, height), asked = map(float, x), self.bound.design
        newtons = force * weight(build_robot(asked.leg).model)
        reserve = Reserve(torque=torque, speed=speed, ground_force=newtons, height=height, angle=asked.reserve.angle)
        design = asked.model_copy(update={"reserve": reserve})
        try:
            plan = solved_from_known(Hop(reserved(design)), self.bound)
        except (NotSolvedError, UsageError):
            self.trials.append(None)
            return -float(np.sum(x))  # less reserve may leave a plan
        legs = [*self.draws, *self.corners]
        heights = reached(design, TRACKER, reference_of(plan), legs, self.processes).clearances
        counted = heights[: len(self.draws)] if heights.min() > FAILED * plan.clearance else heights
        lowest = float(counted.min()) if plan.verified else 0.0
        self.trials.append(Trial(design, plan, lowest))
        most = max(trial.lowest for trial in self.trials if trial is not None)
        self.say(
            f"reserve {len(self.trials)} of {self.evaluations}: lowest of {len(self.draws)} legs {most:.3f} m so far"
        )
        return lowest
