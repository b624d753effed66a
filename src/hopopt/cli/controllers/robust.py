"""The command that says what a share of uncertain legs reaches."""

import os
import time
from importlib.metadata import version
from pathlib import Path

from hopopt.cli.options import AsJson, Overrides, progress


def robust(
    problem: str = "paper",
    *,
    set_: Overrides = None,
    share: float = 0.95,
    confidence: float = 0.95,
    draws: int = 200,
    evaluations: int = 8,
    seed: int = 0,
    starts: int | None = None,
    seconds: float = 900.0,
    results: Path = Path("results"),
    figures: bool = True,
    json_: AsJson = False,
) -> int:
    """Find the best plan for legs whose masses and motors vary.

    That is the reserve and the tracked plan with the greatest clearance that a stated share of legs reaches.

    Legs are drawn within the problem's [uncertainty]. A plan for them is found in two ways: with a reserve tuned on a few of
    them, and by one program for several legs that share torques and feedback. The better one is judged on other legs, beside
    the bounds and the paper's PD control. The problem with its reserve and the plan (runs.nc) are in the results folder.

    Exit code: 0 bounds and plan verified, 1 not solved, 2 wrong usage, 3 not verified.

    Parameters
    ----------
    problem
        A problem file, or the name of a built-in one.
    share
        The share of legs that must reach the clearance.
    confidence
        The confidence of that statement.
    draws
        Fresh legs on which it stands.
    evaluations
        How many reserves are tried, and programs at most.
    seed
        Seed of the draws.
    starts
        Starting points of each bound (default: the problem's solver.starts).
    seconds
        Time for bounds and plans; what has been found by then is judged on the fresh legs.
    results
        Folder for the results; each run gets a new folder inside it.
    figures
        Draw the figure.
    """
    began = time.perf_counter()
    from hopopt.problem.load import load

    design = load(problem, set_ or ())
    from hopopt.comparison.compare import planned_trace
    from hopopt.comparison.robust import robust as studying
    from hopopt.plots.controllers.robust import save_all
    from hopopt.storage.folder import as_json, prepare
    from hopopt.storage.runs import save_runs

    prepare(results)
    with progress(quiet=json_) as say:
        found = studying.robust(
            design,
            share=share,
            confidence=confidence,
            draws=draws,
            evaluations=evaluations,
            seed=seed,
            starts=starts,
            seconds=seconds,
            processes=os.cpu_count() or 1,
            progress=say,
        )
        data = found.as_dict() | {"wall_s": time.perf_counter() - began, "seed": seed, "hopopt": version("hopopt")}
        say("drawing the figure")
        draw = (lambda folder: save_all(found, folder)) if figures else None
        where = save_runs("robust", found.best.design, data, {"plan": planned_trace(found.best.plan)}, results, draw)
    if json_:
        print(as_json({**data, "result_dir": str(where)}))
        return found.exit_code
    from hopopt.cli.screen.robust import print_robust

    print_robust(data, str(where))
    return found.exit_code
