"""The command that writes a leg, or a planned hop, for other programs: export."""

import sys
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from hopopt.cli.options import AsJson, Overrides, say_written, write_new
from hopopt.errors import ResultError, UsageError

if TYPE_CHECKING:
    from hopopt.planner.solution import Solution


class Format(StrEnum):
    """What a planned hop can be written as."""

    CSV = "csv"
    JSON = "json"
    ROS2 = "ros2"
    C = "c"


SUFFIXES = {Format.CSV: "csv", Format.JSON: "json", Format.ROS2: "yaml", Format.C: "h"}


def export(
    what: str = "paper",
    *,
    format_: Annotated[Format | None, Parameter(name="--format")] = None,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    set_: Overrides = None,
    urdf: Path | None = None,
    mjcf: Path | None = None,
    json_: AsJson = False,
) -> int:
    """Write a planned hop for a robot, or the leg for other simulators.

    An existing file is never overwritten.

    Parameters
    ----------
    what
        For --format a results folder of hopopt solve; for --urdf and --mjcf also a problem file, or the name of a
        built-in problem.
    format_
        csv or json: the plan at the control rate with the tracker's gains; ros2: a JointTrajectory message as YAML; c:
        the tracker as one C header.
    output
        The file to write (default: the folder's name, with the suffix csv, json, yaml or h).
    urdf
        The URDF file to write.
    mjcf
        The MuJoCo file to write.
    """
    if output is not None and format_ is None:
        raise UsageError(f"--output {output}: say in which form the plan is written: --format csv, json, ros2 or c")
    if format_ is None and urdf is None and mjcf is None:
        raise UsageError(
            "say what to write: --format csv, json, ros2 or c for a planned hop; --urdf leg.urdf or --mjcf leg.xml for "
            "the leg"
        )
    from hopopt.leg.files.export import to_mjcf, to_urdf
    from hopopt.leg.robot import build_robot
    from hopopt.problem.load import load

    written: list[Path] = []
    if format_ is not None:
        if set_:
            raise UsageError("--set changes an entry of a problem: a planned hop is exported as it was solved")
        written.append(output or Path(f"{Path(what).resolve().name}.{SUFFIXES[format_]}"))
        write_new(written[-1], _written_as(format_)(_verified_plan(Path(what))))
    if urdf is not None or mjcf is not None:
        robot = build_robot(
            load(str(file) if (file := Path(what) / "problem.toml").is_file() else what, set_ or ()).leg
        )
        for path, write in ((urdf, to_urdf), (mjcf, to_mjcf)):
            if path is not None:
                write_new(path, write(robot))
                written.append(path)
    say_written(written, json_)
    return 0


def _verified_plan(folder: Path) -> "Solution":
    """A stored solution; ResultError if it is not verified, for a robot is to move by it."""
    from hopopt.storage.solution import read

    solution = read(folder)
    for words in solution.doubts:
        print(f"hopopt: {words}", file=sys.stderr)
    if not solution.verified:
        raise ResultError(
            f"{folder}: the plan is not verified, and only verified plans are exported: hopopt verify says why"
        )
    return solution


def _written_as(format_: Format) -> "Callable[[Solution], str]":
    if format_ is Format.C:
        from hopopt.export.tracker_c import to_c

        return to_c
    from hopopt.export import plan

    return {Format.CSV: plan.to_csv, Format.JSON: plan.to_json, Format.ROS2: plan.to_ros2}[format_]
