"""The command that simulates one controller on the leg: simulate."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

from hopopt import amounts
from hopopt.cli.options import AsJson, Figures, Overrides, Problem, Results, ended, repeated
from hopopt.cli.screen import runs
from hopopt.cli.screen.console import progress
from hopopt.comparison.simulation import followed
from hopopt.comparison.stored import run_row, save_run
from hopopt.control import closed_loop
from hopopt.control.reference import PlanReference
from hopopt.control.strategies import find
from hopopt.design import Design, refuse_landed
from hopopt.errors import UsageError
from hopopt.planner.reserve import plan_to_track
from hopopt.plots.controllers.runs import save_all
from hopopt.problem.load import load
from hopopt.storage import solution as stored
from hopopt.storage.folder import fitting, prepare

Options = Annotated[
    list[str] | None,
    repeated("--option", "A setting of the strategy: --option k_p=6000 (repeat)."),
]
TrueLeg = Annotated[
    list[str] | None,
    repeated(
        "--plant", "How the true leg differs from what the strategy believes: --plant leg.body.mass=5.9 (repeat)."
    ),
]


def simulate(
    problem: Problem = "paper",
    *,
    strategy: str = "force",
    set_: Overrides = None,
    plant: TrueLeg = None,
    option: Options = None,
    hops: int = 1,
    plan: Path | None = None,
    results: Results = Path("results"),
    figures: Figures = True,
    json_: AsJson = False,
) -> int:
    """Simulate hops of the leg with one controller.

    At 4 kHz, with encoders, saturated motors and impacts.

    Parameters
    ----------
    strategy
        force, force_braked, force_tuck, force_tuned, position, position_soft, position_tuck, position_tuned (the
        paper's, scaled to the leg), counter_movement (down first), track, track_mpc, track_pd (follow the optimum), an entry point of the group
        hopopt.strategies, or your own class as package.module:Class.
    hops
        How many hops one after the other.
    plan
        A results folder of hopopt solve to follow; without it, track solves for its own plan.
    """
    design = load(problem, set_ or ())
    amounts.check("hops", hops)
    truth, options = load(problem, [*(set_ or ()), *plant]) if plant else None, _options(option or ())
    chosen = find(strategy)
    refuse_landed(design, "a simulation from rest")
    closed_loop.make_plant(truth or design)  # what cannot be simulated is said before the work
    prepare(results)
    with progress(quiet=json_) as say:
        reference = _plan(design, plan, chosen.needs_plan, say)
        say(f"simulating {strategy}")
        run = closed_loop.simulate(design, chosen, plan=reference, plant=truth, hops=hops, options=options)
        draw = (lambda folder: save_all({strategy: run.figures}, folder, plan=reference)) if figures else None
        where = save_run(run, hops, results, believed=design if truth else None, figures=draw)
    data = {**run_row(run, hops), "exit_code": 0, "result_dir": str(where)}
    return ended(data, json_, runs.run(data))


def _options(given: Sequence[str]) -> dict[str, Any]:
    """key=value pairs; values are JSON where they can be, else text."""
    options = {}
    for pair in given:
        key, equals, text = pair.partition("=")
        if not (key and equals):
            raise UsageError(f"--option {pair}: write it as name=value, such as k_p=6000")
        try:
            options[key] = json.loads(text)
        except ValueError:
            options[key] = text
    return options


def _plan(design: Design, folder: Path | None, needed: bool, say: Callable[[str], None]) -> PlanReference | None:
    """What the strategy is to follow: the plan given, or one of its own."""
    if not needed:
        if folder:
            raise UsageError("--plan is for strategies that follow one, such as track")
        return None
    if folder is None:
        return followed(design, plan_to_track(design, say))
    with fitting(folder):
        return followed(design, stored.read(folder))
