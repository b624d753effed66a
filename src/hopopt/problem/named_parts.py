"""Motors and gears that a problem names: each name is replaced by the numbers it stands for as soon as its file is read."""

from collections.abc import Iterator, Mapping
from typing import Any

from hopopt.problem.catalogue import Entry, catalogue, with_part
from hopopt.problem.catalogue_facts import CATALOGUE_PARTS
from hopopt.problem.checking.faults import Report
from hopopt.problem.checking.wording import did_you_mean
from hopopt.problem.render import shown

KEPT_ENTRIES = ("laws",)  # how a motor is modelled is the problem's choice and outlives a change of motor
HOW_TO_GIVE_OWN = {  # how a part that is not in the catalogue is given
    "motor": "for another write [leg.motor] with max_torque, max_speed and rotor_inertia in front of its gear (docs/actuators.md)",
    "gear": "for another write [leg.gear] with its ratio (docs/actuators.md)",
}


def named(layer: Mapping[str, Any]) -> bool:
    """Whether a layer of a problem names a motor or a gear."""
    return any(_name(table.get(part)) is not None for _, table in _holders(layer) for part in CATALOGUE_PARTS)


def gives(layer: Mapping[str, Any], part: str, entry: str) -> bool:
    """Whether a layer of a problem has an entry of a motor or a gear."""
    return any(isinstance(table.get(part), dict) and entry in table[part] for _, table in _holders(layer))


def with_numbers(
    layer: Mapping[str, Any], base: Mapping[str, Any], own: Mapping[str, Entry], label: str, report: Report
) -> dict[str, Any]:
    """``layer`` with the numbers of the motors and gears it names, to be laid over ``base``.

    A name takes the place of what ``base`` has (None takes an entry out); what the layer states beside the name
    ("model") counts over it. ``own``: entries beside the built-in ones. Names that do not exist are reported, with
    ``label`` as the place they came from.
    """
    before, result = dict(_holders(base)), dict(layer)
    for path, table in _holders(layer):
        found = {}
        for part in CATALOGUE_PARTS:
            name = _name(table.get(part))
            if name is None:
                continue
            entries = {**catalogue(), **own}
            known = with_part(part, entries)
            if not isinstance(name, str) or name not in known:
                _report(f"leg.{path}{part}", name, part, entries, table, label, report)
                continue
            old, stated = before.get(path, {}).get(part), table[part] if isinstance(table[part], Mapping) else {}
            gone = dict.fromkeys(set(old) - set(KEPT_ENTRIES)) if isinstance(old, Mapping) else {}
            over = {key: value for key, value in stated.items() if key != "model"}
            found[part] = {**gone, **known[name].parts[part], "catalogue": name, **over}
        if found and path:
            result["leg"] = {**result["leg"], path[:-1]: {**table, **found}}
        elif found:
            result["leg"] = {**table, **found}
    return result


def _holders(layer: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """The tables of a layer that may have a motor and a gear: ("", the leg's) and ("knee.", those within it)."""
    leg = layer.get("leg")
    if isinstance(leg, Mapping):
        yield "", leg
        for key, table in leg.items():
            if isinstance(table, Mapping) and key not in CATALOGUE_PARTS:
                yield f"{key}.", table


def _name(given: Any) -> Any:
    """What ``motor = given`` names: the text itself, or the table's "model"; None if nothing."""
    if isinstance(given, Mapping):
        return given.get("model")
    return given if isinstance(given, str) else None


def _report(
    path: str, name: Any, part: str, entries: Mapping[str, Entry], table: Mapping[str, Any], label: str, report: Report
) -> None:
    known = with_part(part, entries)
    path = path if isinstance(table[part], str) else f"{path}.model"
    report.origins[path] = label
    other = isinstance(name, str) and name in entries
    close = did_you_mean(name, known) if isinstance(name, str) and not other else ""
    wrong = f"has no {part} in the catalogue" if other else f"is not in the catalogue{close}"
    listed = f"hopopt actuators lists its {len(known)} {part}s"
    report.add(path, f"= {shown(name)} {wrong}: {listed}; {HOW_TO_GIVE_OWN[part]}")
    report.unreadable = True
