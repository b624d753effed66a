"""The command that gathers global evidence: evidence."""

import os
import sys
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from hopopt.cli.options import AsJson, Overrides, progress
from hopopt.errors import NotSolvedError, UsageError

MOST_STARTS, MOST_ROWS = 100_000, 2000

Sizes = Annotated[
    tuple[int, ...],
    Parameter(
        name="--grids",
        negative=(),
        consume_multiple=True,
        help="Grids of the dynamic programming, growing: N for N x N states.",
        show_default=lambda sizes: " ".join(map(str, sizes)),
    ),
]


def evidence(
    problem: str | None = None,
    *,
    starts: int = 30,
    grids: Sizes = (40, 120, 320),
    set_: Overrides = None,
    processes: int | None = None,
    resume: Path | None = None,
    results: Path = Path("results"),
    json_: AsJson = False,
) -> int:
    """Say how far the best hop may be trusted to be the best: a bound, a global method, many starts.

    Exit code: 0 the best optimum is verified and nothing speaks against it, 1 no start was solved, 2 wrong usage, 3 it
    is not verified, passes the bound, or the global method finds more than the planner in the reduced hop.

    Parameters
    ----------
    problem
        A problem file, or the name of a built-in one (default: paper).
    starts
        Different starting points: named ones, then drawn ones.
    processes
        How many starts side by side (default: one for each core).
    resume
        Go on with a folder that was begun, with as many starts as are asked for now.
    results
        Folder for the results; each run gets a new folder inside it.
    """
    if not 1 <= starts <= MOST_STARTS or (processes is not None and processes < 1):
        raise UsageError(f"--starts takes 1 to {MOST_STARTS}, --processes at least 1")
    if any(not 8 <= size <= MOST_ROWS for size in grids):
        raise UsageError(f"--grids takes sizes from 8 to {MOST_ROWS}")
    if resume is not None and (problem is not None or set_):
        raise UsageError("--resume goes on with what was begun: leave out the problem and --set")
    from hopopt.problem.load import load
    from hopopt.storage.folder import as_json, prepare, write_json
    from hopopt.studies import local_optima as study

    if resume is None:
        prepare(results)
        design, objective = load(problem or "paper", set_ or ()), "clearance"
        folder = study.open_study(design, objective, results)
    else:
        folder, (design, objective) = resume, study.reopen_study(resume)
    try:
        with progress(quiet=json_) as say:
            ended = study.run_starts(folder, starts, processes or os.cpu_count() or 1, say)
            data = _gathered(design, objective, ended, grids, say)
    except KeyboardInterrupt:
        print(f"hopopt: stopped; go on with: hopopt evidence --resume {folder}", file=sys.stderr)
        return 130
    data["result_dir"] = str(folder)
    write_json(data, folder / "summary.json")
    if json_:
        print(as_json(data))
    else:
        from hopopt.cli.screen.evidence import print_evidence

        print_evidence(data)
    return int(data["exit_code"])


def _gathered(design: Any, objective: str, ended: Any, grids: tuple[int, ...], say: Any) -> dict[str, Any]:
    """Everything that is said, as one object."""
    from hopopt.planner.solve import solve_from
    from hopopt.studies import local_optima as study
    from hopopt.studies.dynamic_programming import CONTRADICTED, TELLING
    from hopopt.verify.upper_bound import upper_bound

    found = study.families(ended)
    if not found:
        statuses = "; ".join(sorted({e.status for e in ended}))
        raise NotSolvedError(f"{design.name}: none of {len(ended)} starts led to a hop.", [statuses])
    say("refining and verifying the best")
    best, bound = solve_from(design, objective, found[0].best.index, say), upper_bound(design)
    passed, simple = best.clearance > bound.clearance, _reduced(design, grids, say)
    finest = (simple.get("grids") or [{"size": 0}])[-1]
    contradicted = finest["size"] >= TELLING and finest["difference"] > CONTRADICTED
    return {
        "problem": design.name, "objective": objective, "upper_bound": bound.figures(),
        "reduced": simple,
        "starts": {"count": len(ended), "solved": sum(e.success for e in ended), "families": study.as_dicts(found)},
        "best": {
            "clearance_m": best.clearance, "verified": best.verified, "failed_checks": list(best.summary.failed_checks),
            "start": found[0].best.name,
        },
        "passes_the_bound": passed,
        "contradicted": contradicted,
        "exit_code": 0 if best.verified and not passed and not contradicted else 3,
    }  # fmt: skip


def _reduced(design: Any, grids: tuple[int, ...], say: Any) -> dict[str, Any]:
    """The reduced hop by both methods; or the reason why not."""
    from hopopt.studies.dynamic_programming import by_dynamic_programming, by_transcription, reduced

    try:
        simple = reduced(design)
        planned, rows = by_transcription(simple, 80), list[dict[str, Any]]()
    except (UsageError, NotSolvedError) as error:
        return {"reason": str(error)}
    for size in grids:
        say(f"dynamic programming on {size} x {size} states")
        height = by_dynamic_programming(simple, size)
        rows.append({"size": size, "height_m": height, "difference": height / planned - 1})
    return {"planned_m": planned, "grids": rows}
