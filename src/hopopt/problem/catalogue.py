"""Motors and gears by name: the catalogue behind ``motor = "maxon-ec45-150"`` in a problem file, and what is known of each."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from hopopt.errors import ProblemFileError
from hopopt.problem.catalogue_facts import CATALOGUE_PARTS, KINDS, Value, checked, problem_entries, usable
from hopopt.problem.checking.faults import Report
from hopopt.problem.reading import tables

MARKED = re.compile(r"^([a-z_]+) = .*?\[([SDU])(\d?)\]", re.MULTILINE | re.DOTALL)  # an entry and the mark after it
MARKS = {
    "S": "public source",
    "D": "derived from a public source",
    "U": "unverified",
    "O": "your own file",
}


@dataclass(frozen=True)
class Source:
    """Where numbers of an entry are printed: title, and address of the page or file."""

    title: str
    address: str


@dataclass(frozen=True)
class Entry:
    """A motor, a gear, or both in one module, and where each of its numbers is from.

    stated: {"motor" or "gear": {key: value in SI units}}, all that its file says; marks: {"motor": {key: "S", "D", "U" or
    "O"}}, see MARKS; cited: {"motor": {key: its Source}} of what is marked S; file: of a user's entry, empty of a built-in one.
    """

    name: str
    title: str
    stated: dict[str, dict[str, Value]]
    marks: dict[str, dict[str, str]]
    sources: tuple[Source, ...] = ()
    cited: Mapping[str, Mapping[str, Source]] = field(default_factory=dict)
    file: str = ""

    @property
    def parts(self) -> dict[str, dict[str, float]]:
        """{"motor": {entry of a problem: value}}: what its name in a problem stands for, defaults that are numbers included."""
        return {part: {**_defaults(part), **usable(part, given)} for part, given in self.stated.items()}

    @property
    def facts(self) -> dict[str, dict[str, Value]]:
        """{"motor": {key: value}} of what no name brings into a problem, such as price and rated torque."""
        return {
            part: {key: value for key, value in given.items() if key not in usable(part, given)}
            for part, given in self.stated.items()
        }

    @property
    def masses(self) -> dict[str, float]:
        """{"motor": mass [kg]} where one is known; no name brings it into a problem, whose leg counts its motors already."""
        return {part: float(given["mass"]) for part, given in self.stated.items() if "mass" in given}  # type: ignore[arg-type]

    @property
    def module_mass(self) -> float | None:
        """Mass [kg] of motor, gear and drive in one housing, which are made for each other; None where it is not known."""
        found = self.stated.get("motor", {}).get("module_mass")
        return found if isinstance(found, float) else None

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user should know of it: a sentence for each part whose mass nobody states."""
        light = [] if self.module_mass else [part for part in self.stated if part not in self.masses]
        return tuple(f"{self.name} has no mass as a {part}: give {part}.mass to compare it by mass" for part in light)

    def unverified(self, part: str) -> tuple[str, ...]:
        """The keys of its "motor" or "gear" whose numbers no source confirms."""
        return tuple(key for key, mark in self.marks.get(part, {}).items() if mark == "U")


def problems_folder() -> Path:
    """Where the built-in problems lie: in an installed package at its top, in a checkout at its own."""
    here = Path(__file__).resolve()
    installed = here.parents[1] / "problems"
    return installed if installed.is_dir() else here.parents[3] / "problems"


@cache
def catalogue() -> dict[str, Entry]:
    """Every built-in entry by its name, which is its file's. ProblemFileError for a number that none can have."""
    return {path.stem: _built_in(path) for path in sorted((problems_folder() / "actuators").glob("*.toml"))}


def names(part: str) -> list[str]:
    """Names of the built-in entries that have a "motor" or a "gear"."""
    return list(with_part(part, catalogue()))


def with_part(part: str, entries: Mapping[str, Entry]) -> dict[str, Entry]:
    """Those of the entries that have a "motor" or a "gear"."""
    return {name: entry for name, entry in entries.items() if part in entry.stated}


def _built_in(path: Path) -> Entry:
    """The entry of a file with a title, sources, and the tables motor and gear, whose comments hold the marks."""
    text, report = path.read_text(encoding="utf-8"), Report(str(path))
    data = tables(text, "catalogue")
    sources = tuple(Source(**table) for table in data.get("source", ()))
    stated = {part: checked(part, part, data[part], path.name, report) for part in CATALOGUE_PARTS if part in data}
    if report.sentences:
        raise ProblemFileError(str(path), report.sentences)
    pieces = re.split(r"^\[(motor|gear)\]$", text, flags=re.MULTILINE)[1:]
    marked = {part: MARKED.findall(table) for part, table in zip(pieces[::2], pieces[1::2], strict=True)}
    marks = {part: {key: mark for key, mark, _ in found} for part, found in marked.items()}
    cited = {
        part: {key: sources[int(number or 1) - 1] for key, mark, number in found if mark == "S"}
        for part, found in marked.items()
    }
    return Entry(path.stem, data["title"], stated, marks, sources, cited)


def _defaults(part: str) -> dict[str, float]:
    """What an entry that its file leaves out has in a problem, so that none falls back on another motor's."""
    fields = KINDS[part].model_fields
    return {name: fields[name].default for name in problem_entries(part) if isinstance(fields[name].default, float)}
