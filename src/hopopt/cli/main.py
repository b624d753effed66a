"""The command line. Heavy imports happen inside the commands, so that ``--help`` answers at once."""

import gc
import json
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any, Literal

from cyclopts import CycloptsError

from hopopt import amounts
from hopopt.cli.answer import diagnose as cli_diagnose
from hopopt.cli.answer import evidence as cli_evidence
from hopopt.cli.answer import verify as cli_verify
from hopopt.cli.controllers import compare as cli_runs
from hopopt.cli.controllers import robust as cli_robust
from hopopt.cli.hops import transition as cli_transition
from hopopt.cli.options import AsJson, Constraints, Couple, CrossChecked, Free, Overrides, app, progress, write_new
from hopopt.cli.paper import calibrate as cli_paper
from hopopt.cli.robot_data import identify as cli_identify
from hopopt.cli.robot_data import log as cli_log
from hopopt.cli.setup import actuators as cli_actuators
from hopopt.cli.setup import doctor as cli_doctor
from hopopt.cli.setup import schema as cli_schema
from hopopt.cli.share import animate as cli_animate
from hopopt.cli.share import export as cli_export
from hopopt.cli.share import report as cli_report
from hopopt.cli.share import view as cli_view
from hopopt.cli.studies import families as cli_families
from hopopt.cli.studies import pareto as cli_pareto
from hopopt.cli.studies import sensitivity as cli_studies
from hopopt.cli.studies import sweep as cli_sweep
from hopopt.errors import HopoptError, NotSolvedError, UsageError
from hopopt.nlp.deadline import NEVER

if TYPE_CHECKING:
    from hopopt.design import Design
    from hopopt.planner.solution import Solution


MORE = 5.0  # s that figures and a simulation take, which are not begun with less time left


@app.command
def solve(
    problem: str = "paper",
    *,
    objective: str = "clearance",
    hop: Literal["single", "landing", "periodic"] | None = None,
    set_: Overrides = None,
    constraint: Constraints = None,
    free: Free = None,
    couple: Couple = None,
    starts: int | None = None,
    processes: int | None = None,
    time_limit: float | None = None,
    structure: bool = False,
    cross_check: CrossChecked = False,
    control: bool = True,
    draws: int = 0,
    results: Path = Path("results"),
    figures: bool = True,
    report: bool = False,
    json_: AsJson = False,
) -> int:
    """Find the highest hop of a leg (or another best one), verify it, and save it with its figures.

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
    starts
        How many different starting points to solve from (default: the problem's solver.starts).
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
    results
        Folder for the results; each run gets a new folder inside it.
    figures
        Draw the figures.
    report
        Also write report.html into the results folder: a page with the hop moving (hopopt report has more).
    """
    began = time.perf_counter()
    from hopopt.problem.load import load

    set_ = [*(set_ or ()), *([f'hop.kind="{hop}"'] if hop else ())]
    design = load(problem, set_)
    amounts.check("starts", starts)
    amounts.check_processes(processes)
    if time_limit is not None and not time_limit >= 1:
        raise UsageError("--time-limit must be at least 1 s")
    if couple and not free:
        raise UsageError("--couple relates numbers that are free: give them as --free leg.thigh.length=0.3:0.45")
    _check_draws(draws, objective, constraint or (), design)
    from hopopt.problem.hints import hints
    from hopopt.storage.folder import prepare

    prepare(results)
    for words in hints(design):
        print(f"hopopt: {words}", file=sys.stderr)  # before what may take long

    control = control and not design.hop.lands  # the paper's control ends with the apex
    draw: Callable[[Solution, Path], Any] | None = None
    with progress(quiet=json_) as say:
        more = {"constraints": constraint or (), "starts": starts, "processes": processes}
        more |= {"time_limit": time_limit, "progress": say}
        once = {"structure": structure, "cross_check": cross_check}
        later = {"hopopt.storage.solution": True, "hopopt.plots.hop": figures, "hopopt.studies.compare": control}
        _import_beside(*(name for name, wanted in later.items() if wanted))
        from hopopt.planner.solve import TIME_LIMIT

        end = NEVER.within(time_limit or TIME_LIMIT)
        solution = _solved(design, objective, free, couple, once, more)
        from hopopt.storage.solution import save

        if end.seconds_left < MORE and (figures or control or draws or report):
            figures = control = report = False
            draws = 0
            print("hopopt: the answer alone: the time limit leaves no time for more", file=sys.stderr)
        if figures:
            from hopopt.plots.hop import save_all as draw

            say("drawing")
        took = time.perf_counter() - began  # all but drawing and writing
        solution = solution.with_summary(overrides=tuple(set_), wall_s=took)
        solution = save(solution, results, draw)
        if control:
            say("simulating the paper's force control")
            with suppress(KeyboardInterrupt):  # the answer is there
                solution = _beside(solution)
        if draws and solution.verified:
            with suppress(KeyboardInterrupt):
                solution = _had(solution, draws, say)
        if report:
            say("writing the report")
            _report(solution)
    _answer(solution, json_)
    return solution.summary.exit_code


def _import_beside(*later: str) -> None:
    """Import what comes after the solve while it runs: Ipopt, and waiting for other processes, leave Python's time free.

    What the solve itself needs is imported before, for modules that import each other must not do so in two threads.
    """
    import_module("hopopt.planner.solve")

    def load() -> None:
        with suppress(ImportError):  # whoever needs it says so
            for name in later:
                import_module(name)

    Thread(target=load).start()


def _beside(solution: "Solution") -> "Solution":
    """The answer with what the paper's force control makes of the same leg; exit code 3 if that passes it."""
    from hopopt.storage.solution import with_more
    from hopopt.studies.compare import paper_strategy

    if (found := paper_strategy(solution)) is None:
        return solution
    code = 3 if found.beyond_bound else solution.summary.exit_code
    return with_more(solution, paper_strategy=found, exit_code=code)


def _check_draws(draws: int, objective: str, constraints: Sequence[str], design: "Design") -> None:
    """UsageError where legs are drawn for a hop that is no bound of theirs."""
    amounts.check("draws", draws, 0)
    if draws:
        from hopopt.control.closed_loop import make_plant
        from hopopt.design import refuse_landed

        if objective != "clearance" or constraints:
            raise UsageError("--draws is for the objective clearance without user-defined constraints")
        refuse_landed(design, "solve --draws")
        make_plant(design)


def _had(solution: "Solution", draws: int, say: Callable[[str], None]) -> "Solution":
    """The answer with what controllers make of it on drawn legs; the answer is there, so what goes wrong is only reported."""
    from hopopt.storage.solution import with_more
    from hopopt.studies.robustness import can_be_had

    try:
        return with_more(solution, can_be_had=can_be_had(solution, draws, 0, os.cpu_count() or 1, say))
    except HopoptError as error:
        print(f"hopopt: what can be had is missing ({error})", file=sys.stderr)
        return solution


def _report(solution: "Solution") -> None:
    """Write report.html into the folder of a saved solution; the answer is there, so what goes wrong is only reported."""
    from hopopt.report.content import of_solutions
    from hopopt.report.page import page

    assert solution.result_dir is not None
    try:
        write_new(solution.result_dir / "report.html", page(of_solutions([solution])))
    except (HopoptError, KeyboardInterrupt) as error:
        print(f"hopopt: the report is missing ({error or 'interrupted'})", file=sys.stderr)


def _solved(
    design: "Design",
    objective: str,
    free: list[str] | None,
    couple: list[str] | None,
    once: dict[str, bool],
    more: dict[str, Any],
) -> "Solution":
    """The best hop of the design, or of the best design if numbers of it are free."""
    if not free:
        from hopopt.planner.solve import solve as run

        return run(design, objective, **once, **more)
    for asked in (name.replace("_", "-") for name, wanted in once.items() if wanted):
        raise UsageError(f"--{asked} goes with a design that is given: use it on the problem.toml that --free finds")
    from hopopt.ocp.free_parameters import parse_free
    from hopopt.studies.codesign import codesign

    return codesign(design, parse_free(free), objective, couple=couple or (), **more)


@app.command
def show(what: str = "paper", *, set_: Overrides = None, json_: AsJson = False) -> int:
    """Print a stored answer with all that is known of it, or a problem with every entry, its value, unit and meaning.

    Parameters
    ----------
    what
        A folder that hopopt solve wrote; or a problem file, or the name of a built-in problem.
    """
    if Path(what).is_dir():
        from hopopt.storage.folder import fitting
        from hopopt.storage.solution import read

        if set_:
            raise UsageError("--set changes an entry of a problem: a stored answer is shown as it is")
        with fitting(Path(what)):
            _answer(read(what), json_, whole=True)
        return 0
    from hopopt.problem.load import as_json, load, rows

    design = load(what, set_ or ())
    if json_:
        print(json.dumps(as_json(design)))
        return 0
    from hopopt.cli.screen.console import print_rows

    print_rows(design.title or design.name, rows(design))
    return 0


@app.command
def new(name: str) -> int:
    """Write NAME.toml: a commented problem file to start from. An existing file is never overwritten.

    Parameters
    ----------
    name
        Name of the problem, with or without .toml; may lie in a folder: legs/mine.
    """
    from hopopt.problem.load import template

    if name.endswith(("/", os.sep)) or Path(name).name in ("", "..", ".toml"):
        raise UsageError(f'"{name}" names no file: give a name such as mine, or legs/mine')
    path = Path(name if name.endswith(".toml") else f"{name}.toml")
    write_new(path, template(path.stem))
    print(f"{path} written. Change it, then: hopopt solve {path}")
    return 0


def _answer(solution: "Solution", as_object: bool, whole: bool = False) -> None:
    """Print an answer: as one object, or for a person short or ``whole``; one that is not verified is never short, but
    where the time was up."""
    if as_object:
        from hopopt.storage.folder import as_json
        from hopopt.storage.solution import stated

        print(as_json(stated(solution.shown)))
        return
    from hopopt.cli.screen.answer import print_answer, print_late
    from hopopt.cli.screen.details import print_details

    s = solution.summary
    unverified = print_late if s.late else print_details
    show_it = print_details if whole else print_answer if s.verified else unverified
    show_it(solution)
    if solution.summary.codesign:
        from hopopt.cli.screen.codesign import print_codesign

        print_codesign(solution.summary.codesign)
    if solution.summary.second_opinions:
        from hopopt.cli.screen.cross_check import print_cross_checks

        print_cross_checks(solution.summary)


for command in (
    cli_verify.verify, cli_verify.repair, cli_runs.simulate, cli_runs.compare, cli_export.export, cli_studies.sensitivity, cli_paper.calibrate,
    cli_paper.tune, cli_paper.reproduce, cli_sweep.sweep, cli_pareto.pareto, cli_actuators.actuators,
    cli_evidence.evidence, cli_families.families, cli_diagnose.diagnose, cli_schema.schema, cli_robust.robust,
    cli_transition.transition, cli_doctor.doctor, cli_report.report, cli_animate.animate, cli_log.log,
    cli_identify.identify, cli_view.view,
):  # fmt: skip
    app.command(command)
app.register_install_completion_command(help="Let the shell complete hopopt's commands and options (bash, zsh, fish).")
for each in app.subapps:
    each.help_epilogue = ""  # where to start is said once, on the first page


def main(arguments: list[str] | None = None) -> None:
    """Entry point: runs a command and exits with its code; every expected fault is a sentence on standard error."""
    _ended_as_by_ctrl_c(signal.SIGTERM, signal.SIGHUP)
    gc.set_threshold(100_000)  # imports leave no garbage in cycles: less search for it is a tenth of a cold answer
    code = run(arguments)
    gc.freeze()  # nor is there any to look for on the way out
    sys.exit(code)


def _ended_as_by_ctrl_c(*signals: signal.Signals) -> None:
    """So that what is known is kept, and the processes of a search end too; nohup ignores SIGHUP, and so do we then."""
    for each in signals:
        if signal.getsignal(each) is signal.SIG_DFL:
            signal.signal(each, signal.default_int_handler)


def run(arguments: list[str] | None = None) -> int:
    """Run one command line and return its exit code."""
    words = sys.argv[1:] if arguments is None else arguments
    try:
        if any("\0" in word for word in words):
            raise UsageError("an argument holds a NUL character, which no name and no number has")
        result = app(
            arguments, exit_on_error=False, print_error=False, result_action="return_value", help_on_error=False
        )
        return result if isinstance(result, int) else 0
    except CycloptsError as error:
        print(f"hopopt: {error}", file=sys.stderr)
        command = f"{words[0]} " if words and words[0] in app else ""
        print(f"Try: hopopt {command}--help", file=sys.stderr)
        return 2
    except HopoptError as error:
        print(f"hopopt: {error}", file=sys.stderr)
        if isinstance(error, NotSolvedError) and "--json" in words:
            failure = {"status": "not solved", "verified": False, "exit_code": 1, "clearance_m": None}
            print(json.dumps({**failure, "message": str(error), "diagnosis": error.diagnosis}))
        return error.exit_code
    except KeyboardInterrupt:
        print("hopopt: interrupted; nothing was written", file=sys.stderr)
        return 130
    except BrokenPipeError:
        return 0
    except OSError as error:  # of a file or folder that no command expected to be as it is
        from hopopt.storage.folder import reason_of

        where = f"{error.filename!s:.200}: " if error.filename else ""
        print(f"hopopt: {where}{reason_of(error)}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    main()
