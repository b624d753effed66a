"""The glossary has every word of the output: checks, conditions, limits, headings, keys of the summary."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import hopopt
from hopopt.drivetrain.operating_region.limits import Line
from hopopt.leg.limit_id import Kind
from hopopt.ocp.objectives.registry import OBJECTIVES
from hopopt.storage.summary import summary_schema
from hopopt.verify import whole_hop

SOURCE = Path(hopopt.__file__).parent
TEXT = (Path(__file__).parents[2] / "docs" / "glossary.md").read_text(encoding="utf-8")
HEADS = [line.partition(": ")[0] for line in TEXT.replace("\n  ", " ").splitlines() if line.startswith("- **")]
WORDS = {word for head in HEADS for word in re.findall(r"\*\*(.+?)\*\*", head)}
KEYS = {
    key for line in TEXT.splitlines() if line.startswith("| `") for key in re.findall(r"`(\w+)`", line.split("|")[1])
}


@cache
def calls_in(path: Path) -> list[ast.Call]:
    return [node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.Call)]


def calls(function: str, folder: str = "") -> Iterator[ast.Call]:
    """Every call of a function by its name; a file without it need not be parsed."""
    for path in sorted((SOURCE / folder).rglob("*.py")):
        if f"{function}(" in path.read_text(encoding="utf-8"):
            yield from (call for call in calls_in(path) if isinstance(call.func, ast.Name) and call.func.id == function)


def fixed(node: ast.AST) -> str:
    """The text of a name that is the same for every phase and joint."""
    if isinstance(node, ast.JoinedStr):
        return "".join(str(part.value) for part in node.values if isinstance(part, ast.Constant)).strip()
    return str(node.value) if isinstance(node, ast.Constant) else ""


def names_of_checks() -> set[str]:
    return {fixed(call.args[0]) for call in calls("Check") if call.args} - {""}


def headings() -> set[str]:
    """Of an answer's parts, on the screen."""
    parts = {(keyword.arg or "").replace("_", " ") for call in calls("headed", "cli") for keyword in call.keywords}
    return (parts | {fixed(call.args[0]) for call in calls("NamedLines", "cli")}) - {"", "from"}


def keys_of_the_summary() -> set[str]:
    return set(summary_schema()["properties"])


def test_there_is_something_to_look_for() -> None:
    assert {"replay", "stationarity", "energy balance", "Hamiltonian along arcs"} <= names_of_checks()
    assert {"hop", "control", "limits", "evidence", "notes", "results"} <= headings()
    assert {"problem", "verified", "upper_bound"} <= keys_of_the_summary()


@pytest.mark.parametrize("name", sorted(names_of_checks() | {str(whole_hop.VALUE.name), str(whole_hop.LIMITS.name)}))
def test_every_check_is_in_the_glossary(name: str) -> None:
    assert name in WORDS


@pytest.mark.parametrize("name", sorted(headings()))
def test_every_heading_of_an_answer_is_in_the_glossary(name: str) -> None:
    assert name in WORDS


@pytest.mark.parametrize("name", [*(kind.value for kind in Kind), *Line, *OBJECTIVES])
def test_every_limit_and_objective_is_in_the_glossary(name: str) -> None:
    assert str(name) in WORDS


def test_every_key_of_the_summary_is_in_the_glossary() -> None:
    assert keys_of_the_summary() == KEYS


def test_entries_stand_in_alphabetical_order() -> None:
    first = [re.sub(r"[^a-z0-9 ]", "", head.split("**")[1].lower()) for head in HEADS]
    assert first == sorted(first)
    assert len(first) == len(set(first))
