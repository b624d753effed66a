"""Costates, Hamiltonian and multipliers in a result's netCDF file: groups certificate/<phase> and certificate/ends.

Signs and units: docs/certificate.md. Every multiplier is the objective's derivative by what it belongs to.
"""

from collections.abc import Mapping

import numpy as np

from hopopt.planner.checks.verdict import Multipliers
from hopopt.storage.netcdf import Group
from hopopt.verify.check import Check

CERTIFICATE_GROUP = "certificate"
SAME_COSTATES = 1e-9  # stored costates against those of the stored multipliers, relative
LAYOUT = {  # dimensions, unit and meaning of every array
    "costate": (("edge", "state"), "objective/state", "derivative of the objective by the state, at the interval edges"),
    "hamiltonian": (("interval",), "objective/s", "Hamiltonian, mean of each interval"),
    "limit_multiplier": (
        ("interval", "abscissa", "limit"), "objective/limit/s", "derivative by the limit, per second, at the abscissae",
    ),
    "limit_at_end": (("limit",), "objective/limit", "derivative by the limit at the very end of the phase"),
    "multiplier": (("constraint",), "objective/bound", "derivative by the boundary constraint's bound"),
}  # fmt: skip
LABELS = {"state": "states of the program", "limit": "limits of the phase", "constraint": "constraints of its ends"}


def groups(kept: Mapping[str, Multipliers]) -> dict[str, Group]:
    """A group for each phase and for the ends, by its path in the file."""
    return {f"{CERTIFICATE_GROUP}/{name}": _group(arrays) for name, arrays in kept.items()}


def _group(arrays: Multipliers) -> Group:
    variables = {
        name: (dimensions, arrays[name], {"units": unit, "long_name": text})
        for name, (dimensions, unit, text) in LAYOUT.items()
        if name in arrays
    }
    labels = {name: ((name,), arrays[name], {"long_name": text}) for name, text in LABELS.items() if name in arrays}
    return Group(variables | labels)


def multipliers(stored: Mapping[str, Group]) -> dict[str, Multipliers]:
    """What ``groups`` wrote; nothing if the file has no such groups."""
    own = {
        path.removeprefix(f"{CERTIFICATE_GROUP}/"): group
        for path, group in stored.items()
        if path.startswith(f"{CERTIFICATE_GROUP}/")
    }
    return {path: {name: group[name] for name in group.variables} for path, group in own.items()}


def agreement(computed: Mapping[str, Multipliers], kept: Mapping[str, Multipliers]) -> Check:
    """Costates and multipliers as they lie in the file (``kept``) against those of the program's multipliers."""
    wrong = 0.0
    for name, fresh in computed.items():
        for part, values in fresh.items():
            if values.dtype.kind == "f" and values.size:
                miss = float(np.abs(kept[name][part] - values).max())
                wrong = max(wrong, miss / max(1.0, float(np.abs(values).max())))
    return Check("stored costates", wrong, SAME_COSTATES, "relative")
