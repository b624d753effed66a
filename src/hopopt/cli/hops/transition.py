"""The command that leads from rest, or from one periodic hop, onto another."""

import os
import time
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from hopopt.cli.options import AsJson, Overrides, progress, repeated


def transition(
    problem: str | None = None,
    *,
    set_: Overrides = None,
    from_: Annotated[Path | None, Parameter(name="--from")] = None,
    to: Path | None = None,
    clearance: Annotated[
        list[float] | None,
        repeated("--clearance", "What a hop must clear at least [m], one for each hop in turn (repeat)."),
    ] = None,
    most: int = 4,
    starts: int | None = None,
    results: Path = Path("results"),
    figures: bool = True,
    json_: AsJson = False,
) -> int:
    """Find the fewest hops from rest onto a hop that repeats itself.

    Or from one periodic hop onto another.

    All hops are one program: stance, flight, descent and impact, hop by hop, up to the state in which the orbit's stance
    begins. Of all ways in so many hops it is the one of least effort. The plan (runs.nc) is in the results folder.

    Exit code: 0 verified, 1 no way was found, 2 wrong usage, 3 not verified.

    Parameters
    ----------
    problem
        A problem file, or the name of a built-in one (default: that of --to, or paper).
    from_
        A stored periodic hop from which all begins (default: rest, in the problem's start pose).
    to
        A stored periodic hop on which all ends (default: the highest, which is solved for).
    most
        How many hops are tried at most, where --clearance does not say it.
    starts
        Starting points of the periodic hop that is solved for (default: the problem's solver.starts).
    results
        Folder for the results; each run gets a new folder inside it.
    figures
        Draw the figure.
    """
    began = time.perf_counter()
    from hopopt.comparison.compare import planned_trace
    from hopopt.comparison.hops import transition as studying
    from hopopt.plots.transition import save_all
    from hopopt.problem.load import load
    from hopopt.storage.folder import as_json, prepare
    from hopopt.storage.runs import save_runs
    from hopopt.storage.solution import read, save

    begin, orbit = (None if folder is None else read(folder) for folder in (from_, to))
    words = ["hop.kind=periodic", *(set_ or ())]
    design = load(problem or "paper", words) if orbit is None or problem or set_ else orbit.design
    prepare(results)
    with progress(quiet=json_) as say:
        found = studying.transition(
            design,
            begin=begin,
            orbit=orbit,
            clearances=clearance or (),
            most=most,
            starts=starts,
            processes=os.cpu_count() or 1,
            progress=say,
        )
        data = found.as_dict() | {"wall_s": time.perf_counter() - began, "hopopt": version("hopopt")}
        traces = {f"hop_{k}": planned_trace(hop) for k, hop in enumerate(found.plan.hops, 1)}
        draw = (lambda folder: save_all(found, folder)) if figures else None
        where = save_runs("transition", found.design, data, traces, results, draw)
        if orbit is None:
            save(found.orbit, where)
    if json_:
        print(as_json({**data, "result_dir": str(where)}))
        return found.exit_code
    from hopopt.cli.screen.transition import print_transition

    print_transition(data, str(where))
    return found.exit_code
