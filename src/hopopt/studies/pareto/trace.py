"""Pareto fronts of the clearance against what it costs, by the epsilon-constraint method.

The front's points are hops that reach a given clearance with the least of the other objective (hop.clearance is the
epsilon), between that objective's own optimum and the highest hop. Each is refined and verified as any other, and can be
solved again alone. Neighbours begin from each other on one compiled program, upwards and downwards, so that a local
optimum at one end does not stay unnoticed. (Miettinen, Nonlinear Multiobjective Optimization, 1999, section 3.2.)
"""

import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hopopt.design import Design
from hopopt.design.parameters import own_numbers
from hopopt.errors import NotSolvedError, SolverError, UsageError, one_line
from hopopt.extensions import known
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.solver.ipopt import CARRIED, NlpSolver
from hopopt.nlp.solver.reuse import with_numbers_of
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.hop import Hop
from hopopt.ocp.objectives.objective import HopObjective
from hopopt.ocp.objectives.registry import OBJECTIVES, find
from hopopt.planner.attempts import FRONT
from hopopt.planner.checks.custom_check import objective_of
from hopopt.planner.refine_and_verify import refined_and_verified
from hopopt.planner.search.first_mesh import search_first_mesh
from hopopt.planner.search.multistart import Progress, StartOutcome, first_transcription, outcome_of
from hopopt.planner.search.required_clearance import begun_from, maximum_clearance_hop, reaches
from hopopt.planner.solution import Solution
from hopopt.planner.solve import TIME_LIMIT, solve
from hopopt.planner.stopwatch import Countdown, Stopwatch
from hopopt.problem.checking.wording import did_you_mean
from hopopt.problem.load import as_design, changed
from hopopt.storage.folder import new_folder, prepare, writing
from hopopt.storage.solution import save
from hopopt.studies.faults import Fault, guarded, kept
from hopopt.studies.pareto.front import Front, FrontPoint
from hopopt.verify.measures import MEASURES

CROWDING = 1.5  # exponent that brings points closer to the highest hop
NEIGHBOUR_ITERATIONS = 150  # iterations from a neighbour
MOST_POINTS = 1000  # points of a front
TOP, LEAST = "highest hop", "least {}"
LOWEST = 0.2  # of the highest clearance, where a front begins: below, the leg hardly leaves the ground


def front(
    design: Design | str | Path,
    against: str = "energy",
    *,
    points: int = 8,
    lowest: float | None = None,
    starts: int | None = None,
    processes: int | None = None,
    results: Path | None = None,
    progress: Progress | None = None,
    begun: Any = None,
    until: Deadline = NEVER,
) -> Front:
    """The front of the clearance against an economical objective: ``points`` hops from the least of that objective
    (at a clearance of at least ``lowest`` [m]; None, and of a periodic hop at least: LOWEST of the highest) to the highest hop.

    results: the folder in which a new folder keeps every point as it is finished (none: nothing is written); begun is
    called with the front before the first point. until: when no point may be begun any more; the front is then not complete. Raises UsageError for what is no front, NotSolvedError if an end
    cannot be solved.
    """
    design = as_design(design)
    goal = _goal(design, against, points)
    say = progress or (lambda text: None)
    if results is not None:
        prepare(results)
    say("the highest hop")
    left = min(TIME_LIMIT, until.seconds_left)
    top = solve(design, "clearance", starts=starts, processes=processes, time_limit=left, progress=say)
    if lowest is None or design.hop.periodic:
        lowest = max(lowest or 0.0, LOWEST * top.clearance)
    if lowest >= top.clearance:
        raise UsageError(f"the leg clears {top.clearance:.4f} m at most: give a lowest clearance below that")
    found = Front(design, goal)
    if results is not None:
        with writing(f"{results}: the front", "choose another folder"):
            found.folder = new_folder(results / f"{design.name}-pareto-{goal.short}")
            (found.folder / "points").mkdir()
    if begun:
        begun(found)
    with kept(found.folder, "the points that are finished are kept there"):
        _keep(found, TOP, top, top.clearance, _cost(goal, top), 0.0)
        count = starts or design.solver.starts
        chain = Chain(design, goal, lowest, count, processes or os.cpu_count() or 1, say, until)
        if until.passed:
            return found
        least = _refined(found, chain, 0, LEAST.format(goal.short.replace("_", " ")))
        reached = least.clearance if least is not None and least.verified else lowest
        chain.between(reached, top.clearance, points)
        count_down = Countdown(say, "points of the front", len(chain.clearances) - 1)
        for k in range(1, len(chain.clearances)):
            if until.passed:
                break
            _refined(found, chain, k, f"point {k + 1} of {points}")
            count_down.more()
        found.complete = len(found.points) == points
        found.write()
    return found


def _goal(design: Design, against: str, points: int) -> HopObjective:
    # The highest hop does not land, so that it has no impact.
    choices = [n for n in OBJECTIVES.built_in if find(n).ends == "required clearance" and n != "impact"]
    if against not in choices and (against in OBJECTIVES.built_in or not known("objective", against)):
        close = did_you_mean(against, choices)
        raise UsageError(f"there is no front against {against!r}{close}: choose one of {', '.join(choices)}")
    if not 3 <= points <= MOST_POINTS:
        raise UsageError(f"a front has at least 3 points and at most {MOST_POINTS}")
    goal = find(against)
    if goal.ends != "required clearance" or goal.maximize:
        raise UsageError(
            f"{against}: a front asks how little of it a clearance needs: mark it as "
            "hopopt.objective(clearance=True, maximize=False)"
        )
    if fault := goal.fault(changed(design, {"hop.clearance": 0.0})):
        raise UsageError(f"objective {against}: {fault}")
    return goal


def _cost(goal: HopObjective, top: Solution) -> float:
    """What the highest hop happens to cost [the goal's unit]."""
    if goal.custom is not None:
        return objective_of(top.robot, top.tables, goal.custom, own_numbers(top.design))
    return MEASURES[goal.figure](top.robot, top.tables, top.design.hop)


class Chain:
    """First-mesh optima at rising clearances, each begun from its neighbours, on one compiled program."""

    def __init__(
        self, design: Design, goal: HopObjective, lowest: float, starts: int, processes: int, say: Progress,
        until: Deadline = NEVER,
    ):  # fmt: skip
        self.design, self.goal, self.starts, self.processes, self.say = design, goal, starts, processes, say
        self.until = until
        self.clearances, self.outcomes = [lowest], list[list[StartOutcome]]()
        hop = self.hop(0)
        self.program = first_transcription(hop)
        self.warm = NlpSolver(self.program, CARRIED | {"ipopt.max_iter": NEIGHBOUR_ITERATIONS})
        self.cold = NlpSolver(self.program, {"ipopt.max_iter": design.solver.max_iterations})
        self.outcomes.append(self._from_starts(hop))

    def _from_starts(self, hop: Hop) -> list[StartOutcome]:
        until = self.until.within(TIME_LIMIT)
        highest = maximum_clearance_hop(hop, self.starts, until)
        besides = [begun_from(hop, highest, until)] if highest and reaches(hop, highest) else []
        return list(search_first_mesh(hop, self.starts, self.processes, self.say, besides, until).outcomes)

    def _from_highest(self, hop: Hop) -> list[StartOutcome]:
        """What the highest hop leads to, if that is as high; so near to it other starts find nothing better, and take longest."""
        until = NEVER.within(TIME_LIMIT)
        highest = maximum_clearance_hop(hop, self.starts, until)
        found = [begun_from(hop, highest, until)] if highest and reaches(hop, highest) else []
        return [outcome for outcome in found if outcome.success]

    def hop(self, k: int) -> Hop:
        """The problem of point k."""
        return Hop(changed(self.design, {"hop.clearance": float(self.clearances[k])}), self.goal)

    def transcription(self, k: int) -> Transcription:
        """The compiled program with the numbers of point k."""
        return with_numbers_of(self.program, self.hop(k).problem)

    def between(self, low: float, high: float, points: int) -> None:
        """All points: from the highest hop at the upper end, then up from the least and down from the upper end."""
        share = 1 - (1 - np.linspace(0, 1, points)[1:-1]) ** CROWDING  # the cost rises most at the upper end
        self.clearances = [self.clearances[0], *(low + (high - low) * share)]
        last = len(self.clearances) - 1
        self.outcomes += [[] for _ in range(last)]
        self.outcomes[last] += self._from_highest(self.hop(last)) or self._from_starts(self.hop(last))
        for k in range(1, last + 1):
            self._step(k, k - 1)
        for k in range(last - 1, -1, -1):
            self._step(k, k + 1)
        # Less clearance can only cost less: a point that costs more than one above it is solved again from there.
        for k in range(last - 1, -1, -1):
            own, above = best(self.outcomes[k]), best(self.outcomes[k + 1])
            if above is not None and (own is None or own.signed_value < above.signed_value):
                self._step(k, k + 1)

    def _step(self, k: int, neighbour: int) -> None:
        """Solve point k from the best of a neighbour."""
        self.say(f"clearance {self.clearances[k]:.3f} m from {self.clearances[neighbour]:.3f} m")
        begin, began, t = best(self.outcomes[neighbour]), time.perf_counter(), self.transcription(k)
        if begin is None or self.until.passed:
            return
        v, until = begin.vectors, self.until.within(TIME_LIMIT)
        try:
            s = self.warm.on(t, until).from_vector(v["z"], (v["lam_g"], v["lam_x"]))
            if not s.success:
                s = self.cold.on(t, until).from_vector(v["z"])
        except SolverError as error:
            self.say(f"clearance {self.clearances[k]:.3f} m: {one_line(error)}")
            return
        name = f"from {self.clearances[neighbour]:.3f} m"
        self.outcomes[k].append(outcome_of(name, s, time.perf_counter() - began))


def best(outcomes: Sequence[StartOutcome]) -> StartOutcome | None:
    """The best that was solved, if any."""
    return max((o for o in outcomes if o.success), key=lambda o: o.signed_value, default=None)


def _refined(found: Front, chain: Chain, k: int, kind: str) -> Solution | None:
    """Refine, verify and keep point k, its best first-mesh optimum or, if that is not verified, the next."""
    began, hop, clock, until = time.perf_counter(), chain.hop(k), Stopwatch(), chain.until.within(TIME_LIMIT)
    asked, outcomes = float(chain.clearances[k]), chain.outcomes[k]
    solution, why = None, "not solved: no start led to a hop"
    for outcome in _distinct(outcomes)[:2]:
        told, first = lambda text: chain.say(f"{kind}: {text}"), chain.transcription(k)
        try:
            ended = guarded(
                refined_and_verified, hop, outcome, outcomes, told, clock, first, until=until, attempts=FRONT
            )
        except NotSolvedError as error:
            why = f"refinement stopped: {one_line(error)}"
            continue
        if isinstance(ended, Fault):
            why = found.note(ended, k)
            chain.say(f"{kind}: {why}")
            continue
        solution = ended
        if solution.verified:
            break
    if solution is None:
        found.add(FrontPoint(kind, asked, None, None, False, why), None)
        return None
    value = float(solution.summary.figure(found.against.figure) or 0.0)
    return _keep(found, kind, solution, asked, value, time.perf_counter() - began)


def _distinct(outcomes: Sequence[StartOutcome]) -> list[StartOutcome]:
    """Those that were solved and differ by more than 0.2 %, best first."""
    found: list[StartOutcome] = []
    for o in sorted((o for o in outcomes if o.success), key=lambda o: -o.signed_value):
        if all(abs(o.objective - other.objective) > 2e-3 * abs(other.objective) for other in found):
            found.append(o)
    return found


def _keep(found: Front, kind: str, s: Solution, asked: float, value: float, seconds: float) -> Solution:
    if found.folder is not None:
        s = save(s, found.folder / "points")
    place = str(s.result_dir) if s.result_dir else None
    figures = (s.clearance, value) if s.verified else (None, None)
    sentence = "" if s.verified else f"not verified: {', '.join(s.summary.failed_checks)}"
    found.add(FrontPoint(kind, asked, *figures, s.verified, sentence, place, seconds, kind != TOP), s)
    return s
