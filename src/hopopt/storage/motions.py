"""Motions of plans that are no answers of their own, as netCDF: of each a group for every phase, as a solution's file has them."""

from collections.abc import Mapping
from pathlib import Path

from hopopt.design import Design
from hopopt.errors import ResultError
from hopopt.files import write_whole
from hopopt.planner.motion import Motion
from hopopt.storage.folder import reason_of, writing
from hopopt.storage.netcdf import Group, to_bytes
from hopopt.storage.netcdf import read as read_netcdf
from hopopt.storage.phases import phase_group, trajectory_of

FILE = "plan.nc"


def write_motions(folder: Path, motions: Mapping[str, Motion]) -> None:
    """Write motions by name into a folder of results; ResultError if it cannot be written."""
    groups = {"/": Group(attributes={"objective": next(iter(motions.values())).objective})}
    for name, motion in motions.items():
        groups |= {f"{name}/{key}": phase_group(motion, motion.tables[key], x) for key, x in motion.phases.items()}
    with writing(f"{folder}: the plan", "all else is there"):
        write_whole(folder / FILE, to_bytes(groups))


def read_motions(folder: Path, design: Design) -> dict[str, Motion]:
    """The motions that ``write_motions`` wrote, by name; ResultError if there are none, or they are broken."""
    try:
        groups = read_netcdf(folder / FILE)
        phases = [(path.split("/"), group) for path, group in groups.items() if path.count("/") == 1]
        names = dict.fromkeys(name for (name, _), _ in phases)
        objective = str(groups[""].attributes["objective"])
        return {
            name: Motion(design, objective, {key: trajectory_of(g) for (of, key), g in phases if of == name})
            for name in names
        }
    except FileNotFoundError:
        raise ResultError(f"{folder}: its plan is not stored ({FILE} is missing): make it again") from None
    except (OSError, KeyError, ValueError, RuntimeError) as error:
        raise ResultError(f"{folder / FILE}: it is damaged ({reason_of(error)}): make it again") from error
