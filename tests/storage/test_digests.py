"""Nothing stored is restated as verified once its files were changed: each fault is planted, and named."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hopopt.api import Study, sweep
from hopopt.cli.main import run
from hopopt.errors import ResultError
from hopopt.planner.solution import Solution
from hopopt.problem.load import load
from hopopt.storage.seal.digests import DATA, changed, digests, seal
from hopopt.storage.seal.recheck import recheck, reverified
from hopopt.storage.seal.repair import repaired
from hopopt.storage.solution import read, save, with_more
from hopopt.studies.sweep.store import FILES, save_point
from stored_results import point, stored_study

Change = Callable[[dict[str, Any]], Any]


def edit(path: Path, change: Change) -> None:
    """A JSON file with its data changed."""
    data = json.loads(path.read_text(encoding="utf-8"))
    change(data)
    path.write_text(json.dumps(data), encoding="utf-8")


def higher(data: dict[str, Any]) -> None:
    data["clearance_m"] += 0.1


def higher_and_summing(data: dict[str, Any]) -> None:
    higher(data)
    data["parts"]["ballistic_rise_m"] += 0.1


@pytest.fixture(scope="module")
def written(hop: Solution, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = save(hop, tmp_path_factory.mktemp("results")).result_dir
    assert folder is not None
    return folder


@pytest.fixture
def stored(written: Path, tmp_path: Path) -> Path:
    """A result that a test may change."""
    return Path(shutil.copytree(written, tmp_path / written.name))


def says_verified(shown: str) -> bool:
    """Whether the word stands there without a NOT before it."""
    return bool(re.search(r"(?<!NOT )(?<!un)\bverified\b", shown))


# ---- a result -------------------------------------------------------------------------------------------------


def test_what_was_not_changed_is_as_it_was(stored: Path, hop: Solution) -> None:
    again = read(stored)
    assert not again.doubts
    assert again.verified
    assert again.shown == again.summary
    assert with_more(again, notes=("more",)).result_dir == stored
    assert not read(stored).doubts


@pytest.mark.parametrize("change", [higher, higher_and_summing])
def test_a_clearance_that_was_changed_is_not_called_verified(
    stored: Path, change: Change, capsys: pytest.CaptureFixture[str]
) -> None:
    edit(stored / "summary.json", change)
    again = read(stored)
    assert any("summary.json was changed" in words for words in again.doubts)
    assert not again.verified
    assert not reverified(again).verified
    run(["show", str(stored)])
    shown = capsys.readouterr().out
    assert not says_verified(shown)
    assert "summary.json was changed after it was written" in shown
    assert f"hopopt verify {stored}" in shown
    run(["show", str(stored), "--json"])
    found = json.loads(capsys.readouterr().out)
    assert (found["verified"], found["clearance_m"], found["exit_code"]) == (False, None, 3)
    assert run(["verify", str(stored)]) == 3
    assert "summary.json was changed" in capsys.readouterr().err
    assert not read(stored).verified


@pytest.mark.parametrize("name", ["summary.json", "solution.nc"])
def test_a_change_that_no_figure_feels_is_told_and_not_sealed(
    stored: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """More space in the text, another byte after the data: all that can be computed again is as stated."""
    (stored / name).write_bytes((stored / name).read_bytes() + b"\n")
    before = digests(stored, [*DATA, "manifest.json"])
    assert run(["verify", str(stored)]) == 3
    said = capsys.readouterr()
    assert f"{name} was changed" in said.err
    assert "all that can be computed again is as stated" in said.out.splitlines()[-1]
    assert digests(stored, [*DATA, "manifest.json"]) == before
    assert not read(stored).verified


@pytest.mark.slow
def test_a_repair_computes_figures_again_and_nothing_that_only_the_search_knew(
    stored: Path, hop: Solution, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(ResultError, match="nothing to repair"):
        repaired(read(stored))
    edit(stored / "summary.json", higher)
    before = digests(stored, [*DATA, "manifest.json"])
    assert run(["repair", str(stored)]) == 0
    assert "repaired: summary.json was changed" in capsys.readouterr().out
    again = read(stored.with_name(f"{stored.name}-2"))
    assert again.verified
    assert recheck(again).verified
    assert again.clearance == pytest.approx(hop.clearance, abs=1e-12)
    assert "repaired" in again.summary.notes[-1]
    assert digests(stored, [*DATA, "manifest.json"]) == before
    edit(stored / "summary.json", lambda data: data["starts"].update(count=5000))
    assert run(["repair", str(stored)]) == 2
    assert "summary.json: starts" in capsys.readouterr().err
    assert not read(stored).verified


def test_figures_that_no_check_of_the_plan_reads_are_computed_again(stored: Path) -> None:
    edit(stored / "summary.json", lambda data: data.update(peak_ground_force_N=1.0))
    seal(stored)
    failed = {check.name: check for check in recheck(read(stored)).failed}
    assert failed["figures of the summary as computed"].where == "peak_ground_force_N"


def test_a_clearance_equals_the_sum_of_its_parts(stored: Path) -> None:
    """Also where the digest was changed with it."""
    edit(stored / "summary.json", higher)
    seal(stored)
    (words,) = read(stored).doubts
    assert "its parts sum to" in words
    assert not recheck(read(stored)).verified


def test_a_manifest_without_digests_leaves_doubt(stored: Path) -> None:
    (stored / "manifest.json").write_text("[]")
    assert changed(stored) == ["manifest.json holds no digests of the files"]
    assert run(["verify", str(stored)]) == 3
    assert not read(stored).verified
    assert run(["repair", str(stored)]) == 2


def gone(*keys: str) -> Change:
    def take_out(data: dict[str, Any]) -> None:
        for key in keys[:-1]:
            data = data[key]
        del data[keys[-1]]

    return take_out


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (gone("clearance_m"), "clearance_m"),
        (gone("parts", "ballistic_rise_m"), "parts.ballistic_rise_m"),
        (gone("version"), "no version"),
        (lambda data: data.update(version=3), "version 3"),
        (lambda data: data.update(clearance_m="0.8"), "clearance_m"),
        (lambda data: data.update(clearence_m=0.8), "clearence_m"),
        (lambda data: data.update(verification=[{}]), "verification.0"),
    ],
)
def test_a_damaged_summary_is_refused_in_a_sentence(
    stored: Path, change: Change, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    edit(stored / "summary.json", change)
    for command in (["show"], ["verify"], ["sensitivity", "--result"], ["compare", "--bound"]):
        assert run([*command, str(stored)]) != 0
        said = capsys.readouterr().err
        assert words in said
        assert len(said.splitlines()) == 1
        assert "summary.json" in said
        assert "solve it again" in said


def test_sensitivity_says_nothing_of_a_result_that_was_changed(
    stored: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    edit(stored / "summary.json", higher)
    assert run(["sensitivity", "--result", str(stored), "--json"]) == 3
    found = json.loads(capsys.readouterr().out)
    assert found["clearance_m"] is None
    assert any("summary.json was changed" in words for words in found["failed_checks"])


# ---- a study --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """Two points of a short stance."""
    design = load("paper", {"hop.stance_duration": [0.03, 0.2]})
    vary = {"leg.gear.ratio": [115.0, 120.0]}
    return sweep(design, vary, starts=1, processes=1, results=tmp_path_factory.mktemp("results"))


@pytest.fixture
def study(finished: Study, tmp_path: Path) -> Path:
    return Path(shutil.copytree(finished.folder, tmp_path / "study"))


@pytest.fixture
def noted(tmp_path: Path) -> Path:
    """A study of two points, with given heights, with where a neighbour of the first begins."""
    made = stored_study(tmp_path, {"leg.gear.ratio": [115.0, 120.0]}, [0.7, 0.71])
    save_point(made.folder, point(made.definition, 0, 0.7), {"x": np.zeros(3)})
    return made.folder


@pytest.mark.slow
def test_a_study_is_verified_again(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["verify", str(study), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["verified"]
    assert len(found["points"]) == 2
    assert run(["sweep", "--resume", str(study), "--no-figures", "--json"]) == 0


@pytest.mark.slow
def test_a_points_clearance_that_was_changed_enters_no_table(
    study: Path, finished: Study, capsys: pytest.CaptureFixture[str]
) -> None:
    path = study / "points" / "0001-0.json"
    edit(path, higher)
    assert run(["sweep", "--resume", str(study), "--no-figures"]) == 2
    said = capsys.readouterr()
    assert "0001-0.json: it was changed after it was written" in said.err
    assert "remove it and resume" in said.err
    assert not says_verified(said.out)
    assert run(["verify", str(study)]) == 3
    shown = capsys.readouterr()
    assert "0001-0.json: it was changed" in shown.err
    assert "point 1: states" in shown.out
    assert "clearance_m" in shown.out


@pytest.mark.slow
def test_a_point_that_was_changed_is_told_and_not_written_anew(
    study: Path, finished: Study, capsys: pytest.CaptureFixture[str]
) -> None:
    path = study / "points" / "0001-0.json"
    edit(path, lambda data: data.update(seconds=1.0))
    before = path.read_bytes()
    assert run(["verify", str(study)]) == 3
    assert "0001-0.json: it was changed" in capsys.readouterr().err
    assert path.read_bytes() == before
    path.unlink()
    assert run(["sweep", "--resume", str(study), "--no-figures", "--json"]) == 0
    again = json.loads(capsys.readouterr().out)["points"][1]
    assert again["clearance_m"] == pytest.approx(finished.points[1].clearance_m, rel=1e-6)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[1, 2]", "no JSON object"),
        ("3", "no JSON object"),
        ("{}", "no entry index"),
        ('{"index": 0}', "no entry values"),
        ("{", "cannot be read"),
    ],
)
def test_a_point_file_that_holds_no_point_is_named(
    noted: Path, text: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (noted / "points" / "0000-0.json").write_text(text)
    for command in (["sweep", "--no-figures", "--resume"], ["verify"]):
        assert run([*command, str(noted)]) == ResultError("").exit_code
        said = capsys.readouterr().err
        assert len(said.splitlines()) == 1
        assert "0000-0.json" in said
        assert words in said


def test_where_a_neighbour_begins_is_kept_too(noted: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = noted / "points" / "0000-0.npz"
    path.write_bytes(path.read_bytes() + b" ")
    assert run(["sweep", "--no-figures", "--resume", str(noted)]) == 2
    assert "0000-0.npz beside it was changed" in capsys.readouterr().err


@pytest.mark.slow
def test_a_table_that_was_changed_is_named_and_written_anew_by_a_resume(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = (study / "table.csv").read_text()
    (study / "table.csv").write_text(table.replace("verified", "verified best"))
    assert run(["verify", str(study)]) == 3
    assert "table.csv was changed" in capsys.readouterr().err
    assert (study / "table.csv").read_text() != table
    assert run(["sweep", "--resume", str(study), "--no-figures"]) == 0
    assert (study / "table.csv").read_text() == table
    assert not changed(study, FILES)


def test_a_definition_that_was_changed_is_not_resumed(noted: Path, capsys: pytest.CaptureFixture[str]) -> None:
    edit(noted / "sweep.json", lambda data: data.update(starts=2))
    for command in (["sweep", "--no-figures", "--resume"], ["verify"]):
        assert run([*command, str(noted)]) == 2
        assert "sweep.json was changed after it was written: starts" in capsys.readouterr().err
