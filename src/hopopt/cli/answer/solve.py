"""The command that finds the best hop of a leg: solve."""

import os
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from hopopt import amounts
from hopopt.cli.expected_time import ExpectedTime
from hopopt.cli.options import (
    AsJson,
    Constraints,
    Figures,
    Overrides,
    Results,
    Starts,
    ended,
    note,
    repeated,
    write_new,
)
from hopopt.cli.screen.console import progress
from hopopt.cli.screen.details import answer
from hopopt.design import Design, refuse_landed
from hopopt.errors import HopoptError, UsageError
from hopopt.nlp.deadline import NEVER
from hopopt.ocp.free_parameters import parse_free
from hopopt.planner import solve as planning
from hopopt.planner.search.beside import Task, ahead
from hopopt.planner.solution import Solution
from hopopt.problem.checking.hints import hints
from hopopt.problem.load import load
from hopopt.storage.folder import prepare
from hopopt.storage.solution import save, stated, with_more
from hopopt.studies.faults import Fault, guarded

if TYPE_CHECKING:
    from hopopt.comparison.paper_control import PaperHop

LEAST_TIME_LEFT = 5.0  # s that figures and a simulation take, which are not begun with less time left

Free = Annotated[
    list[str] | None,
    repeated(
        "--free", "Let the optimum choose a number of the leg: --free leg.gear.ratio=50:200 (repeat; docs/codesign.md)."
    ),
]
Couple = Annotated[
    list[str] | None,
    repeated(
        "--couple",
        'A relation of free numbers, "leg.thigh.length + leg.shank.length = 0.741", powers too, or "catalogue: MASS by TORQUE" (repeat).',
    ),
]
CrossChecked = Annotated[bool, Parameter(alias="--second-opinion", negative="--no-cross-check")]


def solve(
    problem: str = "paper",
    *,
    objective: str = "clearance",
    hop: Literal["single", "landing", "periodic"] | None = None,
    set_: Overrides = None,
    constraint: Constraints = None,
    free: Free = None,
    couple: Couple = None,
    starts: Starts = None,
    processes: int | None = None,
    time_limit: float | None = None,
    structure: bool = False,
    cross_check: CrossChecked = False,
    control: bool = True,
    draws: int = 0,
    results: Results = Path("results"),
    figures: Figures = True,
    report: bool = False,
    json_: AsJson = False,
) -> int:
    """Find the highest hop of a leg, verify it, and save it.

    Or the best one by another --objective. Its figures and what the paper's control makes of the leg are saved with it.

    Exit code: 0 solved and verified, 1 not solved, 2 wrong usage, 3 solved but not verified, or a cross-check,
    or the paper's control, found a better hop.

    Parameters
    ----------
    problem
        A problem file, or the name of a built-in one: paper and its variants, three_joint, a1_leg, go2_leg and others
        (README.md lists them).
    objective
        What to make as large as possible: clearance (of the leg's lowest point), apex (height of the body) or obstacle (the
        highest box that the leg clears, with --set hop.obstacle.width=0.2). Or as small as possible, with the clearance to
        reach as --set hop.clearance=0.4: energy, absolute_work, electrical_energy, time, saturation, peak_torque,
        peak_force or impact. Or a Python function of your own as module:function (docs/objectives.md).
    hop
        single: one hop from rest. landing: the same, landed and brought to rest (docs/landing.md). periodic: a hop that ends
        as it began, for ever (docs/periodic.md); its mean speed is --set hop.speed=0.5. Default: the problem's hop.kind.
    processes
        How many of them side by side (default: one for each core).
    time_limit
        Seconds after which the best hop so far is the answer, or the reason why there is none (default: 600).
    structure
        Solve the best once more with the switches of its drives at free times, so that torques jump exactly there.
    cross_check
        Also solve with another NLP solver (Uno) and two other transcription schemes; half a minute or more
        (docs/certificate.md).
    control
        Also simulate the paper's force control on the same leg (hopopt compare has more); a few seconds.
    draws
        Also say what can be had, about a minute: what 95 % of so many legs reach that differ from this one by the problem's
        [uncertainty], tracking a plan and by PD control.
    report
        Also write report.html into the results folder: a page with the hop moving (hopopt report has more).
    """
    began = time.perf_counter()
    set_ = [*(set_ or ()), *([f'hop.kind="{hop}"'] if hop else ())]
    design = load(problem, set_)
    amounts.check("starts", starts)
    amounts.check_processes(processes)
    if time_limit is not None and not time_limit >= 1:
        raise UsageError("--time-limit must be at least 1 s")
    if couple and not free:
        raise UsageError("--couple relates numbers that are free: give them as --free leg.thigh.length=0.3:0.45")
    _check_draws(draws, objective, constraint or (), design)
    prepare(results)
    for words in hints(design):
        note(words)  # before what may take long
    control = control and not design.hop.lands  # the paper's control ends with the apex
    # beside a search, if it is sure that it will be asked for, and of this leg
    sure = control and objective == "clearance" and not (constraint or free) and (starts or design.solver.starts) > 1
    simulated = _paper_hop(design, processes) if sure else None
    searched = (starts or design.solver.starts) > 1
    parts = {
        "solve": float(searched),
        "start alone": float(not searched),
        "co-design": float(bool(free)),
        "cross-check": float(cross_check),
        "free switches": float(structure),
        "simulated hop": 3.0 * control + draws,
    }
    with progress(json_, ExpectedTime("solve", design, parts, time_limit)) as say:
        more = {"constraints": constraint or (), "starts": starts, "processes": processes}
        more |= {"time_limit": time_limit, "progress": say}
        once = {"structure": structure, "cross_check": cross_check}
        end = NEVER.within(time_limit or planning.TIME_LIMIT)
        solution = _solved(design, objective, free, couple, once, more)
        if end.seconds_left < LEAST_TIME_LEFT and (figures or control or draws or report):
            figures = control = report = False
            draws = 0
            note("the answer alone: the time limit leaves no time for more")
        draw = None
        if figures:
            from hopopt.plots.hop import save_all as draw

            say("drawing")
        took = time.perf_counter() - began  # all but drawing and writing
        solution = solution.with_summary(overrides=tuple(set_), wall_s=took)
        solution = save(solution, results, draw)
        with suppress(KeyboardInterrupt):  # the answer is there
            if control:
                say("simulating the paper's force control")
                solution = _beside(solution, simulated)
        with suppress(KeyboardInterrupt):
            if draws and solution.verified:
                solution = _had(solution, draws, say)
        if report:
            say("writing the report")
            _report(solution)
    return ended(stated(solution.shown), json_, answer(solution), solution.summary.exit_code)


def _check_draws(draws: int, objective: str, constraints: Sequence[str], design: Design) -> None:
    """UsageError where legs are drawn for a hop that is no bound of theirs."""
    amounts.check("draws", draws, 0)
    if draws:
        if objective != "clearance" or constraints:
            raise UsageError("--draws is for the objective clearance without user-defined constraints")
        from hopopt.control.closed_loop import make_plant

        refuse_landed(design, "solve --draws")
        make_plant(design)


def _solved(
    design: Design,
    objective: str,
    free: list[str] | None,
    couple: list[str] | None,
    once: dict[str, bool],
    more: dict[str, Any],
) -> Solution:
    """The best hop of the design, or of the best design if numbers of it are free."""
    if not free:
        return planning.solve(design, objective, **once, **more)
    for asked in (name.replace("_", "-") for name, wanted in once.items() if wanted):
        raise UsageError(f"--{asked} goes with a design that is given: use it on the problem.toml that --free finds")
    from hopopt.studies.codesign import codesign

    return codesign(design, parse_free(free), objective, couple=couple or (), **more)


# What is added when the answer is there: what goes wrong with it is only reported.


def _paper_hop(design: Design, processes: int | None) -> "Task[PaperHop | None]":
    """The paper's control on this leg, for another process; which need not import the command line for it."""
    from hopopt.comparison.paper_control import paper_hop

    return ahead(paper_hop, design, more=(processes or os.cpu_count() or 1) - 1)


def _beside(solution: Solution, simulated: "Task[PaperHop | None] | None") -> Solution:
    """The answer with what the paper's force control makes of the same leg; exit code 3 if that passes it."""
    from hopopt.comparison.paper_control import paper_strategy

    found = guarded(lambda: paper_strategy(solution, simulated and simulated.result()))
    if isinstance(found, Fault):
        assert solution.result_dir is not None  # the answer was saved before
        found.keep(solution.result_dir, "control")
        note(f"the paper's control is missing: {found.sentence}")
        return solution
    if found is None:
        return solution
    code = 3 if found.beyond_bound else solution.summary.exit_code
    return with_more(solution, paper_strategy=found, exit_code=code)


def _had(solution: Solution, draws: int, say: Callable[[str], None]) -> Solution:
    """The answer with what controllers make of it on drawn legs."""
    from hopopt.comparison.robust.robustness import can_be_had

    try:
        return with_more(solution, can_be_had=can_be_had(solution, draws, 0, os.cpu_count() or 1, say))
    except HopoptError as error:
        note(f"what can be had is missing ({error})")
        return solution


def _report(solution: Solution) -> None:
    """Write report.html into the folder of a saved solution."""
    from hopopt.report.content import of_solutions
    from hopopt.report.page import page

    assert solution.result_dir is not None
    try:
        write_new(solution.result_dir / "report.html", page(of_solutions([solution])))
    except (HopoptError, KeyboardInterrupt) as error:
        note(f"the report is missing ({error or 'interrupted'})")
