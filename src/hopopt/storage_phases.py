"""A phase of a plan in a result's netCDF file: its table with units, and its collocation data."""

from typing import Any

import numpy as np
import xarray as xr

from hopopt.leg.kinematics import contact_axes
from hopopt.nlp.schemes import scheme
from hopopt.nlp.trajectory import PhaseTrajectory
from hopopt.solution import Solution
from hopopt.verify import Table

UNITS = {"t": "s", "q": "m or rad", "v": "m/s or rad/s", "a": "m/s^2 or rad/s^2", "tau": "N m", "f": "N"}


def phase_dataset(solution: Solution, table: Table, trajectory: PhaseTrajectory) -> xr.Dataset:
    """The table and the collocation data of one phase, with units."""
    joints, last = list(solution.robot.joints), dict.fromkeys("qva", "coordinate")
    last |= {"tau": "joint", "f": "direction"}
    variables: dict[str, Any] = {"t": (("interval", "place"), table.t, {"units": "s"})}
    variables |= {k: (("interval", "place", dim), getattr(table, k), {"units": UNITS[k]}) for k, dim in last.items()}
    variables |= {
        "edges": ("edge", trajectory.edges, {"units": "s", "long_name": "interval edges since the phase began"}),
        "arc": ("interval", trajectory.arc),
        "x_start": (("interval", "state"), trajectory.x_start, {"units": "SI"}),
        "xdot": (("interval", "abscissa", "state"), trajectory.xdot, {"units": "SI"}),
        "u": (("interval", "abscissa", "control"), trajectory.u, {"units": "rad/s^2"}),
    }
    coords = {
        "coordinate": ["x", "z", *joints],
        "joint": joints,
        "direction": ["xyz"[axis] for axis in contact_axes(solution.design.leg)],
    }
    return xr.Dataset(variables, coords=coords, attrs={"scheme": trajectory.scheme.name})


def trajectory_of(data: xr.Dataset) -> PhaseTrajectory:
    """The trajectory that ``phase_dataset`` wrote."""
    arrays = {name: np.array(data[name]) for name in ("edges", "x_start", "xdot", "u", "arc")}
    return PhaseTrajectory(scheme(str(data.attrs["scheme"])), **arrays)


def table_of(data: xr.Dataset) -> Table:
    """The table that ``phase_dataset`` wrote."""
    return Table(*(np.array(data[name]) for name in ("t", "q", "v", "a", "tau", "f")))
