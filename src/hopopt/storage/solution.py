"""Results folders: data written whole or not at all, never overwritten, read back as data (no pickle).

results/<problem>-<hash8>/
    solution.nc     netCDF: the plan's table of each phase with units, its collocation data, the NLP's vectors;
                    in certificate/ costates, Hamiltonian and multipliers (storage/multipliers.py)
    summary.json    every printed number          problem.toml   all defaults filled in, runs again
    manifest.json   versions, seed, mesh history, digests (storage/seal/digests.py)      figures/       PNG and SVG

Figures come last, when the data are safe: one that fails leaves a note in the summary, nothing else.
"""

import hashlib
import logging
import platform
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from hopopt.design import Design
from hopopt.errors import ResultError
from hopopt.extensions import note_needed
from hopopt.ocp.custom import CUSTOM_FIGURE
from hopopt.planner.answer.summary import Summary
from hopopt.planner.solution import Solution
from hopopt.problem.load import design_hash, load, resolved_toml
from hopopt.record import as_data
from hopopt.storage.folder import new_work_folder, published, reason_of, write_json
from hopopt.storage.multipliers import groups, multipliers
from hopopt.storage.netcdf import Group, to_bytes
from hopopt.storage.netcdf import read as read_netcdf
from hopopt.storage.phases import phase_group, table_of, trajectory_of
from hopopt.storage.seal.digests import changed, digest, seal
from hopopt.storage.summary import read_summary
from hopopt.verify.measures import MEASURES

PROGRAM = {  # vectors of the nonlinear program, all scaled
    "z": "variables", "p": "parameters: numbers of the leg", "g": "rows: equations and limits", "lam_g": "multipliers of the rows",
    "lam_x": "multipliers of the variables' bounds", "low_z": "lower bounds of the variables",
    "high_z": "upper bounds of the variables", "low_g": "lower bounds of the rows", "high_g": "upper bounds of the rows",
}  # fmt: skip
STORED_VERSIONS = ("hopopt", "casadi", "pin", "numpy", "scipy", "matplotlib", "xarray", "h5netcdf")
FORMAT = 2  # of the folder's contents
FOLDER_KINDS = {  # what a folder is that another command wrote, by a file in it
    "front.json": "a Pareto front", "sweep.json": "a study", "table.csv": "a study", "comparison.json": "a comparison",
    "hops.json": "a comparison hop after hop", "robust.json": "a robust plan", "transition.json": "a transition",
    "simulation.json": "a simulation", "sensitivity.json": "a study of what to change first",
    "families.json": "a study of families", "evidence.json": "a gathering of evidence",
}  # fmt: skip
Figures = Callable[[Solution, Path], Any]


def folder_name(design: Design, objective: str, limits: Sequence[str] = ()) -> str:
    """``<problem>-<hash8>`` from the problem's contents, the objective and the names of user-defined limits."""
    text = " ".join([design_hash(design), objective, *limits])
    return f"{design.name}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"


def stated(summary: Summary) -> dict[str, Any]:
    """A summary as it may be printed: figures that are not verified are named as such, not as the answer."""
    data = as_data(summary)
    if summary.verified:
        return data
    figures = dict.fromkeys(("clearance_m", "apex_m", summary.objective_figure))
    heights = {k: data[k] for k in figures if k in data}
    return {**data, **dict.fromkeys(heights), **{f"unverified_{k}": v for k, v in heights.items()}}


def save(solution: Solution, results: str | Path = "results", figures: Figures | None = None) -> Solution:
    """Write a solution into a new folder below ``results``; the solution with its folder noted.

    figures(solution, folder) draws the pictures; what it cannot draw is noted in the summary's ``notes`` and
    logged. Raises ResultError, naming the folder and the reason, if ``results`` cannot be written; the data are
    then kept in a folder for temporary files, which the error names.
    """
    try:
        saved = _save_data(solution, Path(results))
    except OSError as error:
        words = f"the result cannot be written ({reason_of(error)}){_rescued(solution)}"
        raise ResultError(f"{results}: {words}") from error
    return saved if figures is None else _with_figures(saved, figures)


def _save_data(solution: Solution, results: Path) -> Solution:
    work = new_work_folder(results)
    name = folder_name(solution.design, solution.objective, solution.summary.functions.constraints)

    def placed(folder: Path) -> Solution:
        return solution.noted(result_dir=folder, summary=replace(solution.summary, result_dir=str(folder)))

    def note(folder: Path) -> None:
        write_json(as_data(placed(folder).summary), work / "summary.json")
        seal(work, more=_manifest(solution))

    try:
        (work / "solution.nc").write_bytes(_netcdf(solution))
        (work / "problem.toml").write_text(resolved_toml(solution.design), encoding="utf-8")
        return placed(published(work, results / name, note))
    except BaseException:
        shutil.rmtree(work, ignore_errors=True)
        raise


def _rescued(solution: Solution) -> str:
    """Where the data are kept instead, to end a sentence."""
    place = None
    with suppress(OSError):
        place = Path(tempfile.mkdtemp(prefix="hopopt-"))
        return f"; it is kept in {_save_data(solution, place).result_dir}: move it from there"
    if place is not None:
        shutil.rmtree(place, ignore_errors=True)
    return " and neither can the folder for temporary files: make room or choose another folder, and solve again"


def _with_figures(solution: Solution, figures: Figures) -> Solution:
    """Draw the figures into the folder of a saved solution; the solution, with a note if any failed."""
    folder = solution.result_dir
    assert folder is not None
    try:
        (folder / "figures").mkdir(exist_ok=True)
        figures(solution, folder / "figures")
        return solution
    except (Exception, KeyboardInterrupt) as error:  # the data are what took the time: nothing here may lose them
        note = f"figures are missing ({reason_of(error)}); the data in {folder} are complete"
    logging.getLogger(__name__).warning(note)
    return with_more(solution, notes=(*solution.summary.notes, note))


def with_more(solution: Solution, **entries: Any) -> Solution:
    """A saved solution with other entries of its summary, in its folder as well if that can be written."""
    solution, folder = solution.with_summary(**entries), solution.result_dir
    assert folder is not None
    with suppress(OSError):
        write_json(as_data(solution.summary), folder / "summary.json")
        seal(folder, ("summary.json",))
    return solution


def _manifest(solution: Solution) -> dict[str, Any]:
    versions = {"python": platform.python_version()} | {name: version(name) for name in STORED_VERSIONS}
    stated = as_data(solution.summary)
    figures = {name: stated[name] for name in ("seed", "scheme", "mesh", "timings_s")}
    return {"format": FORMAT, "objective": solution.objective, "versions": versions, **figures}


def _netcdf(solution: Solution) -> bytes:
    attributes = {"objective": solution.objective, "problem": solution.design.name, "format": FORMAT}
    attributes["problem_sha256"] = digest(resolved_toml(solution.design).encode())
    attributes["in_python"] = "hopopt.read(folder).to_dataframe() is the whole hop as one table"
    found = {"/": Group(attributes=attributes)}
    for phase, trajectory in solution.phases.items():
        found[phase] = phase_group(solution, solution.tables[phase], trajectory)
    found["nlp"] = Group(
        {
            name: ((f"{name}_row",), value, {"units": "1", "long_name": PROGRAM.get(name, name)})
            for name, value in solution.kkt.items()
        }
    )
    return to_bytes(found | groups(solution.multipliers))


def read(folder: str | Path) -> Solution:
    """A solution from its results folder; ResultError in a sentence if something is missing or broken.

    Its ``tables`` are the stored ones, so that verification sees what the file holds; its ``doubts`` name files that
    were changed.
    """
    folder = Path(folder)
    with _readable(folder):
        if not (folder / "solution.nc").is_file():
            what = "no results folder (solution.nc is missing)" if folder.exists() else "there is no such folder"
            if kind := next((words for name, words in FOLDER_KINDS.items() if (folder / name).exists()), None):
                what = f"{kind}, not a single result"
            if (folder / "table.csv").exists():
                what += " (its table is table.csv, its figures are in figures/)"
            raise ResultError(f"{folder}: {what}: give a folder that `hopopt solve` wrote{_results_in(folder)}")
    problem = folder / "problem.toml"
    with _readable(problem):
        problem_digest = digest(problem.read_bytes())
    with _readable(folder / "summary.json"):
        summary, contradictions = read_summary(folder / "summary.json")
    with _readable(folder / "solution.nc"):
        stored = read_netcdf(folder / "solution.nc")
        names = ("stance", "flight", *(name for name in ("descent", "landing") if name in stored))
        phases = {name: trajectory_of(stored[name]) for name in names}
        tables = {name: table_of(stored[name]) for name in names}
        nlp = stored.get("nlp", Group())
        kkt, kept = {name: nlp[name] for name in nlp.variables}, multipliers(stored)
        objective = str(stored[""].attributes["objective"])
        written = stored[""].attributes.get("problem_sha256", problem_digest)
    if written != problem_digest:
        raise ResultError(
            f"{problem}: it was changed after this result was written: undo that, and change a copy elsewhere instead"
        )
    figures = {name: x for name in (*MEASURES, CUSTOM_FIGURE) if (x := summary.figure(name)) is not None}
    doubts = (*changed(folder), *(f"summary.json contradicts itself: {words}" for words in contradictions))
    note_needed(e.module for e in summary.extensions)
    design = load(problem, without_modules=True)
    solution = Solution(design, objective, phases, summary, kkt, folder, kept, doubts=doubts, stated=figures)
    solution.__dict__["tables"] = tables
    return solution


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """ResultError that names the file, or folder, of a result for whatever makes it unreadable."""
    try:
        yield
    except FileNotFoundError as error:
        raise ResultError(f"{path}: this file of the result is missing: solve it again") from error
    except PermissionError as error:
        raise ResultError(f"{path}: it cannot be read ({reason_of(error)})") from error
    except KeyError as error:
        raise ResultError(f"{path}: it is damaged (an entry is missing: {reason_of(error)}): solve it again") from error
    except (OSError, ValueError, TypeError, AttributeError, RuntimeError) as error:
        kind = (
            "a JSON object" if path.suffix == ".json" else "a whole netCDF file" if path.suffix == ".nc" else "a result"
        )
        raise ResultError(f"{path}: it is damaged, not {kind}: solve it again") from error


def _results_in(folder: Path) -> str:
    """The results that lie in a folder of results, newest first, to end a sentence."""
    found = sorted(folder.glob("*/solution.nc"), key=lambda path: -path.stat().st_mtime)[:3]
    return f", such as {', '.join(str(path.parent) for path in found)}" if found else ""
