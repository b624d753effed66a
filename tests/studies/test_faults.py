"""A fault of the program ends a part of a study with its traceback kept; it never passes for a result of the problem."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hopopt.api import sweep
from hopopt.cli.main import run
from hopopt.errors import NotSolvedError, SolverError
from hopopt.evidence import family_optima, local_optima
from hopopt.nlp.solver.ipopt import Bounds, NlpSolver
from hopopt.ocp.hop import Hop
from hopopt.planner.refine_and_verify import refine_and_verify
from hopopt.planner.search.first_mesh import search_first_mesh
from hopopt.planner.search.multistart import first_transcription, run_chunk
from hopopt.problem.load import load
from hopopt.studies.faults import Fault, guarded
from hopopt.studies.pareto import trace as pareto
from hopopt.studies.sweep import point
from hopopt.studies.sweep.point_file import ENDED, VERIFIED

SMALL = {"solver.stance_intervals": 12, "solver.flight_intervals": 5, "solver.refine": False}
SETTINGS = [word for entry, value in SMALL.items() for word in ("--set", f"{entry}={str(value).lower()}")]
WORDS = "a fault of hopopt ended it (ValueError: planted)"


def planted(*given: Any, **more: Any) -> Any:
    raise ValueError("planted")


def once(function: Callable[..., Any], number: int) -> Callable[..., Any]:
    """The function, but for one call, which fails."""
    calls = list[int]()

    def called(*given: Any, **more: Any) -> Any:
        calls.append(1)
        return planted() if len(calls) == number else function(*given, **more)

    return called


@pytest.mark.slow
def test_a_fault_of_a_point_is_said_and_kept_and_the_study_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is not what the point comes to: resumed, it is solved."""
    words = [
        "sweep",
        "--vary",
        "leg.gear.ratio=100,110",
        "--starts",
        "1",
        "--processes",
        "1",
        "--no-figures",
        *SETTINGS,
    ]
    with monkeypatch.context() as patch:
        patch.setattr(point, "refine_and_verify", planted)
        assert run([*words, "--json", "--results", str(tmp_path)]) == 3
    told = json.loads(capsys.readouterr().out)
    assert [p["outcome"] for p in told["points"]] == [ENDED] * 2
    assert all(p["sentence"].startswith(WORDS) for p in told["points"])
    folder = Path(told["result_dir"])
    kept = sorted((folder / "points").iterdir())
    assert [path.suffixes[-2:] for path in kept] == [[".traceback", ".txt"]] * 2
    assert "in planted" in kept[0].read_text(encoding="utf-8")
    run([*words, "--json", "--resume", str(folder)])
    assert not [p for p in json.loads(capsys.readouterr().out)["points"] if p["outcome"] == ENDED]


def test_one_point_of_two_does_not_end_the_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(point, "refine_and_verify", once(refine_and_verify, 1))
    monkeypatch.setattr("hopopt.studies.sweep.run.PASSES", 0)
    study = sweep(load("paper", SMALL), {"leg.gear.ratio": [100.0, 110.0]}, starts=1, processes=1, results=tmp_path)
    assert sorted(p.outcome == ENDED for p in study.points) == [False, True]
    assert study.exit_code == 3


def test_a_solver_that_cannot_is_told_from_a_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def cannot(*given: Any, **more: Any) -> Any:
        raise SolverError("Ipopt cannot work on the program: limits cross")

    monkeypatch.setattr(point, "refine_and_verify", cannot)
    study = sweep(load("paper", SMALL), {"leg.gear.ratio": [100.0]}, starts=1, processes=1, results=tmp_path)
    assert (study.points[0].outcome, study.points[0].sentence) == ("not solved", point.REFINEMENT_STOPPED)
    assert study.exit_code == 1


def test_limits_that_cross_are_a_sentence_of_the_solver() -> None:
    t = first_transcription(Hop(load("paper", SMALL)))
    low, high = t.bounds({})
    solver = NlpSolver(t, {"ipopt.max_iter": 1})
    with pytest.raises(SolverError, match=r"Ipopt cannot work on the program: .*LBX"):
        solver._solve(np.zeros(len(low)), t.parameter_values(), Bounds(high, low, t.lbg, t.ubg), None)


def test_a_fault_of_a_family_is_said_and_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(family_optima, "refined_and_verified", planted)
    assert run(["families", "--starts", "1", "--processes", "1", *SETTINGS, "--results", str(tmp_path)]) == 3
    told = " ".join(capsys.readouterr().out.split())
    assert f"refinement at value 1: {WORDS}" in told
    (folder,) = tmp_path.iterdir()
    assert "in planted" in (folder / "refinement-at-value-1.traceback.txt").read_text(encoding="utf-8")


def test_a_fault_of_a_start_is_said_and_kept_and_it_counts_as_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = list[str]()
    folder = local_optima.open_study(load("paper", SMALL), "clearance", tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(local_optima, "run_chunk", once(run_chunk, 1))
        assert [e.index for e in local_optima.run_starts(folder, 2, 1, said.append)] == [1]
    assert any(line.startswith(f"start 1: {WORDS}") for line in said)
    assert (folder / "starts" / "0000.traceback.txt").is_file()
    assert [e.index for e in local_optima.run_starts(folder, 2, 1, said.append)] == [0, 1]


@pytest.mark.slow
def test_a_fault_of_a_fronts_point_is_said_and_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pareto, "refined_and_verified", planted)
    found = pareto.front(load("paper", SMALL), "time", points=3, starts=1, processes=1, results=tmp_path)
    ended = [p for p in found.points if not p.verified]
    assert len(ended) >= 2
    assert all(p.sentence.startswith(WORDS) for p in ended if p.kind != pareto.TOP)
    assert found.folder is not None
    assert list((found.folder / "points").glob("*.traceback.txt"))


def test_errors_that_are_sentences_pass() -> None:
    def not_solved() -> None:
        raise NotSolvedError("no start led to a hop")

    with pytest.raises(NotSolvedError):
        guarded(not_solved)
    assert isinstance(fault := guarded(planted), Fault)
    assert "ValueError: planted" in fault.sentence
    assert guarded(lambda: VERIFIED) == VERIFIED


def test_a_value_that_no_solver_can_work_on_does_not_end_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nor is what the others found removed."""
    calls = list[int]()

    def first_cannot(*given: Any, **more: Any) -> Any:
        calls.append(1)
        if len(calls) == 1:
            raise SolverError("Ipopt cannot work on the program: limits cross")
        return search_first_mesh(*given, **more)

    monkeypatch.setattr(family_optima, "search_first_mesh", first_cannot)
    words = ["--vary", "leg.gear.ratio=100,110", "--starts", "1", "--processes", "1", "--no-verify", *SETTINGS]
    assert run(["families", *words, "--results", str(tmp_path)]) == 3
    assert "search at value 1: Ipopt cannot work on the program: limits cross" in " ".join(
        capsys.readouterr().out.split()
    )
    (folder,) = tmp_path.iterdir()
    assert (folder / "search-at-value-1.traceback.txt").is_file()


@pytest.mark.parametrize(
    ("line", "where", "goes_on"),
    [
        ("sweep --vary leg.gear.ratio=100 --starts 1 --no-figures", "hopopt.studies.sweep.run.save_tables", "--resume"),
        ("pareto --points 3 --starts 1 --no-figures", "hopopt.studies.pareto.trace.Chain", "are kept there"),
        ("evidence --starts 1", "hopopt.cli.answer.evidence._gathered", "go on with: hopopt evidence --resume"),
        ("families --starts 1", "hopopt.cli.studies.families.find_families", "is kept in families.json"),
    ],
)
def test_a_fault_between_the_parts_of_a_study_is_a_sentence_and_loses_nothing(
    line: str,
    where: str,
    goes_on: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(where, planted)
    assert run([*line.split(), "--processes", "1", *SETTINGS, "--results", str(tmp_path)]) == 1
    (folder,) = tmp_path.iterdir()
    said = capsys.readouterr().err.splitlines()[-1]
    assert said.startswith(f"hopopt: {folder}: {WORDS}")
    assert goes_on in said
    assert "in planted" in (folder / "study.traceback.txt").read_text(encoding="utf-8")
    finished = {"sweep": "points/*.json", "pareto": "points/*/solution.nc", "evidence": "starts/*.json"}
    assert line.startswith("families") or list(folder.glob(finished[line.split()[0]]))
