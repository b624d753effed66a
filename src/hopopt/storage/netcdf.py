"""netCDF files of groups of named arrays, as xarray writes and reads them, without the second that it takes to import."""

import io
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5netcdf
import h5py
import numpy as np


@dataclass(frozen=True)
class Group:
    """variables: name -> (dimensions, values, attributes); one named like its only dimension labels it."""

    variables: Mapping[str, tuple[tuple[str, ...], Any, Mapping[str, str]]] = field(default_factory=dict)
    attributes: Mapping[str, Any] = field(default_factory=dict)

    def __getitem__(self, name: str) -> np.ndarray:
        return self.variables[name][1]


def to_bytes(groups: Mapping[str, Group]) -> bytes:
    """A file of groups by their path, made in memory: HDF5 itself does not survive a disk that is full."""
    buffer = io.BytesIO()
    with h5netcdf.File(buffer, "w") as file:
        for path, group in groups.items():
            _write(group, file if path == "/" else file.create_group(path))
    return buffer.getvalue()


def _write(group: Group, target: Any) -> None:
    target.attrs.update(group.attributes)
    sizes = (zip(dims, np.shape(values), strict=True) for dims, values, _ in group.variables.values())
    target.dimensions = dict(pair for pairs in sizes for pair in pairs)
    for name, (dimensions, values, attributes) in group.variables.items():
        array = np.asarray(values)
        words = array.dtype.kind == "U"
        fill = np.nan if array.dtype.kind == "f" else None
        variable = target.create_variable(
            name, dimensions, h5py.string_dtype() if words else array.dtype, fillvalue=fill
        )
        variable[...] = array.astype(object) if words else array
        variable.attrs.update(attributes)


def read(path: Path) -> dict[str, Group]:
    """The groups of a file by their path, without the first stroke; the root's is empty. OSError if it is no netCDF file."""
    with h5netcdf.File(path, "r") as file:
        return {group.name.strip("/"): _read(group) for group in _groups(file)}


def _groups(group: Any) -> Iterator[Any]:
    yield group
    for inner in group.groups.values():
        yield from _groups(inner)


def _read(group: Any) -> Group:
    arrays = {name: np.array(variable[...]) for name, variable in group.variables.items()}
    words = {name: a.astype(str) if a.dtype.kind == "O" else a for name, a in arrays.items()}
    return Group({name: (group.variables[name].dimensions, words[name], {}) for name in words}, dict(group.attrs))
