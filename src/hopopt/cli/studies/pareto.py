"""The command that traces what a clearance costs: pareto."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from hopopt import amounts
from hopopt.cli.options import AsJson, Overrides, progress
from hopopt.errors import UsageError

if TYPE_CHECKING:
    from hopopt.studies.pareto import Front


def pareto(
    problem: str = "paper",
    *,
    against: str = "energy",
    points: int = 8,
    lowest: Annotated[float, Parameter(name="--from")] = 0.0,
    set_: Overrides = None,
    starts: int | None = None,
    processes: int | None = None,
    results: Path = Path("results"),
    figures: bool = True,
    json_: AsJson = False,
) -> int:
    """Find the least energy, force or time for each clearance.

    That is the Pareto front of the clearance against another objective. Its upper end is the highest hop with what it happens to cost, which may be more than the least at that clearance.

    Exit code: 0 every point verified, 1 none (or an end not solved), 2 wrong usage, 3 some not verified, 130 stopped:
    what is finished is kept.

    Parameters
    ----------
    problem
        A problem file, or the name of a built-in one.
    against
        What is to be small: energy, absolute_work, electrical_energy, time, saturation, peak_torque or peak_force.
    points
        How many hops, 3 to 1000, the two ends counted.
    lowest
        The clearance [m] at which the front begins (default 0: the least of the other
        objective; a fifth of the highest for a periodic hop).
    starts
        How many different starting points to solve both ends from (default: the problem's solver.starts).
    processes
        How many of them side by side (default: one for each core).
    results
        Folder for the results; each front gets a new folder inside it.
    figures
        Draw the figure.
    """
    amounts.check("starts", starts)
    amounts.check_processes(processes)
    if not 0 <= lowest < 20:
        raise UsageError(f"--from {lowest}: a clearance from 0 to 20 m is needed")
    from hopopt.problem.load import load
    from hopopt.storage.folder import as_json
    from hopopt.studies.pareto import front

    design, begun = load(problem, set_ or ()), list["Front"]()
    code = None
    try:
        with progress(quiet=json_) as say:
            front(
                design, against, points=points, lowest=lowest, starts=starts, processes=processes, results=results,
                progress=say, begun=begun.append,
            )  # fmt: skip
    except KeyboardInterrupt:
        if not begun or not begun[0].points:
            raise
        print(f"hopopt: interrupted; what is finished is kept in {begun[0].folder}", file=sys.stderr)
        code = 130
    found = begun[0]
    if figures:
        _draw(found)
    if json_:
        print(as_json(found.as_dict()))
    else:
        from hopopt.cli.screen.pareto import print_front

        print_front(found)
    return found.exit_code if code is None else code


def _draw(found: "Front") -> None:
    import logging

    from hopopt.plots.studies.pareto import save
    from hopopt.storage.folder import reason_of

    assert found.folder is not None
    try:
        save(found, found.folder / "figures")
    except (Exception, KeyboardInterrupt) as error:  # the data are what took the time
        words = f"figures are missing ({reason_of(error)}); the data in {found.folder} are complete"
        logging.getLogger(__name__).warning(words)
