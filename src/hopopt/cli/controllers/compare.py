"""The command that sets controllers beside the optimum: compare, of one hop from rest or hop after hop."""

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal

from hopopt import amounts
from hopopt.cli.expected_time import ExpectedTime
from hopopt.cli.options import AsJson, Figures, Flag, Overrides, Results, ended, repeated
from hopopt.cli.screen.console import progress
from hopopt.cli.screen.hops import hops as shown_hops
from hopopt.cli.screen.runs import comparison
from hopopt.comparison import compare as comparing
from hopopt.comparison.compare import Comparison
from hopopt.comparison.hops.hop_after_hop import HopsComparison, compare_hops
from hopopt.comparison.hops.stored import save_hops
from hopopt.comparison.ladder import Ladder, ladder
from hopopt.comparison.robust.least_reserve import least_reserve
from hopopt.comparison.robust.robustness import chosen, drawn, four_numbers, spread
from hopopt.comparison.stored import save_comparison
from hopopt.design import Design
from hopopt.errors import HopoptError, UsageError
from hopopt.planner.reserve import reference_of
from hopopt.planner.solve import solve
from hopopt.plots import hops as hops_figures
from hopopt.plots.controllers import runs as figures_of_one
from hopopt.problem.load import load
from hopopt.record import as_data
from hopopt.storage.folder import prepare
from hopopt.storage.seal.recheck import reverified
from hopopt.storage.solution import read

Say = Callable[[str], None]
Strategies = Annotated[
    list[str] | None,
    repeated(
        "--strategies",
        "A strategy to simulate, such as force, or your own as package.module:Class (repeat, or separate by commas). All "
        "that suit the leg: all. Default: track, force, force_tuck, counter_movement and the better tuned one.",
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
    why: Annotated[bool, Flag] = False,
    mass: float | None = None,
    torque: float | None = None,
    seed: int = 0,
    hops: int = 50,
    basin: Annotated[bool, Flag] = False,
    results: Results = Path("results"),
    figures: Figures = True,
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
        reserve.ground_force; where that is not enough, of torque and speed too.
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
    """
    began = time.perf_counter()
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
    given = reverified(read(bound)) if bound else None
    set_ = [*(set_ or ()), *([f'hop.kind="{hop}"'] if hop else ()), *(f"{entry}={x}" for entry, x in spreads.items())]
    design = load(problem or (bound / "problem.toml" if bound else "paper"), set_)
    prepare(results)
    periodic, processes, steps = design.hop.periodic, os.cpu_count() or 1, None
    if periodic and (tune or reserve):
        raise UsageError("--tune and --reserve are for the hop from rest: leave them out for a periodic one")
    if basin and not periodic:
        raise UsageError("--basin is for the hop that repeats itself: give --hop periodic, or leave it out")
    if periodic:
        amounts.check("hops", hops, 2)
    chosen_ones = len(names or ()) or 4
    parts = {
        "solve": 0.0 if given else 1.0,
        "hops of a strategy" if periodic else "controllers": chosen_ones if periodic else chosen_ones / 4,
        "simulated hop": 2.0 * tune + 0.5 * draws * chosen_ones,
        "rung of the ladder": 12.0 * bool(why),
        "least reserve": float(reserve is not None),
        "basin": float(chosen_ones * bool(basin)),
    }
    with progress(json_, ExpectedTime("compare", design, parts)) as say:
        if periodic:
            legs = drawn(design, design.uncertainty, draws, seed)
            found = compare_hops(
                design, names, hops=hops, bound=given, draws=legs, basins=basin, mujoco=mujoco, processes=processes,
                progress=say,
            )  # fmt: skip
            data = found.as_dict() | {"seed": seed}
        else:
            plan, words = None, list[str]()
            if reserve:
                given = solve(design, progress=say) if given is None else comparing.answering(design, given)
                kept = least_reserve(given, seed=seed, processes=processes, progress=say)
                design, plan, words = kept.design, kept.plan, [kept.words]
            found = comparing.compare(design, names, bound=given, plan=plan, mujoco=mujoco, tune=tune, progress=say)
            data = found.as_dict()
            data["notes"] += words
            if draws:
                data |= _on_drawn_legs(design, found, draws, seed, say)
        if why:
            steps = _ladder(found, data, say)
        data["wall_s"] = time.perf_counter() - began  # all but drawing and writing
        draw = (lambda folder: _draw(found, folder, steps)) if figures else None
        if isinstance(found, HopsComparison):
            where = save_hops(found, results, data, draw)
        else:
            where = save_comparison(found, results, data, draw)
    data["result_dir"] = str(where)
    return ended(data, json_, (shown_hops if periodic else comparison)(data), found.exit_code)


def _on_drawn_legs(design: Design, found: Comparison, draws: int, seed: int, say: Say) -> dict[str, Any]:
    """What strategies reach on legs that differ from the believed one, and what can be had there."""
    of_legs = seed, design.uncertainty, os.cpu_count() or 1, say
    mismatch = spread(found, draws, *of_legs)
    best, ideal = chosen(found, *of_legs), comparing.on_ideal_ground(found.solution, say)
    return {"mismatch": mismatch, "four_numbers": as_data(four_numbers(found, mismatch, best, ideal))}


def _ladder(found: Comparison | HopsComparison, data: dict[str, Any], say: Say) -> Ladder | None:
    """The ladder, and its entries in the data; a note where there is none, for all else is found."""
    try:
        steps = ladder(found, say)
    except HopoptError as error:
        data["notes"].append(str(error))
        return None
    data |= steps.as_dict()
    return steps


def _draw(found: Comparison | HopsComparison, folder: Path, steps: Ladder | None) -> None:
    if isinstance(found, HopsComparison):
        hops_figures.save_all(found, folder, steps)
    else:
        plan = reference_of(found.plan) if found.plan else None
        figures_of_one.save_all(found.figures, folder, steps=steps, plan=plan)
