"""The command that writes a leg, or a planned hop, for other programs: export."""

import os
from enum import StrEnum
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from hopopt.cli.options import AsJson, Overrides, note, write_new, written
from hopopt.design import Design
from hopopt.errors import ResultError, UsageError
from hopopt.export import plan, tracker_c
from hopopt.leg.files.export import to_mjcf, to_urdf
from hopopt.leg.robot import build_robot
from hopopt.planner.reserve import TrackedPlan
from hopopt.problem.load import load, resolved_toml
from hopopt.storage.motions import read_plan


class Format(StrEnum):
    """What a planned hop can be written as."""

    CSV = "csv"
    JSON = "json"
    ROS2 = "ros2"
    C = "c"


EXPORTS = {  # suffix of the file, and what makes its text
    Format.CSV: ("csv", plan.to_csv),
    Format.JSON: ("json", plan.to_json),
    Format.ROS2: ("yaml", plan.to_ros2),
    Format.C: ("h", tracker_c.to_c),
}


def export(
    what: str = "paper",
    *,
    format_: Annotated[Format | None, Parameter(name="--format")] = None,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    set_: Overrides = None,
    urdf: Path | None = None,
    mjcf: Path | None = None,
    dc_motors: bool = False,
    json_: AsJson = False,
) -> int:
    """Write a planned hop for a robot, or the leg for other simulators.

    An existing file is never overwritten.

    Parameters
    ----------
    what
        For --format a results folder of hopopt solve or hopopt robust; for --urdf and --mjcf also a problem file, or the name of a
        built-in problem.
    format_
        csv or json: the plan at the control rate with the tracker's gains; ros2: a JointTrajectory message as YAML; c:
        the tracker as one C header.
    output
        The file to write (default: the folder's name, with the suffix csv, json, yaml or h).
    urdf
        The URDF file to write, and beside it a problem file (leg.problem.toml) with what a URDF leaves out.
    mjcf
        The MuJoCo file to write.
    dc_motors
        Write MuJoCo's DC motors, which take a voltage, in place of motors that take a torque (needs leg.motor.voltage or supply.voltage).
    """
    if output is not None and format_ is None:
        raise UsageError(f"--output {output}: say in which form the plan is written: --format csv, json, ros2 or c")
    if format_ is None and urdf is None and mjcf is None:
        raise UsageError(
            "say what to write: --format csv, json, ros2 or c for a planned hop; --urdf leg.urdf or --mjcf leg.xml for "
            "the leg"
        )
    if dc_motors and mjcf is None:
        raise UsageError("--dc-motors is for MuJoCo's file: say --mjcf leg.xml")
    made = list[Path]()
    if format_ is not None:
        if set_:
            raise UsageError("--set changes an entry of a problem: a planned hop is exported as it was solved")
        suffix, write = EXPORTS[format_]
        made.append(output or Path(f"{Path(what).resolve().name}.{suffix}"))
        write_new(made[-1], write(_verified_plan(Path(what))))
    if urdf is not None or mjcf is not None:
        file = Path(what) / "problem.toml"
        design = load(str(file) if file.is_file() else what, set_ or ())
        made += _leg_files(design, urdf, mjcf, dc_motors)
    return written(made, json_)


def _leg_files(design: Design, urdf: Path | None, mjcf: Path | None, dc_motors: bool) -> list[Path]:
    """The leg in each file that was named, and beside a URDF the problem, which has what a URDF leaves out."""
    robot, texts = build_robot(design.leg), dict[Path, str]()
    if urdf is not None:
        texts[urdf] = to_urdf(robot)
        head = (
            f"# The leg of {urdf.name} with all that a URDF has no place for: drives, gears, rotor inertias, the hop.\n"
        )
        texts[urdf.with_suffix(".problem.toml")] = head + resolved_toml(design)
    if mjcf is not None:
        texts[mjcf] = to_mjcf(robot, dc_motors)
    for path in texts:
        if os.path.lexists(path):
            raise UsageError(f"{path} exists already and is not overwritten: choose another name")
    for path, text in texts.items():
        write_new(path, text)
    return list(texts)


def _verified_plan(folder: Path) -> TrackedPlan:
    """A stored plan; ResultError if it is not verified, for a robot is to move by it."""
    found, verified, doubts = read_plan(folder)
    for words in doubts:
        note(words)
    if not verified:
        raise ResultError(
            f"{folder}: the plan is not verified, and only verified plans are exported: hopopt verify says why"
        )
    return found
