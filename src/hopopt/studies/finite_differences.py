"""Derivatives of the best height confirmed by solving again: the entry a little larger, a little smaller.

Each changed problem is built anew from its file's entries and solved on the optimum's mesh from the optimum, with
the same limits enforced between the nodes. So nothing that the derivative was made of is taken for granted but the mesh.
"""

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import ValidationError

from hopopt.design import Design
from hopopt.errors import SolverError, UsageError, one_line
from hopopt.leg.scales import Scale
from hopopt.nlp.refinement.continuous_limits import enforced_in, enforcing, holds
from hopopt.nlp.solver.ipopt import WARM, Bounds, NlpSolution, NlpSolver
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.hop import Hop
from hopopt.planner.solution import Solution, stored_nlp
from hopopt.problem.checking.wording import did_you_mean
from hopopt.studies.influence import Difference, Influence
from hopopt.studies.sensitivity import settled_within

RELATIVE_STEP, WIDEST_STEP = 0.005, 0.05  # relative change of an entry, and of one that hardly matters
SLIGHTEST_SLOPE = 1e-6  # [m per unit] on the paper's leg, below which an entry that is 0 is not looked at
FELT_SHARE = 5e-4  # share of the height that a step from 0 is to make
LEADING = 5  # entries that are confirmed unless others are named
NOISE_SHARE = 0.005  # share of the difference that noise should be
CLOSER_STEP = 0.1  # share of a step, over which a difference that disagrees is taken again
SOLVED = 1e-8  # relative accuracy to which a program is solved again on one mesh


def chosen(influences: Sequence[Influence], wanted: Sequence[str]) -> list[str]:
    """Names of the influences to confirm: the leading ones, "all", or those named, [supply] being the leg's as in a problem;
    UsageError for another name."""
    names = [i.name for i in influences]
    if not wanted:
        return [i.name for i in influences if i.part_of is None][:LEADING]
    wanted = [f"leg.{name}" if name.startswith("supply.") else name for name in wanted]
    for name in wanted:
        if name not in (*names, "all"):
            raise UsageError(f"--confirm {name}: there is no such entry{did_you_mean(name, names)}; or say all")
    return names if "all" in wanted else list(wanted)


def confirmed(solution: Solution, influence: Influence) -> Influence:
    """The influence with its finite difference, from two solves."""
    return replace(influence, difference=_difference(solution, stored_nlp(solution), influence))


def _difference(solution: Solution, nlp: NlpSolution, i: Influence) -> Difference:
    if i.kinked:  # each side counts by itself, so that the middle must have been solved alike
        nlp = replace(nlp, objective=solve_again(nlp, solution.design, solution.objective).objective)
    noise, slope = settled_within(solution), max(abs(i.per_unit), abs(i.less_per_unit or 0.0), 1e-12)
    if not i.value:
        if slope < SLIGHTEST_SLOPE * Scale.of(solution.design.leg).length:
            return Difference(fault="not solved again: it is 0, and hardly matters")
        return _over(solution, nlp, i, FELT_SHARE * abs(nlp.objective) / slope, noise)
    wide = abs(i.value) * float(np.clip(noise / (NOISE_SHARE * abs(i.value) * slope), RELATIVE_STEP, WIDEST_STEP))
    found, narrow = _over(solution, nlp, i, wide, noise), RELATIVE_STEP * abs(i.value)
    if found.fault and wide > narrow:
        found = _over(solution, nlp, i, narrow, noise)
    sides = i.per_unit, i.less_per_unit
    if found.fault or found.agrees(*sides):
        return found
    closer = _over(solution, nlp, i, CLOSER_STEP * wide, SOLVED * abs(nlp.objective))  # over a smaller step less bends
    return closer if not closer.fault and closer.agrees(*sides) else found


def _over(solution: Solution, nlp: NlpSolution, i: Influence, h: float, noise: float) -> Difference:
    """The difference over a step of h [the entry's unit]."""
    heights, ways, step = list[float](), _ways(solution.design, i, h), h / (abs(i.value) or 1.0)
    for value in (i.value + way * h for way in ways):
        try:
            again = solve_again(nlp, with_entry(solution.design, i.name, value), solution.objective)
        except ValidationError:
            return Difference(step, fault=f"not solved again: {value:g} is more or less than it may be")
        except (UsageError, SolverError) as error:  # no start pose, or limits that cross
            return Difference(step, fault=f"not solved again at {value:g}: {one_line(error)}")
        if not again.success:
            return Difference(step, fault=f"not solved again at {value:g}: {again.status}")
        heights.append(again.objective)
    (one, two), here = heights, nlp.objective
    if ways != (1, -1):  # an entry at the end of what it may be: a parabola through three points on the other side
        side, slope = ways[0], ways[0] * (4 * one - two - 3 * here) / (2 * h)
        return Difference(step, slope, *(side * (one - here) / h, np.nan)[::side], noise=4 * noise / h)
    return Difference(step, (one - two) / (2 * h), (one - here) / h, (here - two) / h, noise / h)


def _ways(design: Design, i: Influence, h: float) -> tuple[int, int]:
    """Steps of h at which to solve again: up and down, or twice to one side if the entry may not be more or less."""

    def allowed(way: int) -> bool:
        with suppress(ValidationError):
            return bool(with_entry(design, i.name, i.value + way * h))
        return False

    return (1, -1) if allowed(1) and allowed(-1) else (1, 2) if allowed(1) else (-1, -2)


def with_entry(design: Design, path: str, value: float) -> Design:
    """The problem with another value of one entry, or of one in a list: "hop.stance_duration[1]".

    Raises ValueError if it cannot have that value.
    """
    data = design.model_dump(exclude_none=True)
    *tables, last = path.split(".")
    inner: Any = data
    for table in tables:
        inner = inner.setdefault(table, {})
    if found := re.fullmatch(r"(.+)\[(\d+)\]", last):
        last, listed = found[1], list(inner[found[1]])
        listed[int(found[2])] = value
        inner[last] = tuple(listed)
    else:
        inner[last] = value
    return Design.model_validate(data)


def solve_again(old: NlpSolution, design: Design, objective: str) -> NlpSolution:
    """The optimum of a slightly different problem on the same mesh, with the same limits enforced between the nodes or
    tightened by as much."""
    before, b = old.transcription, old.bounds
    t, guess = Transcription(Hop(design, objective).problem, before.scheme, before.mesh), before.guess_from(old.phases)
    enforced, given = enforcing(t, enforced_in(old)), (*before.bounds(guess), before.lbg, before.ubg)
    rows = given[2:] if holds(before) else (b.low_g, b.high_g)  # those enforced between the nodes are not tightened
    bounds = Bounds(*map(_moved, (*t.bounds(guess), t.lbg, t.ubg), (b.low_z, b.high_z, *rows), given))
    program, lam_g = enforced.transcription, enforced.multipliers(old.lam_g)
    start = replace(old, transcription=program, p=t.parameter_values(), lam_g=lam_g)
    solution = NlpSolver(program, WARM).again(start, bounds)
    return solution if solution.success else NlpSolver(program).again(start, bounds)


def _moved(new: np.ndarray, tightened: np.ndarray, given: np.ndarray) -> np.ndarray:
    """New limits, tightened by as much as the given ones were."""
    by = np.zeros(len(new))
    np.subtract(tightened, given, out=by, where=tightened != given)  # not where both are infinite
    return new + by
