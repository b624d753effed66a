"""Calibrated motor values written into a problem file: only these numbers change, and never half a file."""

import os
import re
import shutil
from collections.abc import Mapping
from pathlib import Path

from hopopt.errors import ProblemFileError, UsageError
from hopopt.files import mark, write_whole
from hopopt.paper.result import Calibration
from hopopt.problem.load import load
from hopopt.problem.render import toml_value

CALIBRATED_MARK = "# calibrated with `hopopt calibrate`"
MOTOR_TABLE = "leg.motor"
ENTRIES = {"max_torque": "N m", "max_speed": "rad/s"}


def write_motor(path: Path, found: Calibration) -> None:
    """Put the calibrated max_torque and max_speed into the problem file's [leg.motor], with their standard errors.

    Written beside the file, read back, and only then put in its place. Raises UsageError, the file untouched, if a
    value is not determined or the file would not come out as the same problem with another motor.
    """
    p = {x.path: x for x in found.parameters}
    values = {entry: p[f"{MOTOR_TABLE}.{entry}"].rounded for entry in ENTRIES if f"{MOTOR_TABLE}.{entry}" in p}
    if not found.determined or not found.matched or not values:
        raise UsageError(
            f"{path} was not changed: the paper's figures do not determine the motor, or no motor matches them"
        )
    errors = {entry: p[f"{MOTOR_TABLE}.{entry}"].standard_error or 0.0 for entry in values}
    try:
        before = path.read_bytes().decode("utf-8")
        replace_checked(path, with_motor(before, values, errors), values)
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{path} was not changed: {error}") from None


def with_motor(text: str, values: Mapping[str, float], errors: Mapping[str, float]) -> str:
    """The text of a problem file with values of [leg.motor] by entry, all else as it was; a line above each names its
    standard error, in place of the line of an earlier calibration."""
    for entry, value in values.items():
        text = _with_entry(
            text, entry, value, f"{CALIBRATED_MARK}, standard error {errors[entry]:.2g} {ENTRIES[entry]}"
        )
    return text


def replace_checked(path: Path, text: str, values: Mapping[str, float]) -> None:
    """Put ``text`` in place of a problem file if it is the same problem but for these values of [leg.motor].

    Raises UsageError, the file untouched, if it is not.
    """
    path = path.resolve()
    before = load(path)
    trial = path.with_name(f"{path.stem}{mark()}.toml")
    try:
        write_whole(trial, text.encode("utf-8"))
        motor = before.leg.motor.model_copy(update=dict(values))
        leg = before.leg.model_copy(update={"motor": motor})
        if load(trial) != before.model_copy(update={"leg": leg}):
            raise UsageError(
                f"{path} was not changed: its [{MOTOR_TABLE}] is written in a way that cannot be edited safely"
            )
        shutil.copymode(path, trial)
        os.replace(trial, path)
    except ProblemFileError as error:
        raise UsageError(f"{path} was not changed: {error}".replace(trial.name, path.name)) from None
    finally:
        trial.unlink(missing_ok=True)


def _with_entry(text: str, entry: str, value: float, note: str) -> str:
    newline = "\r\n" if "\r\n" in text else "\n"
    header = re.search(rf"^[ \t]*\[[ \t]*{re.escape(MOTOR_TABLE)}[ \t]*\][^\n]*(?:\n|\Z)", text, re.MULTILINE)
    if header is None:
        return f"{text.rstrip()}{newline}{newline}[{MOTOR_TABLE}]{newline}{note}{newline}{entry} = {toml_value(value)}{newline}"
    following = re.search(r"^[ \t]*\[", text[header.end() :], re.MULTILINE)
    end = header.end() + following.start() if following else len(text)
    table, assignment = text[header.end() : end], f"{entry} = {toml_value(value)}"
    present = rf"^(?:{re.escape(CALIBRATED_MARK)}[^\n]*\n)?([ \t]*{entry}[ \t]*=[ \t]*[^\s#]+[ \t]*)"

    def line(found: re.Match[str]) -> str:
        before = found[1]  # up to a comment, which stays in its column
        return note + newline + (f"{assignment} ".ljust(len(before)) if before[-1].isspace() else assignment)

    table, count = re.subn(present, line, table, count=1, flags=re.MULTILINE)
    if not count:
        table = note + newline + assignment + newline + table
    return text[: header.end()] + table + text[end:]
