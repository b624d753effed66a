"""The command that sets controllers beside the optimum: compare."""

import os
import time
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from hopopt import amounts
from hopopt.cli.controllers.ladder import ladder_of
from hopopt.cli.controllers.simulate import save_with_figures
from hopopt.cli.options import AsJson, Overrides, progress, repeated
from hopopt.errors import UsageError

Strategies = Annotated[
    list[str] | None,
    repeated(
        "--strategies",
        "A strategy to simulate, such as force, or your own as package.module:Class (repeat, or separate by commas). All "
        "that suit the leg: all. Default: track, force, force_tuck and the better tuned one.",
    ),
]


def compare(
    problem: str | None = None,
    *,
    hop: Literal["single", "periodic"] | None = None,
    set_: Overrides = None,
    strategies: Strategies = None,
    bound: Path | None = None,
    tune: int = 0,
    reserve: Literal["auto"] | None = None,
    mujoco: bool = False,
    draws: int = 0,
    why: Annotated[bool, Parameter(negative=())] = False,
    mass: float | None = None,
    torque: float | None = None,
    seed: int = 0,
    hops: int = 50,
    basin: Annotated[bool, Parameter(negative=())] = False,
    results: Path = Path("results"),
    figures: bool = True,
    json_: AsJson = False,
) -> int:
    """Compare the paper's controllers, or yours, with the optimum.

    How near each comes in simulation, and what is missing; the tracked optimum is among them.

    Exit code: 0 the bound is verified and holds, 1 not solved, 2 wrong usage, 3 not verified or passed by a strategy.

    Parameters
    ----------
    problem
        A problem file, or the name of a built-in one (default: the bound's problem, or paper).
    hop
        single: one hop from rest. periodic: hop after hop, beside the hop that repeats itself (docs/periodic.md).
        Default: the problem's hop.kind.
    bound
        A results folder of hopopt solve for the same problem, to save solving again.
    tune
        Tune the gains of force and position for this leg on so many simulated hops each (24 or more; half a minute),
        in place of those tuned for the paper's leg and scaled.
    reserve
        auto: hold back from the ground force the least with which the plan is tracked on drawn legs, in place of the problem's
        reserve.ground_force.
    mujoco
        Also run every strategy in MuJoCo (optional: pip install 'hopopt[mujoco]').
    draws
        Also run every strategy on this many legs that differ from the believed one by the problem's [uncertainty], and say
        what can be had: two bounds, and what 95 % of the legs reach.
    why
        Also say by which freedoms PD is lower: a ladder of verified optima, each with one more (minutes).
    mass
        Masses are drawn within this share of the believed ones (default: uncertainty.mass).
    torque
        Torque constants are drawn within this share of the believed ones (default: uncertainty.torque_constant).
    seed
        Seed of the draws.
    hops
        Of a periodic hop: how many each strategy does.
    basin
        Of a periodic hop: also find from how far off each strategy comes back to its orbit; a minute or two each.
    results
        Folder for the results; each run gets a new folder inside it.
    figures
        Draw the figures.
    """
    began = time.perf_counter()
    from hopopt.problem.load import load

    given_names = [name.strip() for words in strategies or () for name in words.split(",") if name.strip()]
    names = list(dict.fromkeys(given_names)) if strategies else None
    if names == []:
        raise UsageError("--strategies names none: give one or more, such as --strategies track --strategies force")
    if tune and tune < 24:
        raise UsageError("--tune must be 0 or at least 24")
    amounts.check("tune", tune, 0)
    amounts.check("draws", draws, 0)
    amounts.check("seed", seed, 0)
    spreads = {"uncertainty.mass": mass, "uncertainty.torque_constant": torque}
    spreads = {entry: share for entry, share in spreads.items() if share is not None}
    if not all(0 <= share <= 0.5 for share in spreads.values()):
        raise UsageError("--mass and --torque are shares from 0 to 0.5")
    from hopopt.comparison import compare as comparing
    from hopopt.comparison.robust.least_reserve import least_reserve
    from hopopt.comparison.robust.robustness import chosen, four_numbers, spread
    from hopopt.planner.answer.summary_entry import as_data
    from hopopt.planner.solve import solve
    from hopopt.storage.folder import as_json, prepare
    from hopopt.storage.seal.recheck import reverified
    from hopopt.storage.solution import read, save

    given = reverified(read(bound)) if bound else None
    set_ = [*(set_ or ()), *([f'hop.kind="{hop}"'] if hop else ()), *(f"{entry}={x}" for entry, x in spreads.items())]
    design = load(problem or (bound / "problem.toml" if bound else "paper"), set_)
    prepare(results)
    if design.hop.periodic:
        from hopopt.cli.hops.compare import compare_hops

        if tune or reserve:
            raise UsageError("--tune and --reserve are for the hop from rest: leave them out for a periodic one")
        return compare_hops(design, names, given, hops, draws, seed, basin, mujoco, why, results, figures, json_)
    if basin:
        raise UsageError("--basin is for the hop that repeats itself: give --hop periodic, or leave it out")
    with progress(quiet=json_) as say:
        plan, words = None, list[str]()
        if reserve:
            given = solve(design, progress=say) if given is None else comparing.answering(design, given)
            kept = least_reserve(given, seed=seed, processes=os.cpu_count() or 1, progress=say)
            design, plan, words = kept.design, kept.plan, [kept.words]
        found = comparing.compare(design, names, bound=given, plan=plan, mujoco=mujoco, tune=tune, progress=say)
        data = found.as_dict()
        data["notes"] += words
        if draws:
            of_legs = seed, design.uncertainty, os.cpu_count() or 1, say
            data["mismatch"] = spread(found, draws, *of_legs)
            best, ideal = chosen(found, *of_legs), comparing.on_ideal_ground(found.solution, say)
            numbers = four_numbers(found, data["mismatch"], best, ideal)
            data["four_numbers"] = as_data(numbers)
        steps = ladder_of(found, data, say) if why else None
        data["wall_s"] = time.perf_counter() - began  # all but drawing and writing
        traces = {name: f.trace for name, f in found.figures.items()}
        tracked = comparing.reference_of(found.plan) if found.plan else None
        where = save_with_figures("comparison", design, data, traces, results, figures, found.figures, steps, tracked)
        for solution in (found.solution, found.plan):
            if solution is not None and solution.result_dir is None:  # what the figures stand on
                save(solution, where)
    if json_:
        print(as_json({**data, "result_dir": str(where)}))
        return found.exit_code
    from hopopt.cli.screen.runs import print_comparison

    print_comparison(data, f"{where}   ({data['wall_s']:.1f} s)")
    return found.exit_code
