"""The command that runs design studies: sweep."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from hopopt import amounts
from hopopt.cli.options import AsJson, Overrides, progress, repeated
from hopopt.errors import UsageError

if TYPE_CHECKING:
    from hopopt.studies.sweep.definition import Definition
    from hopopt.studies.sweep.run import Study

Vary = Annotated[
    list[str] | None,
    repeated(
        "--vary", "An entry and its values: leg.gear.ratio=60:160:11, or =60,80,100, or with a sample =60:160 (repeat)."
    ),
]


def sweep(
    problem: str | None = None,
    *,
    vary: Vary = None,
    sample: str | None = None,
    seed: int = 0,
    objective: str = "clearance",
    set_: Overrides = None,
    starts: int | None = None,
    processes: int | None = None,
    scheduler: str | None = None,
    resume: Path | None = None,
    results: Path = Path("results"),
    figures: bool = True,
    json_: AsJson = False,
) -> int:
    """Solve a problem at many values of one entry or several.

    Every point is verified: a table, figures, and the best of them.

    Exit code: 0 every point verified or its failure stated, 1 none verified, 2 wrong usage, 3 some not verified.

    Parameters
    ----------
    problem
        A problem file, or the name of a built-in one (default: paper).
    sample
        Points drawn between lower and upper in place of a grid: lhs:40 (Latin hypercube) or sobol:64.
    seed
        Seed of the sample.
    objective
        What to make as large, or as small, as possible: as in hopopt solve, but no function of your own.
    starts
        Starting points of those points that have no neighbour yet (default: the problem's solver.starts).
    processes
        How many points side by side (default: one for each core).
    scheduler
        Let the workers of a Dask scheduler do it: its address, or "local" for a cluster on this computer.
    resume
        The folder of a study that was interrupted: it goes on where it stopped; nothing else need be given.
    results
        Folder for the results; each study gets a new folder inside it.
    figures
        Draw the figures.
    """
    definition = _definition(problem, vary, sample, seed, objective, set_, starts, resume)
    amounts.check_processes(processes)
    from hopopt.studies.sweep.run import run

    folders = [] if resume is None else [resume]
    try:
        with progress(quiet=json_) as say:
            study = run(
                definition, processes=processes, scheduler=scheduler, results=results, resume=resume, progress=say,
                opened=folders.append,
            )  # fmt: skip
            if figures:
                say("drawing")
                _draw(study)
    except KeyboardInterrupt:
        if not folders:
            raise
        print(f"hopopt: interrupted; what is finished is kept: hopopt sweep --resume {folders[-1]}", file=sys.stderr)
        return 130
    _answer(study, json_)
    return study.exit_code


def verify_study(folder: Path, as_object: bool) -> int:
    """Verify every point of a stored study again; exit code 0 if all that it states is confirmed and no file was changed,
    3 if not."""
    from hopopt.storage.folder import as_json
    from hopopt.studies.sweep.recheck import recheck_study

    with progress(quiet=as_object) as say:
        found, wrong = recheck_study(folder, say)
    doubts = [*wrong, *(f"{r.path.name}: {r.doubt}" for r in found if r.doubt)]
    for words in doubts:
        print(f"hopopt: {words}", file=sys.stderr)
    code = 3 if doubts or any(r.fault for r in found) else 0
    if as_object:
        points = [r.as_dict() for r in found]
        print(as_json({"verified": not code, "exit_code": code, "changed": doubts, "points": points}))
        return code
    from hopopt.cli.screen.sweep import print_rechecked

    print_rechecked(folder, found, doubts)
    return code


def _definition(
    problem: str | None,
    vary: list[str] | None,
    sample: str | None,
    seed: int,
    objective: str,
    set_: list[str] | None,
    starts: int | None,
    resume: Path | None,
) -> "Definition":
    """What is asked for; with only --resume, what that study's folder says."""
    if resume is not None and not (problem or vary or sample or set_):
        from hopopt.studies.sweep.store import read_definition

        found = read_definition(resume)
        for name, asked in {"objective": objective, "seed": seed, "starts": starts}.items():
            if asked not in ("clearance", 0, None, has := getattr(found, name)):
                stated = "that of the problem" if has is None else has
                raise UsageError(f"--{name} {asked}: of the study in {resume} it is {stated}: leave --{name} out")
        return found
    from hopopt.problem.load import load
    from hopopt.studies.sweep.definition import define, parse

    design = load(problem or "paper", set_ or ())
    return define(design, parse(vary or ()), objective=objective, sample=sample, seed=seed, starts=starts)


def _draw(study: "Study") -> None:
    import logging

    from hopopt.plots.studies.sweep import save_all
    from hopopt.storage.folder import reason_of

    try:
        save_all(study, study.folder / "figures")
    except (Exception, KeyboardInterrupt) as error:  # the data are what took the time
        words = f"figures are missing ({reason_of(error)}); the data in {study.folder} are complete"
        logging.getLogger(__name__).warning(words)


def _answer(study: "Study", as_object: bool) -> None:
    if as_object:
        from hopopt.storage.folder import as_json

        print(as_json(study.as_dict()))
        return
    from hopopt.cli.screen.sweep import print_study

    print_study(study)
