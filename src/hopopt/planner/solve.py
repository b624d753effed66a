"""From a problem to a verified answer: several starts, the best of them finished, what is doubtful solved once more."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from hopopt.amounts import check
from hopopt.design import Design
from hopopt.errors import NotSolvedError
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.refinement.mesh_refinement import BEHIND
from hopopt.nlp.refinement.mesh_step import MeshStep, relative
from hopopt.ocp.custom import custom
from hopopt.ocp.guesses.feasibility import cannot_begin
from hopopt.ocp.hop import Hop
from hopopt.ocp.objectives.objective import HopObjective
from hopopt.ocp.objectives.registry import given
from hopopt.optimality.minimum_principle.free_switches import resolve
from hopopt.planner.answer.limit_names import flat_words
from hopopt.planner.answer.notes import flat_directions, notes_on, saddle_note, second_order
from hopopt.planner.answer.starts import start_figures
from hopopt.planner.answer.summary import LATE
from hopopt.planner.attempts import HOP, WORK, Attempt, AttemptOutcome, tried_again, with_tighter_tolerances
from hopopt.planner.checks.cross_check import cross_check_entries
from hopopt.planner.checks.global_verdict import GRID_TOO_COARSE, MAY_EXIST, alarm_note, global_figures
from hopopt.planner.refine_and_verify import (
    aims_of,
    judged,
    progress_line,
    refine_outcome,
    refined_and_verified,
    summed_up,
    told_of_calm,
)
from hopopt.planner.search.beside import make_missing
from hopopt.planner.search.calm_first import calmest
from hopopt.planner.search.families import families, told_apart
from hopopt.planner.search.first_mesh import SEARCH, FirstMesh, looked_closer, search_first_mesh
from hopopt.planner.search.from_known import GUESS, Known, from_motion
from hopopt.planner.search.multistart import (
    Progress,
    StartOutcome,
    contenders,
    distinct,
    first_transcription,
    not_solved,
    solution_of,
    solved_from,
)
from hopopt.planner.search.neighbours.obstacle_place import below_the_middle
from hopopt.planner.search.required_clearance import from_highest
from hopopt.planner.search.shortest_stance import with_shortest_stance
from hopopt.planner.solution import Solution, stored_nlp
from hopopt.planner.stopwatch import Stopwatch
from hopopt.problem.checking.hints import hints
from hopopt.problem.load import as_design
from hopopt.problem.own import named_apart

TIME_LIMIT = 600.0  # s; one random leg in ten takes over a minute from two starts, the slowest known 270 s
SEARCHING = (
    0.85  # share of the time limit, after which nothing more is searched for: what is found is still to be checked
)


def solve(
    design: Design | str | Path,
    objective: str | Callable[..., Any] | HopObjective = "clearance",
    *,
    constraints: Sequence[str | Callable[..., Any]] = (),
    starts: int | None = None,
    processes: int | None = None,
    structure: bool = False,
    cross_check: bool = False,
    time_limit: float | None = None,
    guess: Known | None = None,
    progress: Progress | None = None,
) -> Solution:
    """The best hop of a leg: solved from several starts, refined, verified.

    design is a problem, or its name or file. objective is the name of one, or a function of your own (or its name "module:function"); constraints are path
    constraints of your own (hopopt.ocp.custom). starts overrides the problem's number; processes (default: the cores)
    solve them side by side; structure: the best is solved once more with the switches of its drives at free times
    (optimality/minimum_principle/free_switches.py), with tighter tolerances (planner/attempts.py); cross_check: solved by another
    solver and other schemes too, in the summary's ``second_opinions`` (planner/checks/cross_check.py); time_limit [s] (default:
    TIME_LIMIT): when it is reached the best hop so far is the answer, or the reason why there is none; progress is called
    with a line of text now and then; guess: a hop from which it is solved as well. Raises NotSolvedError, with the worst constraints, if no start leads to a solution. A solution that fails verification is
    returned with ``verified`` False. UsageError for what is no problem.
    """
    seconds = TIME_LIMIT if time_limit is None else time_limit
    end, until = NEVER.within(seconds), NEVER.within(SEARCHING * seconds)
    design, functions = named_apart(as_design(design), constraints)
    check("starts", starts)
    say, clock = progress or (lambda text: None), Stopwatch()
    asked, design = design, with_tighter_tolerances(design) if structure else design
    hop = Hop(design, given(objective), constraints=tuple(custom(c) for c in functions))
    if faults := cannot_begin(hop.design, hop.robot):
        raise NotSolvedError(f"{design.name}: the leg cannot hop from its start.", [*faults, *hints(design)])
    clock.mark("model")
    hop, best, found = _found(hop, asked, starts, processes, structure, say, clock, until, guess)
    if cross_check:
        found |= cross_check_entries(hop, best, found["notes"], say, end)
        clock.mark("second opinions")
    times = {"timings_s": clock.stages, "wall_s": clock.last - clock.begin, "time_limit_s": seconds}
    return best.with_summary(**found, **times)


def _found(
    hop: Hop, asked: Design, starts: int | None, processes: int | None, structure: bool, say: Progress, clock: Stopwatch,
    until: Deadline, guess: Known | None,
) -> tuple[Hop, Solution, dict[str, Any]]:  # fmt: skip
    """The best hop that is found in the time that is left, with its problem, and what its summary says of the search."""
    count = starts or hop.design.solver.starts
    economical = from_highest(hop, count, say, until=until)
    economical += below_the_middle(hop, count, until)
    economical += [] if guess is None else [from_motion(hop, guess, GUESS, until)]
    searched = search_first_mesh(hop, count, processes, say, economical, until)
    outcomes = searched.outcomes
    clock.mark("starts")
    if count >= SEARCH:
        make_missing(processes)
    finished = _refined(hop, contenders(outcomes), outcomes, say, clock, until, ())
    if not finished:
        say("looking for the limits that cannot hold together")
        raise not_solved(hop, outcomes, thorough=True, until=until)
    if not until.passed and doubted(hop, searched, finished):
        known, searched = {o.name for o in outcomes}, looked_closer(hop, searched, say, until)
        outcomes = searched.outcomes
        more = [o for o in contenders(outcomes) if o.name not in known]
        finished += _refined(hop, more, outcomes, say, clock, until, finished)
    hop, best, better = settled(hop, finished, outcomes, say, clock, until)
    if count >= SEARCH:
        make_missing(processes)
    if (shorter := with_shortest_stance(hop, best, outcomes, say, clock, until)) is not best:
        finished.append(best := shorter)
    if structure and not until.passed:
        best = _with_free_switches(hop, best, outcomes, say, clock, until)
    found = None if until.passed else flat_directions(hop, best)
    known_as = families(hop, outcomes, [*finished, best])
    overall = global_figures(searched, best, known_as)
    late = (LATE,) if until.passed else ()
    second = None if until.passed else second_order(stored_nlp(best, hop.problem))
    own = notes_on(hop, asked, structure, best, better)
    notes = (*late, *saddle_note(second), *alarm_note(overall), *own, *flat_words(found or []))
    ended = start_figures(
        outcomes, outcomes[_chosen(best, outcomes)], count, told_apart(hop, outcomes, [*finished, best])
    )
    flat = None if found is None else tuple(found)
    return hop, best, {
        "notes": notes, "flat": flat, "second_order": second, "starts": ended, "searched": count >= SEARCH,
        "families": known_as, "global_": overall,
    }  # fmt: skip


def doubted(hop: Hop, searched: FirstMesh, finished: Sequence[Solution]) -> bool:
    """Whether the global method, as far as it has looked, has not found the best of the finished hops, or promises more."""
    found = global_figures(searched, best_of(hop.objective, finished), families(hop, searched.outcomes, finished))
    return found.verdict in (MAY_EXIST, GRID_TOO_COARSE)


def _refined(
    hop: Hop, chosen: Sequence[StartOutcome], outcomes: Sequence[StartOutcome], say: Progress, clock: Stopwatch,
    until: Deadline, before: Sequence[Solution],
) -> list[Solution]:  # fmt: skip
    """The chosen outcomes of the first mesh, the best first, refined and verified; the first of them, and more while there
    is time. Those that turn out no better than a verified one, of these or of those finished before, are left."""
    if hop.objective.calm_first and chosen:
        return [_least(hop, distinct(outcomes), outcomes, say, clock, until)]
    finished: list[Solution] = []
    for k, outcome in enumerate(chosen, 1):
        if finished and until.passed:
            break
        told = _one_of(say, k, len(chosen))
        verified = [s for s in (*before, *finished) if s.verified]
        known = best_of(hop.objective, verified).summary.objective_value if verified else None
        refinement = refine_outcome(hop, outcome, told, restarts=False, until=until, known=known)
        if refinement.ended == BEHIND:
            clock.mark("refinement")
            told("left, for a hop that is better, or as good, is verified")
            continue
        finished.append(
            refined_and_verified(
                hop, outcome, outcomes, told, clock, restarts=False, until=until, refinement=refinement
            )
        )
    return finished


def _least(
    hop: Hop, found: Sequence[StartOutcome], outcomes: Sequence[StartOutcome], say: Progress, clock: Stopwatch,
    until: Deadline,
) -> Solution:  # fmt: skip
    """The best of what was found on the first mesh, where its values tell little, refined and verified: the best where they
    can be compared."""
    t = first_transcription(hop)
    least = calmest(hop, [solution_of(o, t) for o in found], aims_of(hop, until), told_of_calm(hop, say))
    clock.mark("refinement")
    best, calmed = least or (0, None)
    return refined_and_verified(hop, found[best], outcomes, say, clock, until=until, calmed=calmed)


def _one_of(say: Progress, k: int, count: int) -> Progress:
    """Progress that says which of several hops is refined."""
    return say if count == 1 else lambda text: say(f"hop {k} of {count}: {text}")


def solve_from(
    hop: Hop, chosen: Sequence[StartOutcome], outcomes: Sequence[StartOutcome], say: Progress = lambda text: None,
    until: Deadline = NEVER,
) -> Solution:  # fmt: skip
    """The best of the chosen outcomes of the first mesh, refined and verified, within TIME_LIMIT; NotSolvedError if there is
    none."""
    clock, until = Stopwatch(), until.within(TIME_LIMIT)
    if not chosen:
        raise not_solved(hop, outcomes, until=until)
    finished = [refined_and_verified(hop, outcome, outcomes, say, clock, until=until) for outcome in chosen]
    return best_of(hop.objective, finished)


def best_of(goal: HopObjective, finished: Sequence[Solution]) -> Solution:
    """The best of the verified solutions, or of all if none is."""
    return max(finished, key=lambda s: (s.verified, goal.signed_value(s.summary.objective_value)))


def settled(
    hop: Hop, finished: Sequence[Solution], outcomes: Sequence[StartOutcome], say: Progress, clock: Stopwatch,
    until: Deadline = NEVER,
) -> tuple[Hop, Solution, Solution | None]:  # fmt: skip
    """The best hop with its problem, and a better one that is not verified, if any, after those that claim more than the
    best of the verified were solved again."""

    def signed_value(s: Solution) -> float:
        return hop.objective.signed_value(s.summary.objective_value)

    chosen, best, better = hop, best_of(hop.objective, finished), None
    for doubtful in sorted((s for s in finished if not s.verified), key=signed_value, reverse=True):
        if until.passed or (best.verified and signed_value(doubtful) <= signed_value(best)):
            break
        where, again = once_more(hop, doubtful, outcomes, say, clock, until)
        if again.verified and (not best.verified or signed_value(again) > signed_value(best)):
            chosen, best = where, again
        elif not again.verified:
            nearer = min(again, doubtful, key=lambda s: len(s.summary.failed_checks))  # it may have run out of time
            best, better = nearer if doubtful is best else best, better or nearer
    return chosen, best, better if best.verified and better and signed_value(better) > signed_value(best) else None


def once_more(
    hop: Hop, doubtful: Solution, outcomes: Sequence[StartOutcome], say: Progress, clock: Stopwatch,
    until: Deadline = NEVER,
) -> tuple[Hop, Solution]:  # fmt: skip
    """A hop that is not verified, or what the attempts after it lead to (planner/attempts.py), with its problem."""
    start = outcomes[_chosen(doubtful, outcomes)]

    def again(attempt: Attempt, other: Hop) -> Solution | None:
        if (begin := start if other is hop else solved_from(other, start, until)).success:
            return refined_and_verified(other, begin, outcomes, say, clock, restarts=attempt.restarts, until=until)
        return None

    return tried_again(hop, doubtful, WORK if hop.objective.calm_first else HOP, again, trial_of, say, until)


def trial_of(s: Solution) -> AttemptOutcome:
    """What attempts look at of a solution."""
    return AttemptOutcome(s.verified, s.summary.certified, s.summary.refinement_ended, s.summary.objective_value)


def _chosen(found: Solution, outcomes: Sequence[StartOutcome]) -> int:
    """Which start led to it."""
    return [o.name for o in outcomes].index(found.summary.starts.chosen)


def _with_free_switches(
    hop: Hop, best: Solution, outcomes: Sequence[StartOutcome], say: Progress, clock: Stopwatch, until: Deadline
) -> Solution:
    """The best hop solved again with its drives' switches at free times, if that is verified and agrees with it."""
    say("solving again with free switching times")
    settled = MeshStep(**asdict(best.summary.mesh[-1]))
    found = resolve(stored_nlp(best), settled, aims_of(hop, until), lambda step: say(progress_line(hop, step)))
    clock.mark("structure")
    if isinstance(found, str):
        return _with_structure(best, solved_again=False, note=found)
    outcome = next(o for o in outcomes if o.name == best.summary.starts.chosen)
    again = summed_up(judged(hop, found, clock), outcomes, outcome, clock)
    difference = relative(again.summary.objective_value, best.summary.objective_value)
    wrong = [*again.summary.failed_checks, *([] if again.summary.certified else ["the certificate"])]
    wrong += [f"another optimum, {difference:.0e} away"] if difference > hop.design.solver.objective_tolerance else []
    note = f"with free switching times it failed: {', '.join(wrong)}" if wrong else ""
    return _with_structure(
        best if wrong else again,
        solved_again=not wrong,
        note=note,
        switches_s=dict(found.switches),
        jumps_s=dict(found.jumps),
        difference=difference,
    )


def _with_structure(solution: Solution, **more: Any) -> Solution:
    return solution.with_summary(structure=replace(solution.summary.structure, **more))
