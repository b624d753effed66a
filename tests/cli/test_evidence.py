"""Global evidence from the command line: starts kept one by one, families of local optima, what contradicts it."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from hopopt.cli import main as cli
from hopopt.errors import ResultError
from hopopt.evidence import dynamic_programming as upright
from hopopt.evidence import local_optima
from hopopt.evidence.local_optima import Ended, families, finished
from hopopt.ocp.objectives.registry import OBJECTIVES
from hopopt.planner.search.families import words
from hopopt.problem.load import load

COARSE = ("solver.refine=false", "solver.stance_intervals=12", "solver.flight_intervals=5")
SETTINGS = [word for entry in COARSE for word in ("--set", entry)]


def ended(index: int, objective: float, success: bool = True, **motion: Any) -> Ended:
    return Ended(index, f"start {index}", success, "Solve_Succeeded", objective, 50, 1.0, **motion)


def test_families_gather_what_ends_alike_best_first() -> None:
    starts = [ended(0, 0.7), ended(1, 0.8), ended(2, 0.7001), ended(3, 0.9, success=False), ended(4, 0.8002)]
    found = families(starts, OBJECTIVES["clearance"])
    assert [(f.best.index, f.count) for f in found] == [(4, 2), (2, 2)]
    least = families([ended(0, 7.0), ended(1, 5.0)], OBJECTIVES["time"])
    assert [f.best.index for f in least] == [1, 0]


def test_a_start_that_ended_without_a_number_is_read_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As where Ipopt met no number: it is kept, and --resume goes on."""
    lost = ended(0, float("nan"), success=False)
    folder, said = local_optima.open_study(load("paper"), "clearance", tmp_path), list[str]()
    with monkeypatch.context() as patch:
        patch.setattr(local_optima, "_ended", lambda design, objective, index: lost)
        local_optima.run_starts(folder, 1, 1, said.append)
    (again,) = local_optima.run_starts(folder, 1, 1, said.append)
    assert (again.index, again.success, str(again.objective)) == (0, False, "nan")
    assert said[1] == "1 of 1 starts"


@pytest.mark.parametrize(
    ("motion", "said"),
    [
        ({"stance": 0.4, "swing": 0.5, "lean": 0.1},
         "pushes without a dip; swings forward by 50% of the leg and back; leaves in front of the foot; stance 0.40 s"),
        ({"stance": 0.2}, "pushes without a dip; leaves upright; stance 0.20 s"),
        ({"stance": 0.4, "dip": 0.1, "sway": -0.2, "lean": 0.1, "drift": -1.0},
         "dips by 10% of the leg behind the foot; leaves in front of the foot, drifting backward; stance 0.40 s"),
    ],
)  # fmt: skip
def test_words_say_what_the_body_does(motion: dict[str, Any], said: str) -> None:
    assert words(asdict(ended(0, 0.8, **motion))) == said


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study of three starts, begun and finished."""
    results = tmp_path_factory.mktemp("results")
    code = cli.run(
        [
            "evidence",
            *SETTINGS,
            "--starts",
            "3",
            "--grids",
            "20",
            "--processes",
            "1",
            "--results",
            str(results),
            "--json",
        ]
    )
    assert code == 3  # one coarse mesh is not verified
    return next(results.iterdir())


@pytest.mark.slow
def test_summary_holds_bound_reduced_hop_and_families(study: Path) -> None:
    data = json.loads((study / "summary.json").read_text())
    assert data["starts"]["count"] == 3
    assert sum(f["count"] for f in data["starts"]["families"]) == data["starts"]["solved"]
    assert data["best"]["clearance_m"] < data["upper_bound"]["clearance_m"]
    assert not data["passes_the_bound"]
    assert abs(data["reduced"]["grids"][0]["difference"]) < 0.05
    assert not data["best"]["verified"]


@pytest.mark.rarely
def test_resume_computes_only_what_is_missing(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = {path: path.stat().st_mtime_ns for path in (study / "starts").iterdir()}
    lost = study / "starts" / "0001.json"
    kept = json.loads(lost.read_text())
    lost.unlink()
    assert cli.run(["evidence", "--resume", str(study), "--starts", "4", "--grids", "20", "--processes", "1"]) == 3
    assert "best of 4 starts" in capsys.readouterr().out
    assert [e.index for e in finished(study)] == [0, 1, 2, 3]
    after = {path: path.stat().st_mtime_ns for path in (study / "starts").iterdir()}
    assert {p for p in before if p != lost and before[p] != after[p]} == set()
    again = json.loads(lost.read_text())
    assert again["objective"] == pytest.approx(kept["objective"], rel=1e-9)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--resume", "nowhere"], "nowhere is not a folder that hopopt evidence began"),
        (["paper", "--resume", "nowhere"], "leave out the problem"),
        (["--starts", "0"], "--starts takes 1 to"),
        (["--starts", "1000000000"], "--starts takes 1 to"),
        (["--grids", "2"], "--grids takes sizes from 8"),
        (["--grids", "20000"], "--grids takes sizes from 8"),
        (["--grids", "--starts", "1"], "--grids takes sizes from 8"),
        (["--global", "--nodes", "--starts", "1"], "--nodes takes sizes from 9"),
    ],
)
def test_wrong_usage_is_a_sentence(arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["evidence", *arguments]) == 2
    assert said in capsys.readouterr().err


@pytest.fixture
def begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A study of one start, with a given end."""
    folder = local_optima.open_study(load("paper"), "clearance", tmp_path)
    monkeypatch.setattr(local_optima, "_ended", lambda design, objective, index: ended(index, 0.8))
    local_optima.run_starts(folder, 1, 1, lambda words: None)
    return folder


@pytest.mark.parametrize("change", ["{}", '"index": "a"', '"objective": "9"', '"index": 7'])
def test_a_changed_file_is_named(begun: Path, change: str, capsys: pytest.CaptureFixture[str]) -> None:
    file = begun / "starts" / "0000.json"
    data = json.loads(file.read_text())
    file.write_text(json.dumps(data | json.loads(f"{{{change}}}")) if change != "{}" else "{}")
    assert cli.run(["evidence", "--resume", str(begun), "--starts", "1"]) == ResultError("").exit_code
    assert "0000.json is not what hopopt wrote" in capsys.readouterr().err


def test_starts_of_another_problem_are_not_mixed_in(begun: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (begun / "problem.toml").read_text()
    (begun / "problem.toml").write_text(text.replace("ratio = 100.0", "ratio = 90.0"))
    assert cli.run(["evidence", "--resume", str(begun), "--starts", "1"]) == ResultError("").exit_code
    assert "problem.toml was changed since the study began" in capsys.readouterr().err


@pytest.mark.rarely
def test_what_the_global_method_finds_more_counts(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A planner that falls short by 5 % in the reduced hop is contradicted, in the exit code and in the JSON; a grid that is
    too coarse to tell contradicts nothing."""
    short = upright.by_transcription
    monkeypatch.setattr(upright, "by_transcription", lambda design, n: 0.95 * short(design, n))
    arguments = [*SETTINGS, "--starts", "1", "--grids", "60", "--processes", "1", "--results", str(tmp_path)]
    assert cli.run(["evidence", *arguments]) == 3
    assert json.loads(next(tmp_path.glob("*/summary.json")).read_text())["contradicted"]
    arguments = [*SETTINGS, "--starts", "1", "--grids", "20", "--processes", "1", "--results", str(tmp_path / "coarse")]
    cli.run(["evidence", *arguments])
    assert not json.loads(next((tmp_path / "coarse").glob("*/summary.json")).read_text())["contradicted"]


@pytest.mark.rarely
def test_a_leg_without_a_reduced_hop_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cli.run(["evidence", "three_joint", *SETTINGS, "--starts", "1", "--processes", "1", "--results", str(tmp_path)])
    assert "left out: three_joint: the reduced hop needs a leg of two joints" in capsys.readouterr().out


def test_a_start_without_a_number_leaves_the_others_in_order() -> None:
    starts = [ended(0, 0.7), ended(1, float("nan"), success=False), ended(2, 0.8)]
    assert [f.best.index for f in families(starts, OBJECTIVES["clearance"])] == [2, 0]


def test_grids_are_taken_from_coarse_to_fine(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What is judged by is the last of them."""
    monkeypatch.setattr(local_optima, "run_starts", lambda *given: [])

    def gathered(*given: Any) -> dict[str, Any]:
        return {"asked": given[3:5], "exit_code": 0}

    monkeypatch.setattr("hopopt.cli.answer.evidence._gathered", gathered)
    words = ["--grids", "60", "20", "40", "--global", "--nodes", "15", "9", "--results", str(tmp_path), "--json"]
    assert cli.run(["evidence", *words]) == 0
    assert json.loads(capsys.readouterr().out)["asked"] == [[20, 40, 60], [9, 15]]
