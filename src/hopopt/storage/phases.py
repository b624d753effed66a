"""A phase of a plan in a result's netCDF file: its table with units, and its collocation data."""

from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from hopopt.leg.kinematics import contact_axes
from hopopt.nlp.schemes import SCHEMES, Scheme, scheme
from hopopt.nlp.trajectory import PhaseTrajectory
from hopopt.planner.motion import Motion
from hopopt.storage.netcdf import Group
from hopopt.verify.table import Table

TABLE_ARRAYS = {  # of every array of a table: its last dimension, unit and meaning
    "t": (None, "s", "time since the phase began, at nine instants of every interval"),
    "q": ("coordinate", "m or rad", "place of the body (x, z) and joint angles"),
    "v": ("coordinate", "m/s or rad/s", "velocity of the body and joint speeds"),
    "a": ("coordinate", "m/s^2 or rad/s^2", "acceleration of the body and of the joints"),
    "tau": ("joint", "N m", "joint torque"),
    "f": ("direction", "N", "force of the ground on the foot"),
    "command": ("joint", "N m", "torque that the drive is asked for"),
    "drive": ("drive_state", "SI", "states of the drives"),
}  # fmt: skip


def phase_group(motion: Motion, table: Table, trajectory: PhaseTrajectory) -> Group:
    """The table and the collocation data of one phase, with units."""
    joints, of_interval = list(motion.robot.joints), ("interval", "place")
    found = {
        name: (of_interval if last is None else (*of_interval, last), getattr(table, name), _described(unit, text))
        for name, (last, unit, text) in TABLE_ARRAYS.items()
        if name in table.parts
    }
    states, steps = "states of the program", ("interval", "abscissa")
    found |= {
        "edges": (("edge",), trajectory.edges, _described("s", "interval edges since the phase began")),
        "arc": (("interval",), trajectory.arc, _described("1", "number of the arc that the interval belongs to")),
        "x_start": (("interval", "state"), trajectory.x_start, _described("SI", f"{states} where an interval begins")),
        "xdot": ((*steps, "state"), trajectory.xdot, _described("SI", f"rates of the {states} at the abscissae")),
        "u": (
            (*steps, "control"),
            trajectory.u,
            _described("SI", "controls at the abscissae: joint accelerations first"),
        ),
    }
    labels = {
        "coordinate": (["x", "z", *joints], "the body's coordinates, then the joints"),
        "joint": (joints, "joints from the body to the foot"),
        "direction": (["xyz"[axis] for axis in contact_axes(motion.design.leg)], "axes of the ground force, z up"),
    }
    found |= {name: ((name,), np.array(words), {"long_name": text}) for name, (words, text) in labels.items()}
    return Group(found, dict(_stored(trajectory.scheme)))


def _described(unit: str, text: str) -> dict[str, str]:
    return {"units": unit, "long_name": text}


def trajectory_of(group: Group) -> PhaseTrajectory:
    """The trajectory that ``phase_group`` wrote."""
    arrays = {name: group[name] for name in ("edges", "x_start", "xdot", "u", "arc")}
    return PhaseTrajectory(_scheme(group.attributes), **arrays)


def _stored(used: Scheme) -> Iterator[tuple[str, Any]]:
    """A scheme by its name; one of the user's own whole, so that it is read without its module."""
    yield "scheme", used.name
    if used.name in SCHEMES.added:
        yield "abscissae", " ".join(map(repr, used.c))
        yield "control_abscissae", " ".join(map(repr, used.control_c))
        yield "order", used.order


def _scheme(stored: Mapping[str, Any]) -> Scheme:
    if "abscissae" not in stored:
        return scheme(str(stored["scheme"]))
    c, control_c = (tuple(map(float, str(stored[name]).split())) for name in ("abscissae", "control_abscissae"))
    return Scheme(str(stored["scheme"]), c, control_c, int(np.ravel(stored["order"])[0]))


def table_of(group: Group) -> Table:
    """The table that ``phase_group`` wrote."""
    names = [f.name for f in fields(Table)]
    return Table(**{name: group[name] for name in names if name in group.variables})
