"""Co-design: the hop and the leg's own numbers optimised together, then confirmed on the leg that comes out.

The free parameters are variables of the same nonlinear program. Its optimum is not what is stated: the design with the
optimal numbers is solved and verified as any other problem, from its own starts and from the co-design's motion, and
must reach the same objective.
"""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from hopopt.amounts import check
from hopopt.design import Design, Leg
from hopopt.design.parameters import variable_numbers
from hopopt.errors import NotSolvedError, ProblemFileError, UsageError
from hopopt.leg.geometry.solids import has_shape
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.ocp.custom import custom
from hopopt.ocp.free_parameters import Coupling, FreeParameters, monotone, parse_coupling
from hopopt.ocp.hop import Hop
from hopopt.ocp.objectives.registry import given
from hopopt.optimality.directions.parametric_sensitivity import slopes
from hopopt.planner.answer.extras import CoDesign, CouplingHeld, FreeEntry
from hopopt.planner.answer.summary import LATE
from hopopt.planner.attempts import CODESIGN, Attempt, tried_again
from hopopt.planner.checks.verdict import Verification
from hopopt.planner.refine_and_verify import refine_outcome, refined_and_verified
from hopopt.planner.search.first_mesh import search_first_mesh
from hopopt.planner.search.from_known import GUESS, Known, from_motion
from hopopt.planner.search.multistart import (
    Progress,
    StartOutcome,
    contenders,
    first_transcription,
    not_solved,
    solution_of,
    solved_from,
)
from hopopt.planner.search.required_clearance import from_highest
from hopopt.planner.solution import Solution
from hopopt.planner.solve import SEARCHING, TIME_LIMIT, best_of, trial_of
from hopopt.planner.stopwatch import Stopwatch
from hopopt.problem.checking.wording import did_you_mean
from hopopt.problem.load import as_design, changed
from hopopt.problem.own import named_apart
from hopopt.problem.render import unit_at
from hopopt.record import computed
from hopopt.storage.seal.recheck import CONFIRMED, co_design_checks
from hopopt.studies.codesign_kinks import between
from hopopt.studies.mass_coupling import asks_catalogue, beyond, catalogue_coupling, keeps_order, laws, meets

AT_BOUND = 1e-6  # share of its range within which a parameter sits on a bound
LOOKS = 9  # values of its range at which a linkage's entry is looked at, its bounds among them
LINKAGE = re.compile(
    r"leg(\.\S+\.transmission\S*)? (cannot close|has a dead point|has drives)"
)  # what fails by an entry


def codesign(
    design: Design | str | Path,
    free: Mapping[str, tuple[float, float]],
    objective: Any = "clearance",
    *,
    couple: Sequence[str] = (),
    constraints: Sequence[Any] = (),
    starts: int | None = None,
    processes: int | None = None,
    time_limit: float | None = None,
    guess: Known | None = None,
    progress: Progress | None = None,
) -> Solution:
    """The best hop with the best design parameters: ``free`` maps entries to their (lowest, highest) values.

    couple: equations or inequalities between entries, such as "leg.thigh.length + leg.shank.length = 0.741"; or the law
    of mass that the catalogue's motors follow, "catalogue: leg.body.mass by leg.motor.max_torque".
    The solution's ``design`` has the optimal numbers; its summary's ``codesign`` says what was free and what is at
    its bound. time_limit [s]: as in ``solve``. Raises UsageError for entries or bounds that no problem can have, NotSolvedError as ``solve`` does.
    """
    seconds = TIME_LIMIT if time_limit is None else time_limit
    until = NEVER.within(SEARCHING * seconds)
    design, functions = named_apart(as_design(design), constraints)
    check("starts", starts)
    say, clock, count = progress or (lambda text: None), Stopwatch(), starts or design.solver.starts
    side_by_side = processes or os.cpu_count() or 1
    free_parameters = checked(design, free, couple)
    own = tuple(custom(c) for c in functions)
    hop = Hop(design, given(objective), free_parameters, own)
    found = _found(hop, count, side_by_side, clock, say, until, guess)
    late = (LATE,) if until.passed else ()
    return found.with_summary(time_limit_s=seconds, notes=(*late, *found.summary.notes))


def _found(
    hop: Hop, count: int, side_by_side: int, clock: Stopwatch, say: Progress, until: Deadline, guess: Known | None
) -> Solution:
    """The best hop with the best parameters that is found in the time that is left."""
    reported = _of_codesign(say)
    begun = [] if guess is None else [from_motion(hop, guess, GUESS, until)]
    begun += _begun(hop, count, side_by_side, reported, until)
    outcomes = search_first_mesh(hop, count, side_by_side, reported, begun, until).outcomes
    answer = _confirmed(hop, outcomes, count, side_by_side, clock, say, until)

    def again(attempt: Attempt, other: Hop) -> Solution | None:
        begun = outcomes if other is hop else [solved_from(other, o, until) for o in contenders(outcomes)]
        if not any(o.success for o in begun):
            return None
        return _confirmed(other, begun, count, side_by_side, clock, say, until, attempt.restarts)

    if not answer.verified:
        with suppress(NotSolvedError):  # what there is, is kept: the time may be up before there is another
            return tried_again(hop, answer, CODESIGN, again, trial_of, reported, until)[1]
    return answer


def _confirmed(
    hop: Hop, outcomes: Sequence[StartOutcome], count: int, side_by_side: int, clock: Stopwatch, say: Progress,
    until: Deadline, restarts: bool = False,
) -> Solution:  # fmt: skip
    """The best of the co-designs of the first mesh refined, and the hop of the leg that comes out."""
    refined = [
        refine_outcome(hop, o, _of_codesign(say), restarts=restarts, until=until).solution
        for o in _in_time(contenders(outcomes), until)
    ]
    if not refined or until.passed:
        raise not_solved(hop, outcomes, until=until)
    best = max(refined, key=lambda s: hop.objective.signed_value(s.objective))
    clock.mark("co-design")
    fixed = Hop(changed(hop.design, optimal(hop.free_parameters, best)), hop.asked, constraints=hop.constraints)
    say("solving the design that came out")
    begun = from_motion(fixed, best, "co-design", until)
    again = search_first_mesh(fixed, count, side_by_side, say, [begun], until).outcomes
    clock.mark("starts")
    finished = [
        refined_and_verified(fixed, o, again, say, clock, restarts=restarts, until=until)
        for o in _in_time(contenders(again), until)
    ]
    if not finished:
        raise not_solved(fixed, again, until=until)
    return _described(best_of(fixed.objective, finished), hop, best, until)


def _in_time(outcomes: Sequence[StartOutcome], until: Deadline) -> Iterator[StartOutcome]:
    """The first, and more while there is time."""
    return (o for k, o in enumerate(outcomes) if not k or not until.passed)


def _of_codesign(say: Progress) -> Progress:
    """Progress of the co-design, not of the leg that comes out."""
    return lambda text: say(f"co-design: {text}")


def _begun(hop: Hop, count: int, side_by_side: int, reported: Progress, until: Deadline) -> list[StartOutcome]:
    """Co-designs begun from what is known: the highest hop where a clearance is asked for, and the best hop of the design
    as it is given, below which the co-design's optimum cannot lie."""
    besides = from_highest(hop, count, reported, until=until)
    if count == 1 or until.passed or any(o.success for o in besides):
        return besides
    given_design = Hop(hop.design, hop.asked, constraints=hop.constraints)
    found = contenders(search_first_mesh(given_design, count, side_by_side, reported, until=until).outcomes)
    t = first_transcription(given_design)
    return besides + [from_motion(hop, solution_of(o, t), "the design as given", until) for o in found[:1]]


def optimal(free_parameters: FreeParameters, solution: NlpSolution) -> dict[str, float]:
    """The free parameters' values, those on a bound exactly there."""
    found = {}
    for path, (low, high) in free_parameters.bounds.items():
        value = float(solution.parameters[path][0])
        side = next((x for x in (low, high) if abs(value - x) < AT_BOUND * (high - low)), value)
        found[path] = side
    return found


def _described(answer: Solution, hop: Hop, best: NlpSolution, until: Deadline) -> Solution:
    """The answer with what was free, and the check that the fixed design confirms the co-design."""
    found = CoDesign(
        best.value,
        parameters=tuple(_parameters(hop, best, until)),
        couplings=tuple(_coupling(c, hop, best) for c in hop.free_parameters.couplings),
        mass_laws=laws(hop.free_parameters),
    )
    assert answer.verdict is not None
    value, notes = answer.summary.objective_value, beyond(hop.free_parameters)
    verdict = answer.verdict.with_checks(co_design_checks(hop.objective, value, found))
    if hop.objective.sign * (value - best.value) > CONFIRMED * abs(value):
        notes.append("the fixed design has a better hop than the co-design found: try more starts")
    reported = (*answer.summary.notes, *notes)
    return answer.noted(verdict=verdict).with_summary(**computed(Verification, verdict), codesign=found, notes=reported)


def _parameters(hop: Hop, best: NlpSolution, until: Deadline) -> list[FreeEntry]:
    """For each free entry: value before and now, bounds, whether it is at one and what moving that would gain."""
    t, by = best.transcription, slopes(best)
    known, values, found = variable_numbers(hop.design), optimal(hop.free_parameters, best), []
    for k, p in enumerate(t.free):
        if p.name not in values:
            continue
        low, high = hop.free_parameters.bounds[p.name]
        at = t.parameters.start + sum(q.size for q in t.free[:k])
        bound = "lower" if values[p.name] == low else "upper" if values[p.name] == high else None
        slope = float((by.low_z if bound == "lower" else by.high_z)[at]) if bound else 0.0
        found.append(
            FreeEntry(
                p.name,
                unit_at(hop.design, p.name),
                known[p.name],
                low,
                high,
                optimal=values[p.name],
                at_bound=bound,
                gain_per_unit_of_the_bound=slope,
                between=None if bound or until.passed else between(hop, best, p.name),
            )
        )
    return found


def _coupling(c: Coupling, hop: Hop, best: NlpSolution) -> CouplingHeld:
    values = {**variable_numbers(hop.design), **{k: float(v[0]) for k, v in best.parameters.items()}}
    total = c.value(values)
    active = bool(np.isclose(total, c.lower) or np.isclose(total, c.upper))
    return CouplingHeld(c.text, c.equation(), active)


# ---- what may be free ---------------------------------------------------------------------------------------


def _unknown(leg: Leg, entry: str, known: Mapping[str, float]) -> str:
    """Why an entry cannot be free: a joint's own number that it shares with the others, or none of the leg's."""
    for joint in leg.joints:
        for part in ("motor", "gear"):
            name = entry.removeprefix(f"leg.{joint}.{part}.")
            if name != entry and (shared := f"leg.{part}.{name}") in known:
                return f"the {joint} has no number of its own there but {shared}: add --set {entry}={known[shared]:g}"
    near = did_you_mean(entry, known) or f"; it has {', '.join(known)}"
    return f"there is no such number of the leg that is set{near}"


def checked(design: Design, free: Mapping[str, tuple[float, float]], couple: Sequence[str] = ()) -> FreeParameters:
    """The free parameters that are asked for, if the problem can have it; UsageError in a sentence if not."""
    known = variable_numbers(design)
    if not free:
        raise UsageError("nothing is free: give --free leg.gear.ratio=50:200, say")
    bounds = FreeParameters(dict(free))
    for entry, (low, high) in free.items():
        if entry not in known:
            raise UsageError(f"--free {entry}: {_unknown(design.leg, entry, known)}")
        if not low < high:
            raise UsageError(f"--free {entry}: its bounds {low:g} and {high:g} leave it no room")
        if entry.endswith(".length") and has_shape(design.leg):
            raise UsageError(f"--free {entry}: shapes do not follow a free length: sweep it, or leave the shapes out")
        for value in _looked_at(design.leg, entry, low, high):
            _possible(design, entry, value)
        _holds_com(entry, low, bounds, known)
    couplings = tuple(
        catalogue_coupling(text, design.leg, free) if asks_catalogue(text) else parse_coupling(text) for text in couple
    )
    own_mass = [next(iter(c.factors)) for c in couplings if asks_catalogue(c.text)]
    if repeated := next((mass for k, mass in enumerate(own_mass) if mass in own_mass[:k]), None):
        raise UsageError(f'--couple: two laws of the catalogue say {repeated}: name their torques in one, with "and"')
    kept = tuple(monotone(design.leg, free))
    for c in couplings:
        meets(c, free, known)
    for c in kept:
        keeps_order(c, free, known)
    return FreeParameters(dict(free), (*couplings, *kept))


def _looked_at(leg: Leg, entry: str, low: float, high: float) -> list[float]:
    """Values of an entry at which the leg must be possible: its bounds, and between them too where linkages depend on it."""
    linked = ".transmission." in entry or (leg.five_bars and entry.endswith(".length"))
    return np.linspace(low, high, LOOKS if linked else 2).tolist()


def _possible(design: Design, entry: str, value: float) -> None:
    """That a value is one the entry may have, and no linkage fails by it; whether the leg can start so is left to the optimum."""
    try:
        changed(design, {entry: value})
    except ProblemFileError as error:
        words = [s.removeprefix("override ").removeprefix(f"{design.name}: ") for s in error.problems]
        own = [s for s in words if s.startswith(f"{entry} ")]
        if wrong := own or [f"{entry} = {value:.4g}: {s}" for s in words if LINKAGE.match(s)]:
            raise UsageError(f"--free: {wrong[0]}") from None


def _holds_com(entry: str, shortest: float, free_parameters: FreeParameters, known: Mapping[str, float]) -> None:
    """That a link cannot get shorter than its centre of mass is far, where that is set."""
    com = f"{entry.removesuffix('.length')}.com"
    if not entry.endswith(".length") or com not in known:
        return
    far = free_parameters.bounds.get(com, (known[com], known[com]))[1]
    if shortest < far:
        reach = f"{com} can be {far:g} m" if com in free_parameters.bounds else f"{com} = {far:g} m is set"
        raise UsageError(
            f"--free {entry}: {reach}, beyond the end of a link of {shortest:g} m: begin its range at {far:g} m or above"
        )
