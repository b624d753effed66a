"""What is tried again where an answer is not verified, or not certified: every attempt, in its order, with its reason.

REFINEMENT is for one refinement of an optimum of the first mesh (planner/refine_and_verify.py). Where a hop still
fails, HOP is for a solve (planner/solve.py) and WORK for one of work, POINT
for a point of a sweep (studies/sweep/point.py), CODESIGN for a co-design (studies/codesign.py); each refinement among them has those of REFINEMENT again. SEVERAL_HOPS is for
planner/several_hops.py. What one program is solved with again stands beside its solver:
nlp/refinement/solving.py, planner/search/multistart.py.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import NamedTuple, TypeVar

from hopopt.design import Design
from hopopt.nlp.deadline import Deadline
from hopopt.nlp.refinement.mesh_refinement import MET, UNSOLVED
from hopopt.nlp.refinement.mesh_step import relative
from hopopt.ocp.hop import Hop

TOLERANCE, PRICE_TOLERANCE = 1e-6, 1e-5  # a tenth and a fifth of the defaults
AT_MOST = {"tolerance": TOLERANCE, "price_tolerance": PRICE_TOLERANCE}  # entries of [solver]
EXCESS_MARGIN = 0.5  # refinement aims at this share of the excess that verification allows
CALMER, LARGEST_TIE_BREAK = 10.0, 1e-5  # times as large; from which weight on not even larger
T = TypeVar("T")


class AttemptOutcome(NamedTuple):
    """What attempts look at of an answer: its verdict, how its refinement ended, its objective [its unit]."""

    verified: bool
    certified: bool
    ended: str
    objective: float


@dataclass(frozen=True)
class Attempt:
    """One way to try again.

    reason: why it may help, and why it comes where it does
    said: told as it begins; {tie_break} is that of its problem
    verified: whether it is for answers that are verified but not certified, or for those not verified; None: for both
    ended: how refinement must have ended for it to help; None: in any way
    tolerances: whether those of the solver are tightened to AT_MOST
    tie_break: times as large
    margin: share of the excess that verification allows, at which refinement aims
    further: whether it goes on from the last mesh, not from the first again
    costates: whether it cuts the intervals of the last mesh in which costates or torques are not resolved, and no others
    restarts: whether meshes may be solved again without the last one's multipliers
    within: relative distance of its objective, beyond which it is another optimum and not taken
    anyhow: whether it is taken even if it is no better
    """

    reason: str
    said: str
    verified: bool | None = False
    ended: str | None = None
    tolerances: bool = False
    tie_break: float = 1.0
    margin: float = EXCESS_MARGIN
    further: bool = False
    costates: bool = False
    restarts: bool = False
    within: float = inf
    anyhow: bool = False

    def may_help(self, found: AttemptOutcome) -> bool:
        """Whether it is for such an answer."""
        sound = found.verified and found.certified
        return not sound and self.verified in (None, found.verified) and self.ended in (None, found.ended)

    def problem(self, hop: Hop) -> Hop | None:
        """The hop's problem with the attempt's settings; None if they are no others."""
        if self.tolerances:
            tighter = with_tighter_tolerances(hop.design)
            return None if tighter == hop.design else hop.with_solver_of(tighter)
        return hop if self.tie_break == 1 else with_larger_tie_break(hop, self.tie_break)

    def is_better(self, again: AttemptOutcome, found: AttemptOutcome) -> bool:
        """Whether what it led to is to be taken."""
        better = again.verified and (again.certified or not found.verified)
        return self.anyhow or (better and relative(again.objective, found.objective) < self.within)


RESOLVED = Attempt(
    "costates and torques may change within an interval where states hardly do, as where gears turn round or a bus sags most: first, "
    "for it takes seconds",
    "verified, but not certified: refining where costates or torques are not resolved",
    verified=True, ended=MET, costates=True,
)  # fmt: skip
FURTHER = Attempt(
    "the hop holds, but its mesh leaves open more than the certificate allows: so it goes on from there",
    "verified, but not certified: refining further, with tighter tolerances",
    verified=True, ended=MET, tolerances=True, further=True,
)  # fmt: skip
CLOSER_AIM_FURTHER = Attempt(
    "all aims were met and checks still fail: from its last mesh less excess is soon reached, and a smaller local error: first, for it "
    "takes seconds",
    "not verified: refining further, with tighter tolerances",
    ended=MET, tolerances=True, margin=0.1, further=True,
)  # fmt: skip
CLOSER_AIM = Attempt(
    "all aims were met and checks still fail: with all drives at their limits excess adds up, so less of it is allowed",
    "not verified: refining again, with tighter tolerances",
    ended=MET, tolerances=True, margin=0.1,
)  # fmt: skip
CALMED = Attempt(
    "torques that hardly matter may have chattered; with a larger tie-break they do not: first, for it takes seconds",
    "not verified: solving again with solver.tie_break = {tie_break:g}",
    tie_break=CALMER, restarts=True, within=2e-2,  # as far apart as optima of the first mesh that are refined
)  # fmt: skip
RESTARTED = Attempt(
    "a mesh was not solved from the last one's multipliers; from its point alone it may be: last, for it takes minutes",
    "not verified: refining again, with restarts",
    ended=UNSOLVED, restarts=True, anyhow=True,
)  # fmt: skip

REFINEMENT = (RESOLVED, FURTHER, CLOSER_AIM_FURTHER, CLOSER_AIM)
# Its points are to be verified: a certificate of each would take as long as all of it.
FRONT = (RESOLVED, CLOSER_AIM_FURTHER, CLOSER_AIM)
AS_GOOD = (RESOLVED,)  # for a hop in place of one that is sure already
HOP = (CALMED, RESTARTED)
WORK = (
    replace(CALMED, within=inf),
    RESTARTED,
)  # torques that chatter between the nodes: what is not verified is far too low
POINT = (replace(CALMED, within=3e-3), RESTARTED)  # neighbours are compared: a point may not change to another optimum
CODESIGN = (  # the answer is the hop of the leg that comes out: how the co-design's own refinement ended is not known
    replace(CALMED, restarts=False, within=inf), replace(RESTARTED, ended=None),
)  # fmt: skip
SEVERAL_HOPS = (replace(FURTHER, verified=None, said="refining further, with tighter tolerances"),)


def tried_again(
    hop: Hop, found: T, attempts: Sequence[Attempt], run: Callable[[Attempt, Hop], T | None],
    seen: Callable[[T], AttemptOutcome], say: Callable[[str], None], until: Deadline,
) -> tuple[Hop, T]:  # fmt: skip
    """An answer with its problem or, of the attempts that may help it, what the first leads to that is better.

    run: an attempt with its problem; None if it leads to no answer
    seen: what attempts look at of an answer
    """
    for attempt in attempts:
        if until.passed:
            break
        if not attempt.may_help(seen(found)) or (other := attempt.problem(hop)) is None:
            continue
        say(attempt.said.format(tie_break=other.design.solver.tie_break))
        again = run(attempt, other)
        if again is not None and attempt.is_better(seen(again), seen(found)):
            return other, again
    return hop, found


def with_tighter_tolerances(design: Design) -> Design:
    """The problem with tolerances of the solver of at most AT_MOST: more accurate than a height is read."""
    s = design.solver
    smaller = {name: min(getattr(s, name), most) for name, most in AT_MOST.items()}
    return design.model_copy(update={"solver": s.model_copy(update=smaller)})


def with_larger_tie_break(hop: Hop, times: float = CALMER) -> Hop | None:
    """The problem with a tie-break that is larger, and still too small to matter; None if there is none."""
    s = hop.design.solver
    if not (s.refine and s.max_refinements and 0 < s.tie_break <= LARGEST_TIE_BREAK):
        return None
    larger = s.model_copy(update={"tie_break": times * s.tie_break})
    changed = hop.design.model_copy(update={"solver": larger})
    return Hop(changed, hop.asked, hop.free_parameters, hop.constraints)
