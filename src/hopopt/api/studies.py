"""What a Python program asks of many hops: studies, fronts, plans that hold for many legs, hops that follow each other.

What is returned has methods (``results``). Nothing is written but where a folder is given; only a study keeps its points,
among temporary files.
"""

import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hopopt.api.asked import Constraint, Objective, Problem, Progress, as_class, renamed, told, within
from hopopt.api.keeping import check_can_be_kept, kept
from hopopt.api.results import Choice, Front, Map, RobustHop, Study, Transition
from hopopt.comparison.hops import transition as transitions
from hopopt.comparison.robust import robust as robustness
from hopopt.design import Design
from hopopt.errors import UsageError
from hopopt.planner import solution
from hopopt.problem.catalogue import Entry
from hopopt.problem.load import as_design, catalogue_of
from hopopt.problem.own import check_can_be_sent, name_of, with_constraints
from hopopt.studies.choose.each import choose_each
from hopopt.studies.choose.run import choose as chosen
from hopopt.studies.maps.run import check_verify_best, run_map
from hopopt.studies.pareto import trace as fronts
from hopopt.studies.sweep.definition import define
from hopopt.studies.sweep.run import run


@renamed(design="problem")
def sweep(
    problem: Problem,
    vary: Mapping[str, Any],
    *,
    objective: Objective = "clearance",
    constraints: Sequence[Constraint] = (),
    sample: str | None = None,
    seed: int = 0,
    starts: int | None = None,
    processes: int | None = None,
    scheduler: str | None = None,
    time_limit: float | None = None,
    results: str | Path | None = None,
    resume: str | Path | None = None,
    preliminary: bool = False,
    verify_best: int = 0,
    progress: Progress = None,
) -> Study:
    """Solve and verify a problem at every point of a study.

    problem: a problem, its name or file
    vary: entry -> "lower:upper:count", a list of values or, with a sample, (lower, upper)
    objective: the name of one, or a function of your own
    constraints: path constraints of your own, functions or their names
    sample: "lhs:40" or "sobol:64" for so many points of a design of experiments; None: a grid
    seed: of the sample
    starts: search every point from so many (None: seeds and spots alone)
    processes: as in ``solve``
    scheduler: the address of a Dask scheduler, or "local" for a cluster of so many processes on this computer
    time_limit: [s], when nothing more is begun; what is finished is kept (None: no limit)
    results: the folder below which a new one keeps every point (None: in a folder for temporary files)
    resume: the folder of a study that was stopped; it goes on there
    preliminary: solve every point on the first mesh alone and verify some drawn ones; what is returned is a ``Map``
    verify_best: of the preliminary points, how many of the best are verified
    progress: a function that is told a line of text; True: lines on standard error; None: a bar in a notebook

    Raises UsageError if the study makes no sense, ResultError if its folder cannot be used.
    """
    check_verify_best(verify_best, preliminary)
    check_can_be_sent(processes, objective, *constraints)
    design = with_constraints(as_design(problem), constraints)
    definition = define(
        design, vary, objective=name_of(objective), sample=sample, seed=seed, starts=starts, preliminary=preliminary,
        entries=_nameable(problem),
    )  # fmt: skip
    settings: dict[str, Any] = {
        "processes": processes, "scheduler": scheduler, "progress": told(progress), "until": within(time_limit),
        **_places(results, resume),
    }  # fmt: skip
    if preliminary:
        return as_class(Map, run_map(definition, verify_best=verify_best, **settings))
    return as_class(Study, run(definition, **settings))


def _nameable(problem: Problem, overrides: Mapping[str, Any] | None = None) -> dict[str, Entry]:
    """Motors and gears that a problem can name; one that is no file any more can name the built-in ones."""
    return catalogue_of(problem if isinstance(problem, str | Path) else "paper", overrides or {})


def _places(results: str | Path | None, resume: str | Path | None) -> dict[str, Any]:
    """Below which folder a study is kept, and which one goes on: where neither is given, in a folder for temporary files."""
    if results is None and resume is None:
        results = tempfile.mkdtemp(prefix="hopopt-")
    return {"results": Path(results or "."), "resume": None if resume is None else Path(resume)}


def choose(
    problem: Problem,
    clearance: float,
    *,
    joints: Sequence[str] | None = None,
    only: Sequence[str] | None = None,
    each: bool = False,
    legs: int = 1,
    by: str = "mass",
    verify: int = 3,
    present_mass: float | None = None,
    catalogue: str | Path | None = None,
    starts: int = 1,
    processes: int | None = None,
    scheduler: str | None = None,
    time_limit: float | None = None,
    results: str | Path | None = None,
    resume: str | Path | None = None,
    progress: Progress = None,
) -> Choice:
    """Every motor with every gear on a leg: which pairs clear a height, the best first, and what the others lack.

    problem: a problem, its name or file
    clearance: what the hop must clear [m]
    joints: whose drives are chosen, with one pair; the others keep theirs (None: all)
    only: names of motors and gears that are tried, or patterns such as "csf-*" (None: all)
    each: whether each of the joints has a pair of its own: the lightest combinations that clear
    legs: of the robot whose body the leg carries, with the drives of all of them
    by: mass, price, energy or peak-power
    verify: how many of the first are solved and verified in full; the others are preliminary
    present_mass: of the present drives of one leg's chosen joints [kg], which leg.body.mass counts
    catalogue: a .toml or .csv file of motors and gears of your own, beside the built-in ones and the problem's
    starts: of each that is verified, beside the hop that it has already; 6 search as ``solve`` does
    processes, scheduler, time_limit, results, resume, progress: as in ``sweep``; pairs that no time was left for are not solved

    Raises UsageError for what cannot be asked, ProblemFileError for a catalogue with faults.
    """
    own = {} if catalogue is None else {"catalogue": str(catalogue)}
    entries = _nameable(problem, own)
    found = (choose_each if each else chosen)(
        as_design(problem), clearance, joints=joints, only=only, legs=legs, by=by, verify=verify, present_mass=present_mass,
        entries=entries, starts=starts, processes=processes, scheduler=scheduler, progress=told(progress),
        until=within(time_limit), **_places(results, resume),
    )  # fmt: skip
    return as_class(Choice, found)


@renamed(design="problem")
def pareto(
    problem: Problem,
    against: Objective = "energy",
    *,
    constraints: Sequence[Constraint] = (),
    points: int = 8,
    lowest: float | None = None,
    starts: int | None = None,
    processes: int | None = None,
    time_limit: float | None = None,
    results: str | Path | None = None,
    progress: Progress = None,
) -> Front:
    """The Pareto front of the clearance against an economical objective.

    problem: a problem, its name or file
    against: energy, absolute_work, electrical_energy, time, saturation, peak_torque or peak_force; or a function of your own
    constraints: path constraints of your own, functions or their names
    points: how many hops, 3 to 1000, the two ends counted
    lowest: the clearance [m] at which it begins (None, and of a periodic hop at least: a fifth of the highest)
    starts, processes: as in ``solve``
    time_limit: [s], when nothing more is begun; what is finished is kept (None: no limit)
    results: the folder below which a new one keeps every point (None: nothing is written)
    progress: a function that is told a line of text; True: lines on standard error; None: a bar in a notebook

    Raises UsageError for what is no front, NotSolvedError if an end cannot be solved.
    """
    check_can_be_sent(processes, against, *constraints)
    found = fronts.front(
        with_constraints(as_design(problem), constraints), name_of(against), points=points, lowest=lowest, starts=starts, processes=processes,
        results=None if results is None else Path(results), progress=told(progress), until=within(time_limit),
    )  # fmt: skip
    return Front.with_methods(found)


def robust(
    problem: Problem | solution.Solution,
    *,
    constraints: Sequence[Constraint] = (),
    share: float = 0.95,
    confidence: float = 0.95,
    draws: int = 200,
    evaluations: int = 8,
    seed: int = 0,
    starts: int | None = None,
    processes: int | None = None,
    time_limit: float | None = None,
    results: str | Path | None = None,
    progress: Progress = None,
) -> RobustHop:
    """The plan and tracker with the greatest clearance that a share of the legs within ``[uncertainty]`` reaches.

    problem: a problem, its name or file, or its highest hop
    constraints: path constraints of your own, functions or their names, where the hop is not given
    share, confidence: the share of all legs that must reach it, and the confidence of that statement
    draws: fresh legs on which the promise stands
    evaluations: reserves that are tried, and programs for several legs at most
    seed: of the draws
    starts, processes: of each bound's solve, as in ``solve``
    time_limit: [s] for bounds and plans, of which the best so far is judged (None: 900)
    results: the folder below which a new one keeps what was found (None: nothing is written)
    progress: a function that is told a line of text; True: lines on standard error; None: a bar in a notebook

    Raises UsageError without uncertainty and for promises that so few draws cannot make, NotSolvedError without a plan.
    """
    check_can_be_sent(processes, *constraints)
    check_can_be_kept(results)
    design, bound = _with_hop(problem, constraints)
    found = robustness.robust(
        design, share=share, confidence=confidence, draws=draws, evaluations=evaluations, seed=seed, starts=starts,
        seconds=robustness.SECONDS_OF_SEARCH if time_limit is None else time_limit,
        processes=processes or os.cpu_count() or 1, bound=bound, progress=told(progress),
    )  # fmt: skip
    return kept(RobustHop.with_methods(found), results)


def transition(
    problem: Problem | solution.Solution,
    begin: solution.Solution | None = None,
    clearances: Sequence[float] = (),
    *,
    constraints: Sequence[Constraint] = (),
    most: int = transitions.MOST,
    starts: int | None = None,
    processes: int | None = None,
    time_limit: float | None = None,
    results: str | Path | None = None,
    progress: Progress = None,
) -> Transition:
    """The fewest hops from rest, or from the periodic hop ``begin``, onto a periodic hop: one program, of least effort.

    problem: the periodic hop on which they end; or a problem, its name or file, whose highest one is solved for
    begin: the periodic hop from which they start; None from rest
    clearances: what each hop must clear at least [m]; so many hops
    constraints: path constraints of your own, functions or their names, where the periodic hop is not given
    most: how many hops are tried at most, where ``clearances`` does not say it
    starts, processes: of the periodic hop that is solved for, as in ``solve``
    time_limit: [s] after which no way is looked for any more (None: 600 for each)
    results: the folder below which a new one keeps what was found (None: nothing is written)
    progress: a function that is told a line of text; True: lines on standard error; None: a bar in a notebook

    Raises UsageError for hops that are not periodic or of another leg, NotSolvedError if no number of hops leads there.
    """
    check_can_be_sent(processes, *constraints)
    check_can_be_kept(results)
    design, orbit = _with_hop(problem, constraints)
    found = transitions.transition(
        design, begin=begin, orbit=orbit, clearances=clearances, most=most, starts=starts,
        processes=processes or os.cpu_count() or 1, progress=told(progress), until=within(time_limit),
    )  # fmt: skip
    return kept(Transition.with_methods(found), results)


def _with_hop(
    problem: Problem | solution.Solution, constraints: Sequence[Constraint]
) -> tuple[Design, solution.Solution | None]:
    """The problem, and its hop if it was given as that; UsageError for constraints that come too late for it."""
    if not isinstance(problem, solution.Solution):
        return with_constraints(as_design(problem), constraints), None
    if constraints:
        raise UsageError("this hop is solved already: give its problem, or solve it with these constraints")
    return problem.design, problem
