"""What a Python program asks hopopt for, one verb for each command that computes something.

``problem`` is a problem of ``load``, or its name or file. What is returned has methods (``solution``, ``results``).
Nothing is written but where a folder is given; only a study keeps its points, among temporary files.
"""

import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hopopt.api.asked import Progress, as_class, renamed, told
from hopopt.api.program import Program, ProgramSolution
from hopopt.api.results import Front, Map, RobustHop, Run, Study, Transition
from hopopt.api.solution import Solution
from hopopt.comparison.hops import transition as transitions
from hopopt.comparison.robust import robust as robustness
from hopopt.comparison.simulation import followed
from hopopt.control import closed_loop
from hopopt.control.strategies import find
from hopopt.design import Design, refuse_landed
from hopopt.errors import UsageError
from hopopt.ocp.custom import Custom, Moment
from hopopt.ocp.free_parameters import FreeParameters
from hopopt.ocp.hop import Hop
from hopopt.ocp.objectives.objective import HopObjective
from hopopt.ocp.objectives.registry import find as find_objective
from hopopt.planner import solution
from hopopt.planner import solve as planner
from hopopt.planner.reserve import plan_to_track
from hopopt.planner.search.multistart import first_transcription
from hopopt.problem.load import as_design
from hopopt.problem.own import check_can_be_sent, name_of, with_constraints
from hopopt.storage import solution as storage
from hopopt.studies import codesign as studies_codesign
from hopopt.studies.maps.run import check_verify_best, run_map
from hopopt.studies.pareto import trace as fronts
from hopopt.studies.sweep.definition import define
from hopopt.studies.sweep.run import run

if TYPE_CHECKING:
    from hopopt.robot_data.identification import Identification

Problem = Design | str | Path
Objective = str | Callable[[Moment], Any] | HopObjective
Constraint = str | Callable[[Moment], Any] | Custom


@renamed(design="problem")
def solve(
    problem: Problem,
    objective: Objective = "clearance",
    *,
    constraints: Sequence[Constraint] = (),
    free: Mapping[str, tuple[float, float]] | None = None,
    couple: Sequence[str] = (),
    starts: int | None = None,
    processes: int | None = None,
    structure: bool = False,
    cross_check: bool = False,
    time_limit: float | None = None,
    guess: "solution.Solution | ProgramSolution | None" = None,
    progress: Progress = False,
) -> Solution:
    """The best hop of a leg: solved from several starts, refined, verified; with ``free``, of the best leg.

    problem: a problem, its name or file
    objective: the name of one, a function of your own, or its name "module:function"
    constraints: path constraints of your own, functions or their names
    free: entries of the leg that are optimised too, entry -> (lowest, highest); the solution's ``design`` has the best
    couple: equations or inequalities between entries, such as "leg.thigh.length + leg.shank.length = 0.741"
    starts: how many starting points (None: the problem's solver.starts)
    processes: how many are solved side by side (None: the cores)
    structure: solve the best once more with the switches of its drives at free times
    cross_check: solve with another solver and other schemes too
    guess: a hop that was solved, or a solution of a ``program``, from which it is solved as well; with ``starts=1`` that
        and one start
    time_limit: [s] after which the best hop so far is the answer (None: 600)
    progress: a function that is told a line of text, or True for lines on standard error

    A hop that fails verification has ``verified`` False. Raises NotSolvedError, with the worst constraints, for none,
    UsageError for what is no problem or cannot be asked of it.
    """
    begin = guess.nlp if isinstance(guess, ProgramSolution) else guess
    if free is None:
        if couple:
            raise UsageError(
                'couple relates numbers that are free: give them too, free={"leg.thigh.length": (0.3, 0.45)}'
            )
        found = planner.solve(
            as_design(problem), objective, constraints=constraints, starts=starts, processes=processes,
            structure=structure, cross_check=cross_check, time_limit=time_limit, guess=begin, progress=told(progress),
        )  # fmt: skip
        return Solution.with_methods(found)
    if structure or cross_check:
        asked = "structure" if structure else "cross_check"
        raise UsageError(f"{asked} goes with a design that is given: ask it of the design that free finds")
    found = studies_codesign.codesign(
        as_design(problem), free, objective, couple=couple, constraints=constraints, starts=starts, processes=processes,
        time_limit=time_limit, guess=begin, progress=told(progress),
    )  # fmt: skip
    return Solution.with_methods(found)


def program(
    problem: Problem | solution.Solution,
    objective: Objective = "clearance",
    *,
    constraints: Sequence[Constraint] = (),
    free: Mapping[str, tuple[float, float]] | None = None,
    couple: Sequence[str] = (),
) -> Program:
    """The nonlinear program of a problem on its first mesh, at hand: expressions, names, bounds, sparsity, dynamics, solver.

    problem: a problem, its name or file; or a hop, whose program on its last mesh is meant, with its vectors as the guess
    objective, constraints, free, couple: as in ``solve``; of a hop they are its own

    Raises UsageError for what is no problem or cannot be asked of it.
    """
    if isinstance(problem, solution.Solution):
        nlp = solution.stored_nlp(problem)
        return Program(solution.hop_of(problem), nlp.transcription, nlp.z)
    design = with_constraints(as_design(problem), constraints)
    parameters = studies_codesign.checked(design, free, couple) if free else FreeParameters()
    hop = Hop(design, find_objective(name_of(objective)), parameters)
    return Program(hop, first_transcription(hop))


def read(folder: str | Path) -> Solution:
    """A solution from the folder that it was saved in.

    folder: a results folder of ``save`` or ``hopopt solve``; ``doubts`` of the solution name files that were changed

    Raises ResultError if something is missing or broken.
    """
    return Solution.with_methods(storage.read(folder))


def save(
    solution: solution.Solution, results: str | Path = "results", figures: storage.Figures | None = None
) -> Solution:
    """Write a solution into a new folder; the solution with its folder noted, ``result_dir``.

    results: the folder below which
    figures: called with the solution and a folder, draws what is to lie there

    Raises ResultError if it cannot be written; the data are then kept in a folder for temporary files.
    """
    return Solution.with_methods(storage.save(solution, results, figures))


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
    results: str | Path | None = None,
    resume: str | Path | None = None,
    preliminary: bool = False,
    verify_best: int = 0,
    progress: Progress = False,
) -> Study:
    """Solve and verify a problem at every point of a study.

    problem: a problem, its name or file
    vary: entry -> "lower:upper:count", a list of values or, with a sample, (lower, upper)
    objective: the name of one, or a function of your own
    constraints: path constraints of your own, functions or their names
    sample: "lhs:40" or "sobol:64" for so many points of a design of experiments; None: a grid
    seed: of the sample
    starts, processes: as in ``solve``
    scheduler: the address of a Dask scheduler, or "local" for a cluster of so many processes on this computer
    results: the folder below which a new one keeps every point (None: in a folder for temporary files)
    resume: the folder of a study that was stopped; it goes on there
    preliminary: solve every point on the first mesh alone and verify some drawn ones; what is returned is a ``Map``
    verify_best: of the preliminary points, how many of the best are verified
    progress: a function that is told a line of text, or True for lines on standard error

    Raises UsageError if the study makes no sense, ResultError if its folder cannot be used.
    """
    check_verify_best(verify_best, preliminary)
    check_can_be_sent(processes, objective, *constraints)
    design = with_constraints(as_design(problem), constraints)
    definition = define(
        design, vary, objective=name_of(objective), sample=sample, seed=seed, starts=starts, preliminary=preliminary
    )
    if results is None and resume is None:
        results = tempfile.mkdtemp(prefix="hopopt-")
    settings: dict[str, Any] = {
        "processes": processes, "scheduler": scheduler, "results": Path(results or "."), "progress": told(progress),
        "resume": None if resume is None else Path(resume),
    }  # fmt: skip
    if preliminary:
        return as_class(Map, run_map(definition, verify_best=verify_best, **settings))
    return as_class(Study, run(definition, **settings))


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
    results: str | Path | None = None,
    progress: Progress = False,
) -> Front:
    """The Pareto front of the clearance against an economical objective.

    problem: a problem, its name or file
    against: energy, absolute_work, electrical_energy, time, saturation, peak_torque or peak_force; or a function of your own
    constraints: path constraints of your own, functions or their names
    points: how many hops, 3 to 1000, the two ends counted
    lowest: the clearance [m] at which it begins (None, and of a periodic hop at least: a fifth of the highest)
    starts, processes: as in ``solve``
    results: the folder below which a new one keeps every point (None: nothing is written)
    progress: a function that is told a line of text, or True for lines on standard error

    Raises UsageError for what is no front, NotSolvedError if an end cannot be solved.
    """
    check_can_be_sent(processes, against, *constraints)
    found = fronts.front(
        with_constraints(as_design(problem), constraints), name_of(against), points=points, lowest=lowest, starts=starts, processes=processes,
        results=None if results is None else Path(results), progress=told(progress),
    )  # fmt: skip
    return Front.with_methods(found)


def simulate(
    problem: Problem,
    strategy: str = "force",
    *,
    plan: solution.Solution | None = None,
    plant: Design | None = None,
    hops: int = 1,
    options: Mapping[str, Any] | None = None,
    progress: Progress = False,
) -> Run:
    """Hop the simulated leg with a controller: its ``figures`` and its ``trace`` over time.

    problem: a problem, its name or file
    strategy: a built-in one, or your own as module:Class (docs/own_controller.md)
    plan: what ``track`` is to follow; without one it solves for its own
    plant: the true leg, if it differs from the one that the strategy believes in
    hops: how many
    options: settings of the strategy by name
    progress: a function that is told a line of text, or True for lines on standard error

    Raises UsageError for a leg, strategy or plan that cannot be simulated, NotSolvedError if there is no plan to track.
    """
    design, chosen = as_design(problem), find(strategy)
    refuse_landed(design, "a simulation from rest")
    closed_loop.make_plant(plant or design)  # what cannot be simulated is said before the work
    if plan is None and chosen.needs_plan:
        plan = plan_to_track(design, told(progress))
    reference = None if plan is None else followed(design, plan)
    found = closed_loop.simulate(design, chosen, plan=reference, plant=plant, hops=hops, options=options)
    return as_class(Run, found)


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
    progress: Progress = False,
) -> RobustHop:
    """The plan and tracker with the greatest clearance that a share of the legs within ``[uncertainty]`` reaches.

    problem: a problem, its name or file, or its highest hop
    constraints: path constraints of your own, functions or their names, where the hop is not given
    share, confidence: the share of all legs that must reach it, and the confidence of that statement
    draws: fresh legs on which the promise stands
    evaluations: reserves that are tried, and programs for several legs at most
    seed: of the draws
    starts, processes: of each bound's solve, as in ``solve``
    progress: a function that is told a line of text, or True for lines on standard error

    Raises UsageError without uncertainty and for promises that so few draws cannot make, NotSolvedError without a plan.
    """
    check_can_be_sent(processes, *constraints)
    design, bound = _with_hop(problem, constraints)
    found = robustness.robust(
        design, share=share, confidence=confidence, draws=draws, evaluations=evaluations, seed=seed, starts=starts,
        processes=processes or os.cpu_count() or 1, bound=bound, progress=told(progress),
    )  # fmt: skip
    return RobustHop.with_methods(found)


def transition(
    problem: Problem | solution.Solution,
    begin: solution.Solution | None = None,
    clearances: Sequence[float] = (),
    *,
    constraints: Sequence[Constraint] = (),
    most: int = transitions.MOST,
    starts: int | None = None,
    processes: int | None = None,
    progress: Progress = False,
) -> Transition:
    """The fewest hops from rest, or from the periodic hop ``begin``, onto a periodic hop: one program, of least effort.

    problem: the periodic hop on which they end; or a problem, its name or file, whose highest one is solved for
    begin: the periodic hop from which they start; None from rest
    clearances: what each hop must clear at least [m]; so many hops
    constraints: path constraints of your own, functions or their names, where the periodic hop is not given
    most: how many hops are tried at most, where ``clearances`` does not say it
    starts, processes: of the periodic hop that is solved for, as in ``solve``
    progress: a function that is told a line of text, or True for lines on standard error

    Raises UsageError for hops that are not periodic or of another leg, NotSolvedError if no number of hops leads there.
    """
    check_can_be_sent(processes, *constraints)
    design, orbit = _with_hop(problem, constraints)
    found = transitions.transition(
        design, begin=begin, orbit=orbit, clearances=clearances, most=most, starts=starts,
        processes=processes or os.cpu_count() or 1, progress=told(progress),
    )  # fmt: skip
    return Transition.with_methods(found)


def _with_hop(
    problem: Problem | solution.Solution, constraints: Sequence[Constraint]
) -> tuple[Design, solution.Solution | None]:
    """The problem, and its hop if it was given as that; UsageError for constraints that come too late for it."""
    if not isinstance(problem, solution.Solution):
        return with_constraints(as_design(problem), constraints), None
    if constraints:
        raise UsageError("this hop is solved already: give its problem, or solve it with these constraints")
    return problem.design, problem


def identify(problem: Problem, *runs: str | Path, known: Sequence[str] = ()) -> "Identification":
    """A leg's parameters from logs of its hops, with 95 % intervals; see ``hopopt identify``.

    problem: what is believed of the leg, a problem or its name or file
    runs: CSV files of logs
    known: keys of parameters that are right in the problem

    Raises UsageError for a leg that cannot be identified, ResultError for a log that is not readable or of this leg.
    """
    from hopopt.robot_data.identification import identify
    from hopopt.robot_data.robot_log import read_log

    design = as_design(problem)
    return identify(design, [read_log(Path(run), design) for run in runs], known)
