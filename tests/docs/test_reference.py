"""The reference of the Python interface: written from docstrings, whole, and its examples run."""

import inspect
import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import hopopt as ho
from hopopt.api.asked import as_class
from hopopt.comparison.hops.transition import Transition
from hopopt.planner import solution
from hopopt.planner.checks.verdict import Verdict
from hopopt.planner.several_hops import HopsPlan
from hopopt.robot_data.identification import Identification
from hopopt.studies.choose.choice import Choice
from scripts import script
from stored_results import robust_hop, stored_front, stored_study

DOCS = Path(__file__).parents[2] / "docs"
MOST_WORDS = 1500

WRITER = script("write_reference")
PAGES: dict[str, str] = WRITER.pages()


def test_the_pages_are_those_of_today() -> None:
    """After a change of a docstring or a signature: python docs/write_reference.py"""
    assert {p.name: p.read_text(encoding="utf-8") for p in (DOCS / "reference").glob("*.md")} == PAGES


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_short_and_says_what_everything_is(name: str) -> None:
    assert len(PAGES[name].split()) <= MOST_WORDS
    assert not [line for line in PAGES[name].splitlines() if re.match(r"\| `\w+` \|\s*\||- `[^`]+`$", line)]


def test_every_public_name_has_its_part_and_every_function_its_example() -> None:
    parts = re.findall(r"^## ho\.(\w+)$", "".join(PAGES.values()), re.M)
    assert sorted(parts) == sorted(ho.__all__)
    assert {name for name in ho.__all__ if not inspect.isclass(getattr(ho, name))} == WRITER.EXAMPLES.keys()


def test_fields_of_a_motion_have_shape_and_unit() -> None:
    for name in ("t", "q", "v", "a", "tau", "f", "com_v"):
        (line,) = re.findall(rf"^\| `{name}` \| (.*) \|$", PAGES["hop.md"].partition("## Samples")[2], re.M)
        assert "(k," in line, line
        assert re.search(r"\[.+\]", line), line


def given(function: Callable[..., Any], found: Any) -> Callable[..., Any]:
    """A verb that takes what the real one takes, and gives what was found before."""

    def call(*args: Any, **kwargs: Any) -> Any:
        inspect.signature(function).bind(*args, **kwargs)
        return found

    return call


@pytest.mark.parametrize("name", WRITER.EXAMPLES)
def test_every_example_runs(name: str, hop: solution.Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On one solved hop: what takes minutes is called with its arguments checked, and gives a result made of that hop."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("hopopt.planner.several_hops.highest_lowest_point", lambda hop: float(hop.apex.lowest[0]))
    s = ho.Solution.with_methods(hop)
    drives: Any = None
    made = {
        "solve": lambda: s,
        "sweep": lambda: ho.read(stored_study(tmp_path, {"leg.gear.ratio": [80, 90]}, [0.7, 0.8]).folder, ho.Study),
        "pareto": lambda: ho.Front.with_methods(stored_front(s, tmp_path)),
        "robust": lambda: ho.RobustHop.with_methods(robust_hop(s)),
        "transition": lambda: ho.Transition.with_methods(Transition(HopsPlan((s,), 1.0, Verdict(())), s)),
        "choose": lambda: as_class(ho.Choice, Choice(drives, 0.6, "mass", (), None, 0.0)),
        "identify": lambda: Identification(s.design, (), {}, {}),
    }
    asked = {verb for verb in made if f"ho.{verb}(" in WRITER.EXAMPLES[name]}
    verbs = {each: getattr(ho, each) for each in ho.__all__} | {v: given(getattr(ho, v), made[v]()) for v in asked}
    exec(WRITER.EXAMPLES[name], {"ho": SimpleNamespace(**verbs), "s": s})
