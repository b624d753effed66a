"""From one start's optimum on the first mesh to a verified answer: refined, checked, summed up."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.refinement.mesh_refinement import Refinement
from hopopt.nlp.refinement.mesh_step import MeshStep, Report
from hopopt.nlp.refinement.next_mesh import Aims
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.hop import Hop
from hopopt.ocp.objectives.objective import HEIGHT_FIGURES
from hopopt.optimality.certificate import certify, unresolved
from hopopt.optimality.minimum_principle.free_switches import Resolved
from hopopt.planner.attempts import EXCESS_MARGIN, REFINEMENT, Attempt, AttemptOutcome, tried_again
from hopopt.planner.checks.judge import judge, with_sharper_gears
from hopopt.planner.checks.verdict import Verdict
from hopopt.planner.motion import Motion
from hopopt.planner.search.calm_first import calmest, uncalmed
from hopopt.planner.search.multistart import Progress, StartOutcome, first_transcription, solution_of
from hopopt.planner.solution import Solution, summarize
from hopopt.planner.stopwatch import Stopwatch
from hopopt.verify.check import LIMIT

Refined = Refinement | Resolved
COSTATE_ROUNDS = 3  # of cutting intervals where costates or torques are not resolved


@dataclass(frozen=True)
class Answer:
    """A refined plan with its verdict: what a solve, a study's point and a co-design all come to.

    hop: the question that was answered, with the tolerances that it was answered with
    refined: the last mesh's solution, and how it was reached
    plan: the motion
    claims: what may be stated of it, by name [the name's unit]
    verdict: whether it is true
    """

    hop: Hop
    refined: Refined
    plan: Motion
    claims: Mapping[str, float]
    verdict: Verdict

    @property
    def verified(self) -> bool:
        """Whether every check passed."""
        return self.verdict.verified

    @property
    def trial(self) -> AttemptOutcome:
        """What attempts look at."""
        return AttemptOutcome(self.verified, self.verdict.certified, self.refined.ended, self.objective_value)

    @property
    def objective_value(self) -> float:
        """The objective without its tie-break [its unit]."""
        return self.refined.solution.value


def refined_and_verified(
    hop: Hop,
    outcome: StartOutcome,
    outcomes: Sequence[StartOutcome],
    say: Progress,
    clock: Stopwatch,
    first: Transcription | None = None,
    restarts: bool = True,
    until: Deadline = NEVER,
    calmed: NlpSolution | None = None,
    attempts: Sequence[Attempt] = REFINEMENT,
    refinement: Refinement | None = None,
) -> Solution:
    """Refine one start's optimum, verify it (as ``refine_and_verify``) and sum it up."""
    answer = refine_and_verify(
        hop, outcome, say, first, restarts, clock,
        until=until, calmed=calmed, attempts=attempts, refinement=refinement,
    )  # fmt: skip
    return summed_up(answer, outcomes, outcome, clock)


def refine_and_verify(
    hop: Hop,
    outcome: StartOutcome,
    say: Progress,
    first: Transcription | None = None,
    restarts: bool = True,
    clock: Stopwatch | None = None,
    margin: float = EXCESS_MARGIN,
    until: Deadline = NEVER,
    calmed: NlpSolution | None = None,
    attempts: Sequence[Attempt] = REFINEMENT,
    refinement: Refinement | None = None,
) -> Answer:
    """One start's optimum refined, with its verdict, or what the ``attempts`` after a refinement lead to that is better
    (planner/attempts.py). ``first`` is the first mesh's program if there is one; ``margin``: share of the excess that
    is aimed at; ``calmed``: what the start leads to with a larger tie-break, if that is known
    (planner/search/calm_first.py); ``refinement``: of the start, if that is known."""
    clock = clock or Stopwatch()
    refinement = refinement or refine_outcome(hop, outcome, say, first, restarts, margin, until, calmed)
    clock.mark("refinement")
    say("verifying")

    def again(attempt: Attempt, closer: Hop) -> Answer | None:
        if attempt.costates:
            resolved = with_costates(refinement)
            return None if resolved is refinement else judged(closer, resolved, clock)
        more = None
        if attempt.further:
            own = {"excess": attempt.margin * LIMIT, "restarts": refinement.aims.restarts}
            more = refinement.further(replace(aims_of(closer, until), **own))
            if len(more.history) == len(refinement.history):  # it goes no further
                return None
        return refine_and_verify(
            closer, outcome, say, first, restarts, clock, attempt.margin, until, calmed, attempts, more
        )

    found = judged(hop, refinement, clock)
    return tried_again(hop, found, attempts, again, lambda answer: answer.trial, say, until)[1]


def with_costates(refinement: Refinement) -> Refinement:
    """A refinement with more intervals where costates or torques alone are not resolved; the same one if that does not help."""
    for _ in range(COSTATE_ROUNDS):  # layers of a few milliseconds are narrower than the pieces of the first
        pieces = unresolved(certify(refinement.solution))
        finer = refinement.on_pieces(pieces) if pieces else None
        if finer is None:
            break
        refinement = finer
    return refinement


def judged(hop: Hop, refined: Refined, clock: Stopwatch | None = None) -> Answer:
    """A refined solution with its verdict."""
    goal, solution = hop.objective, refined.solution
    stated, own = stated_figure(hop, solution), (goal if goal.is_function else None, hop.constraints)
    plan = Motion(hop.design, goal.name, solution.phases, stated=stated, own=own)
    claims = {**plan.claims(), **stated}
    verdict = judge(plan, solution, goal, hop.own, claims, refined.errors, refined.change, clock)
    return Answer(hop, refined, plan, claims, verdict)


def summed_up(answer: Answer, outcomes: Sequence[StartOutcome], outcome: StartOutcome, clock: Stopwatch) -> Solution:
    """An answer with every figure that is printed of it."""
    verdict = with_sharper_gears(answer.plan, answer.verdict)
    return summarize(answer.hop, answer.plan, answer.refined, verdict, outcomes, outcome, clock)


def stated_figure(hop: Hop, solution: NlpSolution) -> dict[str, float]:
    """Name and value [its unit] of what was optimised, without the tie-break, where no table of the plan tells it."""
    goal = hop.objective
    if goal.figure in HEIGHT_FIGURES:
        return {}
    return {goal.figure: solution.value}


def refine_outcome(
    hop: Hop,
    outcome: StartOutcome,
    say: Progress,
    first: Transcription | None = None,
    restarts: bool = True,
    margin: float = EXCESS_MARGIN,
    until: Deadline = NEVER,
    calmed: NlpSolution | None = None,
    known: float | None = None,
) -> Refinement:
    """A start's optimum, refined as the problem's solver settings ask for; ``margin`` and ``calmed`` as of
    ``refine_and_verify``; ``known``: objective of a hop that is verified [its unit]: it ends once it cannot become better."""
    aims = replace(aims_of(hop, until), excess=margin * LIMIT, known=known)
    aims = aims if restarts else replace(aims, restarts=0)
    solution = solution_of(outcome, first or first_transcription(hop))
    if hop.objective.calm_first and aims.meshes:
        calmed = calmed or (calmest(hop, [solution], aims, told_of_calm(hop, say)) or (0, None))[1]
        solution = (uncalmed(hop, calmed, aims) if calmed else None) or solution
    return Refinement(solution, aims, _told(hop, say)).run()


def told_of_calm(hop: Hop, say: Progress) -> Report:
    """Progress of a program with a larger tie-break."""
    return _told(hop, lambda text: say(f"with a larger tie-break: {text}"))


def _told(hop: Hop, say: Progress) -> Report:
    return lambda step: say(progress_line(hop, step))


def aims_of(hop: Hop, until: Deadline = NEVER) -> Aims:
    """What refinement is to reach, and by when it is to end."""
    s = hop.design.solver
    meshes = s.max_refinements if s.refine else 0
    return Aims(
        s.tolerance,
        s.objective_tolerance,
        EXCESS_MARGIN * LIMIT,
        s.price_tolerance,
        meshes,
        s.max_iterations,
        until=until,
    )


def progress_line(hop: Hop, s: MeshStep) -> str:
    """One solve of a refinement, for whoever waits; what counts first, for narrow screens cut the rest."""
    sizes = " + ".join(str(n) for n in s.intervals.values())
    held = f", limits enforced between the nodes in {s.held} intervals" if s.held else ""
    held += f", limits tightened {s.drawn_in} time{'s' if s.drawn_in > 1 else ''}" if s.drawn_in else ""
    return (
        f"{hop.objective.name} {s.objective:.5f} {hop.objective.unit} on {sizes} intervals, local error "
        f"{s.local_error:.0e}, limits exceeded by {s.excess:.0e}{held}"
    )
