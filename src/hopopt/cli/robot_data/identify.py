"""The command that finds a leg's parameters in logs of the real robot: identify."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from rich.table import Column

from hopopt.cli.options import AsJson, LogNames, ended, repeated, write_new
from hopopt.cli.screen.console import NamedLines, Shown, figures, table
from hopopt.errors import ResultError, UsageError
from hopopt.problem.load import load
from hopopt.robot_data.identification import identify as identification
from hopopt.robot_data.robot_log import read_log, read_map

Known = Annotated[
    list[str] | None,
    repeated("--known", "A parameter that is right in the problem: --known leg.body.mass (repeat)."),
]


def identify(
    runs: list[Path],
    /,
    *,
    leg: str = "paper",
    map_: LogNames = None,
    known: Known = None,
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
    json_: AsJson = False,
) -> int:
    """Find a leg's masses, motor constants and losses from its logs.

    Torque constant, gear losses and no-load speed are found with 95 % intervals. What the logs cannot tell is named, with the reason, and keeps the problem's value.

    Parameters
    ----------
    runs
        CSV or MCAP files as hopopt log reads them. Their columns command_JOINT, force_z and force_x tell more (docs/logs.md).
    leg
        The problem file of the leg as it is believed to be, or the name of a built-in problem.
    map_
        A TOML file with the logs' own names: q_hip = "hip_position".
    output
        Also write the problem with what was identified, such as my_leg_identified.toml.
    """
    design, names = load(leg), read_map(map_)
    if output is not None and output.exists():
        raise UsageError(f"{output} exists already and is not overwritten: choose another name")
    logs = [read_log(run, design, names) for run in runs]
    try:
        found = identification(design, logs, known or ())
    except ResultError as error:
        raise ResultError(f"{', '.join(map(str, runs))}: {error}") from None
    if output is not None:
        write_new(output, found.problem_file([run.name for run in runs]))
    data = {"logs": [str(run) for run in runs], **found.as_dict(), "output": None if output is None else str(output)}
    return ended({**data, "exit_code": 0}, json_, shown(data))


def shown(data: Mapping[str, Any]) -> Iterator[Shown]:
    """The table of parameters, what the logs cannot tell, and where the problem was written."""
    parameters, rows = data["parameters"], []
    for key, p in parameters.items():
        interval = "" if p["low"] is None or not p["identified"] else f"{p['low']:.5g} to {p['high']:.5g}"
        value = f"{p['value']:.5g}" if interval else "given" if p["identified"] else "not told"
        rows.append([key, f"{p['believed']:.5g}", value, interval, p["unit"]])
    numbers = figures("problem", "identified", "95 % interval")
    columns = [Column("parameter", no_wrap=True), *numbers, Column("unit", no_wrap=True)]
    yield table(columns, rows, f"{data['problem']}: {', '.join(data['logs'])}")
    lines = [f"the data cannot tell {key}: {p['why']}" for key, p in parameters.items() if not p["identified"]]
    yield NamedLines("not told", lines)
    if data["output"]:
        yield f"{data['output']} written; to see it: hopopt show {data['output']}"
