"""What a Python program asks hopopt for, one verb for each command that computes something.

``problem`` is a problem of ``load``, or its name or file. What is returned has methods (``solution``, ``results``).
Nothing is written but where a folder is given. Verbs for many hops at once: ``studies``.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hopopt.api.asked import Constraint, Objective, Problem, Progress, as_class, renamed, told, within
from hopopt.api.keeping import check_can_be_kept, kept
from hopopt.api.program import Program, ProgramSolution
from hopopt.api.results import Run
from hopopt.api.solution import Solution
from hopopt.comparison.simulation import followed
from hopopt.control import closed_loop
from hopopt.control.strategies import find, named
from hopopt.design import Design, refuse_landed
from hopopt.errors import UsageError
from hopopt.ocp.free_parameters import FreeParameters
from hopopt.ocp.hop import Hop
from hopopt.ocp.objectives.registry import find as find_objective
from hopopt.planner import solution
from hopopt.planner import solve as planner
from hopopt.planner.reserve import plan_to_track
from hopopt.planner.search.multistart import first_transcription
from hopopt.problem.load import as_design
from hopopt.problem.own import name_of, with_constraints
from hopopt.studies import codesign as studies_codesign

if TYPE_CHECKING:
    from hopopt.robot_data.identification import Identification


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
    results: str | Path | None = None,
    progress: Progress = None,
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
    results: the folder below which a new one keeps what was found (None: nothing is written)
    progress: a function that is told a line of text; True: lines on standard error; None: a bar in a notebook

    A hop that fails verification has ``verified`` False. Raises NotSolvedError, with the worst constraints, for none,
    UsageError for what is no problem or cannot be asked of it.
    """
    check_can_be_kept(results)
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
        return kept(Solution.with_methods(found), results)
    if structure or cross_check:
        asked = "structure" if structure else "cross_check"
        raise UsageError(f"{asked} goes with a design that is given: ask it of the design that free finds")
    found = studies_codesign.codesign(
        as_design(problem), free, objective, couple=couple, constraints=constraints, starts=starts, processes=processes,
        time_limit=time_limit, guess=begin, progress=told(progress),
    )  # fmt: skip
    return kept(Solution.with_methods(found), results)


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


def simulate(
    problem: Problem,
    strategy: str | type = "force",
    *,
    plan: solution.Solution | None = None,
    plant: Design | None = None,
    hops: int = 1,
    options: Mapping[str, Any] | None = None,
    time_limit: float | None = None,
    results: str | Path | None = None,
    progress: Progress = None,
) -> Run:
    """Hop the simulated leg with a controller: its ``figures`` and its ``trace`` over time.

    problem: a problem, its name or file
    strategy: the name of a built-in one, or your own, the class or its name module:Class (docs/own_controller.md)
    plan: what ``track`` is to follow; without one it solves for its own
    plant: the true leg, if it differs from the one that the strategy believes in
    hops: how many
    options: settings of the strategy by name
    time_limit: [s] of the solve for a plan that is tracked, if none is given (None: 600)
    results: the folder below which a new one keeps what was found (None: nothing is written)
    progress: a function that is told a line of text; True: lines on standard error; None: a bar in a notebook

    Raises UsageError for a leg, strategy or plan that cannot be simulated, NotSolvedError if there is no plan to track.
    """
    check_can_be_kept(results)
    design, chosen = as_design(problem), find(named(strategy))
    refuse_landed(design, "a simulation from rest")
    closed_loop.make_plant(plant or design)  # what cannot be simulated is said before the work
    if plan is None and chosen.needs_plan:
        plan = plan_to_track(design, told(progress), within(time_limit))
    reference = None if plan is None else followed(design, plan)
    found = closed_loop.simulate(design, chosen, plan=reference, plant=plant, hops=hops, options=options)
    return kept(as_class(Run, found), results)


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
