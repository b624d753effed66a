"""A user's files as text and tables: problem files and catalogues, and in a sentence what a file is instead of one."""

import os
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from hopopt.files import read_regular
from hopopt.problem.checking.faults import Report
from hopopt.problem.render import shown, shown_path

MAX_BYTES = 1_000_000  # of a file; a problem has a few thousand
MAX_DEPTH = 12  # of nested tables and lists; a problem needs 4
PROBLEM = "problem file"  # kind of a file in a sentence


class NotOne(Exception):
    """What a file is instead of what it should be, in words that follow its name."""


def read(
    path: Path, report: Report, absent: Callable[[], str], kind: str = PROBLEM, suffix: str = ".toml"
) -> str | None:
    """The text of a file of this ``kind``; None, and reported, if it cannot be had. ``absent``: what to say further if there
    is none."""
    try:
        if os.path.isdir(path):
            inside = ", ".join(sorted(p.name for p in path.glob(f"*{suffix}"))) or "it holds none"
            raise NotOne(f"is a folder: give the path of a {suffix} file ({inside})")
        raw = read_regular(path, MAX_BYTES + 1)
        if len(raw) > MAX_BYTES:
            raise NotOne(f"has more than {MAX_BYTES} bytes: this is not a {kind}")
        return _text(raw, kind, suffix)
    except FileNotFoundError:
        report.unusable(f"{shown_path(str(path))}: there is no such file{absent()}")
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        report.unusable(f"{shown_path(str(path))} cannot be read: {reason}")
    except NotOne as error:
        report.unusable(f"{shown_path(str(path))} {error}")
    return None


def tables(text: str, kind: str = PROBLEM) -> dict[str, Any]:
    """The table in the text of a TOML file; NotOne if it is none."""
    if text.lstrip().startswith("<"):
        raise NotOne(f"is XML (a URDF?), not a {kind} in TOML: `hopopt new my_leg` writes one to start from")
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise NotOne(_syntax_fault(str(error), text)) from None
    except (ValueError, RecursionError):  # numbers of thousands of digits, thousands of brackets
        raise NotOne(f"is not a {kind}: a number is too long or brackets are nested too deeply") from None
    if too_deep(data):
        raise NotOne(f"is not a {kind}: tables are nested more than {MAX_DEPTH} deep")
    return data


def read_tables(path: Path, report: Report, absent: Callable[[], str], kind: str = PROBLEM) -> dict[str, Any]:
    """The table in a TOML file; empty, and reported, if it cannot be had."""
    text = read(path, report, absent, kind)
    try:
        return {} if text is None else tables(text, kind)
    except NotOne as error:
        report.unusable(f"{shown_path(str(path))} {error}")
        return {}


def too_deep(data: Any) -> bool:
    """Whether tables and lists are nested deeper than any problem nests them."""
    return any(depth > MAX_DEPTH for depth in _depths(data))


def _text(raw: bytes, kind: str, suffix: str) -> str:
    try:
        return raw.decode("utf-8-sig")  # editors on Windows put a byte-order mark in front
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        made = "TOML text" if suffix == ".toml" else "text"
        raise NotOne(f"is not text (line {line} is not UTF-8): a {kind} is a {made} file") from None


def _syntax_fault(message: str, text: str) -> str:
    found, lines = re.search(r" \(at line (\d+), column \d+\)$", message), text.splitlines()
    number = int(found[1]) if found else max(len(lines), 1)
    line = lines[number - 1].strip() if number <= len(lines) else ""
    return (
        f"line {number} is not valid TOML: {message[: found.start()] if found else message}. It reads {shown(line)}; "
        'write key = value, text in "quotes", tables as [leg.gear], comments after #'
    )


def _depths(data: Any) -> Iterator[int]:
    """Depth of everything in ``data``, without recursion; stops soon after MAX_DEPTH."""
    level, depth = [data], 0
    while level and depth <= MAX_DEPTH:
        depth += 1
        inner = [list(item.values()) if isinstance(item, Mapping) else item for item in level]
        level = [x for items in inner for x in items if isinstance(x, (Mapping, list, tuple))]
        yield depth


def beside(
    name: Any, folder: Path, where: str, what: str, absent: Callable[[Path], str], report: Report
) -> Path | None:
    """The file that a problem file in ``folder`` names, beside it or below; None, and reported as ``where``, if it is not.

    ``what``: the file in a word; ``absent``: what to say of a path at which there is none.
    """
    try:
        found = (folder / name).resolve()
    except (OSError, ValueError, RuntimeError, TypeError):  # a null byte, a loop of links, no text
        return report.unusable(f"{where} is not the path of a file")
    if os.path.isabs(name) or not found.is_relative_to(folder.resolve()):
        return report.unusable(f"{where} leads out of the folder of the problem: put the {what} beside it, or below")
    if not os.path.exists(found):
        return report.unusable(f"{where}: {absent(found)}")
    return found
