"""What may be stated of a motor or a gear in a catalogue: the entries of a problem, and further facts with unit and range."""

from collections.abc import Mapping
from functools import cache
from typing import Any

from hopopt.design import Gear, Motor
from hopopt.drivetrain.heat import BODIES, LIMIT
from hopopt.drivetrain.motor import IMPLIES
from hopopt.drivetrain.supply import WINDING
from hopopt.problem.checking import entries
from hopopt.problem.checking.faults import Report
from hopopt.problem.checking.wording import allowed, did_you_mean, hint, is_number
from hopopt.problem.render import shown, shown_path

GOES_WITH = {  # entries of a motor that say something only beside others
    "no_load_current": ("torque_constant",),
    "current_cap": ("torque_constant",),
    **{name: (*BODIES, *WINDING) for name in (LIMIT, *BODIES)},
}
KINDS = {"motor": Motor, "gear": Gear}
CATALOGUE_PARTS = tuple(KINDS)
TEXTS = ("title", "source", "unverified")  # keys of a user's entry that are not numbers
Value = float | list[float]


def _fact(meaning: str, unit: str, low: float, high: float) -> dict[str, Any]:
    return {"description": meaning, "unit": unit, "type": "number", "minimum": low, "maximum": high}


def _facts(meaning: str, unit: str, low: float, high: float) -> dict[str, Any]:
    return {"description": meaning, "unit": unit, "type": "array", "items": _fact(meaning, unit, low, high)}


COMMON = {
    "mass": _fact("of this part alone", "kg", 1e-3, 100),
    "price": _fact("of one, without tax", "EUR", 0.1, 1e5),
    "diameter": _fact("outer diameter", "m", 1e-3, 2),
    "length": _fact("along the axis", "m", 1e-3, 2),
}
FACTS = {  # what may be stated beside the entries of a problem; one that becomes an entry of a problem counts as that
    "motor": COMMON
    | {
        "module_mass": _fact("of motor, gear and drive in one housing", "kg", 1e-3, 100),
        "no_load_speed": _fact("as the maker states it, friction included", "rad/s", 1, 2e4),
        "stall_torque": _fact("as the maker states it", "N m", 1e-6, 1e4),
        "mechanical_time_constant": _fact("J R / k^2", "s", 1e-5, 10),
    },
    "gear": COMMON
    | {
        "rated_torque": _fact("for the life that the maker states, joint side", "N m", 1e-4, 1e5),
        "average_torque": _fact("limit for the average torque, joint side", "N m", 1e-4, 1e5),
        "momentary_torque": _fact("limit for a moment, a few times in its life, joint side", "N m", 1e-4, 1e5),
        "ratcheting_torque": _fact("at which teeth jump, joint side", "N m", 1e-4, 1e5),
        "efficiency_speeds": _facts("input speeds of efficiency_values", "rad/s", 0.1, 6000),
        "efficiency_values": _facts("efficiency at efficiency_speeds, rated torque and 20 degC", "1", 0.05, 1),
    },
}


@cache
def fields(part: str) -> Mapping[str, entries.Entry]:
    """{key: its unit, meaning and range} of all that may be stated of a "motor" or a "gear"."""
    known = (entries.entry_at(("leg", part)) or {})["properties"]
    return {key: known[key] for key in problem_entries(part)} | {
        key: fact for key, fact in FACTS[part].items() if key not in known
    }


def problem_entries(part: str) -> list[str]:
    """Entries of [leg.motor] or [leg.gear] that are numbers: what a name in a problem brings."""
    fields = KINDS[part].model_fields
    return [name for name, info in fields.items() if (info.json_schema_extra or {}).get("physical")]  # type: ignore[union-attr]


def checked(part: str, path: str, table: Any, label: str, report: Report) -> dict[str, Value]:
    """The numbers of a motor's or gear's table in a file called ``label``, at ``path`` in it; faults are reported."""
    if not isinstance(table, Mapping):
        report_at(
            path, f"= {shown(table)} is not a table: write [{path}] and its entries on the lines below", label, report
        )
        return {}
    known, found = fields(part), dict[str, Value]()
    for key, value in table.items():
        if key in TEXTS and path != part:
            continue
        if key not in known:
            words = f"is not a known key{did_you_mean(key, known)}: a {part} takes {', '.join(known)}"
            report_at(f"{path}.{key}", words, label, report)
        elif words := _fault(value, known[key]):
            report_at(f"{path}.{key}", words, label, report)
        else:
            found[key] = [float(x) for x in value] if isinstance(value, list) else float(value)
    for key in _needed(part, table):
        if key not in table:
            how = HOW_TO_DERIVE.get(key, "")
            words = f"is missing: {known[key]['description']}; {allowed(known[key])} is needed{how}"
            report_at(f"{path}.{key}", words, label, report)
    return found


HOW_TO_DERIVE = {  # what a data sheet does not print, from what it does
    "max_torque": " (torque_constant * voltage / winding_resistance)",
    "max_speed": " (voltage / torque_constant)",
}


def _needed(part: str, table: Mapping[str, Any]) -> list[str]:
    """What a table must state: a motor's torque and speed unless its datasheet implies them, a gear's ratio."""
    implied = {
        key for key, datasheet in IMPLIES.items() if part == "motor" and all(entry in table for entry in datasheet)
    }
    required = [key for key in problem_entries(part) if KINDS[part].model_fields[key].is_required()]
    return [key for key in (*required, *(IMPLIES if part == "motor" else ())) if key not in implied]


def usable(part: str, given: Mapping[str, Value]) -> dict[str, float]:
    """Those of the numbers that a name brings into a problem: entries of one, without those that say nothing without others."""
    known = problem_entries(part)
    numbers = {key: value for key, value in given.items() if key in known and not isinstance(value, list)}
    return {key: value for key, value in numbers.items() if all(name in numbers for name in GOES_WITH.get(key, ()))}


def _fault(value: Any, field: entries.Entry) -> str:
    """What is wrong with a value, in words that follow its path; empty if nothing is."""
    in_list = field["type"] == "array"
    given = value if in_list and isinstance(value, list) else [value]
    low, high = entries.bounds_of(field)
    wrong = next((x for x in given if not is_number(x) or not low <= x <= high), None)
    if wrong is None and given and isinstance(value, list) == in_list:
        return ""
    size = "is not allowed" if not is_number(wrong) else "is too small" if wrong < low else "is too large"
    unit = f" {entries.unit_of(field)}" if is_number(wrong) and entries.unit_of(field) else ""
    return f"= {shown(value)}{unit} {size}: {allowed(field)} is needed{hint(wrong, field, in_list=in_list)}"


def report_at(path: str, words: str, label: str, report: Report) -> None:
    """Note a fault at ``path`` of the file called ``label``; ``words`` follow the path."""
    report.fault(f"{shown_path(label)}: {shown_path(path)} {words}", path)
