"""Catalogues of a user's own, in TOML or CSV, checked like problem files."""

import csv
import re
from collections.abc import Iterator, Mapping
from io import StringIO
from pathlib import Path
from typing import Any

from hopopt.design.fields import CATALOGUE_NAME
from hopopt.errors import ProblemFileError
from hopopt.problem.catalogue import Entry, Source, catalogue
from hopopt.problem.catalogue_facts import CATALOGUE_PARTS, FACTS, TEXTS, checked, report_at
from hopopt.problem.checking.faults import Report
from hopopt.problem.checking.wording import did_you_mean
from hopopt.problem.reading import NotOne, read, tables
from hopopt.problem.render import shown, shown_path

KIND = "catalogue"  # of a file, in a sentence
ROWS = ("part", "name", *TEXTS)  # columns of a CSV file that are not numbers
Row = tuple[str, str, Mapping[str, Any]]  # "motor" or "gear", name, its table


def own_catalogue(path: str | Path) -> dict[str, Entry]:
    """The entries of a user's .toml or .csv file, by name. ProblemFileError with one sentence for each fault."""
    report = Report(str(path))
    found = read_own(Path(path), report)
    if report.sentences:
        raise ProblemFileError(report.source, report.sentences)
    return found


def read_own(path: Path, report: Report) -> dict[str, Entry]:
    """The entries of a user's file; what is wrong is reported."""
    rows, label = _rows(path, report), str(path)
    before = len(report.faults)
    found = dict[str, Entry]()
    for part, name, table in rows:
        if _name_is_free(part, name, found, label, report):
            found[name] = _with(found.get(name), part, name, table, label, report)
    if len(report.faults) > before:
        report.unreadable = True
    elif not found and not report.unreadable:
        report.unusable(
            f"{shown_path(label)} has no motor and no gear: write [motor.NAME] or [gear.NAME], or rows of CSV"
        )
    return found


def _name_is_free(part: str, name: str, found: Mapping[str, Entry], label: str, report: Report) -> bool:
    path = f"{part}.{name}"
    if not re.fullmatch(CATALOGUE_NAME, name):
        report_at(
            path, "is not a name: at most 50 small letters, digits and hyphens, a letter or digit first", label, report
        )
    elif name in catalogue():
        report_at(path, "has the name of a built-in entry: choose another name", label, report)
    elif name in found and part in found[name].stated:
        report_at(path, "is there twice: give each its own name", label, report)
    else:
        return True
    return False


def _with(entry: Entry | None, part: str, name: str, table: Mapping[str, Any], label: str, report: Report) -> Entry:
    """An entry of a user's, or the one whose gear or motor this is, with one more part."""
    numbers = checked(part, f"{part}.{name}", table, label, report)
    texts = table if isinstance(table, Mapping) else {}
    unsure = texts.get("unverified", [])
    unsure = unsure.split() if isinstance(unsure, str) else unsure
    if not isinstance(unsure, list) or not all(key in texts for key in unsure):
        words = f"= {shown(unsure)} is not allowed: a list of keys of this {part} is needed"
        report_at(f"{part}.{name}.unverified", words, label, report)
        unsure = []
    marks = {key: "U" if key in unsure else "O" for key in numbers}
    sources = (Source(str(texts["source"]), ""),) if texts.get("source") else ()
    before = entry or Entry(name, str(texts.get("title", "")), {}, {}, (), {}, label)
    return Entry(
        name, before.title, {**before.stated, part: numbers}, {**before.marks, part: marks},
        (*before.sources, *sources), {}, label,
    )  # fmt: skip


# ---- rows of a file -------------------------------------------------------------------------------------------


def _rows(path: Path, report: Report) -> list[Row]:
    """(part, name, table) of all that a file lists; empty, and reported, if it cannot be had."""
    is_csv = path.suffix.lower() == ".csv"
    text = read(path, report, lambda: _absent(path), KIND, ".csv" if is_csv else ".toml")
    try:
        return [] if text is None else list(_csv(text) if is_csv else _toml(text))
    except NotOne as error:
        report.unusable(f"{shown_path(str(path))} {error}")
        return []


def _absent(path: Path) -> str:
    there = [p.name for p in path.parent.glob("*.*") if p.suffix.lower() in (".toml", ".csv")]
    return did_you_mean(path.name, there) or "; a catalogue is a .toml or .csv file (docs/actuators.md)"


def _toml(text: str) -> Iterator[Row]:
    data = tables(text, KIND)
    if strange := next((key for key in data if key not in CATALOGUE_PARTS), None):
        raise NotOne(f"has {shown(strange)}, which no catalogue has: write [motor.NAME] and [gear.NAME] alone")
    for part, listed in data.items():
        if not isinstance(listed, dict) or not all(isinstance(table, dict) for table in listed.values()):
            raise NotOne(f"has the numbers of a {part} without its name: write [{part}.NAME] above them")
        yield from ((part, name, table) for name, table in listed.items())


def _csv(text: str) -> Iterator[Row]:
    """A row an entry; an empty cell states nothing, numbers of a list stand with blanks between them."""
    lines = csv.reader(StringIO(text), strict=True)
    try:
        heads = [head.strip() for head in next(lines, [])]
        if missing := [column for column in ROWS[:2] if column not in heads]:
            raise NotOne(
                f"has no column {missing[0]} in its first line: {', '.join(ROWS)}, then a column for each number"
            )
        if twice := next((head for head in heads if head and heads.count(head) > 1), None):
            raise NotOne(f"has the column {shown(twice)} twice: name each once")
        for number, cells in enumerate(lines, 2):
            if len(cells) > len(heads):
                raise NotOne(f"has more cells in line {number} than columns: write decimals with a point, not a comma")
            row = {head: cell.strip() for head, cell in zip(heads, cells, strict=False) if cell.strip()}
            if not row:
                continue
            if row.get("part") not in CATALOGUE_PARTS or "name" not in row:
                given = shown(row.get("part", ""))
                raise NotOne(f"has the part {given} in line {number}: motor or gear is needed, and a name beside it")
            yield row.pop("part"), row.pop("name"), {key: _cell(key, cell) for key, cell in row.items()}
    except csv.Error as error:
        raise NotOne(f"is not CSV: {error}") from None


def _cell(key: str, cell: str) -> Any:
    """A cell as a number or a list of them where it is one, else as text."""
    if key in TEXTS:
        return cell
    try:
        numbers = [float(word) for word in cell.split()]
    except ValueError:
        return cell
    listed = any(FACTS[part].get(key, {}).get("type") == "array" for part in CATALOGUE_PARTS)
    return numbers if listed or len(numbers) > 1 else numbers[0]
