"""Costates, Hamiltonian and multipliers in a result's netCDF file: groups certificate/<phase> and certificate/ends.

Signs and units: docs/certificate.md. Every multiplier is the objective's derivative by what it belongs to.
"""

from collections.abc import Mapping

import numpy as np
import xarray as xr

from hopopt.solution import Multipliers

GROUP = "certificate"
LAYOUT = {  # dimensions and meaning of every array
    "costate": (("edge", "state"), "derivative of the objective by the state, at the interval edges"),
    "hamiltonian": (("interval",), "Hamiltonian, mean of each interval [objective's unit per second]"),
    "limit_multiplier": (("interval", "abscissa", "limit"), "derivative by the limit, per second, at the abscissae"),
    "limit_at_end": (("limit",), "derivative by the limit at the end of the phase: an atom"),
    "multiplier": (("constraint",), "derivative by the boundary constraint's bound"),
}
COORDINATES = ("state", "limit", "constraint")


def groups(kept: Mapping[str, Multipliers]) -> dict[str, xr.Dataset]:
    """A dataset for each phase and for the ends, by its path in the file."""
    return {f"/{GROUP}/{name}": _dataset(arrays) for name, arrays in kept.items()}


def _dataset(arrays: Multipliers) -> xr.Dataset:
    variables = {n: (d, arrays[n], {"long_name": text}) for n, (d, text) in LAYOUT.items() if n in arrays}
    return xr.Dataset(variables, coords={name: arrays[name].tolist() for name in COORDINATES if name in arrays})


def multipliers(tree: xr.DataTree) -> dict[str, Multipliers]:
    """What ``groups`` wrote; nothing if the file has no such groups."""
    if GROUP not in tree:
        return {}
    children = tree[GROUP].children  # type: ignore[union-attr]
    return {str(name): _arrays(child.to_dataset()) for name, child in children.items()}


def _arrays(data: xr.Dataset) -> Multipliers:
    return {str(name): np.array(value) for name, value in (*data.data_vars.items(), *data.coords.items())}
