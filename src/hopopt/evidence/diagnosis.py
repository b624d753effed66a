"""What a stored hop leaves open: flat directions, durations that may change, limits that never act."""

from typing import Any

from hopopt.errors import ResultError
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.optimality.directions.flat_directions import INSENSITIVE, STRETCH, NotInvertible, flat, longer_or_shorter
from hopopt.planner.answer.limit_names import flat_words
from hopopt.planner.answer.limit_use import IdleLimit, idle_limits
from hopopt.planner.answer.motion_figures import Sampled
from hopopt.planner.solution import Solution, has_multipliers, without_tie_break
from hopopt.problem.render import rows
from hopopt.record import as_data
from hopopt.storage.folder import fitting


def diagnose(solution: Solution) -> dict[str, Any]:
    """What a stored hop leaves open; takes seconds. ResultError without stored multipliers.

    flat: what the objective does not depend on, without the tie-break (optimality/directions/flat_directions.py); None if that
        cannot be computed
    durations: by which share the objective gets worse if a phase lasts 10 % shorter or longer and the whole hop is
        solved anew; None where that is not possible
    idle_limits: limits that never act (planner/answer/limit_use.py)
    words: the same in sentences
    """
    if not has_multipliers(solution):
        raise ResultError(f"{solution.result_dir}: the file holds no multipliers: solve it again")
    with fitting(solution.result_dir):
        nlp = without_tie_break(solution)
        durations = {phase: longer_or_shorter(nlp, phase) for phase in nlp.phases}
        try:
            found = flat(nlp)
            words = flat_words(found)
        except NotInvertible as error:  # no reason to lose the rest
            found, words = None, [f"what the objective does not depend on cannot be computed: {error}"]
    idle = idle_limits(solution, Sampled(solution).fine)
    words += [_duration(nlp, phase, *way) for phase, changes in durations.items() for way in changes.items()]
    units = {row.path: row.unit for row in rows(solution.design)}
    words += [_idle(name, limit, units.get(limit.entry.partition("[")[0], "")) for name, limit in idle.items()]
    flat_ones = None if found is None else [as_data(f) for f in found]
    return {
        "flat": flat_ones,
        "durations": durations,
        "idle_limits": {name: as_data(x) for name, x in idle.items()},
        "words": words,
    }


def _duration(nlp: NlpSolution, phase: str, way: str, change: float | None) -> str:
    lasts = nlp.phases[phase].duration
    what = f"{phase} {STRETCH:.0%} {way} ({lasts * (1 + (STRETCH if way == 'longer' else -STRETCH)):.3f} s)"
    if change is None:
        return f"{what}: the limits do not allow it, or no hop was found"
    if abs(change) < INSENSITIVE:
        return f"insensitive: {what} is as good, all else following"
    return (
        f"{what} costs {change:.2%} of the objective" if change > 0 else f"{what} gains {-change:.2%} of the objective"
    )


def _idle(name: str, limit: IdleLimit, unit: str) -> str:
    could = ""
    if limit.entry:
        unit = "" if unit in ("", "1") else f" {unit}"
        could = f": {limit.entry} = {limit.limit:g}{unit} could be tightened to {limit.enough:.4g}{unit} without effect on this hop"
    return f"idle: {name}, at most {limit.used:.0%} used{could}"
