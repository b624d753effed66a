"""What is wrong with a problem: each fault that pydantic finds, as a sentence for its author, then the rules between entries."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from hopopt import extensions
from hopopt.design import Design, Leg
from hopopt.design.geometry.link_joint import unit_along
from hopopt.design.names import names_in
from hopopt.problem.checking.drives.gears import loss_rules
from hopopt.problem.checking.drives.motors import drive_rules, heat_rules
from hopopt.problem.checking.drives.springs import series_rules, spring_rules
from hopopt.problem.checking.drives.transmissions import transmission_rules
from hopopt.problem.checking.entries import entry_at, homes, unit_of, words_of
from hopopt.problem.checking.faults import Report
from hopopt.problem.checking.rules import entry_rules, start_rules, stated_once
from hopopt.problem.checking.wording import allowed, did_you_mean, hint, is_number
from hopopt.problem.render import shown, shown_path
from hopopt.problem.shapes.rules import ground_rules, margin_rules, shape_rules
from hopopt.problem.urdf.leg import ENTRIES

NEEDED = {  # what to write where a whole section is missing
    "leg": "the table [leg] with joints and links, and [leg.body], [leg.motor] and [leg.gear]",
    "start": "the table [start] with hip_height (legs of two joints) or joint_angles",
}
LEG_TABLES = {"joint": "joints", "link": "links"}  # field of Leg -> the list that names its tables
REFUSED = {  # pydantic's kinds of faults of a value in the project's words
    "greater_than_equal": "is too small",
    "less_than_equal": "is too large",
    "finite_number": "is not finite",
    "too_short": "has too few entries",
    "too_long": "has too many entries",
}


def check(data: dict[str, Any], report: Report, without_modules: bool = False) -> Design | None:
    """The design in the nested tables ``data``, or None and every fault in ``report``.

    without_modules: names of modules that are not here are no faults, so that what else there is can be shown
    """
    tables = {**data, "leg": _gathered(data["leg"], report)} if isinstance(data.get("leg"), dict) else data
    design = _validated(tables, report)
    entry_rules(data, report)

    def sound(section: str) -> Any:
        """A section without faults so far; None for another."""
        kind: Any = Design.model_fields[section].annotation
        return kind.model_validate(tables.get(section, {})) if report.clean(section) else None

    if leg := sound("leg"):
        drive_rules(leg, report)
        transmission_rules(leg, report)
        series_rules(leg, report)
        shape_rules(leg, report)
        spring_rules(leg, report)
    if design and sound("leg"):
        heat_rules(design.leg, design.ambient, report)
        margin_rules(design.leg, design.hop, report)
    if (leg := sound("leg")) and (simulation := sound("simulation")):
        loss_rules(leg, simulation, report)
    if start := sound("start"):
        stated_once(start, report)
    if (leg := sound("leg")) and (start := sound("start")):
        start_rules(leg, start, sound("hop"), report)
        if design and report.clean("start"):
            ground_rules(design, report)
    if design:
        design = _with_modules(design, report, without_modules)
    return None if report.faults else design


def _with_modules(design: Design, report: Report, without_modules: bool) -> Design:
    """The problem with the modules that its names come from; names that are nowhere are reported."""
    extensions.note_needed(wanted := extensions.absent(design.needs or ()))
    needed = dict.fromkeys(design.needs or ())
    for at, kind, name in names_in(design):
        listed = isinstance(at[-1], int)
        entry = entry_at(at[:-1] if listed else at) or {}
        if name in entry["words"]:
            continue
        if extensions.known(kind, name):
            needed[extensions.origin(kind, name) or ""] = None
        elif not without_modules:
            report.add(_path(at), f"= {shown(name)} {_not_there(name, kind, entry, wanted)}")
    return design.model_copy(update={"needs": tuple(filter(None, needed)) or None})


def _not_there(name: str, kind: str, entry: Mapping[str, Any], wanted: Sequence[str]) -> str:
    """What to say of a name that its registry does not have."""
    if wanted:
        return extensions.needs(wanted)
    own = f"a {kind} of your own needs the module that has it, --with my_module"
    if not words_of(entry):
        return f"is none that there is: {own}"
    return f"is not allowed: {allowed(entry)} is needed{hint(name, entry, in_list=True) or f'; {own}'}"


def _gathered(table: Mapping[str, Any], report: Report) -> dict[str, Any]:
    """The leg's table with the tables of its joints and links under "joint" and "link", as Leg wants them."""
    for key in LEG_TABLES.keys() & table.keys():
        report.add(f"leg.{key}", f"is not a known key: a {key} has the table [leg.<name of the {key}>]")
    gathered: dict[str, dict[str, Any]] = {}
    for key, names in LEG_TABLES.items():
        own = [n for n in _listed(table, names) if n not in Leg.model_fields]
        for name in own:
            if name not in table:
                needed = _and((entry_at(("leg", key, name)) or {})["required"])
                words = f"is missing: leg.{names} names it, so add the table [leg.{name}] with {needed}"
                report.add(f"leg.{name}", words)
        gathered[key] = {name: table[name] for name in own if name in table}
    elsewhere = {*LEG_TABLES, *gathered["joint"], *gathered["link"]}
    return {key: value for key, value in table.items() if key not in elsewhere} | gathered


def _listed(table: Mapping[str, Any], names: str) -> list[str]:
    """The names in one list of the leg's table, each once, whatever else the list may hold."""
    listed = table.get(names)
    return list(dict.fromkeys(n for n in listed if isinstance(n, str))) if isinstance(listed, tuple) else []


def _validated(tables: dict[str, Any], report: Report) -> Design | None:
    """The problem in ``tables``; None, and its faults reported, if it has any."""
    try:
        return Design.model_validate(tables)
    except ValidationError as error:
        found = error.errors(include_url=False)
        in_lists = [fault["loc"][:-1] for fault in found]
        for fault in found:
            if fault["type"] == "too_short" and fault["loc"] in in_lists:
                continue  # pydantic does not count the list's faulty entries
            report.add(_path(fault["loc"]), _described(fault, tables))
    return None


def _path(loc: Iterable[int | str]) -> str:
    """Where a file has what pydantic finds at ``loc``: tables of joints and links lie in [leg] itself."""
    steps, path = list(loc), ""
    if steps[:1] == ["leg"] and len(steps) > 1 and steps[1] in LEG_TABLES:
        del steps[1]
    for step in steps:
        path += f"[{step}]" if isinstance(step, int) else f".{step}" if path else step
    return path


def _described(fault: Any, tables: Mapping[str, Any]) -> str:
    """What to say about one of pydantic's faults, to follow the path of its entry."""
    loc, value = fault["loc"], fault["input"]
    entry = _as_it_moves(entry_at(loc) or {}, loc, tables)
    if fault["type"] == "extra_forbidden":
        return _unknown(str(loc[-1]), _path(loc[:-1]), _known(loc[:-1], tables))
    if fault["type"] == "missing" and loc[0] in NEEDED and len(loc) == 1:
        return f'is missing: add {NEEDED[loc[0]]}, or begin the file with extends = "paper"'
    if fault["type"] == "missing":
        return f"is missing: {'; '.join(filter(None, (entry.get('description'), allowed(entry))))} is needed"
    if "properties" in entry and len(loc) == 1:
        return f"= {shown(value)} is not a table: write [{loc[0]}] and its entries on the lines below"
    unit = f" {unit_of(entry)}" if is_number(value) and unit_of(entry) else ""
    meant = hint(value, entry, in_list=isinstance(loc[-1], int))
    return f"= {shown(value)}{unit} {REFUSED.get(fault['type'], 'is not allowed')}: {allowed(entry)} is needed{meant}"


def _as_it_moves(entry: Mapping[str, Any], loc: Sequence[int | str], tables: Mapping[str, Any]) -> Mapping[str, Any]:
    """An entry with the unit that it has at its joint, if that slides."""
    joint = tables["leg"]["joint"].get(loc[2], {}) if loc[:2] == ("leg", "joint") and len(loc) > 3 else {}
    if "unit" not in entry or not isinstance(joint, Mapping) or joint.get("type") != "prismatic":
        return entry
    motor = joint.get("motor")
    inner = ".".join(str(step) for step in loc[3:])
    return {**entry, "unit": unit_along(inner, entry["unit"], isinstance(motor, Mapping) and "max_force" in motor)}


def _known(loc: Any, tables: Mapping[str, Any]) -> list[str]:
    """The keys of the table at ``loc``."""
    keys = [key for key in (entry_at(loc) or {})["properties"] if loc != ("leg",) or key not in LEG_TABLES]
    if not loc:
        return [*keys, "supply", "catalogue", "extends"]
    if loc == ("leg",):
        keys += [
            *ENTRIES,
            *(n for names in LEG_TABLES.values() for n in _listed(tables["leg"], names) if n not in keys),
        ]
    return (
        [*keys, "model"] if "catalogue" in keys else keys
    )  # gone where names have become numbers, but it may be written


def _unknown(key: str, path: str, known: list[str]) -> str:
    """What to say about a key that no table at ``path`` has."""
    close = did_you_mean(key, known)
    elsewhere = "" if close else "".join(f"; {key} belongs in {home}" for home in homes(key)[:1])
    return f"is not a known key{close}: {f'[{path}]' if path else 'the top of the file'} takes {_and(known)}{elsewhere}"


def _and(words: Iterable[str]) -> str:
    *most, last = [shown_path(word) for word in words]
    return f"{', '.join(most)} and {last}" if most else last
