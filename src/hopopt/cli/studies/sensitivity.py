"""Commands that study a design: sensitivity."""

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from hopopt import amounts
from hopopt.cli.options import AsJson, Overrides, progress
from hopopt.errors import UsageError

if TYPE_CHECKING:
    from hopopt.planner.solution import Solution
    from hopopt.studies.influence import Influence

Confirm = Annotated[
    list[str] | None,
    Parameter(
        name="--confirm",
        negative=(),
        consume_multiple=True,
        help="Solve again with the leading five a little larger and smaller; or with all, or with the entries named "
        "(default: those for which more and less differ).",
    ),
]


def sensitivity(
    problem: str | None = None,
    *,
    result: Path | None = None,
    objective: str = "clearance",
    set_: Overrides = None,
    starts: int | None = None,
    confirm: Confirm = None,
    results: Path = Path("results"),
    figures: bool = True,
    json_: AsJson = False,
) -> int:
    """Say what to change first: what 1 % more of each entry brings.

    Exit code: 0 reported for a verified optimum, 1 not solved, 2 wrong usage, 3 not verified: nothing is reported.

    Parameters
    ----------
    problem
        A problem file, or the name of a built-in one (default: paper).
    result
        A folder that hopopt solve wrote, in place of a problem: its optimum is verified again, not solved again.
    objective
        What is made as large as possible: clearance or apex.
    starts
        How many different starting points to solve from (default: the problem's solver.starts).
    results
        Folder for the results; each run gets a new folder inside it.
    figures
        Draw the figure.
    """
    if result is not None and (problem, set_, starts, objective) != (None, None, None, "clearance"):
        raise UsageError("--result names an optimum that is there: leave out the problem, --set, --objective, --starts")
    if problem is not None and (Path(problem) / "summary.json").is_file():
        raise UsageError(f"{problem} is a result, not a problem: hopopt sensitivity --result {problem}")
    amounts.check("starts", starts)
    from hopopt.storage.folder import as_json, fitting, prepare
    from hopopt.studies import sensitivity as study

    prepare(results)
    with fitting(result) if result else nullcontext(), progress(quiet=json_) as say:
        solution, failed = _optimum(problem or "paper", result, objective, set_ or [], starts, say)
        influences = [] if failed else _confirmed(solution, study.sensitivity(solution), confirm, say)
        data: dict[str, Any] = study.as_dict(solution, influences, failed)
        if not failed:
            data["result_dir"] = str(_saved(solution, influences, data, results, figures))
    if json_:
        print(as_json(data))
        return data["exit_code"]
    from hopopt.cli.screen.sensitivity import print_sensitivity

    print_sensitivity(data, influences)
    return data["exit_code"]


def _optimum(
    problem: str, folder: Path | None, objective: str, overrides: list[str], starts: int | None, say: Any
) -> "tuple[Solution, list[str]]":
    """The optimum, stored or solved for, and the checks that it fails."""
    if folder is not None:
        from hopopt.storage.seal.recheck import recheck
        from hopopt.storage.solution import read

        say("verifying")
        solution = read(folder)
        return solution, [*solution.doubts, *recheck(solution).failed_checks]
    from hopopt.ocp.objectives.objective import HEIGHTS
    from hopopt.ocp.objectives.registry import find
    from hopopt.planner.solve import solve
    from hopopt.problem.load import load

    if find(objective).figure not in HEIGHTS:
        raise UsageError(
            f"what to change first is reported for heights, not for {objective}: --objective clearance or apex"
        )
    design = load(problem, overrides)
    solution = solve(design, objective, starts=starts, progress=say)
    return solution, list(solution.summary.failed_checks)


def _confirmed(
    solution: "Solution", influences: "list[Influence]", wanted: list[str] | None, say: Any
) -> "list[Influence]":
    """The influences, those that are wanted with their finite differences: unless others are named, those at a kink."""
    kinked = [i.name for i in influences if i.kinked and i.part_of is None]
    if wanted is None and not kinked:
        return influences
    from hopopt.studies.finite_differences import LEADING, chosen, confirmed

    names, found = kinked[:LEADING] if wanted is None else chosen(influences, wanted), []
    for i in influences:
        if i.name in names:
            say(f"solving again with a little more and a little less of {i.name}")
        found.append(confirmed(solution, i) if i.name in names else i)
    return found


def _saved(
    solution: "Solution", influences: "list[Influence]", data: dict[str, Any], results: Path, draw: bool
) -> Path:
    from hopopt.storage.runs import save_runs

    if not draw:
        return save_runs("sensitivity", solution.design, data, {}, results)
    from hopopt.plots.studies.sensitivity import save_all

    return save_runs("sensitivity", solution.design, data, {}, results, lambda f: save_all(solution, influences, f))
