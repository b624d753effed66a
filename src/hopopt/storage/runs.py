"""Folders of simulated runs: written whole or not at all, never overwritten, like those of solutions.

results/<problem>-<what>-<hash8>/
    runs.nc        netCDF: a group for each run, with units        comparison.json, simulation.json, sensitivity.json
    problem.toml   all defaults filled in                          figures/       PNG and SVG
"""

import hashlib
import json
import logging
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from hopopt.design import Design
from hopopt.errors import ResultError
from hopopt.leg.robot import Robot, build_robot
from hopopt.problem.load import design_hash, load, resolved_toml
from hopopt.sim.trace import Event, Trace
from hopopt.storage.folder import new_work_folder, published, reason_of, write_json
from hopopt.storage.netcdf import Group
from hopopt.storage.netcdf import read as read_netcdf

UNITS = {"q": "m or rad", "v": "m/s or rad/s", "command": "N m", "motor": "N m", "tau": "N m", "f": "N", "work": "J"}
DIMENSIONS = {"q": "coordinate", "v": "coordinate", "command": "joint", "motor": "joint", "tau": "joint"}
DIMENSIONS |= {"f": "direction", "work": "account"}


def save_runs(
    what: str,
    design: Design,
    data: Mapping[str, Any],
    traces: Mapping[str, Trace],
    results: Path,
    figures: Callable[[Path], Any] | None = None,
) -> Path:
    """Write runs into a new folder below ``results``, the folder; ResultError if it cannot be written.

    The figures come last, when the data are safe: those that fail are logged, nothing else.
    """
    folder = _save_data(what, design, data, traces, results)
    if figures is not None:
        try:
            (folder / "figures").mkdir()
            figures(folder / "figures")
        except (Exception, KeyboardInterrupt) as error:  # the data are what took the time
            words = f"figures are missing ({reason_of(error)}); the data in {folder} are complete"
            logging.getLogger(__name__).warning(words)
    return folder


def _save_data(what: str, design: Design, data: Mapping[str, Any], traces: Mapping[str, Trace], results: Path) -> Path:
    work = None
    try:
        work = new_work_folder(results)
        write_json(data, work / f"{what}.json")
        (work / "problem.toml").write_text(resolved_toml(design), encoding="utf-8")
        if traces:  # a study of the optimum itself has none
            (work / "runs.nc").write_bytes(_netcdf(design, traces))
        key = hashlib.sha256(f"{design_hash(design)} {sorted(traces)}".encode()).hexdigest()[:8]
        return published(work, results / f"{design.name}-{what}-{key}")
    except BaseException as error:
        if work is not None:
            shutil.rmtree(work, ignore_errors=True)
        if isinstance(error, OSError):
            raise ResultError(f"{results}: the runs cannot be written ({reason_of(error)})") from error
        raise


def _netcdf(design: Design, traces: Mapping[str, Trace]) -> Any:
    groups = {"/": xr.Dataset(attrs={"problem": design.name})}
    groups |= {f"/{name.replace(':', '.')}": _dataset(trace) for name, trace in traces.items()}
    return xr.DataTree.from_dict(groups).to_netcdf(engine="h5netcdf")


def _dataset(trace: Trace) -> xr.Dataset:
    variables: dict[str, Any] = {
        name: (("sample", DIMENSIONS[name]), getattr(trace, name), {"units": unit}) for name, unit in UNITS.items()
    }
    variables["t"] = ("sample", trace.t, {"units": "s"})
    variables["contact"] = ("sample", trace.contact.astype(np.int8), {"long_name": "1: foot on the ground"})
    variables["event_t"] = ("event", np.array([e.t for e in trace.events]), {"units": "s"})
    kinds = np.array([e.kind for e in trace.events], dtype=str)
    variables["event_kind"] = ("event", kinds, {"long_name": "what happened"})
    joints = list(trace.robot.joints)
    coordinates = {"coordinate": ["x", "z", *joints], "joint": joints, "direction": ["x", "z"]}
    coordinates["account"] = ["motors", "gears", "stops", "ground friction"]
    return xr.Dataset(variables, coords=coordinates, attrs={"outcome": trace.outcome})


@dataclass(frozen=True)
class StoredRuns:
    """Runs as they lie in their folder.

    design: the problem
    data: what the JSON file holds
    traces: name -> the run
    """

    design: Design
    data: Mapping[str, Any]
    traces: Mapping[str, Trace]


def read_runs(folder: Path, what: str) -> StoredRuns:
    """Runs that ``save_runs`` wrote, such as a "comparison"; ResultError if files are missing or broken."""
    design, data = read_data(folder, what)
    with _readable(folder, what):
        robot, groups = build_robot(design.leg), read_netcdf(folder / "runs.nc")
        traces = {name: _trace(groups[name.replace(":", ".")], robot) for name in data["strategies"]}
    return StoredRuns(design, data, traces)


def read_data(folder: Path, what: str) -> tuple[Design, Mapping[str, Any]]:
    """The problem and the JSON object that ``save_runs`` wrote; ResultError if files are missing or broken."""
    with _readable(folder, what):
        data = json.loads((folder / f"{what}.json").read_text(encoding="utf-8"))
        if not isinstance(data, dict):
            raise TypeError(f"{what}.json is no JSON object")
        return load(folder / "problem.toml"), data


@contextmanager
def _readable(folder: Path, what: str) -> Iterator[None]:
    try:
        yield
    except FileNotFoundError as error:
        raise ResultError(f"{error.filename}: this file of the {what} is missing: make it again") from error
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise ResultError(f"{folder}: the {what} cannot be read ({reason_of(error)}): make it again") from error


def _trace(group: Group, robot: Robot) -> Trace:
    arrays = {name: group[name] for name in ("t", *UNITS)} | {"contact": group["contact"].astype(bool)}
    kinds = zip(group["event_kind"], group["event_t"], strict=True)
    events = tuple(Event(str(kind), float(t), 0.0) for kind, t in kinds)  # losses: not kept
    return Trace(robot, **arrays, events=events, outcome=str(group.attributes["outcome"]))
