"""Motions of plans that are no answers of their own, as netCDF: of each a group for every phase, as a solution's file has them.

And what can be followed in a folder of results: a solved hop, or the plan of hopopt robust with its feedback.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hopopt.control.reference import PlanReference
from hopopt.design import Design
from hopopt.errors import ResultError
from hopopt.files import write_whole
from hopopt.planner.motion import Motion
from hopopt.planner.reserve import TrackedPlan
from hopopt.storage.folder import fitting, reason_of, writing
from hopopt.storage.netcdf import Group, to_bytes
from hopopt.storage.netcdf import read as read_netcdf
from hopopt.storage.phases import phase_group, trajectory_of
from hopopt.storage.runs import read_data
from hopopt.storage.solution import read
from hopopt.verify.table import NORMALISED_TIMES

FILE = "plan.nc"
ROBUST, PLAN = "robust", "plan"  # the name of its JSON file, and of the plan in a folder of hopopt robust


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


def read_robust_plan(folder: Path) -> tuple[TrackedPlan, Mapping[str, Any]]:
    """The plan that hopopt robust found, with its feedback, and what its JSON file holds; ResultError if files are missing or broken."""
    design, data = read_data(folder, ROBUST)
    plan = read_motions(folder, design)[PLAN]
    with fitting(folder):
        reference = PlanReference.from_tables(NORMALISED_TIMES, plan.tables, float(data["plan_m"]))
        if data["feedback_matrix"] is not None:
            feedback = np.array(data["feedback_matrix"], dtype=float)
            n = len(design.leg.joints)
            if feedback.shape != (n, 2 * n) or not np.isfinite(feedback).all():
                raise ValueError(f"its feedback is no matrix of {n} rows and {2 * n} columns of numbers")
            reference = replace(reference, feedback=feedback)
    return TrackedPlan(plan, reference), data


def read_plan(folder: Path) -> tuple[TrackedPlan, bool, tuple[str, ...]]:
    """What a robot can follow in a folder of hopopt solve or robust: the plan, whether it is verified, and doubts in words."""
    if (folder / f"{ROBUST}.json").is_file():
        plan, data = read_robust_plan(folder)
        return plan, bool(data["plan_verified"]), (str(data["against"]),) if data.get("against") else ()
    solution = read(folder)
    return TrackedPlan.of(solution), solution.verified, solution.doubts
