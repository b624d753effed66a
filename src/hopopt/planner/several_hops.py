"""Several hops as one plan: the program of ocp/hops/several_hops.py solved, refined and verified."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import numpy as np

from hopopt.design import Design
from hopopt.design.parameters import own_numbers
from hopopt.errors import NotSolvedError
from hopopt.leg.kinematics import start_angles
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.mesh import uniform
from hopopt.nlp.refinement.mesh_refinement import Refinement
from hopopt.nlp.refinement.mesh_step import MeshStep
from hopopt.nlp.schemes import scheme
from hopopt.nlp.solver.ipopt import NlpSolution, NlpSolver
from hopopt.nlp.trajectory import FromTrajectory, PhaseTrajectory
from hopopt.nlp.transcription import Guess, Transcription
from hopopt.ocp.guesses.initial_guess import make_guess, starts_of
from hopopt.ocp.hop import Hop
from hopopt.ocp.hops.several_hops import HOP_PHASES, JointState, in_words, numbered, several_hops
from hopopt.ocp.objectives.tie_break import EFFORT
from hopopt.ocp.phases import DESCENT, FLIGHT, STANCE
from hopopt.optimality.certificate import certify
from hopopt.optimality.violations import violations
from hopopt.planner.attempts import SEVERAL_HOPS, Attempt, AttemptOutcome, tried_again
from hopopt.planner.checks.custom_check import custom_checks
from hopopt.planner.checks.judge import numerical_checks
from hopopt.planner.checks.program_limits import program_limits
from hopopt.planner.checks.verdict import Verdict
from hopopt.planner.motion import Motion
from hopopt.planner.refine_and_verify import aims_of
from hopopt.planner.search.multistart import infeasibility
from hopopt.planner.solution import Solution
from hopopt.verify.hops.several_hops import several_hops_checks

FIRST_PUSHES = 2  # first pushes from rest that are tried as a guess
FIRST_MESH_ITERATIONS = 600  # of Ipopt on the first mesh: programs that are solved take fewer


@dataclass(frozen=True)
class HopsPlan:
    """Several hops that follow each other.

    hops: the motion of each; x counts from the foot where it began, time from then.
    effort: of all of them, sum over the joints of (tau / stall torque)^2, integrated [s].
    verdict: what the checks say of the program, of every hop and of both ends.
    """

    hops: tuple[Motion, ...]
    effort: float
    verdict: Verdict

    @cached_property
    def clearances(self) -> tuple[float, ...]:
        """How high the leg's lowest point comes in every hop [m]."""
        return tuple(highest_lowest_point(hop) for hop in self.hops)

    @property
    def duration(self) -> float:
        """Of all hops [s]."""
        return sum(hop.end for hop in self.hops)


def highest_lowest_point(hop: Motion) -> float:
    """How high the leg's lowest point comes in a hop [m]."""
    return max(float(hop.everywhere(phase, np.linspace(0, 1, 9)).lowest.max()) for phase in (FLIGHT, DESCENT))


def state_of(orbit: Solution) -> JointState:
    """The joints as the stance of a periodic hop begins."""
    n, x = len(orbit.robot.joints), orbit.phases[STANCE].x_start[0]
    return JointState(x[:n], x[n : 2 * n])


def at_rest(design: Design) -> JointState:
    """The joints where a hop from rest begins."""
    start = start_angles(design)
    return JointState(start, np.zeros(len(start)))


def plan_hops(
    design: Design, begin: Solution | None, orbit: Solution, clearances: Sequence[float], say: Callable[[str], None],
    until: Deadline = NEVER,
) -> HopsPlan:  # fmt: skip
    """So many hops from rest (or from the orbit ``begin``) onto an orbit, of all ways the one of least effort.

    clearances: what each hop must clear at least [m]. Raises NotSolvedError with the worst constraints.
    """
    hop, s, count = Hop(design), design.solver, len(clearances)
    first, last = at_rest(design) if begin is None else state_of(begin), state_of(orbit)
    problem = several_hops(hop, first, last, clearances)
    intervals = dict(zip(HOP_PHASES, (s.stance_intervals, s.flight_intervals, s.flight_intervals), strict=True))
    mesh = {numbered(phase, k): uniform(intervals[phase]) for k in range(1, count + 1) for phase in HOP_PHASES}
    program = Transcription(problem, scheme(s.scheme, s.degree), mesh)
    solver = NlpSolver(program, {"ipopt.max_iter": min(s.max_iterations, FIRST_MESH_ITERATIONS)}, until=until)
    words, tried = in_words(count), list[NlpSolution]()
    for guess in _guesses(design, begin, orbit, count):
        if tried and until.passed:
            break
        found = solver(guess, {})
        if found.success:
            say(f"a way in {words} was found: refining")
            return _refined(hop, found, count, first, last, say, until)
        tried.append(found)
    if until.passed:
        raise NotSolvedError(
            f"{design.name}: the time limit was reached before a way onto the orbit in {words} was found."
        )
    closest = min(tried, key=infeasibility)
    message = f"{design.name}: no way onto the orbit in {words} was found ({closest.status})."
    raise NotSolvedError(message, violations(closest))


def _guesses(
    design: Design, begin: Solution | None, orbit: Solution, count: int
) -> list[dict[str, FromTrajectory | Guess]]:
    """Every hop as that of the orbit; the first as that of the orbit where all begins, or with a push from rest."""
    every: dict[str, FromTrajectory | Guess] = {
        numbered(phase, k): FromTrajectory(orbit.phases[phase]) for k in range(1, count + 1) for phase in HOP_PHASES
    }
    if begin is not None:
        return [every | {numbered(phase, 1): FromTrajectory(begin.phases[phase]) for phase in HOP_PHASES}, every]
    single = Hop(design.of_kind("single"))
    pushes = starts_of(single, FIRST_PUSHES)
    return [every | {numbered(STANCE, 1): make_guess(single, start)[STANCE]} for start in pushes]


def _refined(
    hop: Hop, found: NlpSolution, count: int, begin: JointState, end: JointState, say: Callable[[str], None],
    until: Deadline,
) -> HopsPlan:  # fmt: skip
    """The plan on a mesh that is fine enough, verified, with the attempts after it (planner/attempts.py)."""

    def told(step: MeshStep) -> None:
        say(f"local error {step.local_error:.0e}, limits exceeded by {step.excess:.0e}")

    refinement = Refinement(found, aims_of(hop, until), told).run()

    def again(attempt: Attempt, closer: Hop) -> HopsPlan:
        return _judged(closer, refinement.further(aims_of(closer, until)), count, begin, end)

    def seen(plan: HopsPlan) -> AttemptOutcome:
        return AttemptOutcome(plan.verdict.verified, plan.verdict.certified, refinement.ended, plan.effort)

    plan = _judged(hop, refinement, count, begin, end)
    return tried_again(hop, plan, SEVERAL_HOPS, again, seen, say, until)[1]


def _judged(hop: Hop, refinement: Refinement, count: int, begin: JointState, end: JointState) -> HopsPlan:
    """What a refinement came to, with its checks."""
    design, solution = hop.design, refinement.solution
    hops = tuple(Motion(design, EFFORT, _phases_of(solution.phases, k)) for k in range(1, count + 1))
    states = (np.r_[state.q, state.v] for state in (begin, end))
    checks = [
        *numerical_checks(design, solution, refinement.errors, refinement.change),
        *several_hops_checks(hop.robot, design, [motion.tables for motion in hops], *states),
    ]
    if design.hop.constraints:
        own = (custom_checks(hop.robot, m.tables, hop.objective, hop.own, None, own_numbers(design)) for m in hops)
        checks += [*chain.from_iterable(own), *program_limits(solution, refinement.errors, ())]
    return HopsPlan(hops, solution.objective, Verdict(tuple(checks), conditions=certify(solution).checks))


def _phases_of(phases: Mapping[str, PhaseTrajectory], hop: int) -> dict[str, PhaseTrajectory]:
    """The phases of one hop, by their usual names."""
    return {phase: phases[numbered(phase, hop)] for phase in HOP_PHASES}
