"""A study's folder: one small file for each finished point, written whole or not at all, and the tables at the end.

results/<problem>-sweep-<hash8>/
    sweep.json, problem.toml    the definition, written first
    points/NNNN-R.json          point N after pass R: outcome and figures; NNNN-R.npz: where its neighbours begin
    study.json, table.csv, sweep.nc, figures/      everything together, once all points are finished
    manifest.json               digests of all but the points, which hold their own
"""

import csv
import hashlib
import io
import json
import re
import zipfile
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hopopt.design.names import names_in
from hopopt.errors import ResultError, UsageError
from hopopt.extensions import note_needed, stored_doubts, used
from hopopt.files import write_whole
from hopopt.ocp.objectives.registry import find
from hopopt.problem.catalogue import Entry
from hopopt.problem.load import load, resolved_toml
from hopopt.record import as_data
from hopopt.storage.folder import as_json, new_folder, reason_of, writing
from hopopt.storage.seal.digests import changed, digest, manifest_of, seal
from hopopt.studies.faults import Fault
from hopopt.studies.sweep.definition import Axis, Definition, define
from hopopt.studies.sweep.point_file import ENDED, Point, point_files, read_point, write_point

if TYPE_CHECKING:
    import xarray as xr


def open_folder(definition: Definition, results: Path) -> Path:
    """A new folder for a study, its definition written; ResultError if it cannot be."""
    key = json.dumps(stamp(definition), sort_keys=True)
    name = f"{definition.design.name}-sweep-{hashlib.sha256(key.encode()).hexdigest()[:8]}"
    with writing(f"{results}: the study", "choose another folder"):
        folder = new_folder(results / name)
        (folder / "points").mkdir()
        write_whole(folder / "problem.toml", resolved_toml(definition.design).encode())
        write_whole(folder / "sweep.json", json.dumps(stamp(definition), indent=2).encode())
        seal(folder, DEFINITION)
    return folder


def stamp(definition: Definition) -> dict[str, Any]:
    """What must be the same for a study to be continued."""
    names = [*((kind, name) for _, kind, name in names_in(definition.design)), ("objective", definition.objective)]
    modules = {"extensions": [as_data(e) for e in found]} if (found := used(names)) else {}
    return {**definition.as_dict(), "hopopt": version("hopopt"), **modules}


def read_definition(folder: Path) -> Definition:
    """The definition of the study in a folder, of this version or an earlier one; ResultError in a sentence if there is none."""
    try:
        data = json.loads((folder / "sweep.json").read_text(encoding="utf-8"))
        note_needed(module["module"] for module in data.get("extensions", ()))
        vary = {a["entry"]: a.get("names") or a.get("values") or a["range"] for a in data["axes"]}
        more = {name: data[name] for name in ("objective", "sample", "seed", "starts")}
        more["preliminary"] = bool(data.get("preliminary"))
        design, listed = load(folder / "problem.toml", without_modules=True), tuple(map(tuple, data.get("listed", ())))
        if listed:
            found = Definition(
                design,
                data["objective"],
                tuple(Axis(e, (), *r) for e, r in vary.items()),
                listed=listed,
                wish=float(data.get("wish", 0.0)),
                full=tuple(dict(entries) for entries in data.get("full", ())),
                starts=data["starts"],
                preliminary=True,
            )
        else:
            own = {name: Entry(name, "", stated, {}) for name, stated in data.get("own_catalogue", {}).items()}
            found = define(design, vary, **more, entries=own)
        stamp(found)  # its points follow from it
    except FileNotFoundError:
        raise ResultError(f"{folder}: no study to resume (sweep.json is missing)") from None
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, UsageError) as error:
        raise ResultError(f"{folder}: the study cannot be read ({reason_of(error)})") from error
    _same(folder, {**stamp(found), **data, "hopopt": version("hopopt")}, found)  # an earlier one has fewer entries
    if wrong := [words for words in changed(folder, DEFINITION) if words.startswith(DEFINITION)]:
        raise ResultError(f"{folder}: {'; '.join(wrong)}: undo that, or begin another study")
    return found


def check_same(folder: Path, definition: Definition) -> None:
    """ResultError, naming what differs, unless the folder holds this very study."""
    found, data = read_definition(folder), json.loads((folder / "sweep.json").read_text(encoding="utf-8"))
    _same(folder, {**stamp(found), "hopopt": data["hopopt"]}, definition)
    if wrong := stored_doubts(data):
        raise ResultError(f"{folder}: {'; '.join(wrong)}: its points would not belong together; begin another study")


def _same(folder: Path, data: Mapping[str, Any], definition: Definition) -> None:
    other = json.loads(json.dumps(stamp(definition)))
    different = [
        name.replace("_", " ")
        for name in {**other, **data}
        if name != "extensions" and data.get(name) != other.get(name)
    ]
    if different:
        raise ResultError(f"{folder}: it holds another study (other {', '.join(different)}); leave --resume out")


def save_point(folder: Path, point: Point, begin: Mapping[str, np.ndarray]) -> None:
    """Keep a point; ``begin`` is what a neighbour's warm start needs. The JSON comes last: it says finished. Of one that a
    fault of hopopt ended there is the traceback alone, so that it is solved again when the study is resumed.

    Nothing is ever written over: what a pass gives depends on the passes before it alone, whenever the study stopped.
    """
    name, begin_digest = f"{point.index:04d}-{point.after_pass}", None
    with writing(f"{folder}: point {point.index + 1}", _go_on(folder)):
        if point.traceback:
            Fault(point.sentence, point.traceback).keep(folder / "points", name)
        if point.traceback or point.outcome == ENDED:
            return
        if begin:
            buffer = io.BytesIO()
            np.savez(buffer, **begin)  # type: ignore[arg-type]
            begin_digest = digest(buffer.getvalue())
            write_whole(folder / "points" / f"{name}.npz", buffer.getvalue())
        write_point(folder / "points" / f"{name}.json", point, begin_digest)


def _go_on(folder: Path) -> str:
    return f"what is finished is kept: make room, then hopopt sweep --resume {folder}"


def load_begin(folder: Path, point: Point) -> dict[str, np.ndarray]:
    """What ``save_point`` kept of a point for its neighbours; ResultError if it is gone."""
    path = folder / "points" / f"{point.index:04d}-{point.solved_in}.npz"
    try:
        with np.load(path, allow_pickle=False) as data:
            return dict(data)
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        raise ResultError(f"{path}: it cannot be read ({reason_of(error)}); remove its .json and resume") from error


def load_points(folder: Path, definition: Definition) -> dict[int, dict[int, Point]]:
    """The finished points of every pass, by pass and index; ResultError if one does not belong to the study."""
    found = dict[int, dict[int, Point]]()
    for path in point_files(folder):
        point, doubt = read_point(path, definition)
        if doubt:
            words = "remove it and resume to have it solved again"
            raise ResultError(f"{path}: {doubt}: {words}")
        found.setdefault(point.after_pass, {})[point.index] = point
    return found


DEFINITION, TABLES = ("sweep.json", "problem.toml"), ("study.json", "table.csv", "sweep.nc")
FILES = (*DEFINITION, *TABLES)  # each point has a digest of its own
COLUMNS = ("clearance_m", "unverified_clearance_m", "objective_value", "seconds")
HEIGHT_PARTS = ("com_height_at_lift_off_m", "ballistic_rise_m", "com_height_over_lowest_point_m")


def save_tables(folder: Path, definition: Definition, points: Sequence[Point], data: Mapping[str, Any]) -> None:
    """study.json, table.csv and sweep.nc; ResultError if they cannot be written."""
    with writing(f"{folder}: the table of all points", _go_on(folder)):
        write_whole(folder / "study.json", (as_json(data) + "\n").encode())
        write_whole(folder / "table.csv", table(definition, points).encode())
        write_whole(folder / "sweep.nc", bytes(dataset(definition, points).to_netcdf(engine="h5netcdf")))  # type: ignore[arg-type]
        sealed = manifest_of(folder).get("sha256", {})
        seal(folder, (*TABLES, *(name for name in DEFINITION if name not in sealed)))  # earlier versions did not yet


def table(definition: Definition, points: Sequence[Point]) -> str:
    """All points as CSV: the varied entries, outcome, heights and parts [m], seconds, and why a point failed."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    entries = [axis.entry for axis in definition.axes]
    writer.writerow(["index", *entries, "outcome", *COLUMNS, *HEIGHT_PARTS, "sentence"])
    for p in points:
        row = [
            p.index,
            *definition.stated(p.values).values(),
            p.outcome,
            *(_figure(p, name) for name in (*COLUMNS, *HEIGHT_PARTS)),
            p.sentence,
        ]
        writer.writerow(["" if x is None else repr(x) if isinstance(x, float) else x for x in row])
    return buffer.getvalue()


def _figure(point: Point, name: str) -> float | None:
    """One of COLUMNS or HEIGHT_PARTS of a point, None where it has none."""
    return (point.parts or {}).get(name) if name in HEIGHT_PARTS else getattr(point, name)


def dataset(definition: Definition, points: Sequence[Point]) -> "xr.Dataset":
    """All points with the varied entries as dimensions (a grid) or as coordinates of the points (a sample).

    Heights are not-a-number where a point is not verified; ``outcome`` says why. Points that are not finished are left out
    of a sample, and have no outcome in a grid. Each entry has another name without dots, such as leg_gear_ratio.
    """
    import xarray as xr  # takes a while, and only the last step of a study needs it

    shape, entries = definition.shape, [axis.entry for axis in definition.axes]
    dims = tuple(entries) if shape else ("point",)
    by_index = {p.index: p for p in points}
    every = [by_index.get(k) for k in range(len(definition.points))] if shape else list(points)
    size = shape or (len(every),)

    units, variables = {"seconds": "s", "objective_value": find(definition.objective).unit}, dict[str, Any]()
    for name in (*COLUMNS, *HEIGHT_PARTS):
        column = np.array([p and _figure(p, name) for p in every], dtype=float).reshape(size)  # None: not-a-number
        variables[name] = (dims, column, {"units": units.get(name, "m")})
    for name in ("outcome", "sentence"):
        variables[name] = (dims, np.array([getattr(p, name, "") for p in every]).reshape(size))
    along = {a.entry: list(a.names or a.values) for a in definition.axes} if shape else {}
    rows = definition.points[[p.index for p in points]]
    coords: dict[str, Any] = along or {e: ("point", rows[:, k]) for k, e in enumerate(entries)}
    coords |= {
        alias: (e if shape else "point", along.get(e, rows[:, k]))
        for k, e in enumerate(entries)
        if (alias := alias_of(e)) != e
    }
    about = {"problem": definition.design.name, "objective": definition.objective, "units": "SI"}
    return xr.Dataset(variables, coords, about)


def alias_of(entry: str) -> str:
    """The name of an entry that Python takes as one: leg_gear_ratio, hop_stance_duration_1."""
    return re.sub(r"\W+", "_", entry).strip("_")
