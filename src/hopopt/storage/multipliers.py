"""Costates, Hamiltonian and multipliers in a result's netCDF file: groups certificate/<phase> and certificate/ends.

Signs and units: docs/certificate.md. Every multiplier is the objective's derivative by what it belongs to.
"""

from collections.abc import Mapping

import numpy as np

from hopopt.planner.checks.verdict import Multipliers
from hopopt.storage.netcdf import Group
from hopopt.verify.check import Check

GROUP = "certificate"
SAME = 1e-9  # stored costates against those of the stored multipliers, relative
LAYOUT = {  # dimensions and meaning of every array
    "costate": (("edge", "state"), "derivative of the objective by the state, at the interval edges"),
    "hamiltonian": (("interval",), "Hamiltonian, mean of each interval [objective's unit per second]"),
    "limit_multiplier": (("interval", "abscissa", "limit"), "derivative by the limit, per second, at the abscissae"),
    "limit_at_end": (("limit",), "derivative by the limit at the end of the phase: an atom"),
    "multiplier": (("constraint",), "derivative by the boundary constraint's bound"),
}
LABELS = ("state", "limit", "constraint")


def groups(kept: Mapping[str, Multipliers]) -> dict[str, Group]:
    """A group for each phase and for the ends, by its path in the file."""
    return {f"{GROUP}/{name}": _group(arrays) for name, arrays in kept.items()}


def _group(arrays: Multipliers) -> Group:
    variables = {n: (d, arrays[n], {"long_name": text}) for n, (d, text) in LAYOUT.items() if n in arrays}
    return Group(variables | {name: ((name,), arrays[name], {}) for name in LABELS if name in arrays})


def multipliers(stored: Mapping[str, Group]) -> dict[str, Multipliers]:
    """What ``groups`` wrote; nothing if the file has no such groups."""
    own = {path.removeprefix(f"{GROUP}/"): group for path, group in stored.items() if path.startswith(f"{GROUP}/")}
    return {path: {name: group[name] for name in group.variables} for path, group in own.items()}


def agreement(computed: Mapping[str, Multipliers], kept: Mapping[str, Multipliers]) -> Check:
    """Costates and multipliers as they lie in the file (``kept``) against those of the program's multipliers."""
    wrong = 0.0
    for name, fresh in computed.items():
        for part, values in fresh.items():
            if values.dtype.kind == "f" and values.size:
                miss = float(np.abs(kept[name][part] - values).max())
                wrong = max(wrong, miss / max(1.0, float(np.abs(values).max())))
    return Check("stored costates", wrong, SAME, "relative")
