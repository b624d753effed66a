"""The command that says what a share of uncertain legs reaches: robust."""

import os
import time
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rich.table import Column

from hopopt.cli.expected_time import ExpectedTime
from hopopt.cli.options import AsJson, Figure, Overrides, Problem, Results, ended
from hopopt.cli.screen.console import Shown, progress, table
from hopopt.cli.screen.runs import results as where_it_lies
from hopopt.comparison.robust import robust as studying
from hopopt.comparison.robust.stored import save_robust
from hopopt.plots.controllers.robust import save_all
from hopopt.problem.load import load
from hopopt.report.robust import GAIN_UNITS, PLAN_WAYS
from hopopt.storage.folder import prepare


def robust(
    problem: Problem = "paper",
    *,
    set_: Overrides = None,
    share: float = 0.95,
    confidence: float = 0.95,
    draws: int = 200,
    evaluations: int = 8,
    seed: int = 0,
    starts: int | None = None,
    seconds: float = 900.0,
    results: Results = Path("results"),
    figures: Figure = True,
    json_: AsJson = False,
) -> int:
    """Find the best plan for legs whose masses and motors vary.

    That is the reserve and the tracked plan with the greatest clearance that a stated share of legs reaches.

    Legs are drawn within the problem's [uncertainty]. A plan for them is found in two ways: with a reserve tuned on a few of
    them, and by one program for several legs that share torques and feedback. The better one is judged on other legs, beside
    the bounds and the paper's PD control. The problem with its reserve, the plan (runs.nc, plan.nc) and the bounds are in
    the results folder.

    Exit code: 0 bounds and plan verified, 1 not solved, 2 wrong usage, 3 not verified.

    Parameters
    ----------
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
    """
    began = time.perf_counter()
    design = load(problem, set_ or ())
    prepare(results)
    parts = {"solve": 2.0, "plan for drawn legs": float(evaluations), "simulated hop": 0.5 * draws}
    with progress(json_, ExpectedTime("robust", design, parts, seconds + 0.5 * draws)) as say:
        found = studying.robust(
            design, share=share, confidence=confidence, draws=draws, evaluations=evaluations, seed=seed, starts=starts,
            seconds=seconds, processes=os.cpu_count() or 1, progress=say,
        )  # fmt: skip
        data = found.as_dict() | {"wall_s": time.perf_counter() - began, "seed": seed, "hopopt": version("hopopt")}
        say("drawing the figure")
        draw = (lambda folder: save_all(found, folder)) if figures else None
        where = save_robust(found, results, data, draw)
    data["result_dir"] = str(where)
    return ended(data, json_, shown(data), found.exit_code)


def shown(found: Mapping[str, Any]) -> Iterator[Shown]:
    """Four numbers: the bounds, what the share reaches with the tracker and with PD; the promise, and the reserve."""
    share = f"{100 * found['share']:g} %"
    rows = []
    for words, key in (("bound, ideal ground", "ideal_bound_m"), ("bound, this ground", "bound_m")):
        rows.append([words, "not verified" if found[key] is None else f"{found[key]:.4f} m", ""])
    rows.append([f"{found['tracker']}, {share} of the legs", f"{found['clearance_m']:.4f} m", f"{found['fell']}"])
    for name, clearance in found["pd"].items():
        rows.append([f"{name}, {share} of the legs", f"{clearance:.4f} m", f"{found['pd_fell'][name]}"])
    yield table(["", *(Column(head, justify="right") for head in ("clearance", "fell"))], rows, edge=True)
    yield (
        f"{share} of all legs within [uncertainty] reach this, with confidence {100 * found['confidence']:g} %: "
        f"it is number {found['rank']} from below of {found['draws']} legs that the tuning did not see"
    )
    yield f"tracked by {found['tracker']}: lowest {found['lowest_m']:.4f} m, median {found['median_m']:.4f} m"
    doubt = "" if found["plan_verified"] else "; it was NOT verified"
    yield f"the plan clears {found['plan_m']:.4f} m, best of {found['evaluations']} that were tried{doubt}"
    if found["against"]:
        yield f"no plan was found that all legs of the search keep: {found['against']}"
    lowest = found["lowest_by_way_m"]
    each = [f"{words} {lowest[way]:.4f} m" for way, words in PLAN_WAYS.items() if lowest.get(way) is not None]
    yield f"lowest of the legs that it was chosen on, by way: {', '.join(each) or 'no way led to a verified plan'}"
    for name, gains in (found["feedback"] or {}).items():
        yield f"its feedback {name} = {', '.join(f'{gain:.4g}' for gain in gains)} {GAIN_UNITS[name]}, joint by joint"
    if (best := found["pd_best"]) and found["pd"][best] > found["clearance_m"]:
        yield f"{best} reaches more than any plan that was tracked: of those that were tried, none suits these legs"
    yield "[reserve]\n" + "\n".join(f"{name} = {value:.6g}" for name, value in found["reserve"].items())
    yield where_it_lies(found)
