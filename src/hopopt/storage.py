"""Results folders: written whole or not at all, never overwritten, read back as data (no pickle).

results/<problem>-<hash8>/
    solution.nc     netCDF: the plan's table of each phase with units, its collocation data, the NLP's vectors
    summary.json    every printed number          problem.toml   all defaults filled in, runs again
    manifest.json   versions, seed, mesh history  figures/       PNG and SVG
"""

import hashlib
import json
import os
import platform
import shutil
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from hopopt.errors import ResultError
from hopopt.leg.design import Design
from hopopt.nlp.schemes import scheme
from hopopt.nlp.trajectory import PhaseTrajectory
from hopopt.problem_file import design_hash, load, resolved_toml
from hopopt.solution import Solution
from hopopt.verify import Table

PACKAGES = ("hopopt", "casadi", "pin", "numpy", "scipy", "matplotlib", "xarray", "h5netcdf")
UNITS = {"t": "s", "q": "m or rad", "v": "m/s or rad/s", "a": "m/s^2 or rad/s^2", "tau": "N m", "f": "N"}
FORMAT = 1  # of the folder's contents


def folder_name(design: Design, objective: str) -> str:
    """``<problem>-<hash8>`` from the problem's contents and the objective."""
    text = f"{design_hash(design)} {objective}"
    return f"{design.name}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"


def prepare(results: Path) -> None:
    """Make sure that results can be written, before the work; ResultError if not."""
    try:
        new = not results.exists()
        results.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=results):
            pass
        if new:
            results.rmdir()  # nothing is left behind if nothing is solved
    except OSError as error:
        raise ResultError(
            f"{results}: results cannot be written here ({error.strerror}): choose another folder"
        ) from error


def stated(summary: Mapping[str, Any]) -> dict[str, Any]:
    """A summary as it may be printed: heights that are not verified are named as such, not as the answer."""
    if summary["verified"]:
        return dict(summary)
    heights = {k: summary[k] for k in ("clearance_m", "apex_m") if k in summary}
    return {**summary, **dict.fromkeys(heights), **{f"unverified_{k}": v for k, v in heights.items()}}


def save(solution: Solution, results: Path, figures: Callable[[Solution, Path], Any] | None = None) -> Solution:
    """Write a solution into a new folder below ``results``; the solution with its folder noted.

    figures(solution, folder) draws the pictures. Raises ResultError if the place cannot be written.
    """
    prepare(results)
    results.mkdir(parents=True, exist_ok=True)
    work = Path(tempfile.mkdtemp(prefix=".writing-", dir=results))
    try:
        return _write(solution, results, work, figures)
    except BaseException:
        shutil.rmtree(work, ignore_errors=True)
        raise


def _write(solution: Solution, results: Path, work: Path, figures: Callable[[Solution, Path], Any] | None) -> Solution:
    target = _unused(results / folder_name(solution.design, solution.objective))
    solution = replace(solution, result_dir=target, summary={**solution.summary, "result_dir": str(target)})
    _write_netcdf(solution, work / "solution.nc")
    (work / "summary.json").write_text(json.dumps(_finite(solution.summary), indent=2) + "\n", encoding="utf-8")
    (work / "problem.toml").write_text(resolved_toml(solution.design), encoding="utf-8")
    (work / "manifest.json").write_text(json.dumps(_finite(_manifest(solution)), indent=2) + "\n", encoding="utf-8")
    if figures is not None:
        (work / "figures").mkdir()
        figures(solution, work / "figures")
    os.chmod(work, 0o755)  # mkdtemp makes it private
    return _publish(solution, work, target)


def _publish(solution: Solution, work: Path, target: Path) -> Solution:
    """Rename into place; another process may have taken the name meanwhile."""
    while True:
        try:
            work.rename(target)
            return solution
        except OSError:
            if not target.exists():
                raise
            target = _unused(target)
            solution = replace(solution, result_dir=target, summary={**solution.summary, "result_dir": str(target)})
            (work / "summary.json").write_text(json.dumps(_finite(solution.summary), indent=2) + "\n", encoding="utf-8")


def _unused(folder: Path) -> Path:
    """The folder, or the first of folder-2, folder-3, … that does not exist."""
    candidate, number = folder, 2
    while candidate.exists():
        candidate, number = folder.with_name(f"{folder.name}-{number}"), number + 1
    return candidate


def _manifest(solution: Solution) -> dict[str, Any]:
    s = solution.summary
    return {
        "format": FORMAT,
        "objective": solution.objective,
        "versions": {"python": platform.python_version()} | {name: version(name) for name in PACKAGES},
        "seed": s.get("seed"),
        "scheme": s.get("scheme"),
        "mesh": s.get("mesh"),
        "timings_s": s.get("timings_s"),
    }


def _write_netcdf(solution: Solution, path: Path) -> None:
    datasets = {
        "/": xr.Dataset(attrs={"objective": solution.objective, "problem": solution.design.name, "format": FORMAT})
    }
    for phase, trajectory in solution.phases.items():
        datasets[f"/{phase}"] = _phase_dataset(solution, solution.tables[phase], trajectory)
    datasets["/nlp"] = xr.Dataset({name: (f"{name}_row", value) for name, value in solution.kkt.items()})
    xr.DataTree.from_dict(datasets).to_netcdf(path, engine="h5netcdf")


def _phase_dataset(solution: Solution, table: Table, trajectory: PhaseTrajectory) -> xr.Dataset:
    joints = list(solution.robot.joints)
    last = {"q": "coordinate", "v": "coordinate", "a": "coordinate", "tau": "joint", "f": "direction"}
    variables: dict[str, Any] = {"t": (("interval", "place"), table.t, {"units": "s"})}
    for name, dim in last.items():
        variables[name] = (("interval", "place", dim), getattr(table, name), {"units": UNITS[name]})
    variables |= {
        "edges": ("edge", trajectory.edges, {"units": "s", "long_name": "interval edges since the phase began"}),
        "arc": ("interval", trajectory.arc),
        "x_start": (("interval", "state"), trajectory.x_start, {"units": "SI"}),
        "xdot": (("interval", "abscissa", "state"), trajectory.xdot, {"units": "SI"}),
        "u": (("interval", "abscissa", "control"), trajectory.u, {"units": "rad/s^2"}),
    }
    coordinates = {"coordinate": ["x", "z", *joints], "joint": joints, "direction": ["x", "z"]}
    return xr.Dataset(variables, coords=coordinates, attrs={"scheme": trajectory.scheme.name})


def read(folder: str | Path) -> Solution:
    """A solution from its results folder; ResultError in a sentence if something is missing or broken.

    Its ``tables`` are the stored ones, so that verification sees what the file holds.
    """
    folder = Path(folder)
    if not (folder / "solution.nc").is_file():
        raise ResultError(
            f"{folder}: no results folder (solution.nc is missing): give a folder that `hopopt solve` wrote"
        )
    try:
        design = load(folder / "problem.toml")
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        with xr.open_datatree(folder / "solution.nc", engine="h5netcdf") as tree:
            tree = tree.load()
        phases = {name: _trajectory(tree[name].to_dataset()) for name in ("stance", "flight")}
        tables = {name: _table(tree[name].to_dataset()) for name in ("stance", "flight")}
        kkt = {str(name): np.array(value) for name, value in tree["nlp"].to_dataset().items()}
        objective = str(tree.attrs["objective"])
    except (OSError, KeyError, ValueError, TypeError) as error:
        raise ResultError(f"{folder}: the result cannot be read ({type(error).__name__}: {error})") from error
    solution = Solution(design, objective, phases, summary, kkt, folder)
    solution.__dict__["tables"] = tables
    return solution


def _trajectory(data: xr.Dataset) -> PhaseTrajectory:
    arrays = {name: np.array(data[name]) for name in ("edges", "x_start", "xdot", "u", "arc")}
    return PhaseTrajectory(scheme(str(data.attrs["scheme"])), **arrays)


def _table(data: xr.Dataset) -> Table:
    return Table(*(np.array(data[name]) for name in ("t", "q", "v", "a", "tau", "f")))


def as_json(summary: Mapping[str, Any]) -> str:
    """A summary as one JSON object (infinities become null)."""
    return json.dumps(_finite(summary))


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(v) for v in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
