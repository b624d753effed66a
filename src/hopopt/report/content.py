"""What a page shows of stored results: solved hops, comparisons of controllers, or robust plans."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

from hopopt.errors import ResultError, UsageError
from hopopt.planner.solution import Solution
from hopopt.problem.load import design_hash
from hopopt.report.motion import PLAN_ENDS, planned, simulated
from hopopt.report.page import COLORS, Content
from hopopt.sim.hop_metrics import HopFigures
from hopopt.storage.motions import PLAN, ROBUST
from hopopt.storage.runs import read_runs
from hopopt.storage.seal.digests import manifest_of
from hopopt.storage.solution import read

FIRST = ("optimum", "force", "track", "position")  # runs of a comparison that move, before others


def content_of(folders: Sequence[Path]) -> Content:
    """What the page of these results shows: of several, hops of legs with the same joints side by side.

    Raises ResultError for a folder that is neither a solved hop, a comparison nor a robust plan, UsageError for results that do not go
    together on one page.
    """
    if len(folders) > len(COLORS):
        raise UsageError(f"{len(folders)} results do not fit on one page: give at most {len(COLORS)}")
    for folder in folders:
        if (folder / "sweep.json").is_file():
            raise ResultError(
                f"{folder}: this is a study, which holds no hop that can move: hopopt report has a page of it"
            )
    alone = {"comparison.json": ("comparison", of_comparison), f"{ROBUST}.json": ("robust plan", of_robust)}
    for folder, (file, (what, made)) in product(folders, alone.items()):
        if (folder / file).is_file():
            if len(folders) > 1:
                raise UsageError(f"{folder}: a {what} fills a page of its own: give it alone")
            return made(folder)
    return of_solutions([read(folder) for folder in folders])


def of_solutions(solutions: Sequence[Solution]) -> Content:
    """Solved hops; limits, evidence and parameters are those of the first."""
    first = solutions[0]
    for other in solutions[1:]:
        if other.design.leg.joints != first.design.leg.joints:
            raise UsageError(f"{other.result_dir}: it moves other joints than {first.result_dir}: give it alone")
    names = [_named(s) for s in solutions]
    if len(set(names)) < len(names):
        folders = [s.result_dir for s in solutions]
        told = [str(folder and folder.name) for folder in folders]
        told = told if len(set(told)) == len(told) else list(map(str, folders))
        names = [where if folder else name for where, folder, name in zip(told, folders, names, strict=True)]
    hops = [planned(s, name) for s, name in zip(solutions, names, strict=True)]
    return Content(first.design, hops, first, provenance=provenance(first))


def _named(s: Solution) -> str:
    """A solution by its problem, and by what is unlike most: its objective, a hop for ever."""
    parts = [s.design.name, *([] if s.objective == "clearance" else [s.objective])]
    return ", ".join([*parts, *(["periodic"] if s.design.hop.periodic else [])])


def of_comparison(folder: Path) -> Content:
    """The runs of a comparison, and the optimum that it stands on if that lies in its folder."""
    stored = read_runs(folder, "comparison")
    names = [name for name in FIRST if name in stored.traces]
    names += [name for name in stored.traces if name not in names]
    heights = {name: stored.data["strategies"][name]["clearance_m"] for name in names}
    hops = [simulated(stored.traces[name], name, heights[name]) for name in names[: len(COLORS)]]
    found = (read(path.parent) for path in sorted(folder.glob("*/solution.nc")))  # none if it was solved before
    solution = next((s for s in found if design_hash(s.design) == design_hash(stored.design)), None)
    where = provenance(solution) if solution else {"folder": str(folder)}
    return Content(stored.design, hops, solution, stored.data, {"comparison": str(folder), **where})


def of_robust(folder: Path) -> Content:
    """The plan that hopopt robust found, and the believed leg that follows it."""
    stored = read_runs(folder, ROBUST)
    design, data = stored.design, stored.data
    heights = {name: HopFigures(design, trace).clearance for name, trace in stored.traces.items()}
    heights |= {PLAN: data["plan_m"] if data["plan_verified"] else None}
    hops = [simulated(trace, name, heights[name]) for name, trace in stored.traces.items()]
    shown = [replace(hop, ends=f"apex: {PLAN_ENDS}") if hop.name == PLAN else hop for hop in hops]
    return Content(design, shown, provenance={"robust plan": str(folder)})


def provenance(solution: Solution) -> Mapping[str, str]:
    """Where a solution comes from: folder, versions, seed, scheme, mesh, times, digests of its files."""
    s, found = solution.summary, {"folder": str(solution.result_dir)}
    manifest = manifest_of(solution.result_dir) if solution.result_dir is not None else {}
    found |= {f"version of {name}": str(x) for name, x in manifest.get("versions", {}).items()}
    found |= {"seed": str(s.seed), "scheme": s.scheme, "refinement ended": s.refinement_ended}
    found |= {"intervals": ", ".join(f"{phase} {p.intervals}" for phase, p in s.phases.items())}
    found |= {"wall time": f"{s.wall_s:.1f} s"}
    if s.overrides:
        found["set on the command line"] = ", ".join(s.overrides)
    return found | {f"SHA-256 of {name}": str(x) for name, x in manifest.get("sha256", {}).items()}
