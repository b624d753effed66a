"""A phase of a plan in a result's netCDF file: its table with units, and its collocation data."""

from dataclasses import fields

import numpy as np

from hopopt.leg.kinematics import contact_axes
from hopopt.nlp.schemes import scheme
from hopopt.nlp.trajectory import PhaseTrajectory
from hopopt.planner.solution import Solution
from hopopt.storage.netcdf import Group
from hopopt.verify.table import Table

UNITS = {
    "t": "s", "q": "m or rad", "v": "m/s or rad/s", "a": "m/s^2 or rad/s^2", "tau": "N m", "f": "N", "command": "N m",
    "drive": "SI",
}  # fmt: skip


def phase_group(solution: Solution, table: Table, trajectory: PhaseTrajectory) -> Group:
    """The table and the collocation data of one phase, with units."""
    joints, last = list(solution.robot.joints), dict.fromkeys("qva", "coordinate")
    last |= {"tau": "joint", "f": "direction"} | {"command": "joint", "drive": "drive_state"}
    last = {name: dim for name, dim in last.items() if name in table.parts}
    labels = {
        "coordinate": ["x", "z", *joints],
        "joint": joints,
        "direction": ["xyz"[axis] for axis in contact_axes(solution.design.leg)],
    }
    return Group(
        {
            "t": (("interval", "place"), table.t, {"units": "s"}),
            **{k: (("interval", "place", dim), getattr(table, k), {"units": UNITS[k]}) for k, dim in last.items()},
            "edges": (("edge",), trajectory.edges, {"units": "s", "long_name": "interval edges since the phase began"}),
            "arc": (("interval",), trajectory.arc, {}),
            "x_start": (("interval", "state"), trajectory.x_start, {"units": "SI"}),
            "xdot": (("interval", "abscissa", "state"), trajectory.xdot, {"units": "SI"}),
            "u": (("interval", "abscissa", "control"), trajectory.u, {"units": "rad/s^2"}),
            **{name: ((name,), np.array(names), {}) for name, names in labels.items()},
        },
        {"scheme": trajectory.scheme.name},
    )


def trajectory_of(group: Group) -> PhaseTrajectory:
    """The trajectory that ``phase_group`` wrote."""
    arrays = {name: group[name] for name in ("edges", "x_start", "xdot", "u", "arc")}
    return PhaseTrajectory(scheme(str(group.attributes["scheme"])), **arrays)


def table_of(group: Group) -> Table:
    """The table that ``phase_group`` wrote."""
    names = [f.name for f in fields(Table)]
    return Table(**{name: group[name] for name in names if name in group.variables})
