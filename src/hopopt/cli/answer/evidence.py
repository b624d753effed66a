"""The command that gathers global evidence: evidence."""

import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from rich.table import Column

from hopopt import amounts
from hopopt.cli.expected_time import ExpectedTime
from hopopt.cli.options import AsJson, Overrides, Results, ended, sizes
from hopopt.cli.screen.answer import bound_line
from hopopt.cli.screen.console import NamedLines, Shown, marked, progress, table
from hopopt.design import Design
from hopopt.errors import NotSolvedError, UsageError
from hopopt.evidence import dynamic_programming as upright
from hopopt.evidence import local_optima as study
from hopopt.evidence import thorough_search as thorough
from hopopt.evidence.dynamic_programming import CONTRADICTING_HEIGHT, TELLING
from hopopt.global_search import applies, left_out
from hopopt.global_search.search import check_size
from hopopt.nlp.deadline import NEVER
from hopopt.ocp.hop import Hop
from hopopt.ocp.objectives.registry import find
from hopopt.planner.checks.global_verdict import MAY_EXIST, highest, led_to, verdict
from hopopt.planner.search.families import families
from hopopt.planner.search.multistart import contenders, run_chunk
from hopopt.planner.solve import TIME_LIMIT, solve_from
from hopopt.problem.load import load
from hopopt.record import as_data
from hopopt.storage.folder import prepare, write_json
from hopopt.studies.faults import kept
from hopopt.verify.upper_bound import upper_bound

MOST_STARTS, MOST_ROWS = 100_000, 2000
FEWEST_NODES, MOST_NODES = 9, 81
BASIN_HOPS = 20  # steps of basin hopping
Say = Callable[[str], None]

Sizes = Annotated[tuple[int, ...], sizes("--grids", "Grids of the dynamic programming, growing: N for N x N states.")]
Nodes = Annotated[
    tuple[int, ...],
    sizes("--nodes", "Grids of --global, growing: N nodes along each axis of the states; 61 takes minutes."),
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
    results: Results = Path("results"),
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
    """
    if not 1 <= starts <= MOST_STARTS:
        raise UsageError(f"--starts takes 1 to {MOST_STARTS}")
    amounts.check_processes(processes)
    if not grids or any(not 8 <= size <= MOST_ROWS for size in grids):
        raise UsageError(f"--grids takes sizes from 8 to {MOST_ROWS}")
    if not nodes or any(not FEWEST_NODES <= size <= MOST_NODES for size in nodes):
        raise UsageError(f"--nodes takes sizes from {FEWEST_NODES} to {MOST_NODES}")
    if global_:
        check_size(max(nodes))
    if resume is not None and (problem is not None or set_):
        raise UsageError("--resume goes on with what was begun: leave out the problem and --set")
    grids, nodes = (tuple(sorted(set(sizes))) for sizes in (grids, nodes))  # the last, the finest, is judged by
    if resume is None:
        prepare(results)
        design, objective = load(problem or "paper", set_ or ()), "clearance"
        folder = study.open_study(design, objective, results)
    else:
        folder, (design, objective) = resume, study.reopen_study(resume)
    go_on = f"go on with: hopopt evidence --resume {folder}"
    try:
        grid = float(len(nodes) * global_ + len(grids))
        expected = ExpectedTime("evidence", design, {"first-mesh start": float(starts), "grid": grid, "solve": 1.0})
        with progress(json_, expected) as say, kept(folder, go_on):
            tried = study.run_starts(folder, starts, processes or os.cpu_count() or 1, say)
            data = _gathered(design, objective, tried, grids, nodes if global_ else (), say)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"stopped; {go_on}") from None
    data["result_dir"] = str(folder)
    write_json(data, folder / "summary.json")
    return ended(data, json_, shown(data), data["exit_code"])


def _gathered(
    design: Design, objective: str, tried: list[study.Ended], grids: tuple[int, ...], nodes: tuple[int, ...], say: Say
) -> dict[str, Any]:
    """Everything that is said, as one object."""
    found = study.families(tried, find(objective))
    if not found:
        statuses = "; ".join(sorted({e.status for e in tried}))
        raise NotSolvedError(f"{design.name}: none of {len(tried)} starts led to a hop.", [statuses])
    hop = Hop(design, objective)
    outcomes = run_chunk(hop, [f.best.index for f in found])
    more, overall = _searched(hop, outcomes, nodes, say)
    outcomes += more
    say("refining and verifying the best")
    best = solve_from(hop, contenders(outcomes), outcomes, say, NEVER.within(TIME_LIMIT))
    bound = upper_bound(design)
    passed, simple = best.clearance > bound.clearance_m, _reduced(design, grids, say)
    finest = (simple.get("grids") or [{"size": 0}])[-1]
    contradicted = finest["size"] >= TELLING and finest["difference"] > CONTRADICTING_HEIGHT
    known_as = families(hop, outcomes, [best])
    on_finest = (overall.get("grids") or [{"value_m": None, "rollout_m": None}])[-1]
    relaxed, solved = left_out(design), led_to(known_as)
    reached = solved if relaxed else highest(on_finest["rollout_m"], solved)
    said = verdict(on_finest["value_m"], reached, best.clearance, relaxed)
    overall |= {"verdict": said, "alarm": said == MAY_EXIST}
    return {
        "problem": design.name, "objective": objective, "upper_bound": as_data(bound),
        "reduced": simple, "global": overall,
        "starts": {"count": len(tried), "solved": sum(e.success for e in tried), "families": [f.as_dict() for f in found]},
        "families": [as_data(f) for f in known_as],
        "best": {
            "clearance_m": best.clearance, "verified": best.verified, "failed_checks": list(best.summary.failed_checks),
            "start": best.summary.starts.chosen,
        },
        "passes_the_bound": passed,
        "contradicted": contradicted,
        "exit_code": 0 if best.verified and not passed and not contradicted and not overall["alarm"] else 3,
    }  # fmt: skip


def _searched(hop: Hop, known: Any, nodes: tuple[int, ...], say: Say) -> tuple[list[Any], dict[str, Any]]:
    """Hops from relaxed problems and, on grids or by basin hopping, from all over; and the grids' account."""
    more = thorough.relaxed(hop, known, say, NEVER.within(TIME_LIMIT))
    if reason := applies(hop.design):
        hops = thorough.hopped(hop, BASIN_HOPS, [*known, *more], say, NEVER.within(TIME_LIMIT))
        return more + hops, {"reason": reason, "basin_hopping": len(hops)}
    if not nodes:
        return more, {"reason": "not asked for (--global)"}
    rows, ended = thorough.on_grids(hop, nodes, [*known, *more], say)
    if not rows:
        return more, {"reason": f"a grid of {nodes[0]} nodes took longer than {thorough.LONGEST_GRID:g} s"}
    return more + ended, {"method": rows[-1]["method"], "grids": rows}


def _reduced(design: Design, grids: tuple[int, ...], say: Say) -> dict[str, Any]:
    """The reduced hop by both methods; or the reason why not."""
    try:
        simple = upright.reduced(design)
        planned, rows = upright.by_transcription(simple, 80), list[dict[str, Any]]()
    except (UsageError, NotSolvedError) as error:
        return {"reason": str(error)}
    for size in grids:
        say(f"dynamic programming on {size} x {size} states")
        height = upright.by_dynamic_programming(simple, size)
        rows.append({"size": size, "height_m": height, "difference": height / planned - 1})
    return {"planned_m": planned, "grids": rows}


def shown(data: Mapping[str, Any]) -> Iterator[Shown]:
    """The best hop, the bound, the reduced hop by two methods, and the families of local optima."""
    best, starts = data["best"], data["starts"]
    state = "verified" if best["verified"] else f"NOT verified ({', '.join(best['failed_checks'])})"
    yield marked(
        f"[bold]{data['problem']}[/bold]: best of {starts['count']} starts {best['clearance_m']:.4f} m, {state}"
    )
    yield NamedLines("bound", bound_line(data["upper_bound"]["clearance_m"], data["objective"]))
    if data["contradicted"]:
        yield marked(
            "[bold red]the global method finds more than the planner in the reduced hop[/bold red]: neither is to be trusted"
        )
    yield NamedLines("global", _global_lines(data["global"], best["clearance_m"]))
    yield NamedLines("reduced", _reduced_lines(data["reduced"]))
    rows = [
        (f"{f['objective_value']:.4f}", str(_count(data, f)), f["words"], f["found_by"][0]) for f in data["families"]
    ]
    numbers = [Column(head, justify="right") for head in ("height [m]", "starts")]
    yield table([*numbers, "what it does", "first found by"], rows, "local optima on the first mesh")
    if failed := starts["count"] - starts["solved"]:
        yield f"{failed} of the starts led to no hop"
    yield f"results {data['result_dir']}"


def _count(data: Mapping[str, Any], family: Mapping[str, Any]) -> int:
    """How many starts, relaxed problems and motions of a global method ended in a family, or were stopped near it."""
    drawn = {f["name"]: f["count"] for f in data["starts"]["families"]}
    return sum(drawn.get(name, 1) for name in (*family["found_by"], *family.get("stopped", ())))


def _global_lines(overall: Mapping[str, Any], best: float) -> list[str]:
    """The global method on growing grids, or why not."""
    if "grids" not in overall:
        hops = f"; basin hopping over {overall['basin_hopping']} starts instead" if "basin_hopping" in overall else ""
        return [f"left out: {overall['reason']}{hops}"]
    lines = [f"{overall['method']}; it approximates and is no bound"]
    for g in overall["grids"]:
        motion = (
            "no motion"
            if g["rollout_m"] is None
            else f"a motion of {g['rollout_m']:.4f} m ({g['rollout_m'] / best - 1:+.1%})"
        )
        solved = "no hop" if g["solved_m"] is None else f"{g['solved_m']:.4f} m"
        lines.append(
            f"{g['size']}^4 states: value {g['value_m']:.4f} m ({g['value_m'] / best - 1:+.1%}), {motion}, "
            f"solved from there {solved}, {g['seconds']:.0f} s"
        )
    return [*lines, f"verdict: {overall['verdict']}"]


def _reduced_lines(reduced: Mapping[str, Any]) -> list[str]:
    if "reason" in reduced:
        return [f"left out: {reduced['reason']}"]
    rows = ", ".join(
        f"{r['height_m']:.4f} m ({r['difference']:+.2%}) on {r['size']} x {r['size']}" for r in reduced["grids"]
    )
    coarse = f"; grids below {TELLING} are too coarse to tell" if reduced["grids"][-1]["size"] < TELLING else ""
    return [
        f"foot under the hip, body on a slider: the centre of mass can be thrown to {reduced['planned_m']:.4f} m (planner)",
        f"by dynamic programming, which knows no local optima: {rows}{coarse}",
    ]
