"""Motors and gears by name: the catalogue behind ``motor = "maxon-ec45-150"`` in a problem file.

A name is replaced by the numbers it stands for as soon as its file is read; everything behind sees numbers only.
"""

import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from hopopt.errors import ProblemFileError
from hopopt.problem.checking.faults import Report
from hopopt.problem.checking.wording import did_you_mean, is_number
from hopopt.problem.render import shown

CATALOGUE_PARTS = ("motor", "gear")
MASSES = (1e-3, 100.0)  # kg: what a motor or gear may weigh
KEPT_ENTRIES = ("laws",)  # how a motor is modelled is the problem's choice and outlives a change of motor
MARKED = re.compile(r"^([a-z_]+) = .*?\[([SDU])\]", re.MULTILINE | re.DOTALL)  # an entry and the mark that follows it
MARKS = {"S": "public source", "D": "derived from a public source", "U": "unverified"}


@dataclass(frozen=True)
class Entry:
    """A file of the catalogue: values of its motor and its gear, whichever it has, and where each is from.

    parts: {"motor": {entry: value in SI units}}, what a name in a problem stands for; masses: {"motor": mass [kg]} where
    one is known, which no name brings into a problem: the leg's masses count its motors already; marks: {"motor": {entry
    or "mass": "S", "D" or "U"}}, see MARKS.
    """

    name: str
    title: str
    parts: dict[str, dict[str, float]]
    masses: dict[str, float]
    marks: dict[str, dict[str, str]]

    def stated(self, part: str) -> dict[str, float]:
        """All that the file says of its motor or gear: the entries of a problem, and the mass if there is one."""
        return self.parts[part] | ({"mass": self.masses[part]} if part in self.masses else {})


def problems_folder() -> Path:
    """Where the built-in problems lie: in an installed package at its top, in a checkout at its own."""
    here = Path(__file__).resolve()
    installed = here.parents[1] / "problems"
    return installed if installed.is_dir() else here.parents[3] / "problems"


@cache
def catalogue() -> dict[str, Entry]:
    """Every entry by its name, which is its file's. ProblemFileError for a mass that none can have."""
    return {path.stem: _entry(path) for path in sorted((problems_folder() / "actuators").glob("*.toml"))}


def names(part: str) -> list[str]:
    """Names of the entries that have a "motor" or a "gear"."""
    return [name for name, entry in catalogue().items() if part in entry.parts]


def named(layer: Mapping[str, Any]) -> bool:
    """Whether a layer of a problem names a motor or a gear."""
    return any(_name(table.get(part)) is not None for _, table in _holders(layer) for part in CATALOGUE_PARTS)


def with_numbers(layer: Mapping[str, Any], base: Mapping[str, Any], label: str, report: Report) -> dict[str, Any]:
    """``layer`` with the numbers of the motors and gears it names, to be laid over ``base``.

    A name takes the place of what ``base`` has (None takes an entry out); what the layer states beside the name
    ("model") counts over it. Names that do not exist are reported, with ``label`` as the place they came from.
    """
    before, result = dict(_holders(base)), dict(layer)
    for path, table in _holders(layer):
        found = {}
        for part in CATALOGUE_PARTS:
            name = _name(table.get(part))
            if name is None:
                continue
            if not isinstance(name, str) or name not in names(part):
                _report(f"leg.{path}{part}", name, part, table, label, report)
                continue
            old, own = before.get(path, {}).get(part), table[part] if isinstance(table[part], Mapping) else {}
            gone = dict.fromkeys(set(old) - set(KEPT_ENTRIES)) if isinstance(old, Mapping) else {}
            stated = {key: value for key, value in own.items() if key != "model"}
            found[part] = {**gone, **catalogue()[name].parts[part], "catalogue": name, **stated}
        if found and path:
            result["leg"] = {**result["leg"], path[:-1]: {**table, **found}}
        elif found:
            result["leg"] = {**table, **found}
    return result


def _entry(path: Path) -> Entry:
    text = path.read_text(encoding="utf-8")
    data = tomllib.loads(text)
    parts = {part: dict(data[part]) for part in CATALOGUE_PARTS if part in data}
    masses = {part: _mass(path, part, table.pop("mass")) for part, table in parts.items() if "mass" in table}
    tables = re.split(r"^\[(motor|gear)\]$", text, flags=re.MULTILINE)[1:]
    marks = {part: dict(MARKED.findall(table)) for part, table in zip(tables[::2], tables[1::2], strict=True)}
    return Entry(path.stem, data["title"], parts, masses, marks)


def _mass(path: Path, part: str, given: Any) -> float:
    """A mass [kg] that is a number within MASSES."""
    low, high = MASSES
    if not is_number(given) or not low <= given <= high:
        wrong = f"{path.name}: {part}.mass = {shown(given)}: a number from {low:g} to {high:g} kg is needed"
        raise ProblemFileError(str(path), [wrong])
    return float(given)


HOW_TO_GIVE_OWN = {  # how a part that is not in the catalogue is given
    "motor": "for another write [leg.motor] with max_torque, max_speed and rotor_inertia in front of its gear (docs/actuators.md)",
    "gear": "for another write [leg.gear] with its ratio (docs/actuators.md)",
}


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


def _report(path: str, name: Any, part: str, table: Mapping[str, Any], label: str, report: Report) -> None:
    path = path if isinstance(table[part], str) else f"{path}.model"
    report.origins[path] = label
    close = did_you_mean(name, names(part)) if isinstance(name, str) else ""
    report.add(
        path,
        f"= {shown(name)} is not in the catalogue{close}: its {part}s are {', '.join(names(part))}; {HOW_TO_GIVE_OWN[part]}",
    )
    report.unreadable = True
