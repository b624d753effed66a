"""A plan as a robot gets it: what stands in the files is the plan, in the units that they name."""

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

import hopopt as ho
from hopopt.cli import main as cli
from hopopt.cli.share import export
from hopopt.comparison.robust.stored import save_robust
from hopopt.control.reference import PlanReference
from hopopt.errors import ResultError, UsageError
from hopopt.export.plan import gains_of, samples_at_control_rate, to_csv, to_json, to_ros2, tracker_of
from hopopt.export.tracker_c import to_c
from hopopt.leg.robot import BASE
from hopopt.planner.checks.smooth_plan import SmoothPlan, smooth_plan
from hopopt.planner.reserve import TrackedPlan
from hopopt.planner.solution import Solution
from hopopt.storage.solution import save
from hopopt.verify.check import failed
from hopopt.verify.table import NORMALISED_TIMES
from once import solved_once
from stored_results import robust_hop

QUICK = {"solver.refine": False, "solver.stance_intervals": 12, "solver.flight_intervals": 6}
RATE = 500.0  # Hz


@pytest.fixture(scope="module")
def solution() -> Solution:
    """Any solution; that its mesh is too coarse to be true does not matter here."""
    return solved_once({**QUICK, "simulation.control_rate": RATE})


@pytest.fixture(scope="module")
def table(solution: Solution) -> dict[str, list[str]]:
    """The columns of the CSV file by their heads."""
    head, *lines = csv.reader(to_csv(TrackedPlan.of(solution)).splitlines())
    return dict(zip(head, map(list, zip(*lines, strict=True)), strict=True))


def test_rows_stand_at_the_control_instants_and_at_the_end(solution: Solution, table: dict[str, list[str]]) -> None:
    t = np.array(table["t [s]"], dtype=float)
    np.testing.assert_allclose(t[:-1], np.arange(len(t) - 1) / RATE, rtol=0, atol=1e-12)
    assert 0 < t[-1] - t[-2] <= 1 / RATE
    assert t[-1] == pytest.approx(solution.duration, abs=1e-12)
    assert table["phase"] == ["stance" if x < solution.lift_off else "flight" for x in t]


def test_the_csv_file_holds_the_plan_that_controllers_follow(solution: Solution, table: dict[str, list[str]]) -> None:
    """By the reference of the tracker, which reads the stored table and not the trajectory."""
    plan = PlanReference.from_tables(NORMALISED_TIMES, solution.tables, solution.clearance)
    for k in range(0, len(table["phase"]), 7):
        t = float(table["t [s]"][k])
        phase, since = (plan.stance, t) if table["phase"][k] == "stance" else (plan.flight, t - solution.lift_off)
        for names, values in zip(("q_{} [rad]", "v_{} [rad/s]", "tau_{} [N m]"), phase.at(since), strict=True):
            written = [float(table[names.format(joint)][k]) for joint in ("hip", "knee")]
            np.testing.assert_allclose(written, values, rtol=1e-6, atol=1e-6)


def test_gains_are_those_of_the_tracker_row_by_row(solution: Solution) -> None:
    samples, tracker = samples_at_control_rate(solution), tracker_of(TrackedPlan.of(solution))
    gains, flying = gains_of(TrackedPlan.of(solution), samples), int(np.argmax(samples.phase == "flight"))
    assert np.isfinite(gains).all()
    np.testing.assert_allclose(gains[3], tracker.gains[True].K[3], rtol=1e-6)
    since = samples.t[flying] - solution.lift_off
    np.testing.assert_allclose(gains[flying], tracker.gains[False].K[round(since * RATE)], rtol=1e-6)


def test_json_says_what_csv_says(solution: Solution, table: dict[str, list[str]]) -> None:
    data = json.loads(to_json(TrackedPlan.of(solution)))
    assert data["joints"] == ["hip", "knee"]
    assert data["period_s"] == 1 / RATE
    assert data["clearance_m"] == solution.clearance
    assert [f"{name} [{data['units'][name]}]" if name in data["units"] else name for name in data["columns"]] == [
        *table
    ]
    np.testing.assert_array_equal(data["columns"]["q_knee"], np.array(table["q_knee [rad]"], dtype=float))


def test_ros_reads_the_plan_as_a_joint_trajectory(solution: Solution) -> None:
    """Fields of trajectory_msgs/msg/JointTrajectory, times that increase, values of the plan."""
    message = yaml.safe_load(to_ros2(TrackedPlan.of(solution)))
    assert message.keys() == {"header", "joint_names", "points"}
    assert message["joint_names"] == ["hip", "knee"]
    point = message["points"][40]
    assert point.keys() == {"positions", "velocities", "accelerations", "effort", "time_from_start"}
    times = [p["time_from_start"]["sec"] * 10**9 + p["time_from_start"]["nanosec"] for p in message["points"]]
    assert (np.diff(times) > 0).all()
    assert all(0 <= p["time_from_start"]["nanosec"] < 10**9 for p in message["points"])
    at = solution.sample(times[40] * 1e-9)
    np.testing.assert_allclose(point["positions"], at.q[0, BASE:], atol=1e-9)
    np.testing.assert_allclose(point["velocities"], at.v[0, BASE:], atol=1e-9)
    np.testing.assert_allclose(point["accelerations"], at.a[0, BASE:], atol=1e-9)
    np.testing.assert_allclose(point["effort"], at.tau[0], atol=1e-9)


def test_a_leg_on_a_slider_is_exported_without_gains() -> None:
    """The plant does not simulate it, so nothing tracks it; its plan is a plan all the same."""
    slider = solved_once({**QUICK, "leg.guides": ["z"], "simulation.control_rate": RATE})
    head = to_csv(TrackedPlan.of(slider)).partition("\n")[0]
    assert "q_knee [rad]" in head
    assert "K_" not in head


def test_a_landed_hop_is_exported_whole() -> None:
    """Up to rest, in one frame: the body moves on through the impact. The tracker has no gains for a landing, and no C."""
    landed = solved_once({**QUICK, "hop.kind": "landing", "simulation.control_rate": RATE})
    s, step = samples_at_control_rate(landed), 1 / RATE
    gains = gains_of(TrackedPlan.of(landed), s)
    assert list(dict.fromkeys(s.phase)) == ["stance", "flight", "descent", "landing"]
    fastest = np.abs(s.v[:, 0]).max()
    assert np.abs(np.diff(s.q[:, 0])).max() < 1.1 * fastest * step
    assert np.abs(s.v[-1]).max() < 1e-6
    followed = np.isin(s.phase, ["stance", "flight"])
    assert np.isfinite(gains[followed]).all()
    assert np.isnan(gains[~followed]).all()
    with pytest.raises(UsageError, match="the tracker in C does not know the hop that lands yet"):
        to_c(TrackedPlan.of(landed))


# ---- the command ---------------------------------------------------------------------------------------------


def test_an_unverified_plan_is_refused(
    solution: Solution, tmp_path: Path, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    saved = save(solution, tmp_path / "results")
    assert not solution.verified
    assert cli.run(["export", str(saved.result_dir), "--format", "csv"]) == 2
    assert "the plan is not verified, and only verified plans are exported" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


def _slow(hop: Solution) -> Solution:
    """At a control rate that leads to fewer rows."""
    slow = hop.design.simulation.model_copy(update={"control_rate": RATE})
    return hop.noted(design=hop.design.model_copy(update={"simulation": slow}))


def test_each_format_is_written_once(hop: Solution, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    result = save(_slow(hop), tmp_path).result_dir
    for form, mark in (("csv", "t [s],"), ("json", '{"format"'), ("ros2", "header:"), ("c", "/* Tracks the plan")):
        file = tmp_path / f"plan.{form}"
        assert cli.run(["export", str(result), "--format", form, "-o", str(file), "--json"]) == 0
        assert json.loads(capsys.readouterr().out) == {"written": [str(file)], "exit_code": 0}
        assert file.read_text(encoding="utf-8").startswith(mark)
    assert cli.run(["export", str(result), "--format", "csv", "-o", str(tmp_path / "plan.csv")]) == 2
    assert "is not overwritten" in capsys.readouterr().err


def test_a_robust_plan_is_exported_and_moves_with_its_tracker(
    hop: Solution, tmp_path: Path, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its own feedback stands in every row and in the C code; the plan and the leg that follows it move one over the other.
    Feedback that is no matrix of numbers is refused."""
    monkeypatch.chdir(tmp_path)
    folder = str(save_robust(robust_hop(ho.Solution.with_methods(_slow(hop))), tmp_path / "results"))
    for form in ("csv", "c"):
        assert cli.run(["export", folder, "--format", form, "-o", f"plan.{form}"]) == 0
    first = next(csv.DictReader((tmp_path / "plan.csv").read_text(encoding="utf-8").splitlines()))
    gains = [
        float(first[f"K_{joint}_{of}_{joint} [N m{s}/rad]"])
        for of, s in (("q", ""), ("v", " s"))
        for joint in ("hip", "knee")
    ]
    assert gains == [9.0, 8.0, 2.0, 1.0]
    assert "hopopt_stance_K[] = {\n9.0, 0.0, 2.0, 0.0, 0.0, 8.0, 0.0, 1.0," in re.sub(
        r"HOPOPT_R\((.*?)\)", r"\1", (tmp_path / "plan.c").read_text()
    )
    assert cli.run(["animate", folder, "-o", "hop.svg"]) == 0
    assert all(f">{name}" in (tmp_path / "hop.svg").read_text(encoding="utf-8") for name in ("plan", "track"))
    data = json.loads((file := Path(folder, "robust.json")).read_text())
    for damage in ("gains", [[1.0, 0.0, None, 0.0], [0.0, 1.0, 0.0, 0.0]]):
        file.write_text(json.dumps(data | {"feedback_matrix": damage}))
        assert cli.run(["export", folder, "--format", "csv", "-o", "other.csv"]) == 2
        assert "do not fit together" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["paper"], "say what to write"),
        (["paper", "-o", "plan.csv"], "say in which form"),
        (["paper", "--format", "csv"], "there is no such folder"),
        (["paper", "--format", "csv", "--set", "leg.body.mass=5"], "exported as it was solved"),
    ],
)
def test_what_cannot_be_exported_is_said_in_a_sentence(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.run(["export", *arguments]) == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


# ---- a smooth plan -------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_smooth_plan_is_as_good_and_its_torques_vary_less(
    hop: Solution, tmp_path: Path, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the paper's leg the knee quivers at the edge of its operating region. The stored hop stays as it is."""
    monkeypatch.chdir(tmp_path)
    saved = save(_slow(hop), tmp_path / "results")
    folder, made = str(saved.result_dir), list[SmoothPlan]()
    monkeypatch.setattr(export, "smooth_plan", lambda solution: made.append(smooth_plan(solution)) or made[-1])
    assert (
        cli.run(
            ["export", folder, "--format", "json", "--smooth", "-o", "smooth.json", "--json", "--figure", "torques.svg"]
        )
        == 0
    )
    printed, found = capsys.readouterr(), made[0]
    before, after = found.variation
    assert after.sum() < before.sum()
    assert after[1] < 0.9 * before[1]  # on the hop's own mesh a flight that is smoother errs by too much
    assert abs(hop.clearance - found.claims["clearance_m"]) <= 1e-5
    assert not failed(list(found.checks))
    assert {c.name for c in found.checks} >= {
        "stance replay",
        "flight replay",
        "simulated in one piece",
        "claimed height",
        "local error of the intervals",
    }
    assert re.search(r"knee by 1\d\d\d in place of 1\d\d\d N m; clearance 0.79935\d* in place", printed.err)
    said = json.loads(printed.out)["smooth"]
    assert said["lost"] == pytest.approx(hop.summary.objective_value - found.claims["clearance_m"], abs=1e-10)
    assert said["lost"] <= said["may_lose"] == pytest.approx(0.8e-5, rel=1e-2)
    assert said["limited"] in printed.err
    assert said["torque_variation"]["knee"] == {
        "hop": pytest.approx(before[1]), "plan": pytest.approx(after[1]), "unit": "N m",
    }  # fmt: skip
    assert all(check["passed"] for check in said["verification"])
    drawn = (tmp_path / "torques.svg").read_text(encoding="utf-8")
    assert all(f"<!-- {words} -->" in drawn for words in ("hip", "knee", "hop", "smooth plan"))
    written = json.loads((tmp_path / "smooth.json").read_text())
    assert written["clearance_m"] == found.claims["clearance_m"]
    torques = found.motion.sample(written["columns"]["t"]).command[:, 1]
    np.testing.assert_allclose(written["columns"]["tau_knee"], torques, rtol=1e-9, atol=1e-9)
    assert cli.run(["verify", folder]) == 0


def test_smooth_is_for_a_solved_hop_in_a_form(capsys: pytest.CaptureFixture) -> None:
    assert cli.run(["export", "paper", "--urdf", "leg.urdf", "--smooth"]) == 2
    assert "--smooth is for a planned hop: say in which form" in capsys.readouterr().err
    for wrong, words in (
        (["--figure", "t.svg"], "it is of a smooth plan: say --smooth"),
        (["--smooth", "--figure", "t.gif"], "a figure's file ends in one of .svg, .png, .pdf"),
        (["--smooth", "--figure", "t.svg", "-o", "t.svg"], "the plan is written there: name another file"),
    ):
        assert cli.run(["export", "paper", "--format", "csv", *wrong]) == 2
        assert words in capsys.readouterr().err


def test_no_smooth_plan_is_made_of_a_hop_that_was_changed_or_lacks_what_it_needs(
    hop: Solution, tmp_path: Path, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A problem that is no longer the hop's, a summary that is not as it was written, a program without multipliers."""
    monkeypatch.chdir(tmp_path)
    for file, old, new in (
        ("problem.toml", "ratio = 100.0", "ratio = 99.0"),
        ("summary.json", '"seed": 0', '"seed": 1'),
    ):
        folder = save(hop, tmp_path / file).result_dir
        assert folder is not None
        text = (folder / file).read_text(encoding="utf-8")
        assert text.count(old) >= 1
        (folder / file).write_text(text.replace(old, new, 1), encoding="utf-8")
        assert cli.run(["export", str(folder), "--format", "csv", "--smooth", "-o", "smooth.csv"]) == 2
        told = capsys.readouterr().err
        assert file in told
        assert "was changed" in told
    with pytest.raises(ResultError, match="holds no multipliers: solve it again"):
        smooth_plan(replace(hop, kkt={}))
    in_python = ho.Solution.with_methods(replace(hop, doubts=("a file was changed",)))
    with pytest.raises(ResultError, match="a smooth plan is made of a verified hop"):
        in_python.smooth()
    assert not (tmp_path / "smooth.csv").exists()
