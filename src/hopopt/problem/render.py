"""A design as text: the resolved problem file, its table of entries, its hash, and values as a file writes them."""

import hashlib
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

from pydantic import BaseModel

from hopopt.design import Design, Leg
from hopopt.design.fields import TRUNK
from hopopt.design.geometry.link_joint import unit_along
from hopopt.design.problem import OwnParameter
from hopopt.drivetrain import springs
from hopopt.leg.scales import reserve_of

ONE_OF_LIST = re.compile(r"(.+)\[(\d{1,3})\]", re.ASCII)


@dataclass(frozen=True)
class Row:
    """One entry of a problem: its path, its value (None: not set) in ``unit``, what it means."""

    path: str
    value: Any
    unit: str
    meaning: str


def rows(design: Design) -> list[Row]:
    """Every entry of the problem with the value it has, in the order of the file."""
    found = list(_rows("", design))
    if design.leg.sliding:
        found = [replace(row, unit=_unit(design.leg, row.path, row.unit)) for row in found]
    return sorted(found, key=lambda row: "." in row.path)  # TOML wants the top entries before the tables


def place(path: str) -> tuple[str, int | None]:
    """The entry at ``path``, and which of its list's numbers: ("hop.stance_duration", 1) of hop.stance_duration[1]."""
    one = ONE_OF_LIST.fullmatch(path)
    return (one[1], int(one[2])) if one else (path, None)


def unit_at(design: Design, path: str) -> str:
    """The unit of the entry at ``path``, or of one number of a list of them: start.joint_angles[1]; empty if there is none."""
    entry, index = place(path)
    if entry == "start.joint_angles" and index is not None:
        return design.leg.units(design.leg.joints[index]).q
    return {row.path: row.unit for row in rows(design)}.get(entry, "")


def value_at(design: Design, path: str) -> Any:
    """The value of the entry at ``path``, or of one number of a list of them: hop.stance_duration[1]; None if there is none."""
    entry, index = place(path)
    value = values_of(design).get(entry)
    if index is None:
        return value
    listed = value if isinstance(value, (tuple, list)) else ()
    return listed[index] if index < len(listed) else None


def _unit(leg: Leg, path: str, unit: str) -> str:
    """The unit of an entry of a leg with joints that slide, by that which it has where all turn."""
    table, _, inner = path.removeprefix("leg.").partition(".")
    name, _, of_spring = inner.partition(".")
    if table in leg.sliding:
        return unit_along(inner, unit, leg.linear(table))
    if table == "spring" and springs.slides(leg, name, (leg.spring or {})[name]):
        return unit_along(of_spring, unit, True)
    if path == "start.joint_angles":
        return ", ".join(dict.fromkeys(leg.units(joint).q for joint in leg.joints))
    return unit


def values_of(design: Design) -> dict[str, Any]:
    """The value of every entry, by path."""
    return {row.path: row.value for row in rows(design)}


def as_json(design: Design) -> dict[str, dict[str, Any]]:
    """{path: {"value", "unit", "meaning"}} of every entry."""
    return {row.path: {k: v for k, v in asdict(row).items() if k != "path"} for row in rows(design)}


def resolved_toml(design: Design, sources: Mapping[str, str] | None = None) -> str:
    """The problem with all defaults filled in, as a file that ``load`` reads back to an equal design; ``sources`` (path ->
    words) stand behind the meaning of their entries."""
    notes = {row.path: f"[{row.unit}] {row.meaning}" if row.unit else row.meaning for row in rows(design)}
    notes |= {path: f"{notes[path]}; {printable(words)}" for path, words in (sources or {}).items()}
    head = "# All entries of this problem, defaults included; entries that are not set are left out. SI units.\n\n"
    return head + _toml(design.model_dump(exclude_none=True), notes)


def design_hash(design: Design) -> str:
    """8 hexadecimal digits that change with every entry but the title; what an entry says by default counts as if it were written."""
    trunk = (TRUNK,) if design.leg.has_trunk else ()
    above = design.hop.above_ground or (*design.leg.chain[:-1], *trunk, "foot")
    hop = design.hop.model_copy(update={"above_ground": above})
    whole = design.model_copy(update={"reserve": reserve_of(design), "hop": hop})
    text = _toml(whole.model_dump(exclude_none=True, exclude={"title"}), {})
    return hashlib.sha256(text.encode()).hexdigest()[:8]


def toml_value(value: Any) -> str:
    """A value as TOML writes it; TypeError if a problem file cannot hold it.

    Not by a library: tomli-w writes no comments, which hold the meaning of every entry, and sentences quote values alone.
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(toml_value(item) for item in value) + "]"
    raise TypeError(f"{type(value).__name__} has no place in a problem file")


def shown(value: Any, width: int = 60) -> str:
    """A value in a sentence: as the file has it, shortened, safe to print whatever it is."""
    if isinstance(value, Mapping):
        return "a table"
    try:
        text = toml_value(value)
    except TypeError:
        text = f"(a {type(value).__name__})"  # TOML's dates and times
    except ValueError:
        text = "(a very long number)"  # thousands of digits, which Python does not print
    text = printable(text)
    return text if len(text) <= width else text[: width - 3] + "..."


def printable(text: str) -> str:
    """``text`` with control characters and the like escaped, so that no file can command a terminal."""
    return "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in text)


def shown_path(path: str) -> str:
    """A key path in a sentence, quoted only if it has to be."""
    return path if re.fullmatch(r"[A-Za-z0-9_./\[\]-]{1,200}", path) else shown(path)


def _rows(path: str, section: BaseModel) -> Iterator[Row]:
    for name, info in type(section).model_fields.items():
        value, extra = getattr(section, name), info.json_schema_extra
        said = extra if isinstance(extra, dict) else {}
        here = f"{path}.{name}" if path else name
        if isinstance(value, BaseModel):
            yield from _rows(here, value)
        elif isinstance(value, dict):  # leg.joint and leg.link: their tables sit in [leg] itself
            for key, item in value.items():
                yield from _rows(f"{path if name in ('joint', 'link') else here}.{key}", item)
        elif value is not None or said.get("listed", True):
            unit = str(said.get("unit", ""))
            if isinstance(section, OwnParameter) and name in ("value", "lower", "upper"):
                unit = section.unit
            yield Row(here, value, unit, info.description or "")


def _toml(table: Mapping[str, Any], notes: Mapping[str, str], path: str = "") -> str:
    """A table and all within it; ``notes`` become comments."""
    lines, tables = [], []
    for key, value in table.items():
        here = f"{path}.{key}" if path else key
        if isinstance(value, Mapping):
            tables.append(f"\n[{here}]\n" + _toml(value, notes, here))
        else:
            entry = f"{key} = {toml_value(value)}"
            lines.append(f"{entry:<33} # {notes[here]}\n" if here in notes else f"{entry}\n")
    return "".join([*lines, *tables])
