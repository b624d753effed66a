"""Limits that never act, and what a stored hop leaves open."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hopopt as ho
from hopopt.cli import run
from hopopt.idle import idle_limits
from hopopt.leg.design import Design
from hopopt.problem_file import load
from hopopt.solution import Solution
from hopopt.storage import save
from hopopt.summary import FINE

pytestmark = pytest.mark.filterwarnings("error")
MARGIN = 1e-6
CAPS = {"leg.gear.torque_cap": 250.0, "leg.gear.speed_cap": 1500.0}  # more than the motors reach


def solved(design: Design) -> Solution:
    return ho.solve(design, starts=1, processes=1)


@pytest.fixture(scope="module")
def plan() -> Solution:
    return solved(load("paper", CAPS))


def test_shares_of_the_limits(plan: Solution) -> None:
    """By hand: a cap of 250 N m that drives of 200 N m cannot reach, a window that the foot passes."""
    idle, own = plan.summary["idle_limits"], plan.apex.points
    off = abs(own["foot"][0, 0] - own["hip"][0, 0])
    assert idle["foot window"]["used"] == pytest.approx(off / 0.1)
    assert idle["foot window"]["enough"] == pytest.approx(off)
    for joint in ("hip", "knee"):
        assert idle[f"{joint} gear torque cap"]["used"] <= 0.8 + 1e-3
        assert idle[f"{joint} gear torque cap"]["entry"] == "leg.gear.torque_cap"
    assert idle["longest flight"]["enough"] == pytest.approx(plan.phases["flight"].duration)
    assert "longest stance" not in idle  # it acts
    assert all(use["used"] < 1 for use in idle.values())


def test_tightening_idle_limits_has_no_effect(plan: Solution) -> None:
    """All of them at once, to what the hop uses of them: as high, but for the price of drawing limits in (1e-5)."""
    idle, entries = plan.summary["idle_limits"], {}
    for use in idle.values():
        if use["entry"].startswith("leg."):
            slack = MARGIN if use["enough"] > 0 else -MARGIN
            slack = -MARGIN if use["entry"].endswith("lower") else MARGIN if use["entry"].endswith("upper") else slack
            entries[use["entry"]] = max(use["enough"] + slack, entries.get(use["entry"], -10.0))
    entries["hop.foot_window"] = idle["foot window"]["enough"] + MARGIN
    entries["hop.flight_duration"] = [
        idle["shortest flight"]["enough"] - MARGIN,
        idle["longest flight"]["enough"] + MARGIN,
    ]
    assert len(entries) >= 5
    tight = solved(load("paper", CAPS | entries))
    assert tight.summary["objective_value"] == pytest.approx(plan.summary["objective_value"], rel=2e-5)


def test_a_friction_cone_says_what_it_needs(plan: Solution) -> None:
    """A push of 30 N along for every 100 N down needs a coefficient of 0.3; a foot that carries nothing does not count."""
    fine = {phase: plan.everywhere(phase, FINE) for phase in plan.phases}
    f = np.tile([-30.0, 100.0], (len(fine["stance"].t), 1))
    f[::7] = [50.0, 0.0]
    fine["stance"] = replace(fine["stance"], f=f)
    for friction, idle in ((0.6, True), (0.3, False)):
        contact = plan.design.contact.model_copy(update={"friction": friction})
        cone = idle_limits(replace(plan, design=plan.design.model_copy(update={"contact": contact})), fine)
        assert ("friction cone" in cone) is idle
        if idle:
            assert cone["friction cone"] == pytest.approx(
                {"used": 0.5, "entry": "contact.friction", "limit": 0.6, "enough": 0.3}
            )


def test_diagnose_says_what_a_stored_hop_leaves_open(plan: Solution, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:  # fmt: skip
    folder = str(save(plan, tmp_path, None).result_dir)
    assert run(["diagnose", folder, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["idle_limits"].keys() == plan.summary["idle_limits"].keys()
    assert {f["name"] for f in found["flat"] if f["phase"] == "flight"} == {"a[hip]", "a[knee]"}
    assert {f["name"] for f in plan.summary["flat"]} == {f["name"] for f in found["flat"]}  # the tie-break hides none
    assert found["durations"]["stance"]["longer"] is None  # at its longest
    assert found["durations"]["stance"]["shorter"] > 1e-3
    assert found["durations"]["flight"]["shorter"] > 1e-3
    assert run(["diagnose", folder]) == 0
    shown = capsys.readouterr().out
    assert "flat: the objective does not feel the torque of the hip and the torque of the knee in flight" in shown
    assert "could be dropped, or tightened to" in shown


def test_diagnose_of_what_is_no_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["diagnose", str(tmp_path)]) == 2
    assert capsys.readouterr().err.startswith("hopopt: ")
