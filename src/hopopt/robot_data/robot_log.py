"""The log of a real robot: a CSV or MCAP file whose columns, units and faults are recognised."""

import csv
import io
import re
import tomllib
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from hopopt.design import Design
from hopopt.errors import ResultError, UsageError
from hopopt.leg.robot import build_robot
from hopopt.leg.scales import weight
from hopopt.robot_data.log_mcap import mcap_table
from hopopt.sim.state import BOUNCE

COLUMN_UNITS = {  # of a column by the beginning of its name: unit -> factor to SI
    "t": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
    "q_": {"rad": 1.0, "deg": np.pi / 180},
    "v_": {"rad/s": 1.0, "deg/s": np.pi / 180, "rpm": np.pi / 30},
    "tau_": {"N m": 1.0, "Nm": 1.0},
    "command_": {"N m": 1.0, "Nm": 1.0},
    "force_": {"N": 1.0},
    "contact": {"": 1.0, "1": 1.0},
}
PRESSED = 0.05  # of the weight: a foot with more vertical force stands
SEPARATORS = ",;\t"  # of the cells of a table: the first of those that a header has most of
FEWEST = 50  # rows of a log
LONGEST_PERIOD = 3.0  # usual periods between two rows that follow each other
SLOWEST = 0.02  # [s] period of a log that shows a hop
HUGE = 1e20  # in any unit: more than every sensor and clock gives
MOST_BEYOND_LIMIT = 0.5  # [rad] by which no joint passes its limits
RATE_CORRELATION = 0.5  # correlation of a speed column with the rate of its angle, below which it is another's
STILL_SPREAD = 0.5  # [rad/s] standard deviation below which a joint's rate says nothing


@dataclass(frozen=True)
class RobotLog:
    """A log in SI units: t (k,) [s] from its first row; q, v, tau (k, n) of the joints; contact (k,); force (k, 2) [N],
    zero where it was not measured; command (k, n) [N m], NaN for joints without one."""

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    tau: np.ndarray
    contact: np.ndarray
    force: np.ndarray
    command: np.ndarray | None = None


def same_run(one: RobotLog, other: RobotLog) -> bool:
    """Whether two logs are of one run, perhaps cut differently: most rows of the shorter are the other's too."""
    rows = [{row.tobytes() for row in np.hstack([log.q, log.v, log.tau])} for log in (one, other)]
    return len(rows[0] & rows[1]) > 0.5 * min(map(len, rows))


def read_map(file: Path | None) -> dict[str, str]:
    """hopopt's column names -> the log's, from a TOML file; UsageError if it is none."""
    if file is None:
        return {}
    try:
        found = tomllib.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UsageError(
            f'{file}: the map cannot be read ({error}): write lines such as q_hip = "hip_position"'
        ) from None
    wrong = [name for name, column in found.items() if not isinstance(column, str)]
    if wrong:
        raise UsageError(f"{file}: {wrong[0]}: the name of a column is needed, in quotation marks")
    return found


def read_log(file: Path, design: Design, names: Mapping[str, str] | None = None) -> RobotLog:
    """A CSV file with a header, or an MCAP file (``robot_data/log_mcap.py``), as a log in SI units.

    Semicolons or tabs may stand for the commas, decimal commas for points then.

    Its columns: t, and q_JOINT, v_JOINT, tau_JOINT of every joint; contact or force_z; force_x and command_JOINT if
    measured.
    A unit may stand in brackets behind a name; without one it is SI. ``names`` gives the log's own names. Raises
    ResultError, with the column and what to do, for a file that is no such log.
    """
    mine, joints = names or {}, design.leg.joints
    parts = [f"{part}_{joint}" for part in ("q", "v", "tau", "command") for joint in joints]
    table = _table(file, {mine.get(name, name) for name in ("t", *parts, "force_x", "force_z", "contact")})

    def column(name: str) -> np.ndarray:
        return _in_si(file, table, name, mine.get(name, name))

    def has(name: str) -> bool:
        return mine.get(name, name) in table

    t = column("t")
    q, v, tau = (np.stack([column(f"{part}_{joint}") for joint in joints], axis=1) for part in ("q", "v", "tau"))
    force = np.stack([column(f"force_{a}") if has(f"force_{a}") else np.zeros(len(t)) for a in "xz"], axis=1)
    if has("contact"):
        contact = column("contact") > 0.5
    elif has("force_z"):
        contact = force[:, 1] > PRESSED * weight(build_robot(design.leg).model)
    else:
        raise ResultError(f"{file}: nothing says when the foot stands: add a column contact (0 or 1) or force_z [N]")
    unknown, asked = np.full(len(t), np.nan), [f"command_{joint}" for joint in joints]
    command = np.stack([column(c) if has(c) else unknown for c in asked], axis=1)
    log = RobotLog(t - t[0], q, v, tau, without_bounces(t, contact), force, command)
    _sensible(file, design, log)
    return log


def without_bounces(t: np.ndarray, contact: np.ndarray) -> np.ndarray:
    """Contact with every change undone that lasts less than ``BOUNCE``."""
    settled = contact.copy()
    edges = [0, *(np.flatnonzero(np.diff(contact)) + 1), len(t)]
    for begin, end in pairwise(edges[1:]):
        if end < len(t) and t[end] - t[begin] < BOUNCE:
            settled[begin:end] = settled[begin - 1]
    return settled


# ---- what makes a log unusable ------------------------------------------------------------------------------------


Table = dict[str, tuple[str, Sequence[str | float]]]  # name -> unit, cells


def _table(file: Path, wanted: Set[str]) -> Table:
    """What a CSV or an MCAP file holds; the columns that are wanted say which topics of an MCAP file count."""
    if file.is_dir():
        raise ResultError(f"{file}: this is a folder: name the file of one log in it")
    columns = mcap_table(file, wanted).items() if file.suffix.lower() == ".mcap" else _csv(file)
    rows = next((len(cells) for _, cells in columns), 0)
    if rows < FEWEST:
        raise ResultError(f"{file}: {rows} rows show no hop: {FEWEST} or more are needed")
    found = Table()
    for head, cells in columns:
        parts = re.fullmatch(r"\s*(.*?)\s*(?:\[(.*)\])?\s*", head, re.DOTALL)
        assert parts
        if (name := parts[1]) in found and name in wanted:
            raise ResultError(f"{file}: there are two columns {name}: leave one out, or give them other names")
        found[name] = (parts[2] or "", cells)
    return found


def _csv(file: Path) -> list[tuple[str, Sequence[str]]]:
    """Header and cells of every column of a table whose cells commas, semicolons or tabs separate.

    Where commas do not separate, and no number has a point, they are decimal commas.
    """
    try:
        with file.open(encoding="utf-8-sig", newline="") as stream:
            text = stream.read()
        first = next((line for line in io.StringIO(text) if line.strip()), "")
        separator = max(SEPARATORS, key=first.count)
        found = [line for line in csv.reader(io.StringIO(text, newline=""), delimiter=separator) if line]
    except FileNotFoundError:
        raise ResultError(f"{file}: there is no such file") from None
    except (OSError, ValueError, csv.Error) as error:
        raise ResultError(f"{file}: it is no CSV file with a header ({error})") from None
    if not first:
        raise ResultError(
            f"{file}: the file is empty: it needs a header with the columns' names, and a row for each instant"
        )
    head, *lines = found
    short = next((k for k, line in enumerate(lines) if len(line) != len(head)), None)
    if short is not None:
        raise ResultError(f"{file}: row {short + 2} has {len(lines[short])} cells, the header {len(head)}")
    if separator != "," and not any("." in cell and _is_number(cell) for line in lines for cell in line):
        lines = [[cell.replace(",", ".") if cell.count(",") == 1 else cell for cell in line] for line in lines]
    return list(zip(head, zip(*lines, strict=True), strict=True)) if lines else [(name, ()) for name in head]


def _in_si(file: Path, table: Table, name: str, column: str) -> np.ndarray:
    if column not in table:
        other = f"; it has {', '.join(list(table)[:12])}"
        raise ResultError(f"{file}: there is no column {column}{other}: name it so, or give its name in a --map file")
    unit, cells = table[column]
    units = next(
        known for start, known in COLUMN_UNITS.items() if name == start or (start[-1] == "_" and name.startswith(start))
    )
    if unit and unit not in units:
        raise ResultError(f"{file}: {column} is in {unit!r}: {', '.join(u for u in units if u)} are known")
    try:
        values = np.array(cells, dtype=float)
    except ValueError:
        values = np.array([np.nan])
    if not (np.abs(values) < HUGE).all():
        bad = next(k for k, cell in enumerate(cells) if not _is_number(cell))
        raise ResultError(f"{file}: row {bad + 2}, {column}: {str(cells[bad])[:40]!r} is not a number that can be used")
    return values * (units[unit] if unit else 1.0)


def _is_number(cell: str | float) -> bool:
    try:
        return abs(float(cell)) < HUGE
    except ValueError:
        return False


def _sensible(file: Path, design: Design, log: RobotLog) -> None:
    """ResultError for times that do not run, angles, speeds or contact that cannot be those of a hop of this leg."""
    steps = np.diff(log.t)
    usual = float(np.median(steps))
    if steps.min() <= 0:
        raise ResultError(f"{file}: row {int(np.argmin(steps)) + 3}: time does not increase")
    if usual > SLOWEST:
        raise ResultError(
            f"{file}: rows are {usual:g} s apart, too few for a hop: is t in ms? write t [ms] in the header"
        )
    if steps.max() > LONGEST_PERIOD * usual:
        at = int(np.argmax(steps))
        raise ResultError(
            f"{file}: nothing was logged from {log.t[at]:.4f} to {log.t[at + 1]:.4f} s: cut the log there, or log again"
        )
    for k, joint in enumerate(design.leg.joints):
        limits, angle, speed = design.leg.joint[joint], log.q[:, k], log.v[:, k]
        if max(float(limits.lower - angle.min()), float(angle.max() - limits.upper)) > MOST_BEYOND_LIMIT:
            raise ResultError(
                f"{file}: q_{joint} runs from {angle.min():.2f} to {angle.max():.2f} rad, its limits are {limits.lower:g} and "
                f"{limits.upper:g}: is it in degrees (write q_{joint} [deg]), another joint's, or counted from elsewhere?"
            )
        rate = np.gradient(angle, log.t)
        alike = np.mean((rate - rate.mean()) * (speed - speed.mean()))
        if (
            rate.std() > STILL_SPREAD and alike <= RATE_CORRELATION * rate.std() * speed.std()
        ):  # a speed that never changes is none
            raise ResultError(
                f"{file}: v_{joint} is not the rate of q_{joint}: are columns swapped, or is its sign the other way round?"
            )
    if not log.contact[0] or log.contact.all():
        when = "the foot never leaves the ground" if log.contact.all() else "the foot does not stand at its beginning"
        raise ResultError(f"{file}: there is no hop from rest in this log: {when}")
