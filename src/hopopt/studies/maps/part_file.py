"""The file of points of a map that were solved together: JSON with a digest of itself, and arrays beside it."""

import io
import json
import zipfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from hopopt.errors import ResultError
from hopopt.files import write_whole
from hopopt.storage.folder import as_json, reason_of, writing
from hopopt.storage.seal.digests import digest
from hopopt.studies.faults import Fault
from hopopt.studies.maps.piece import Part
from hopopt.studies.maps.warm import Carried, Families, MapPoint
from hopopt.studies.sweep.definition import Definition

FOLDER = "pieces"
ARRAYS = ("x", "lam_g", "lam_x", "at", "gap")  # of what is carried


def save_part(folder: Path, part: Part) -> None:
    """Keep a part, the JSON last: it says finished. Of one that a fault ended there are the tracebacks alone."""
    stem = folder / FOLDER / f"{part.kind}-{part.number:04d}"
    with writing(f"{folder}: {stem.name} of the map", f"what is finished is kept: hopopt sweep --resume {folder}"):
        for p in part.points:
            if p.traceback:
                Fault(p.sentence, p.traceback).keep(folder / FOLDER, f"point-{p.index}")
        if part.ended:
            return
        buffer = io.BytesIO()
        np.savez(buffer, **_arrays(part))  # type: ignore[arg-type]
        write_whole(stem.with_suffix(".npz"), buffer.getvalue())
        data = {"points": [p.as_dict() for p in part.points], "words": part.words, "arrays": digest(buffer.getvalue())}
        data = json.loads(as_json(data))
        write_whole(stem.with_suffix(".json"), (json.dumps({**data, "sha256": _digest(data)}) + "\n").encode())


def _arrays(part: Part) -> dict[str, np.ndarray]:
    found = {f"x {k}": x for k, x in part.x.items()}
    for k, families in part.exits.items():
        found |= {f"{name} {k} {f}": np.asarray(getattr(c, name)) for f, c in families.items() for name in ARRAYS}
    return found


def read_part(folder: Path, kind: str, number: int, definition: Definition) -> Part | None:
    """The part as it was kept; None if it is not finished; ResultError if its files cannot be trusted."""
    path = folder / FOLDER / f"{kind}-{number:04d}.json"
    if not path.is_file():
        return None
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        arrays = path.with_suffix(".npz").read_bytes()
        if data.pop("sha256") != _digest(data) or data["arrays"] != digest(arrays):
            raise ValueError("it was changed after it was written (its digest differs)")
        points = _points().validate_json(json.dumps(data["points"]), strict=True)
        if any(p.values != definition.values(p.index) for p in points):
            raise ValueError("it belongs to another study")
        with np.load(io.BytesIO(arrays), allow_pickle=False) as found:
            return Part(kind, number, points, _hops(found), _exits(found), tuple(map(str, data["words"])))
    except (OSError, ValueError, TypeError, LookupError, AttributeError, zipfile.BadZipFile, RecursionError) as error:
        first = error.errors()[0]["msg"].lower() if isinstance(error, ValidationError) else reason_of(error)
        raise ResultError(f"{path}: it cannot be used ({first}); remove it and resume") from error


def _hops(found: Any) -> dict[int, np.ndarray]:
    names = (name.split() for name in found.files)
    return {int(at[0]): found[f"x {at[0]}"] for kind, *at in names if kind == "x" and len(at) == 1}


def _exits(found: Any) -> dict[int, Families]:
    exits = dict[int, dict[int, Carried]]()
    for kind, *at in (name.split() for name in found.files):
        if kind == "gap":
            k, family = map(int, at)
            values: Mapping[str, Any] = {name: found[f"{name} {k} {family}"] for name in ARRAYS}
            exits.setdefault(k, {})[family] = Carried(**{**values, "gap": float(values["gap"])})
    return {k: own for k, own in exits.items()}


@cache
def _points() -> TypeAdapter[tuple[MapPoint, ...]]:
    return TypeAdapter(tuple[MapPoint, ...])


def _digest(data: Mapping[str, Any]) -> str:
    return digest(json.dumps(data, sort_keys=True).encode())
