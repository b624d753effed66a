"""The command that gathers global evidence: evidence."""

import os
import sys
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from hopopt import amounts
from hopopt.cli.options import AsJson, Overrides, progress
from hopopt.errors import NotSolvedError, UsageError

MOST_STARTS, MOST_ROWS = 100_000, 2000
FEWEST_NODES, MOST_NODES = 9, 81
HOPS = 20  # steps of basin hopping

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

Nodes = Annotated[
    tuple[int, ...],
    Parameter(
        name="--nodes",
        negative=(),
        consume_multiple=True,
        help="Grids of --global, growing: N nodes along each axis of the states; 61 takes minutes.",
        show_default=lambda sizes: " ".join(map(str, sizes)),
    ),
]


def evidence(
    problem: str | None = None,
    *,
    starts: int = 30,
    grids: Sizes = (40, 120, 320),
    global_: Annotated[bool, Parameter(name="--global", negative=())] = False,
    nodes: Nodes = (21, 31, 41),
    set_: Overrides = None,
    processes: int | None = None,
    resume: Path | None = None,
    results: Path = Path("results"),
    json_: AsJson = False,
) -> int:
    """Say how far the best hop may be trusted to be the best.

    By a bound, global methods, relaxed problems and many starts.

    Exit code: 0 the best optimum is verified and nothing speaks against it, 1 no start was solved, 2 wrong usage.
    Exit code 3: it is not verified, passes the bound, or a global method finds over 1 % more.

    Parameters
    ----------
    problem
        A problem file, or the name of a built-in one (default: paper).
    starts
        Different starting points: named ones, then drawn ones.
    global_
        Also a global method on the whole stance, on growing grids, and what its motions lead to (legs of two joints).
        Other legs get basin hopping over the starts in any case, which is weaker evidence.
    processes
        How many starts side by side (default: one for each core).
    resume
        Go on with a folder that was begun, with as many starts as are asked for now.
    results
        Folder for the results; each run gets a new folder inside it.
    """
    if not 1 <= starts <= MOST_STARTS:
        raise UsageError(f"--starts takes 1 to {MOST_STARTS}")
    amounts.check_processes(processes)
    if not grids or any(not 8 <= size <= MOST_ROWS for size in grids):
        raise UsageError(f"--grids takes sizes from 8 to {MOST_ROWS}")
    if not nodes or any(not FEWEST_NODES <= size <= MOST_NODES for size in nodes):
        raise UsageError(f"--nodes takes sizes from {FEWEST_NODES} to {MOST_NODES}")
    if global_:
        from hopopt.global_search.search import check_size

        check_size(max(nodes))
    if resume is not None and (problem is not None or set_):
        raise UsageError("--resume goes on with what was begun: leave out the problem and --set")
    grids, nodes = (tuple(sorted(set(sizes))) for sizes in (grids, nodes))  # the last, the finest, is judged by
    from hopopt.evidence import local_optima as study
    from hopopt.problem.load import load
    from hopopt.storage.folder import as_json, prepare, write_json
    from hopopt.studies.faults import kept

    if resume is None:
        prepare(results)
        design, objective = load(problem or "paper", set_ or ()), "clearance"
        folder = study.open_study(design, objective, results)
    else:
        folder, (design, objective) = resume, study.reopen_study(resume)
    try:
        with progress(quiet=json_) as say, kept(folder, f"go on with: hopopt evidence --resume {folder}"):
            ended = study.run_starts(folder, starts, processes or os.cpu_count() or 1, say)
            data = _gathered(design, objective, ended, grids, nodes if global_ else (), say)
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


def _gathered(
    design: Any, objective: str, ended: Any, grids: tuple[int, ...], nodes: tuple[int, ...], say: Any
) -> dict[str, Any]:
    """Everything that is said, as one object."""
    from hopopt.evidence import local_optima as study
    from hopopt.evidence.dynamic_programming import CONTRADICTED, TELLING
    from hopopt.nlp.deadline import NEVER
    from hopopt.ocp.hop import Hop
    from hopopt.ocp.objectives.registry import find
    from hopopt.planner.search.families import families
    from hopopt.planner.search.global_verdict import MAY_EXIST, highest, led_to, verdict
    from hopopt.planner.search.multistart import contenders, run_chunk
    from hopopt.planner.solve import TIME_LIMIT, solve_from
    from hopopt.record import as_data
    from hopopt.verify.upper_bound import upper_bound

    found = study.families(ended, find(objective))
    if not found:
        statuses = "; ".join(sorted({e.status for e in ended}))
        raise NotSolvedError(f"{design.name}: none of {len(ended)} starts led to a hop.", [statuses])
    hop = Hop(design, objective)
    outcomes = run_chunk(hop, [f.best.index for f in found])
    more, overall = _searched(hop, outcomes, nodes, say)
    outcomes += more
    say("refining and verifying the best")
    best = solve_from(hop, contenders(outcomes), outcomes, say, NEVER.within(TIME_LIMIT))
    bound = upper_bound(design)
    passed, simple = best.clearance > bound.clearance_m, _reduced(design, grids, say)
    finest = (simple.get("grids") or [{"size": 0}])[-1]
    contradicted = finest["size"] >= TELLING and finest["difference"] > CONTRADICTED
    known_as = families(hop, outcomes, [best])
    on_finest = (overall.get("grids") or [{"value_m": None, "rollout_m": None}])[-1]
    said = verdict(on_finest["value_m"], highest(on_finest["rollout_m"], led_to(known_as)), best.clearance)
    overall |= {"verdict": said, "alarm": said == MAY_EXIST}
    return {
        "problem": design.name, "objective": objective, "upper_bound": as_data(bound),
        "reduced": simple, "global": overall,
        "starts": {"count": len(ended), "solved": sum(e.success for e in ended), "families": [f.as_dict() for f in found]},
        "families": [as_data(f) for f in known_as],
        "best": {
            "clearance_m": best.clearance, "verified": best.verified, "failed_checks": list(best.summary.failed_checks),
            "start": best.summary.starts.chosen,
        },
        "passes_the_bound": passed,
        "contradicted": contradicted,
        "exit_code": 0 if best.verified and not passed and not contradicted and not overall["alarm"] else 3,
    }  # fmt: skip


def _searched(hop: Any, known: Any, nodes: tuple[int, ...], say: Any) -> tuple[list[Any], dict[str, Any]]:
    """Hops from relaxed problems and, on grids or by basin hopping, from all over; and the grids' account."""
    from hopopt.evidence import thorough_search as thorough
    from hopopt.global_search import applies
    from hopopt.nlp.deadline import NEVER
    from hopopt.planner.solve import TIME_LIMIT

    more = thorough.relaxed(hop, known, say, NEVER.within(TIME_LIMIT))
    if reason := applies(hop.design):
        hops = thorough.hopped(hop, HOPS, [*known, *more], say, NEVER.within(TIME_LIMIT))
        return more + hops, {"reason": reason, "basin_hopping": len(hops)}
    if not nodes:
        return more, {"reason": "not asked for (--global)"}
    rows, ended = thorough.on_grids(hop, nodes, [*known, *more], say)
    if not rows:
        return more, {"reason": f"a grid of {nodes[0]} nodes took longer than {thorough.LONGEST_GRID:g} s"}
    return more + ended, {"method": rows[-1]["method"], "grids": rows}


def _reduced(design: Any, grids: tuple[int, ...], say: Any) -> dict[str, Any]:
    """The reduced hop by both methods; or the reason why not."""
    from hopopt.evidence.dynamic_programming import by_dynamic_programming, by_transcription, reduced

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
