"""What an optimum leans on that no robot has, and what each is worth."""

import json
from dataclasses import replace
from math import inf
from pathlib import Path

import pytest

from hopopt.cli.main import run
from hopopt.evidence.worth import CLEAR, Worth, _without, leanings, worths
from hopopt.ocp.objectives.registry import find
from hopopt.planner.solution import Solution
from hopopt.storage.solution import save
from once import solved_once


@pytest.fixture(scope="module")
def highest() -> Solution:
    return solved_once()


def test_the_paper_s_leg_leans_on_ground_and_time(highest: Solution) -> None:
    """Its foot grips without load for much of a stance that lasts as long as it may, its knee comes to the ground."""
    found = dict(leanings(highest))
    assert [set(entries) for entries in found.values()] == [
        {"contact.friction"}, {"contact.least_force"}, {"hop.stance_duration"}, {"hop.least_height"}
    ]  # fmt: skip
    assert all(name.startswith(("a ", "the ")) for name in found)


@pytest.mark.slow
def test_a_hop_without_any_of_it_leans_on_nothing() -> None:
    """Where the problem takes away what was named, it is not named again."""
    entries = {
        "contact.friction": 0.5, "contact.least_force": 15.0, "hop.least_height": CLEAR,
        "hop.stance_duration": [0.03, 0.2],
    }  # fmt: skip
    named = [entry for _, without in leanings(solved_once(entries)) for entry in without]
    assert not set(named) & (entries.keys() - {"hop.stance_duration"})


@pytest.mark.rarely
def test_what_each_is_worth_is_the_difference_of_two_verified_hops(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], highest: Solution
) -> None:
    """Joints 5 cm above the ground leave 0.753 m by other code, friction 1 0.7236 m by dynamic programming."""
    assert run(["diagnose", str(save(highest, tmp_path).result_dir), "--worth", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    found = {next(iter(w["without"])): w for w in answer["leans_on"]}
    assert len(found) == 4
    for w in found.values():
        assert w["verified"]
        assert w["worth"] == pytest.approx(highest.clearance - w["value"], abs=1e-5)
        assert w["worth"] > -1e-5  # a limit more cannot help
    assert found["hop.least_height"]["value"] == pytest.approx(0.753, abs=1e-3)
    assert found["contact.friction"]["value"] == pytest.approx(0.7236, abs=3e-4)
    assert any(line.startswith("leans on a friction above 1, worth 7.") for line in answer["words"])


def test_a_hop_that_was_not_found_is_said() -> None:
    gone = Worth("a friction above 1", {"contact.friction": 1.0}, None, None, 0.0, False)
    assert gone.words("m") == "leans on a friction above 1: with contact.friction = 1 no hop was found"
    doubtful = Worth("a friction above 1", {"contact.friction": 1.0}, 0.5, 0.1, inf, False)
    assert doubtful.words("m").endswith("worth 10 cm: with contact.friction = 1 the best is 0.5000 m, not verified")


def test_what_costs_less_than_the_numbers_can_tell_is_not_leaned_on() -> None:
    """A stance as long as it may last, halved for nothing: said, and not called worth anything. A loss is stated in cm."""
    halved = Worth("a stance as long as it may last", {"hop.stance_duration": [0.03, 0.4]}, 0.48890, 8e-7, 3e-5, True)
    assert not halved.leans
    assert halved.words("m").startswith(
        "has a stance as long as it may last, and would lose nothing without: with hop."
    )
    gripping = Worth("a friction above 1", {"contact.friction": 1.0}, 0.4887, 2e-4, 3e-5, True)
    assert (
        gripping.words("m")
        == "leans on a friction above 1, worth 0.02 cm: with contact.friction = 1 the best is 0.4887 m"
    )


def test_what_is_no_problem_without_it_is_said_and_ends_nothing(highest: Solution) -> None:
    found = _without(highest, "a joint", {"hop.least_height": CLEAR, "leg.knee.lower": 6.0}, lambda text: None)
    assert "no hop was found" in found.words("m")


def test_nothing_is_said_of_an_objective_of_one_s_own(highest: Solution) -> None:
    own = replace(highest, objective="mine:highest", own=(find("clearance"), ()))
    assert worths(own) == []
