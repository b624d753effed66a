"""The command that simulates one controller on the leg: simulate."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from hopopt import amounts
from hopopt.cli.options import AsJson, Overrides, progress, repeated
from hopopt.errors import UsageError

if TYPE_CHECKING:
    from hopopt.comparison.ladder import Ladder
    from hopopt.design import Design

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
    problem: str = "paper",
    *,
    strategy: str = "force",
    set_: Overrides = None,
    plant: TrueLeg = None,
    option: Options = None,
    hops: int = 1,
    plan: Path | None = None,
    results: Path = Path("results"),
    figures: bool = True,
    json_: AsJson = False,
) -> int:
    """Simulate hops of the leg with one controller.

    At 4 kHz, with encoders, saturated motors and impacts.

    Parameters
    ----------
    problem
        A problem file, or the name of a built-in one.
    strategy
        force, force_braked, force_tuck, force_tuned, position, position_soft, position_tuck, position_tuned (the
        paper's, scaled to the leg), track, track_mpc, track_pd (follow the optimum), an entry point of the group
        hopopt.strategies, or your own class as package.module:Class.
    hops
        How many hops one after the other.
    plan
        A results folder of hopopt solve to follow; without it, track solves for its own plan.
    results
        Folder for the results; each run gets a new folder inside it.
    figures
        Draw the figures.
    """
    from hopopt.problem.load import load

    design = load(problem, set_ or ())
    amounts.check("hops", hops)
    truth, options = load(problem, [*(set_ or ()), *plant]) if plant else None, _options(option or ())
    from hopopt.control import closed_loop
    from hopopt.control.strategies import find
    from hopopt.design import refuse_landed
    from hopopt.storage.folder import as_json, prepare

    chosen = find(strategy)
    refuse_landed(design, "a simulation from rest")
    closed_loop.make_plant(truth or design)  # what cannot be simulated is said before the work
    prepare(results)
    with progress(quiet=json_) as say:
        reference = _plan(design, plan, chosen.needs_plan, say)
        say(f"simulating {strategy}")
        run = closed_loop.simulate(design, chosen, plan=reference, plant=truth, hops=hops, options=options)
        row = {
            "problem": design.name,
            "strategy": strategy,
            "meaning": chosen.meaning,
            "options": run.options,
            "hops": hops,
            **run.figures.as_dict(),
            "overshoot_m": run.overshoot,
            "feedback_moves": run.moves,
            "lift_offs": run.trace.times_of("lift-off"),
            "touchdowns": run.trace.times_of("touchdown"),
        }
        where = save_with_figures(
            "simulation", design, row, {strategy: run.trace}, results, figures, {strategy: run.figures}, plan=reference
        )
    if json_:
        print(as_json({**row, "exit_code": 0, "result_dir": str(where)}))
        return 0
    from hopopt.cli.screen.runs import print_run

    print_run(row, str(where))
    return 0


def _options(given: "list[str] | tuple[str, ...]") -> dict[str, Any]:
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


def _plan(design: "Design", folder: Path | None, needed: bool, say: Any) -> Any:
    """What the strategy is to follow: the plan given, or one of its own."""
    if not needed:
        if folder:
            raise UsageError("--plan is for strategies that follow one, such as track")
        return None
    from hopopt.comparison.simulation import followed
    from hopopt.planner.reserve import plan_to_track
    from hopopt.storage.folder import fitting
    from hopopt.storage.solution import read

    if folder:
        with fitting(folder):
            return followed(design, read(folder))
    return followed(design, plan_to_track(design, say))


def save_with_figures(
    what: str,
    design: "Design",
    data: Any,
    traces: Any,
    results: Path,
    draw: bool,
    figures: Any,
    steps: "Ladder | None" = None,
    plan: Any = None,
) -> Path:
    """Save simulated runs, with their figures if those are wanted, and the plan that was tracked; the new folder."""
    from hopopt.storage.runs import save_runs

    if not draw:
        return save_runs(what, design, data, traces, results)
    from hopopt.plots.controllers.runs import save_all

    return save_runs(
        what, design, data, traces, results, lambda folder: save_all(figures, folder, steps=steps, plan=plan)
    )
