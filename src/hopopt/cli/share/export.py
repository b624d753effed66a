"""The command that writes a leg, or a planned hop, for other programs: export."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from hopopt.cli.options import AsJson, Overrides, check_new, note, write_new, written
from hopopt.control.reference import PlanReference
from hopopt.design import Design
from hopopt.errors import ResultError, UsageError
from hopopt.export import plan, tracker_c
from hopopt.leg.files.export import to_mjcf, to_urdf
from hopopt.leg.robot import build_robot
from hopopt.planner.checks.smooth_plan import SmoothPlan, smooth_plan
from hopopt.planner.reserve import TrackedPlan
from hopopt.planner.solution import Solution
from hopopt.problem.load import load, resolved_toml
from hopopt.storage.folder import fitting
from hopopt.storage.motions import ROBUST, read_plan
from hopopt.storage.solution import read
from hopopt.verify.table import NORMALISED_TIMES


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

FIGURES = (".svg", ".png", ".pdf")  # endings of a figure's file
NOT_VERIFIED = "{}: the plan is not verified, and only verified plans are exported: hopopt verify says why"


def export(
    what: str = "paper",
    *,
    format_: Annotated[Format | None, Parameter(name="--format")] = None,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    smooth: bool = False,
    figure: Path | None = None,
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
    smooth
        Write a plan whose torques vary less, and which is as good within 1e-5 of the objective, a height within 0.01 mm. Where the height hardly depends on a torque,
        the best hop's may have saw teeth. It is verified as the hop is, which takes some seconds. --json says what it brought.
    figure
        With --smooth: also draw the torques of the hop and of the smooth plan, into this file (torques.svg, or png or pdf).
    urdf
        The URDF file to write, and beside it a problem file (leg.problem.toml) with what a URDF leaves out.
    mjcf
        The MuJoCo file to write.
    dc_motors
        Write MuJoCo's DC motors, which take a voltage, in place of motors that take a torque (needs leg.motor.voltage or supply.voltage).
    """
    if output is not None and format_ is None:
        raise UsageError(f"--output {output}: say in which form the plan is written: --format csv, json, ros2 or c")
    if smooth and format_ is None:
        raise UsageError(
            "--smooth is for a planned hop: say in which form it is written: --format csv, json, ros2 or c"
        )
    if figure is not None and not smooth:
        raise UsageError(f"--figure {figure}: it is of a smooth plan: say --smooth")
    if figure is not None and figure.suffix.lower() not in FIGURES:
        raise UsageError(f"--figure {figure}: a figure's file ends in one of {', '.join(FIGURES)}")
    if figure is not None and output is not None and figure.resolve() == output.resolve():
        raise UsageError(f"--figure {figure}: the plan is written there: name another file")
    if format_ is None and urdf is None and mjcf is None:
        raise UsageError(
            "say what to write: --format csv, json, ros2 or c for a planned hop; --urdf leg.urdf or --mjcf leg.xml for "
            "the leg"
        )
    if dc_motors and mjcf is None:
        raise UsageError("--dc-motors is for MuJoCo's file: say --mjcf leg.xml")
    made, stated = list[Path](), dict[str, Any]()
    if format_ is not None:
        if set_:
            raise UsageError("--set changes an entry of a problem: a planned hop is exported as it was solved")
        made, stated = _plan_files(Path(what), format_, output, smooth, figure)
    if urdf is not None or mjcf is not None:
        file = Path(what) / "problem.toml"
        design = load(str(file) if file.is_file() else what, set_ or ())
        made += _leg_files(design, urdf, mjcf, dc_motors)
    return written(made, json_, more=stated)


def _plan_files(
    folder: Path, form: Format, output: Path | None, smooth: bool, figure: Path | None
) -> tuple[list[Path], dict[str, Any]]:
    """The files of a plan, and what is stated of a smooth one."""
    suffix, write = EXPORTS[form]
    made = [output or Path(f"{folder.resolve().name}.{suffix}")]
    for file in (*made, *([figure] if figure else [])):
        check_new(file)
    if smooth:
        solution, found = _smooth_plan(folder)
        write_new(made[0], write(_tracked(found)))
        made += [_drawn(figure, solution, found)] if figure else []
        return made, {"smooth": found.as_dict()}
    write_new(made[0], write(_verified_plan(folder)))
    return made, {}


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
        check_new(path)
    for path, text in texts.items():
        write_new(path, text)
    return list(texts)


def _verified_plan(folder: Path) -> TrackedPlan:
    """A stored plan; ResultError if it is not verified, for a robot is to move by it."""
    found, verified, doubts = read_plan(folder)
    for words in doubts:
        note(words)
    if not verified:
        raise ResultError(NOT_VERIFIED.format(folder))
    if isinstance(found.motion, Solution) and found.motion.summary.flat:
        note(
            "its torques may have saw teeth where the objective hardly depends on them: --smooth looks for a plan without"
        )
    return found


def _smooth_plan(folder: Path) -> tuple[Solution, SmoothPlan]:
    """A stored hop, and a plan as good with torques that vary less; ResultError if the hop is not verified, or no solved one."""
    if (folder / f"{ROBUST}.json").is_file():
        raise ResultError(
            f"{folder}: --smooth is for a solved hop: a robust plan's torques are smooth enough to be tracked"
        )
    solution = read(folder)
    for words in solution.doubts:
        note(words)
    if not solution.verified:
        raise ResultError(NOT_VERIFIED.format(folder))
    with fitting(folder):
        found = smooth_plan(solution)
    leg, was = solution.design.leg, solution.summary.objective_value
    joints = zip(leg.joints, *found.variation.tolist(), strict=True)
    varies = [f"{j} by {after:.4g} in place of {before:.4g} {leg.units(j).tau}" for j, before, after in joints]
    note(
        f"smooth: torques vary less: {', '.join(varies)}; {solution.objective} {found.value:.7g} in place of {was:.7g} "
        f"{found.unit}; limited by {found.limited}; all {len(found.checks)} checks passed"
    )
    return solution, found


def _drawn(file: Path, solution: Solution, plan: SmoothPlan) -> Path:
    """The file with the torques of both, drawn."""
    from hopopt.plots.hop import save_figure
    from hopopt.plots.smooth_plan import torques

    file.parent.mkdir(parents=True, exist_ok=True)
    (written_file,) = save_figure(torques(solution, plan), file.with_suffix(""), [file.suffix[1:]])
    return written_file


def _tracked(found: SmoothPlan) -> TrackedPlan:
    """A smooth plan as what is exported."""
    reference = PlanReference.from_tables(NORMALISED_TIMES, found.motion.tables, found.claims["clearance_m"])
    return TrackedPlan(found.motion, reference)
