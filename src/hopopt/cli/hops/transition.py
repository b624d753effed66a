"""The command that leads from rest, or from one periodic hop, onto another: transition."""

import os
import time
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from hopopt.cli.expected_time import ExpectedTime
from hopopt.cli.options import AsJson, Figure, Overrides, Results, ended, repeated
from hopopt.cli.screen.console import Shown, progress, table
from hopopt.cli.screen.console import figures as columns
from hopopt.cli.screen.runs import results as where_it_lies
from hopopt.comparison.hops import transition as studying
from hopopt.comparison.hops.stored import save_transition
from hopopt.ocp.hops.several_hops import in_words
from hopopt.plots.transition import save_all
from hopopt.problem.load import load
from hopopt.storage.folder import prepare
from hopopt.storage.solution import read


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
    results: Results = Path("results"),
    figures: Figure = True,
    json_: AsJson = False,
) -> int:
    """Find the fewest hops from rest onto a hop that repeats itself.

    Or from one periodic hop onto another.

    All hops are one program: stance, flight, descent and impact, hop by hop, up to the state in which the orbit's stance
    begins. Of all ways in so many hops it is the one of least effort. The plan (runs.nc, plan.nc) is in the results folder.

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
    """
    began = time.perf_counter()
    begin, orbit = (None if folder is None else read(folder) for folder in (from_, to))
    words = ["hop.kind=periodic", *(set_ or ())]
    design = load(problem or "paper", words) if orbit is None or problem or set_ else orbit.design
    prepare(results)
    parts = {"solve": float(orbit is None), "transition": 1.0}
    with progress(json_, ExpectedTime("transition", design, parts)) as say:
        found = studying.transition(
            design, begin=begin, orbit=orbit, clearances=clearance or (), most=most, starts=starts,
            processes=os.cpu_count() or 1, progress=say,
        )  # fmt: skip
        data = found.as_dict() | {"wall_s": time.perf_counter() - began, "hopopt": version("hopopt")}
        draw = (lambda folder: save_all(found, folder)) if figures else None
        where = save_transition(found, results, data, draw)
    data["result_dir"] = str(where)
    return ended(data, json_, shown(data), found.exit_code)


def shown(found: Mapping[str, Any]) -> Iterator[Shown]:
    """Where the hops begin and end, each of them, and why fewer do not do."""
    count, failed = in_words(found["hops"]), found["failed_checks"]
    begin = "rest" if found["from"] is None else f"the periodic hop of {found['from']['clearance_m']:.4f} m"
    yield (
        f"{found['problem']}: from {begin} onto the periodic hop of {found['to']['clearance_m']:.4f} m in "
        f"{count}, {found['duration_s']:.3f} s, {'verified' if found['verified'] else 'NOT verified'}"
    )
    if not found["verified"]:
        yield f"failed: {', '.join(failed) or 'a periodic hop at one of the ends is not verified'}"
    rows = []
    for k, (lasts, clears) in enumerate(zip(found["durations_s"], found["clearances_m"], strict=True), 1):
        stance, air = lasts["stance"], sum(lasts.values()) - lasts["stance"]
        rows.append([str(k), f"{stance:.3f}", f"{air:.3f}", f"{clears:.3f}"])
    yield table(columns("hop", "stance\ns", "in the air\ns", "lowest point\nup to m"), rows, between=(0, 2))
    sure = "certified" if found["certified"] else "not certified"
    yield (
        f"of all ways in {count} that of least effort; first-order optimality {sure}; "
        f"{found['checks'] - len(failed)} of {found['checks']} checks passed"
    )
    for k, why in enumerate(found["fewer_hops"], 1):
        yield f"in {in_words(k)} no way was found: {why}"
    yield where_it_lies(found)
