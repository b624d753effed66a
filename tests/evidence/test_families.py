"""Families of hops: which optima belong together, where the best changes, and the command with its picture."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hopopt.cli import main as cli
from hopopt.evidence import family_search
from hopopt.evidence.families import FamilyStudy, crossings
from hopopt.evidence.family_chains import chains, letter
from hopopt.evidence.family_optima import LocalOptimum, Refined, remember
from hopopt.planner.search.multistart import StartOutcome
from hopopt.plots.studies.families import common_value
from hopopt.problem.load import load
from hopopt.studies.sweep.definition import Axis, Definition

COARSE = ("solver.refine=false", "solver.stance_intervals=12", "solver.flight_intervals=5")
SETTINGS = [word for entry in COARSE for word in ("--set", entry)]
PNG = b"\x89PNG"


def test_optima_that_lead_to_each_other_are_one_family() -> None:
    steps = {((0, 0), (1, 1)), ((1, 1), (0, 0)), ((1, 1), (2, 0)), ((2, 0), (1, 1))}
    assert chains([1, 2, 1], steps) == [[(0, 0), (1, 1), (2, 0)], [(1, 0)]]


def test_one_way_is_enough_if_nothing_speaks_for_another() -> None:
    assert chains([1, 1], {((0, 0), (1, 0))}) == [[(0, 0), (1, 0)]]
    assert chains([1, 1], {((1, 0), (0, 0))}) == [[(0, 0), (1, 0)]]


def test_two_optima_that_run_into_the_same_one_stay_apart() -> None:
    assert chains([2, 1], {((0, 0), (1, 0)), ((0, 1), (1, 0))}) == [[(0, 0)], [(0, 1)], [(1, 0)]]


def test_who_leads_to_whom_mutually_comes_first() -> None:
    steps = {((0, 0), (1, 0)), ((0, 1), (1, 0)), ((1, 0), (0, 1))}
    assert chains([2, 1], steps) == [[(0, 0)], [(0, 1), (1, 0)]]


def test_no_chain_passes_over_a_value_without_the_family() -> None:
    assert chains([1, 0, 1], set()) == [[(0, 0)], [(2, 0)]]


def test_letters_do_not_end() -> None:
    assert [letter(k) for k in (0, 25, 26, 27, 52)] == ["A", "Z", "AA", "AB", "BA"]


def test_the_best_changes_between_two_values_with_a_hop() -> None:
    found = crossings([1.0, 2.0, 3.0, 4.0], ["A", "A", None, "B"])
    assert found == [{"between": [2.0, 4.0], "from": "A", "to": "B"}]


def optimum(height: float, place: float = 0.0, name: str = "start 1") -> LocalOptimum:
    """A made-up optimum: its clearance [m], where it lies among the shapes, what found it."""
    outcome = StartOutcome(name, "Solve_Succeeded", True, height, 50, 1.0, {})
    return LocalOptimum(
        outcome, (name,), np.zeros(1), np.full((13, 4), place), height, f"at {place:g}", np.zeros((6, 3, 2))
    )


def made_up(heights: dict[str, list[float]], entry: str = "contact.friction") -> FamilyStudy:
    """Families that keep their places, with a clearance [m] at each of the values 1, 2, ..."""
    rows = list(heights.values())
    count = len(rows[0])
    axis = Axis(entry, tuple(float(k + 1) for k in range(count)))
    optima = [[optimum(row[k], place=float(i)) for i, row in enumerate(rows)] for k in range(count)]
    steps = {((k, i), (k + 1, i)) for k in range(count - 1) for i in range(len(rows))}
    return FamilyStudy(Definition(load("paper"), "clearance", (axis,)), optima, steps)


def test_what_does_the_same_counts_once_and_the_better_is_kept() -> None:
    found = [optimum(0.7, 0.0, "start 1")]
    assert remember(found, optimum(0.703, 0.3, "start 2")) == (0, True)
    assert remember(found, optimum(0.701, 0.2, "start 3")) == (0, False)
    assert remember(found, optimum(0.703, 1.5, "start 4")) == (1, True)  # another motion
    assert remember(found, optimum(0.5, 0.3, "start 5")) == (2, True)  # much lower
    assert [o.clearance for o in found] == [0.703, 0.703, 0.5]
    assert found[0].found_by == ("start 1", "start 2", "start 3")


def test_the_same_push_counts_once_whatever_comes_long_before() -> None:
    found, other = [optimum(0.7)], optimum(0.7001)
    other.shape[8:] += 1.0
    assert remember(found, other) == (0, True)
    other.shape[0] += 0.2
    assert remember(found, replace(other, shape=other.shape + 0.2)) == (0, False)
    assert remember(found, replace(other, shape=other.shape + 2.0)) == (1, True)


def test_families_are_named_best_first_and_cross() -> None:
    study = made_up({"low": [0.3, 0.5, 0.9], "flat": [0.6, 0.6, 0.6]})
    data = study.as_dict()
    assert [(f["name"], f["clearance_m"]) for f in data["families"]] == [("A", [0.6, 0.6, 0.6]), ("B", [0.3, 0.5, 0.9])]
    assert data["best"] == ["A", "A", "B"]
    assert data["crossings"] == [{"between": [2.0, 3.0], "from": "A", "to": "B"}]
    assert data["exit_code"] == 0
    assert common_value(study, study.families()) in (1, 2)


def test_more_grip_that_lowers_the_best_is_a_contradiction() -> None:
    data = made_up({"only": [0.6, 0.7, 0.65]}).as_dict()
    assert [(c["at"], c["better_at"]) for c in data["contradictions"]] == [(3.0, 2.0)]
    assert data["exit_code"] == 3
    assert not made_up({"only": [0.6, 0.7, 0.65]}, "leg.gear.ratio").as_dict()["contradictions"]


def test_a_best_that_is_not_verified_is_told_by_the_exit_code() -> None:
    study = made_up({"only": [0.6, 0.7]})
    study.refined = {(0, 0): Refined(0.601, True), (1, 0): Refined(0.702, False, ("local error",))}
    data = study.as_dict()
    assert data["families"][0]["clearance_m"] == [0.601, 0.702]
    assert data["families"][0]["verified"] == [True, False]
    assert data["exit_code"] == 3


def run(results: Path, *words: str) -> int:
    common = ["--starts", "1", "--processes", "1", "--results", str(results)]
    return cli.run(["families", "paper", *SETTINGS, *common, *words])


@pytest.mark.slow
def test_the_command_follows_families_over_friction(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code = run(tmp_path, "--vary", "contact.friction=0.9,0.6,0.75", "--json", "--no-verify")
    data: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert code == data["exit_code"] == 0
    assert data["values"] == [0.6, 0.75, 0.9]
    assert {"problem", "entry", "families", "best", "crossings", "contradictions", "result_dir"} <= data.keys()
    for f in data["families"]:
        assert f.keys() == {"name", "words", "found_by", "clearance_m", "verified"}
        assert len(f["clearance_m"]) == len(f["verified"]) == 3
        assert set(f["verified"]) == {None}
    rows = {f["name"]: f["clearance_m"] for f in data["families"]}
    best = [rows[name][k] for k, name in enumerate(data["best"])]
    assert best == sorted(best)
    assert best == [max(row[k] or 0.0 for row in rows.values()) for k in range(3)]
    folder = Path(data["result_dir"])
    assert (folder / "families.png").read_bytes().startswith(PNG)
    assert json.loads((folder / "families.json").read_text()) == data
    assert (folder / "problem.toml").exists()


def test_without_an_entry_the_best_is_verified_or_the_exit_code_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(tmp_path) == 3  # the mesh is too coarse
    said = capsys.readouterr().out
    assert "what the leg does" in said
    assert "the best hop is NOT verified" in said
    (folder,) = tmp_path.iterdir()
    data = json.loads((folder / "families.json").read_text())
    assert data["best"] == ["A"]
    assert data["families"][0]["verified"] == [False]
    assert (folder / "families.png").read_bytes().startswith(PNG)


def test_where_no_hop_is_found_no_folder_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(family_search, "searched", lambda design, count: [])
    assert run(tmp_path) == 1
    assert "no hop was found" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_what_is_known_is_kept_when_interrupted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stop(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(family_search, "refined", stop)
    assert run(tmp_path) == 130
    assert "what is known is kept in" in capsys.readouterr().err
    (folder,) = tmp_path.iterdir()
    data = json.loads((folder / "families.json").read_text())
    assert not data["finished"]
    assert data["families"][0]["clearance_m"][0] > 0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--starts", "0"], "--starts must be at least 1"),
        (["--vary", "contact.friction"], "write lower:upper:count"),
        (["--vary", "leg.gear.ratio=80,90", "--vary", "contact.friction=0.5,0.6"], "give --vary once"),
        (["--vary", "no.such=1,2"], "--vary"),
        (["--vary", "contact.friction=-1,1"], "contact.friction"),
        (["--vary", "leg.gear.ratio=-5,100"], "leg.gear.ratio"),
    ],
)
def test_wrong_usage_is_a_sentence(
    arguments: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.run(["families", *arguments, "--results", str(tmp_path / "results")]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "results").exists()
