"""Folders of simulated runs: written whole or not at all, never overwritten, like those of solutions.

results/<problem>-<what>-<hash8>/
    runs.nc        netCDF: a group for each run, with units        comparison.json, simulation.json, sensitivity.json
    problem.toml   all defaults filled in                          figures/       PNG and SVG
    bound/, plan/  folders of solutions: what the runs stand on
"""

import hashlib
import json
import logging
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hopopt.design import Design
from hopopt.design.names import names_in
from hopopt.errors import ResultError
from hopopt.extensions import used
from hopopt.leg.robot import Robot, build_robot
from hopopt.planner.solution import Solution
from hopopt.problem.load import design_hash, load, resolved_toml
from hopopt.record import as_data
from hopopt.sim.trace import Event, Trace
from hopopt.storage.folder import new_work_folder, published, reason_of, write_json, writing
from hopopt.storage.netcdf import Group, to_bytes
from hopopt.storage.netcdf import read as read_netcdf
from hopopt.storage.solution import read, save

ARRAYS = {  # of every array of a run: its dimensions, unit and meaning
    "t": (("sample",), "s", "time since the run began"),
    "q": (("sample", "coordinate"), "m or rad", "place of the body (x, z) and joint angles"),
    "v": (("sample", "coordinate"), "m/s or rad/s", "velocity of the body and joint speeds"),
    "command": (("sample", "joint"), "N m", "joint torque that the controller asks for"),
    "motor": (
        ("sample", "joint"),
        "N m",
        "torque of the drive at the joint, within its limits, before the gear's losses",
    ),
    "tau": (("sample", "joint"), "N m", "torque that reaches the joint"),
    "f": (("sample", "direction"), "N", "force of the ground on the foot"),
    "work": (("sample", "account"), "J", "work so far, by account"),
}


def save_runs(
    what: str,
    design: Design,
    data: Mapping[str, Any],
    traces: Mapping[str, Trace],
    results: Path,
    figures: Callable[[Path], Any] | None = None,
    hops: Mapping[str, Solution | None] | None = None,
) -> Path:
    """Write runs into a new folder below ``results``, the folder; ResultError if it cannot be written.

    hops: name -> what the runs stand on, each written to a folder of that name, or copied from where it lies

    The figures come last, when the data are safe: those that fail are logged, nothing else.
    """
    folder = _save_data(what, design, data, traces, results)
    for name, hop in (hops or {}).items():
        if hop is not None:
            _keep(hop, folder / name)
    if figures is not None:
        try:
            (folder / "figures").mkdir()
            figures(folder / "figures")
        except (Exception, KeyboardInterrupt) as error:  # the data are what took the time
            words = f"figures are missing ({reason_of(error)}); the data in {folder} are complete"
            logging.getLogger(__name__).warning(words)
    return folder


def _keep(hop: Solution, place: Path) -> None:
    if hop.result_dir is None or not hop.result_dir.is_dir():
        save(hop, place)
        return
    with writing(f"{place}: a hop", "all else is there"):
        shutil.copytree(hop.result_dir, place / hop.result_dir.name, ignore=shutil.ignore_patterns("figures"))


def stored_hop(folder: Path, name: str) -> Solution | None:
    """The hop that runs stand on and that was kept under a name; None if there is none."""
    found = sorted(path.parent for path in (folder / name).glob("*/solution.nc"))
    return read(found[0]) if found else None


def required_hop(folder: Path, name: str) -> Solution:
    """The same; ResultError if there is none."""
    if (found := stored_hop(folder, name)) is None:
        raise ResultError(f"{folder}: its {name.replace('_', ' ')} is not stored ({name}/ is missing): make it again")
    return found


def _save_data(what: str, design: Design, data: Mapping[str, Any], traces: Mapping[str, Trace], results: Path) -> Path:
    work = None
    try:
        work = new_work_folder(results)
        wanted = [*((kind, name) for _, kind, name in names_in(design)), *(("strategy", name) for name in traces)]
        modules = {"extensions": [as_data(e) for e in found]} if (found := used(wanted)) else {}
        write_json({**data, **modules}, work / f"{what}.json")
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


def _netcdf(design: Design, traces: Mapping[str, Trace]) -> bytes:
    runs = {name.replace(":", "."): _group(trace) for name, trace in traces.items()}
    return to_bytes({"/": Group(attributes={"problem": design.name}), **runs})


def _group(trace: Trace) -> Group:
    found: dict[str, Any] = {
        name: (dimensions, getattr(trace, name), {"units": unit, "long_name": text})
        for name, (dimensions, unit, text) in ARRAYS.items()
    }
    contact = {"units": "1", "long_name": "1 while the foot is on the ground"}
    found["contact"] = (("sample",), trace.contact.astype(np.int8), contact)
    times = np.array([e.t for e in trace.events], dtype=float)
    found["event_t"] = (("event",), times, {"units": "s", "long_name": "time of an event"})
    lost = np.array([e.lost for e in trace.events], dtype=float)
    found["event_lost"] = (("event",), lost, {"units": "J", "long_name": "energy that an impact took"})
    kinds = np.array([e.kind for e in trace.events], dtype=str)
    found["event_kind"] = (("event",), kinds, {"long_name": "what happened"})
    joints = list(trace.robot.joints)
    labels = {
        "coordinate": (["x", "z", *joints], "the body's coordinates, then the joints"),
        "joint": (joints, "joints from the body to the foot"),
        "direction": (["x", "z"], "axes of the ground force, z up"),
        "account": (["motors", "gears", "stops", "ground friction"], "who does the work or takes it"),
    }
    found |= {name: ((name,), np.array(words), {"long_name": text}) for name, (words, text) in labels.items()}
    return Group(found, {"outcome": trace.outcome})


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


def read_runs(folder: Path, what: str, names: Sequence[str] | None = None) -> StoredRuns:
    """Runs that ``save_runs`` wrote, such as a "comparison"; ResultError if files are missing or broken.

    names: of the runs; None: one for each of the stored strategies, or all that there are
    """
    design, data = read_data(folder, what)
    with _readable(folder, what):
        robot, groups = build_robot(design.leg), read_netcdf(folder / "runs.nc")
        wanted = data.get("strategies", [name for name in groups if name]) if names is None else names
        traces = {name: _trace(groups[name.replace(":", ".")], robot) for name in wanted}
    return StoredRuns(design, data, traces)


def read_data(folder: Path, what: str) -> tuple[Design, Mapping[str, Any]]:
    """The problem and the JSON object that ``save_runs`` wrote; ResultError if files are missing or broken."""
    with _readable(folder, what):
        data = json.loads((folder / f"{what}.json").read_text(encoding="utf-8"))
        if not isinstance(data, dict):
            raise TypeError(f"{what}.json is no JSON object")
        return load(folder / "problem.toml", without_modules=True), data


@contextmanager
def _readable(folder: Path, what: str) -> Iterator[None]:
    try:
        yield
    except FileNotFoundError as error:
        raise ResultError(f"{error.filename}: this file of the {what} is missing: make it again") from error
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise ResultError(f"{folder}: the {what} cannot be read ({reason_of(error)}): make it again") from error


def _trace(group: Group, robot: Robot) -> Trace:
    arrays = {name: group[name] for name in ARRAYS} | {"contact": group["contact"].astype(bool)}
    times = group["event_t"]
    lost = (
        group["event_lost"] if "event_lost" in group.variables else np.zeros_like(times)
    )  # earlier versions kept none
    events = tuple(Event(str(k), float(t), float(e)) for k, t, e in zip(group["event_kind"], times, lost, strict=True))
    return Trace(robot, **arrays, events=events, outcome=str(group.attributes["outcome"]))
