"""The command that runs design studies: sweep."""

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

from hopopt import amounts
from hopopt.cli.expected_time import ExpectedTime
from hopopt.cli.options import AsJson, Constraints, Figures, Overrides, drawn, ended, note, repeated
from hopopt.cli.screen.console import Shown, progress
from hopopt.cli.screen.studies import of_map, of_sweep
from hopopt.errors import UsageError
from hopopt.planner.search.first_mesh import SEARCH
from hopopt.plots.studies.sweep import save_all
from hopopt.problem.load import catalogue_of, load
from hopopt.problem.own import name_of, with_constraints
from hopopt.studies.maps.run import CHECKED, check_verify_best, run_map
from hopopt.studies.sweep.definition import Definition, define, parse
from hopopt.studies.sweep.order import SEED_FOR, SPOTS
from hopopt.studies.sweep.recheck import Rechecked, recheck_study
from hopopt.studies.sweep.run import run
from hopopt.studies.sweep.store import read_definition

SEARCHED = 1 + SPOTS  # points of a small study that are searched as a single solve is

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
    constraint: Constraints = None,
    set_: Overrides = None,
    starts: int | None = None,
    processes: int | None = None,
    scheduler: str | None = None,
    preliminary: bool = False,
    verify_best: int = 0,
    resume: Path | None = None,
    results: Path = Path("results"),
    figures: Figures = True,
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
        What to make as large, or as small, as possible: as in hopopt solve.
    starts
        Search every point from so many starting points (default: seeds and spots alone, from solver.starts).
    processes
        How many points side by side (default: one for each core).
    scheduler
        Let the workers of a Dask scheduler do it: its address, or "local" for a cluster on this computer.
    preliminary
        Solve every point on the first mesh alone, warm from its neighbour: many designs a second, none of them verified but
        five that are drawn.
    verify_best
        With --preliminary: how many of the best points are solved and verified in full.
    resume
        The folder of a study that was interrupted: it goes on where it stopped; nothing else need be given.
    results
        Folder for the results; each study gets a new folder inside it.
    """
    definition = _definition(problem, vary, sample, seed, objective, constraint, set_, starts, resume, preliminary)
    check_verify_best(verify_best, definition.preliminary)
    amounts.check_processes(processes)
    folders = [] if resume is None else [resume]
    try:
        with progress(json_, _expected(definition, processes, resume)) as say:
            settings: dict[str, Any] = {
                "processes": processes, "scheduler": scheduler, "results": results, "resume": resume, "progress": say,
                "opened": folders.append,
            }  # fmt: skip
            mapped = run_map(definition, verify_best=verify_best, **settings) if definition.preliminary else None
            study = mapped or run(definition, **settings)
            if figures:
                say("drawing")
                safe = f"the data in {study.folder} are complete"
                drawn(lambda: save_all(study, study.folder / "figures"), "figures are missing", safe)
    except KeyboardInterrupt:
        if not folders:
            raise
        kept = f"interrupted; what is finished is kept: hopopt sweep --resume {folders[-1]}"
        raise KeyboardInterrupt(kept) from None
    return ended(study.as_dict(), json_, of_map(mapped) if mapped else of_sweep(study), study.exit_code)


def _expected(definition: Definition, processes: int | None, folder: Path | None) -> ExpectedTime:
    """How long the points take that are not finished."""
    finished = 0 if folder is None else len(list((folder / "points").glob("*.json")))
    side_by_side = min(processes or os.cpu_count() or 1, os.cpu_count() or 1)
    left = max(len(definition.points) - finished, 0)
    if definition.preliminary:
        parts = {"solve": 1.0, "design of a map": left / side_by_side, "point": CHECKED / side_by_side}
        return ExpectedTime("map", definition.design, parts)
    searched = left if definition.starts is not None else min(left, SEARCHED + 2 * left // SEED_FOR)
    kind = "start alone" if (definition.starts or definition.design.solver.starts) < SEARCH else "point"
    parts = {kind: searched / side_by_side, "point from neighbours": (left - searched) / side_by_side}
    return ExpectedTime("sweep", definition.design, parts)


def verify_study(folder: Path, json_: bool) -> int:
    """Verify every point of a stored study again; exit code 0 if all that it states is confirmed and no file was changed,
    3 if not."""
    with progress(quiet=json_) as say:
        found, wrong = recheck_study(folder, say)
    doubts = [*wrong, *(f"{r.path.name}: {r.doubt}" for r in found if r.doubt)]
    for words in doubts:
        note(words)
    code = 3 if doubts or any(r.fault for r in found) else 0
    data = {"verified": not code, "exit_code": code, "changed": doubts, "points": [r.as_dict() for r in found]}
    return ended(data, json_, rechecked(folder, found, doubts), code)


def _definition(
    problem: str | None,
    vary: list[str] | None,
    sample: str | None,
    seed: int,
    objective: str,
    constraint: list[str] | None,
    set_: list[str] | None,
    starts: int | None,
    resume: Path | None,
    preliminary: bool,
) -> Definition:
    """What is asked for; with only --resume, what that study's folder says."""
    if resume is not None and not (problem or vary or sample or set_ or constraint):
        found = read_definition(resume)
        for name, asked in {"objective": objective, "seed": seed, "starts": starts}.items():
            if asked not in ("clearance", 0, None, has := getattr(found, name)):
                stated = "that of the problem" if has is None else has
                raise UsageError(f"--{name} {asked}: of the study in {resume} it is {stated}: leave --{name} out")
        if preliminary and not found.preliminary:
            raise UsageError(
                f"--preliminary: every point of the study in {resume} is verified: leave --preliminary out"
            )
        return found
    design = with_constraints(load(problem or "paper", set_ or ()), constraint or ())
    return define(
        design,
        parse(vary or ()),
        objective=name_of(objective),
        sample=sample,
        seed=seed,
        starts=starts,
        preliminary=preliminary,
        entries=catalogue_of(problem or "paper", set_ or ()),
    )


def rechecked(folder: Path, found: Sequence[Rechecked], doubts: Sequence[str]) -> Iterator[Shown]:
    """Points that were verified again: what each states, and what is wrong with that; and which files were changed."""
    for r in found:
        stated = "nothing" if r.stated.clearance_m is None else f"{r.stated.clearance_m:.4f} m"
        wrong = r.fault or r.doubt
        yield f"point {r.stated.index}: states {stated}: {f'FAILED: {wrong}' if wrong else 'verified'}"
    bad = sum(bool(r.fault) for r in found)
    mend = f"remove a point's file to have it solved again, then hopopt sweep --resume {folder} writes the tables"
    files = f"; {'; '.join(doubts)}: {mend}" if doubts else ""
    verdict = "NOT verified" if bad or doubts else "verified"
    yield f"{folder}: {verdict}: {len(found) - bad} of {len(found)} points confirmed{files}"
