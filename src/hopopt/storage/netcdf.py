"""netCDF files of groups of named arrays, as xarray writes and reads them, without the second that it takes to import."""

import io
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import h5netcdf
import h5py
import numpy as np

TO_OPEN = 'xarray.open_dataset(file, group="...") opens one of the groups, xarray.open_datatree(file) all of them'


@dataclass(frozen=True)
class Group:
    """variables: name -> (dimensions, values, attributes); one named like its only dimension labels it."""

    variables: Mapping[str, tuple[tuple[str, ...], Any, Mapping[str, str]]] = field(default_factory=dict)
    attributes: Mapping[str, Any] = field(default_factory=dict)

    def __getitem__(self, name: str) -> np.ndarray:
        return self.variables[name][1]


def to_bytes(groups: Mapping[str, Group]) -> bytes:
    """A file of groups by their path, made in memory: HDF5 itself does not survive a disk that is full.

    A file whose variables all lie in groups opens empty in xarray.open_dataset: attributes of its root name them.
    """
    root, inner = groups.get("/", Group()), [path.strip("/") for path in groups if path != "/"]
    groups = {
        **groups,
        "/": replace(root, attributes={**root.attributes, "groups": ", ".join(inner), "to_open": TO_OPEN}),
    }
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
    """The groups of a file by their path, without the first stroke; the root's is empty. OSError, KeyError or RuntimeError
    if it is no netCDF file."""
    with h5py.File(path, "r") as file:  # h5netcdf has a word of its own on files that are damaged
        return {str(group.name).strip("/"): _read(group) for group in _groups(file)}


def _groups(group: h5py.Group) -> Iterator[h5py.Group]:
    yield group
    for inner in group.values():
        if isinstance(inner, h5py.Group):
            yield from _groups(inner)


def _read(group: h5py.Group) -> Group:
    """The variables of a group."""
    found = {name: item for name, item in group.items() if isinstance(item, h5py.Dataset) and not _bare(item)}
    arrays = {
        name: np.asarray(d.asstr()[...]).astype(str) if h5py.check_string_dtype(d.dtype) else d[...]
        for name, d in found.items()
    }
    return Group({name: (_dimensions(found[name]), array, {}) for name, array in arrays.items()}, dict(group.attrs))


def _dimensions(dataset: h5py.Dataset) -> tuple[str, ...]:
    """Names of a variable's dimensions; one that labels a dimension has the dimension's name."""
    names = [axis[0].name if len(axis) else dataset.name for axis in dataset.dims]
    return tuple(str(name).rpartition("/")[2] for name in names)


def _bare(dataset: h5py.Dataset) -> bool:
    """Whether it is a dimension without values, as netCDF marks them."""
    return bytes(dataset.attrs.get("NAME", b"")).startswith(b"This is a netCDF dimension but not")
