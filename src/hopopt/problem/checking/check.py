"""What is wrong with a problem, section by section: each fault pydantic finds, as a sentence for its author."""

from collections.abc import Iterable, Mapping
from inspect import isclass
from typing import Any

from pydantic import ValidationError, create_model
from pydantic.fields import FieldInfo

from hopopt.design import Design, Leg
from hopopt.design.fields import Section
from hopopt.problem.checking.faults import Report
from hopopt.problem.checking.rules import drive_rules, entry_rules, loss_rules, start_rules, stated_once
from hopopt.problem.checking.wording import allowed, did_you_mean, entry_at, hint, homes, is_number, unit_of
from hopopt.problem.render import shown, shown_path
from hopopt.problem.urdf import ENTRIES

NEEDED = {  # what to write where a whole section is missing
    "leg": "the table [leg] with joints and links, and [leg.body], [leg.motor] and [leg.gear]",
    "start": "the table [start] with hip_height (legs of two joints) or joint_angles",
}
LEG_TABLES = {"joint": "joints", "link": "links"}  # field of Leg -> the list that names its tables
SECTIONS: dict[str, Any] = {
    name: info.annotation
    for name, info in Design.model_fields.items()
    if isclass(info.annotation) and issubclass(info.annotation, Section)
}
_HEAD: dict[str, Any] = {n: (info.annotation, info) for n, info in Design.model_fields.items() if n not in SECTIONS}
Head = create_model("Head", __base__=Section, **_HEAD)  # the entries above the first table
WHAT = {
    "greater_than_equal": "is too small",
    "less_than_equal": "is too large",
    "finite_number": "is not finite",
    "too_short": "has too few entries",
    "too_long": "has too many entries",
}


def check(data: dict[str, Any], report: Report) -> Design | None:
    """The design in the nested tables ``data``, or None and every fault in ``report``."""
    head = _validated(Head, "", {key: value for key, value in data.items() if key not in SECTIONS}, report)
    parts = {name: _section(name, kind, data, report) for name, kind in SECTIONS.items()}
    entry_rules(data, report)
    if report.clean("leg"):
        drive_rules(parts["leg"], report)
    if report.clean("leg") and report.clean("simulation"):
        loss_rules(parts["leg"], parts["simulation"], report)
    if report.clean("start"):
        stated_once(parts["start"], report)
    if report.clean("leg") and report.clean("start"):
        start_rules(parts["leg"], parts["start"], parts["hop"] if report.clean("hop") else None, report)
    return None if report.faults else Design(**dict(head), **parts)


def _section(name: str, kind: Any, data: Mapping[str, Any], report: Report) -> Any:
    """A section of the problem; None, and its faults reported, if it has any."""
    if name not in data and Design.model_fields[name].is_required():
        return report.add(name, f'is missing: add {NEEDED[name]}, or begin the file with extends = "paper"')
    table = data.get(name, {})
    if not isinstance(table, dict):
        return report.add(name, f"= {shown(table)} is not a table: write [{name}] and its entries on the lines below")
    return _validated(kind, name, _gathered(table, report) if kind is Leg else table, report)


def _gathered(table: Mapping[str, Any], report: Report) -> dict[str, Any]:
    """The leg's table with the tables of its joints and links under "joint" and "link", as Leg wants them."""
    table, gathered = dict(table), {}
    for key in LEG_TABLES.keys() & table.keys():
        del table[key]
        report.add(f"leg.{key}", f"is not a known key: a {key} has the table [leg.<name of the {key}>]")
    for key, names in LEG_TABLES.items():
        own = [n for n in _listed(table, names) if n not in Leg.model_fields]
        for name in own:
            if name not in table:
                needed = _and(k for k, info in entry_at(Leg, (key, name))[0].model_fields.items() if info.is_required())
                report.add(
                    f"leg.{name}", f"is missing: leg.{names} names it, so add the table [leg.{name}] with {needed}"
                )
        gathered[key] = {name: table[name] for name in own if name in table}
    return {k: v for k, v in table.items() if not any(k in tables for tables in gathered.values())} | gathered


def _listed(table: Mapping[str, Any], names: str) -> list[str]:
    """The names in one list of the leg's table, each once, whatever else the list may hold."""
    listed = table.get(names)
    return list(dict.fromkeys(n for n in listed if isinstance(n, str))) if isinstance(listed, tuple) else []


def _validated(kind: Any, path: str, table: dict[str, Any], report: Report) -> Any:
    """``table`` as a ``kind``; None, and its faults reported, if it has any."""
    try:
        return kind.model_validate(table)
    except ValidationError as error:
        found = error.errors(include_url=False)
        in_lists = [fault["loc"][:-1] for fault in found]
        for fault in found:
            if fault["type"] == "too_short" and fault["loc"] in in_lists:
                continue  # pydantic does not count the list's faulty entries
            report.add(*_described(kind, path, fault, table))
    return None


def _described(kind: Any, path: str, fault: Any, table: Mapping[str, Any]) -> tuple[str, str]:
    """Path of the entry that has one of pydantic's faults, and the words that follow it."""
    loc = fault["loc"]
    info = entry_at(kind, loc)[1]
    in_leg = kind is Leg and loc[0] in LEG_TABLES
    here = _path(path, loc[1:] if in_leg else loc)
    if fault["type"] == "extra_forbidden":
        known = _known(kind, loc[:-1], table)
        return here, _unknown(str(loc[-1]), _path(path, loc[1:-1] if in_leg else loc[:-1]), known)
    if fault["type"] == "missing" and info is not None:
        meaning = f"{info.description}; " if info.description else ""
        return here, f"is missing: {meaning}{allowed(info)} is needed"
    return here, _refused(fault, info)


def _path(path: str, loc: Iterable[int | str]) -> str:
    for step in loc:
        path += f"[{step}]" if isinstance(step, int) else f".{step}" if path else step
    return path


def _known(kind: Any, loc: Any, table: Mapping[str, Any]) -> list[str]:
    """The keys of the table at ``loc``."""
    if kind is Head:
        return [*Design.model_fields, "extends"]
    keys = list(entry_at(kind, loc)[0].model_fields)
    keys += ["model"] if "catalogue" in keys else []  # gone where names have become numbers, but it may be written
    if kind is Leg and not loc:
        keys = [*keys, *ENTRIES]
        keys = [key for key in keys if key not in LEG_TABLES]
        keys += [n for names in LEG_TABLES.values() for n in _listed(table, names) if n not in keys]
    return keys


def _unknown(key: str, path: str, known: list[str]) -> str:
    """What to say about a key that no table at ``path`` has."""
    elsewhere = (
        "" if (close := did_you_mean(key, known)) else "".join(f"; {key} belongs in {h}" for h in homes(key)[:1])
    )
    return f"is not a known key{close}: {f'[{path}]' if path else 'the top of the file'} takes {_and(known)}{elsewhere}"


def _refused(fault: Any, info: FieldInfo | None) -> str:
    """What to say about a value that is not allowed."""
    value = fault["input"]
    meant = hint(value, info, in_list=isinstance(fault["loc"][-1], int))
    unit = f" {unit_of(info)}" if is_number(value) and unit_of(info) else ""
    what = WHAT.get(fault["type"], "is not allowed")
    return f"= {shown(value)}{unit} {what}: {allowed(info)} is needed{meant}"


def _and(words: Iterable[str]) -> str:
    *most, last = [shown_path(word) for word in words]
    return f"{', '.join(most)} and {last}" if most else last
