"""A summary that was edited, and its digest made to fit again, is not verified, and the figure is named."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from hopopt.cli.main import run
from hopopt.nlp.refinement.interval_errors import interval_errors
from hopopt.planner.answer.summary import Summary
from hopopt.planner.checks.judge import judge
from hopopt.planner.solution import Solution, hop_of, stored_nlp
from hopopt.record import adapter, as_data
from hopopt.storage.seal.digests import seal
from hopopt.storage.seal.recheck import recheck
from hopopt.storage.solution import read, save
from hopopt.storage.stated_figures import difference, stated_checks
from once import solved_once

EDITS = [  # (path of the figure, factor)
    ("parts.ballistic_rise_m", 1.05),
    ("upper_bound.clearance_m", 1.05),
    ("gain_per_percent_m.knee operating region", 1.05),
    ("saturation_mean.knee", 0.95),
    ("peak_vertical_force_N", 0.95),
    ("phases.stance.duration_s", 0.95),
    ("lift_off.speed_m_s", 1.05),
    ("objective_error.simulated.clearance_m", 1.05),
    ("objective_error.too_high_by", 0.95),
    ("objective_value", 1.05),
    ("tie_break_bias_m", 0.95),
    ("energy.stance_positive_J", 0.95),
    ("leans_on.load_free_share", 0.95),
    ("active_limits.ground cannot pull", 0.95),
    ("mesh.-1.objective", 0.95),
    ("certificate.stance_costates.residual", 0.9),
    ("clearance_m", 1.05),
]


def edited(data: Any, path: str, factor: float) -> None:
    """One number of nested data multiplied by a factor."""
    *way, last = path.split(".")
    for key in way:
        data = data[int(key) if isinstance(data, list) else key]
    assert data[last] != 0.0
    data[last] *= factor


@pytest.mark.parametrize(("stated", "computed"), [(1.0, float("nan")), (1.0, float("inf")), (float("nan"), 1.0)])
def test_what_is_no_number_agrees_with_no_number(stated: float, computed: float) -> None:
    """As a difference it would be no number either, and below what is allowed."""
    assert difference(stated, computed) == float("inf")
    assert difference(computed, computed) == difference(stated, stated) == 0.0
    assert difference(float("nan"), float("inf")) == 0.0  # JSON has null for both


@pytest.fixture(scope="module")
def hop() -> Solution:
    """The paper's hop, whose residuals are large enough to be stated wrongly by a tenth."""
    return solved_once()


@pytest.fixture(scope="module")
def folder(hop: Solution, tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = save(hop, tmp_path_factory.mktemp("results")).result_dir
    assert found
    return found


@pytest.mark.slow
def test_what_is_stored_is_what_is_computed(folder: Path) -> None:
    assert recheck(read(folder)).verified


def test_every_edit_is_named(folder: Path) -> None:
    """One after the other, against one verdict, as none of them moves what the verdict is computed from."""
    stored = read(folder)
    hop, nlp = hop_of(stored), stored_nlp(stored)
    errors = {name: interval_errors(nlp, name) for name in nlp.phases}
    fresh = judge(stored, nlp, hop.objective, (), stored.claims(), errors, 0.0)
    again = {s.name: s for s in stated_checks(stored, hop, nlp, errors, fresh)}
    assert all(check.passed for check in again.values()), again
    for figure, factor in EDITS:
        data = as_data(stored.summary)
        edited(data, figure, factor)
        other = stored.noted(summary=adapter(Summary).validate_python(data))
        wrong = [c for c in stated_checks(other, hop, nlp, errors, fresh) if not c.passed]
        last = figure.replace("-1", str(len(stored.summary.mesh) - 1))
        assert last in ", ".join(c.where for c in wrong), (figure, wrong)


@pytest.mark.slow
def test_a_summary_that_counts_the_tie_break_in_is_verified_as_what_it_was(folder: Path) -> None:
    """Version 1 stated the program's objective; a repaired one would state it as now."""
    stored = read(folder)
    nlp, data = stored_nlp(stored), as_data(stored.summary)
    data["objective_value"], data["tie_break_weighs"] = nlp.objective, 0.0
    data["objective_error"]["could_be_beaten_by"] -= nlp.tie_break
    assert not recheck(stored.noted(summary=adapter(Summary).validate_python(data))).verified
    assert recheck(stored.noted(summary=adapter(Summary).validate_python({**data, "version": 1}))).failed == []


def test_an_edit_whose_digest_fits_is_not_verified(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = folder / "summary.json"
    text = path.read_text(encoding="utf-8")
    data = json.loads(text)
    edited(data, "upper_bound.clearance_m", 1.05)
    path.write_text(json.dumps(data), encoding="utf-8")
    seal(folder)
    assert run(["verify", str(folder)]) == 3
    last = capsys.readouterr().out.splitlines()[-1]
    assert "NOT verified: figures of the summary as computed (upper_bound.clearance_m)" in last


@pytest.mark.slow
def test_an_entry_that_follows_from_others_is_not_believed(folder: Path, tmp_path: Path) -> None:
    """A check that says it passed is computed anew, and an entry that no check has is told; their digests fit."""
    for entry, value in (("passed", False), ("reason", "none")):
        copy = Path(shutil.copytree(folder, tmp_path / entry))
        data = json.loads((copy / "summary.json").read_text(encoding="utf-8"))
        data["verification"][0][entry] = value
        (copy / "summary.json").write_text(json.dumps(data), encoding="utf-8")
        seal(copy)
        stored = read(copy)
        assert stored.summary.verification[0].passed
        assert stored.doubts == ("summary.json contradicts itself: verification is not what its own entries say",)
        assert not recheck(stored).verified
