"""Results read from their folders as what they were, and verified again."""

import json
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hopopt as ho
from hopopt.api.asked import as_class
from hopopt.comparison.hops.hop_after_hop import HopsComparison
from hopopt.comparison.hops.transition import Transition
from hopopt.comparison.hops.trials import Hops
from hopopt.control.closed_loop import simulate
from hopopt.control.setting import Setting
from hopopt.control.strategies import find
from hopopt.errors import ResultError, UsageError
from hopopt.planner.checks.verdict import Verdict
from hopopt.planner.several_hops import HopsPlan
from hopopt.sim.controller import Measurement
from hopopt.verify.check import Check
from stored_results import robust_hop, stored_front, stored_study

QUICK = {"simulation.control_rate": 500}
RATIOS = {"leg.gear.ratio": [80, 90, 100]}


class Still:
    """A controller of the user's own, given as a class."""

    def __init__(self, setting: Setting):
        self.asked = setting

    def torque(self, now: Measurement) -> np.ndarray:
        return 0.0 * now.q


def short(found: Any) -> bool:
    return len(repr(found).splitlines()) <= 3 and len(repr(found)) < 300


# ---- as what they were ----------------------------------------------------------------------------------------------


def test_a_comparison_is_read_as_it_was(comparison: ho.Comparison, tmp_path: Path) -> None:
    """All figures are computed anew from the stored motions: those of the bound depend on rounding alone."""
    saved = ho.save(comparison, str(tmp_path))
    assert saved.folder is not None
    found = ho.read(str(saved.folder), ho.Comparison)
    assert found.folder == saved.folder
    was, now = comparison.as_dict(), found.as_dict()
    assert now["strategies"]["force"] == was["strategies"]["force"]
    assert {k: v for k, v in now.items() if k != "strategies"} == {k: v for k, v in was.items() if k != "strategies"}
    assert found.figures["optimum"].clearance == pytest.approx(comparison.bound, rel=1e-12)
    assert found.plot("foot_height").axes
    assert short(found)


def test_a_run_is_read_as_it_was_and_a_class_is_a_strategy(comparison: ho.Comparison, tmp_path: Path) -> None:
    for made in (as_class(ho.Run, comparison.runs["force"]), ho.simulate(ho.load("paper", QUICK), Still)):
        run = ho.save(made, tmp_path)
        assert run.folder is not None
        found = ho.read(run.folder, ho.Run)
        assert found.figures.as_dict() == run.figures.as_dict()
        assert (found.options, found.overshoot, found.limited_by) == (run.options, run.overshoot, run.limited_by)
        assert found.strategy.name in ("force", f"{__name__}:Still")
        assert short(found)
    with pytest.raises(UsageError, match="is no strategy: give its name, or a class with a method torque"):
        ho.simulate("paper", dict)


def test_a_study_is_read_with_the_points_that_are_finished(tmp_path: Path) -> None:
    """Also before all are; the entry has a name without dots, by which a point is selected."""
    study = stored_study(tmp_path, RATIOS, [0.7, 0.8, None])
    found = ho.read(str(study.folder), ho.Study)
    assert found.points == study.points
    assert float(found.to_xarray().sel(leg_gear_ratio=90).clearance_m) == 0.8
    assert "leg_gear_ratio" not in found.to_dataframe()
    next((study.folder / "points").glob("0001*.json")).unlink()
    part = ho.read(study.folder, ho.Study).to_xarray()
    assert np.isnan(float(part.clearance_m.sel({"leg.gear.ratio": 90})))
    assert list(part.outcome.values) == ["verified", "", "not verified"]


def test_a_front_is_read_in_the_order_of_its_axis(hop: ho.Solution, tmp_path: Path) -> None:
    front = stored_front(hop, tmp_path)
    assert front.folder is not None
    found = ho.read(str(front.folder), ho.Front)
    assert [p.asked_m for p in found.points] == [0.2, 0.5, hop.clearance]
    assert [s is not None for s in found.solutions] == [True, False, True]
    assert type(found.solutions[0]) is ho.Solution
    table = found.to_dataframe()
    assert list(table["objective_value"].dropna()) == [50.0, 200.0]
    assert found.to_xarray().objective_value.attrs["units"] == "J"
    assert short(found)


def test_tables_of_studies_fronts_and_robust_plans_have_columns_of_the_same_names(
    hop: ho.Solution, tmp_path: Path
) -> None:
    study = ho.read(stored_study(tmp_path, RATIOS, [0.7, 0.8, None]).folder, ho.Study).to_dataframe()
    front = ho.Front.with_methods(stored_front(hop, tmp_path)).to_dataframe()
    drawn = ho.RobustHop.with_methods(robust_hop(hop)).to_dataframe()
    assert {"outcome", "clearance_m", "objective_value", "seconds", "sentence"} <= set(study) & set(front)
    assert {"outcome", "clearance_m"} <= set(drawn)


def test_a_robust_plan_is_read_as_it_was(hop: ho.Solution, tmp_path: Path) -> None:
    """With its motion, as a controller follows it."""
    found = ho.RobustHop.with_methods(robust_hop(hop))
    saved = ho.save(found, tmp_path)
    assert saved.folder is not None
    again = ho.read(saved.folder, ho.RobustHop)
    assert json.dumps(again.as_dict()) == json.dumps(found.as_dict())
    t = [0.0, 0.1, hop.duration]
    assert np.array_equal(again.best.plan.sample(t).q, hop.sample(t).q)
    assert again.best.reference.stance.tau == pytest.approx(found.best.reference.stance.tau, rel=1e-12, abs=1e-9)
    assert again.plot().axes
    assert short(again)


def test_hops_one_after_the_other_are_read_as_they_were(hop: ho.Solution, tmp_path: Path) -> None:
    run = simulate(ho.load("paper", QUICK), find("force"), hops=3)
    found = ho.HopsComparison.with_methods(HopsComparison(hop, None, {"force": Hops(run, 2)}, 2, 0.02))
    saved = ho.save(found, tmp_path)
    assert saved.folder is not None
    again = ho.read(saved.folder, ho.HopsComparison)
    assert again.as_dict() == found.as_dict()
    assert again.hops["force"].kept == found.hops["force"].kept
    assert again.shown["force"].clearance == found.shown["force"].clearance
    assert again.plot("clearances").axes
    assert again.to_dataframe().loc["force", "kept_m"] == found.hops["force"].kept
    assert short(again)


def test_a_transition_is_read_as_it_was(hop: ho.Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a hop from rest in place of a periodic one, which takes longer to find."""
    monkeypatch.setattr("hopopt.comparison.hops.transition._orbit", lambda orbit: {"clearance_m": orbit.clearance})
    monkeypatch.setattr("hopopt.planner.several_hops.highest_lowest_point", lambda hop: float(hop.apex.lowest[0]))
    checks = (Check("a limit", 1e-9, 1e-4, "m", "hop 1"), Check("another", float("inf"), 1e-4, "m"))
    plan = HopsPlan((hop,), 1.5, Verdict(checks, None, checks[:1]))
    found = ho.Transition.with_methods(Transition(plan, hop, None, ("two do not do",)))
    saved = ho.save(found, tmp_path)
    assert saved.folder is not None
    again = ho.read(saved.folder, ho.Transition)
    assert again.as_dict() == found.as_dict()
    assert again.plan.verdict.checks == checks
    assert again.plot().axes
    assert short(again)


def test_a_folder_of_another_kind_is_said_in_a_sentence(tmp_path: Path, hop: ho.Solution) -> None:
    study = stored_study(tmp_path, RATIOS, [0.7, 0.8, None])
    with pytest.raises(ResultError, match="it holds a Study, not a Front"):
        ho.read(study.folder, ho.Front)
    with pytest.raises(ResultError, match="there is no such folder"):
        ho.read(tmp_path / "nothing")
    (tmp_path / "x").mkdir()
    with pytest.raises(ResultError, match="no results folder"):
        ho.read(tmp_path / "x")
    front = stored_front(hop, tmp_path)
    assert front.folder is not None
    (front.folder / "front.json").write_text("{}")
    with pytest.raises(ResultError, match="the front cannot be read"):
        ho.read(front.folder)


# ---- verified again -------------------------------------------------------------------------------------------------


def test_a_result_is_verified_again_hop_by_hop(comparison: ho.Comparison, tmp_path: Path) -> None:
    """A clearance that was changed in the stored bound is found."""
    saved = ho.save(comparison, tmp_path)
    assert saved.folder is not None
    found = ho.verify(saved.folder)
    assert found.verified
    assert [v.verified for v in found.hops.values()] == [True]
    (path,) = saved.folder.glob("bound/*/summary.json")
    data = json.loads(path.read_text())
    data["lift_off"]["time_s"] += 0.01
    path.write_text(json.dumps(data))
    wrong = ho.verify(saved.folder)
    assert not wrong.verified
    assert any("files as they were written" in fault for fault in wrong.faults)
    assert short(wrong)


def test_what_has_no_optimum_cannot_be_verified(comparison: ho.Comparison) -> None:
    with pytest.raises(UsageError, match="has no hop of the optimiser"):
        ho.verify(as_class(ho.Run, comparison.runs["force"]))


def test_the_version_is_that_of_the_package() -> None:
    assert ho.__version__ == version("hopopt")
    assert callable(ho.verify)
