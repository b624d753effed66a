"""The command that traces what a clearance costs: pareto."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from hopopt import amounts
from hopopt.cli.expected_time import ExpectedTime
from hopopt.cli.options import AsJson, Constraints, Figure, Overrides, Problem, drawn, ended, note
from hopopt.cli.screen.console import progress
from hopopt.cli.screen.studies import of_front
from hopopt.errors import UsageError
from hopopt.plots.studies.pareto import save
from hopopt.problem.load import load
from hopopt.problem.own import name_of, with_constraints
from hopopt.studies.pareto.front import Front
from hopopt.studies.pareto.trace import front


def pareto(
    problem: Problem = "paper",
    *,
    against: str = "energy",
    points: int = 8,
    constraint: Constraints = None,
    lowest: Annotated[float | None, Parameter(name="--from")] = None,
    set_: Overrides = None,
    starts: int | None = None,
    processes: int | None = None,
    results: Path = Path("results"),
    figures: Figure = True,
    json_: AsJson = False,
) -> int:
    """Find the least energy, force or time for each clearance.

    That is the Pareto front of the clearance against another objective. Its upper end is the highest hop with what it happens to cost, which may be more than the least at that clearance.

    Exit code: 0 every point verified, 1 none (or an end not solved), 2 wrong usage, 3 some not verified, 130 stopped:
    what is finished is kept.

    Parameters
    ----------
    against
        What is to be small: energy, absolute_work, electrical_energy, time, saturation, peak_torque or peak_force; or a function
        of your own as module:function (docs/objectives.md).
    points
        How many hops, 3 to 1000, the two ends counted.
    lowest
        The clearance [m] at which the front begins (default: a fifth of the highest; 0: the least of the other objective,
        where the leg may hardly leave the ground).
    starts
        How many different starting points to solve both ends from (default: the problem's solver.starts).
    processes
        How many of them side by side (default: one for each core).
    results
        Folder for the results; each front gets a new folder inside it.
    """
    amounts.check("starts", starts)
    amounts.check_processes(processes)
    if lowest is not None and not 0 <= lowest < 20:
        raise UsageError(f"--from {lowest}: a clearance from 0 to 20 m is needed")
    design = with_constraints(load(problem, set_ or ()), constraint or ())
    begun, stopped = list[Front](), False
    try:
        parts = {"solve": 2.0, "point of a front": float(points)}
        with progress(json_, ExpectedTime("pareto", design, parts)) as say:
            front(
                design, name_of(against), points=points, lowest=lowest, starts=starts, processes=processes, results=results,
                progress=say, begun=begun.append,
            )  # fmt: skip
    except KeyboardInterrupt:
        if not begun or not begun[0].points:
            raise
        note(f"interrupted; what is finished is kept in {begun[0].folder}")
        stopped = True
    found, folder = begun[0], begun[0].folder
    if figures and folder is not None:
        drawn(lambda: save(found, folder / "figures"), "figures are missing", f"the data in {folder} are complete")
    return ended(found.as_dict(), json_, of_front(found), 130 if stopped else found.exit_code)
