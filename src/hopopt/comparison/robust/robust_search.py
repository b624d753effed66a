"""The search for a plan that drawn legs can track: the best reserve, and one program for several legs.

By reserve: a derivative-free optimiser chooses what is kept from every limit, each reserve is a plan, and the tracker's own
regulator follows it. By program: plan and feedback are chosen together for legs apart by a share of the spreads
(ocp/hops/shared_control.py). Both are judged on the same drawn legs (common random numbers).
"""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import islice

import numpy as np
from scipy.optimize import minimize

from hopopt.comparison.robust.robustness import FAILED_SHARE, Draw, Reached, extremes, reached
from hopopt.control.reference import PlanReference
from hopopt.design import Design, Reserve
from hopopt.errors import NotSolvedError, UsageError, one_line
from hopopt.leg.kinematics import reach, start_angles
from hopopt.leg.robot import build_robot
from hopopt.leg.scales import Scale, reserve_of, weight
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.ocp.hop import Hop
from hopopt.planner.motion import Motion
from hopopt.planner.reserve import reference_of, reserved
from hopopt.planner.search.from_known import solved_from_known
from hopopt.planner.shared_plan import SharedPlan, shared_plan, true_legs
from hopopt.planner.solution import Solution
from hopopt.verify.table import NORMALISED_TIMES

TRACKER = "track"
BY_RESERVE, BY_PROGRAM = "reserve", "program"  # the two ways
TUNING_DRAWS = 16  # legs that every plan is judged on
# angle [rad], torque, speed [shares], ground force [of the weight], height [m on the paper's leg]: where the search begins, its first steps, its ends
FIRST, STEPS = np.array([0.02, 0.0, 0.03, 0.6, 0.005]), np.array([0.08, 0.03, 0.03, -0.1, 0.003])
LOWEST, HIGHEST = np.zeros(5), np.array([0.3, 0.4, 0.3, 2.0, 0.05])
SPREAD_SHARES = (0.3, 0.45, 0.6, 0.8)  # of the spreads, by which the program's legs are apart
FORCE, HEIGHT = 0.3, 0.004  # what the program keeps back: ground force [of the weight], height [of the reach]
LONGEST_SOLVES = {BY_RESERVE: 60.0, BY_PROGRAM: 150.0}  # [s] of a plan's solves: of one reserve, of all programs
ALIKE = 1e-4  # [m] on the paper's leg: reserves whose scores are nearer than this are as good
FALLS = 0.01  # of the lowest clearance that counts for a plan under which legs at the ends of the spreads fall
AGREES = 0.02  # share of the planned clearance by which a leg of the program may stay below it when simulated


@dataclass(frozen=True)
class PlanTrial:
    """A plan that was tried.

    way: how it was found.
    design: the problem with its reserve.
    plan: the motion that is tracked; reference: the same as a controller follows it.
    verified: whether the plan passed its checks; by program, whether its legs reach in simulation what it says.
    lowest: lowest clearance of the draws [m].
    score: what plans are ranked by [m]: lowest, or nearly nothing if legs at the ends of the spreads fall, and less if draws do.
    against: how draws fall, in a sentence; empty if none does.
    """

    way: str
    design: Design
    plan: Motion
    reference: PlanReference
    verified: bool
    lowest: float
    score: float
    against: str = ""


@dataclass
class PlanSearch:
    """What both ways share: every trial is kept, and the best verified plan wins.

    bound: the hop that every plan begins from. draws: legs whose lowest clearance counts. corners: legs at the ends of all
    spreads, none of which may fall: few draws hardly meet them, many do. until: when no plan may be begun any more.
    """

    bound: Solution
    draws: list[Draw]
    corners: list[Draw]
    processes: int
    say: Callable[[str], None]
    until: Deadline = NEVER
    trials: list[PlanTrial | None] = field(default_factory=list)
    against: str = ""  # why the last plan was not found, in a sentence

    @property
    def best(self) -> PlanTrial:
        """The plan with the best score, a verified one first; NotSolvedError if none was found."""
        found = [trial for trial in self.trials if trial is not None]
        if not found:
            late = "before the time was up: give more seconds; " if self.until.passed else ""
            raise NotSolvedError(f"{self.bound.design.name}: no plan to track was found {late}({self.against})")
        return max(found, key=lambda trial: (trial.verified, trial.score))

    def best_by(self, way: str) -> float | None:
        """The lowest clearance [m] of the draws under the best plan of one way; None if it led to no verified plan."""
        found = [t for t in self.trials if t is not None and t.way == way and t.verified]
        return max(found, key=lambda t: t.score).lowest if found else None

    def keep(self, way: str, design: Design, plan: Motion, reference: PlanReference, verified: bool) -> float:
        """Judge a plan on the draws, and on the corners if it may be the best; keep it. Its score [m]."""
        none = Reached(np.zeros(len(self.draws)), ("not verified",) * len(self.draws))
        found = reached(design, TRACKER, reference, self.draws, self.processes) if verified else none
        fallen = found.clearances < FAILED_SHARE * reference.clearance
        score = lowest = float(found.clearances.min(initial=np.inf))
        if fallen.any():  # no promise: such plans are ranked below all others, that first under which the fewest fall
            score = -FALLS * float(np.mean(fallen)) * reference.clearance
        elif score > max((t.score for t in self.trials if t is not None), default=0.0):
            ends = reached(design, TRACKER, reference, self.corners, self.processes).clearances
            held = float(np.mean(ends > FAILED_SHARE * reference.clearance))
            if held < 1:  # where legs at the ends fall under all plans, that wins under which the fewest do
                score = min(lowest, float(ends.min()) + FALLS * held * lowest)
        against = self._falls(found.outcomes, fallen) if fallen.any() else ""
        self.trials.append(PlanTrial(way, design, plan, reference, verified, lowest, score, against))
        return score

    def _falls(self, outcomes: Sequence[str], fallen: np.ndarray) -> str:
        """How many legs fall under a plan, and how most of them do."""
        how = Counter(outcome for outcome, fell in zip(outcomes, fallen, strict=True) if fell)
        return f"under it {fallen.sum()} of {len(fallen)} legs of the search fall, most like this: {how.most_common(1)[0][0]}"

    def by_own_reserve(self) -> None:
        """The problem's own [reserve]."""
        if not self.until.passed:
            asked = self.bound.design
            whole = asked.model_copy(update={"reserve": reserve_of(asked)})
            score = self._tracked(whole, "the problem's own [reserve]")
            words = "no plan" if score is None else f"lowest of {len(self.draws)} legs {max(score, 0.0):.3f} m"
            self.say(f"the problem's own reserve: {words}")

    # ---- by reserve ------------------------------------------------------------------------------------------------

    def by_reserve(self, evaluations: int) -> None:
        """So many reserves, by Nelder and Mead's simplex within bounds."""
        simplex = np.array([FIRST, *(FIRST + np.diag(STEPS))])
        options = {
            "maxfev": evaluations,
            "initial_simplex": simplex,
            "xatol": 1e-3,
            "fatol": ALIKE * Scale.of(self.bound.design.leg).length,
        }
        bounds = list(zip(LOWEST, HIGHEST, strict=True))
        tried, most = 0, 0.0

        def cost(x: np.ndarray) -> float:
            nonlocal tried, most
            if self.until.passed:
                raise StopIteration
            score = self._reserve(x)
            tried, most = tried + 1, max(most, score)
            self.say(f"reserve {tried} of {evaluations}: lowest of {len(self.draws)} legs {most:.3f} m so far")
            return -score

        with suppress(StopIteration):
            minimize(cost, FIRST, method="Nelder-Mead", bounds=bounds, options=options)

    def _reserve(self, x: np.ndarray) -> float:
        """Score [m] of the plan with a reserve x; below zero where no plan is left."""
        (angle, torque, speed, force, height), asked = map(float, x), self.bound.design
        newtons, height = force * weight(build_robot(asked.leg).model), height * Scale.of(asked.leg).length
        reserve = Reserve(torque=torque, speed=speed, ground_force=newtons, height=height, angle=angle)
        kept = f"a ground force of {force:.0%} of the weight, {height:.3g} m of height and {torque:.0%} of the torque"
        score = self._tracked(asked.model_copy(update={"reserve": reserve}), kept)
        return -float(np.sum(x)) if score is None else score  # less reserve may leave a plan

    def _tracked(self, design: Design, kept: str) -> float | None:
        """Score [m] of the plan with a problem's reserve, which is ``kept`` in words; None where no plan is left."""
        try:
            until = self.until.within(LONGEST_SOLVES[BY_RESERVE])
            plan = solved_from_known(Hop(reserved(design)), self.bound, until=until)
        except (NotSolvedError, UsageError) as error:
            self.trials.append(None)
            self.against = f"with {kept} held back: {stands_against(error)}"
            return None
        return self.keep(BY_RESERVE, design, plan, reference_of(plan), plan.verified)

    # ---- by program ------------------------------------------------------------------------------------------------

    def by_program(self, most: int) -> None:
        """Legs ever further apart, each plan begun from the last, until the draws reach less or there are ``most`` plans."""
        design, before = self._kept_back(), 0.0
        try:
            for apart, found in islice(self._programs(design), most):
                lowest = self._program(design, found, apart)
                self.say(f"one program for {len(apart) + 1} legs: lowest of {len(self.draws)} legs {lowest:.3f} m")
                if lowest < before:
                    return
                before = lowest
        except (NotSolvedError, UsageError) as error:
            self.trials.append(None)
            self.against = f"by one program for several legs: {stands_against(error)}"
            self.say(self.against)

    def _programs(self, design: Design) -> Iterator[tuple[list[Draw], SharedPlan]]:
        """Legs ever further apart, and their plan, within the time that all programs may take."""
        until = self.until.within(LONGEST_SOLVES[BY_PROGRAM])
        begin: Solution | SharedPlan = solved_from_known(Hop(reserved(design)), self.bound, until=until)
        for share in SPREAD_SHARES:
            apart = extremes(design, design.uncertainty, share)
            others = [(reserved(draw.leg), draw.torque_gain, draw.start) for draw in apart]
            begin = shared_plan(true_legs(reserved(design), others, start_angles(design)), begin, until)
            yield apart, begin

    def _kept_back(self) -> Design:
        """The problem with what the program keeps back beside the spreads."""
        asked = self.bound.design
        force, height = FORCE * weight(build_robot(asked.leg).model), HEIGHT * reach(asked.leg)
        reserve = Reserve(torque=0.0, speed=0.0, ground_force=force, height=height, angle=asked.reserve.angle)
        return asked.model_copy(update={"reserve": reserve})

    def _program(self, design: Design, found: SharedPlan, apart: list[Draw]) -> float:
        """A program's plan, judged; it is verified if its own legs reach in simulation what it says. Raises NotSolvedError for one
        that hardly clears anything: its feedback holds legs up that should hop."""
        if found.clearance < FAILED_SHARE * self.bound.clearance:
            raise NotSolvedError(f"it clears no more than {found.clearance:.3f} m on all of its legs")
        tables, claims = found.believed.tables, found.believed.claims()
        reference = PlanReference.from_tables(NORMALISED_TIMES, tables, claims["clearance_m"])
        reference = replace(reference, feedback=found.feedback)
        own = reached(design, TRACKER, reference, apart, self.processes).clearances
        verified = bool(own.min() >= (1 - AGREES) * found.clearance)
        return self.keep(BY_PROGRAM, design, found.believed, reference, verified)


def stands_against(error: NotSolvedError | UsageError) -> str:
    """The first of an error's reasons, or what it says; headings end in a colon and are none."""
    reasons = [line.strip() for line in getattr(error, "diagnosis", ()) if not line.endswith(":")]
    return (reasons[0] if reasons else one_line(error)).rstrip(".")
