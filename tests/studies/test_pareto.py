"""Pareto fronts: monotone, ends that are the single optima, every point verified, kept when stopped."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import hopopt as ho
from hopopt.cli.main import run
from hopopt.errors import UsageError
from hopopt.leg.scales import weight
from hopopt.ocp.objectives.registry import find
from hopopt.planner.refine_and_verify import refined_and_verified
from hopopt.problem.load import resolved_toml
from hopopt.sim.machine import Machine
from hopopt.studies.pareto import trace
from hopopt.studies.pareto.front import Front, FrontPoint
from once import solved_once

POINTS = 4
SHORT = {"hop.stance_duration": [0.03, 0.2]}  # few intervals


@pytest.fixture(scope="module")
def hop() -> ho.Solution:
    """The highest hop in so short a stance."""
    return ho.Solution.with_methods(solved_once(SHORT))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fronts")


@pytest.fixture(scope="module")
def front(folder: Path) -> Front:
    """The least peak of the ground force for each clearance."""
    return ho.pareto(
        ho.load("paper", SHORT), "peak_force", points=POINTS, lowest=0.0, starts=1, processes=1, results=folder
    )


@pytest.mark.slow
def test_every_point_is_verified_and_reaches_its_clearance(front: Front) -> None:
    assert front.exit_code == 0
    assert front.complete
    assert len(front.verified_points) == POINTS
    for point in front.points:
        assert point.clearance_m is not None
        assert point.clearance_m >= point.asked_m - 1e-7


@pytest.mark.slow
def test_front_is_monotone(front: Front) -> None:
    clearance, force = np.array([(p.clearance_m, p.value) for p in front.verified_points], dtype=float).T
    assert np.all(np.diff(clearance) > 0)
    assert np.all(np.diff(force) > 0)


@pytest.mark.slow
def test_ends_are_the_single_objective_optima(front: Front, hop: ho.Solution) -> None:
    least, *_, highest = front.verified_points
    alone = solved_once({**SHORT, "hop.clearance": 0.0}, "peak_force")
    assert least.value == pytest.approx(alone.summary.reached, rel=1e-4)
    assert highest.clearance_m == pytest.approx(hop.clearance, rel=1e-4)


@pytest.mark.slow
def test_points_are_what_solving_them_alone_gives(front: Front) -> None:
    point = front.verified_points[1]
    alone = ho.solve(ho.load("paper", {**SHORT, "hop.clearance": point.asked_m}), "peak_force", starts=2, processes=1)
    assert point.value == pytest.approx(alone.summary.reached, rel=2e-4)


@pytest.mark.slow
def test_least_peak_is_at_least_the_weight(front: Front) -> None:
    """To leave the ground the leg's centre of mass must not have fallen: the mean force is the weight at least."""
    s = front.solutions[0]
    assert s is not None
    assert all((p.value or 0) >= weight(Machine(s.robot).model) * (1 - 1e-6) for p in front.verified_points)


@pytest.mark.slow
def test_folder_holds_table_points_and_json(front: Front) -> None:
    assert front.folder is not None
    with (front.folder / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(r["peak_force_N"]) for r in rows] == [p.value for p in sorted(front.points, key=lambda p: p.asked_m)]
    assert [r["least"] for r in rows] == ["True"] * (POINTS - 1) + ["False"]  # what the highest hop happens to have
    assert json.loads((front.folder / "front.json").read_text())["points"][0]["verified"] is True
    for row in rows:
        assert ho.read(row["result_dir"]).verified


@pytest.mark.slow
def test_a_front_begins_where_the_leg_hops(hop: ho.Solution) -> None:
    found = ho.pareto(ho.load("paper", SHORT), "peak_force", points=3, starts=1, processes=1)
    assert found.points[0].asked_m == pytest.approx(0.2 * hop.clearance, rel=1e-3)
    assert found.exit_code == 0


def drawn_front(tmp_path: Path, hop: ho.Solution) -> Front:
    """Three points of which the first is not the least, in a folder."""
    (tmp_path / "points" / "one").mkdir(parents=True)
    (tmp_path / "points" / "one" / "problem.toml").write_text(resolved_toml(hop.design))
    figures = [(0.1, 3.5), (0.2, 3.0), (0.3, 4.0)]
    made = [FrontPoint(f"p{x:g}", x, x, y, True, result_dir="anywhere/one") for x, y in figures]
    made.append(FrontPoint("highest hop", 0.8, 0.8, 9.0, True, least=False))
    front = Front(hop.design, find("energy"), tmp_path, made, complete=True)
    front.write()
    return front


def test_the_mark_of_the_least_is_on_the_least(tmp_path: Path, hop: ho.Solution) -> None:
    from hopopt.plots.studies.pareto import figure

    picture = figure(drawn_front(tmp_path, hop))
    (least,) = (line for line in picture.axes[0].get_lines() if str(line.get_label()).startswith("least"))
    assert (float(least.get_xdata()[0]), float(least.get_ydata()[0])) == (0.2, 3.0)  # type: ignore[index]
    assert picture.get_suptitle() == f"{hop.design.title}: the least energy for each clearance"


def test_a_stored_front_is_shown_as_a_table(
    tmp_path: Path, hop: ho.Solution, capsys: pytest.CaptureFixture[str]
) -> None:
    drawn_front(tmp_path, hop)
    assert run(["show", str(tmp_path)]) == 0
    assert "4 of 4 points verified" in (table := capsys.readouterr().out)
    assert "3.0000" in table
    assert run(["show", str(tmp_path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads((tmp_path / "front.json").read_text())


@pytest.mark.slow
def test_figure_shows_every_point(front: Front) -> None:
    from hopopt.plots.studies.pareto import figure

    lost = FrontPoint("point", 0.5, None, None, False, "not verified: stance replay")
    picture = figure(Front(front.design, front.against, None, [*front.points, lost], []))
    lines = {line.get_label(): line for line in picture.axes[0].get_lines()}
    x, y = (np.asarray(data, dtype=float) for data in lines["verified hops (joined to guide the eye)"].get_data())
    drawn = np.array([(p.clearance_m, p.value) for p in front.verified_points], dtype=float)
    np.testing.assert_allclose(np.stack([x, y], axis=1), drawn)
    assert set(np.asarray(lines["no verified hop at this clearance"].get_xdata())) == {0.5}
    (highest,) = (line for name, line in lines.items() if str(name).startswith("highest, with what it happens to cost"))
    assert np.asarray(highest.get_xdata()) == [front.verified_points[-1].clearance_m]
    alone = figure(Front(front.design, front.against, None, [p for p in front.points if p.least], []))
    assert not any("highest" in str(line.get_label()) for line in alone.axes[0].get_lines())
    assert picture.axes[0].get_ylabel() == "peak force [N]"


@pytest.mark.slow
def test_stopping_keeps_what_is_finished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    real, calls = refined_and_verified, []

    def stopped(*arguments: object, **more: object) -> object:
        calls.append(arguments)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return real(*arguments, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(trace, "refined_and_verified", stopped)
    asked = ["--against", "peak_force", "--points", "4", "--starts", "1", "--processes", "1", "--json", "--no-figures"]
    asked += ["--set", "hop.stance_duration=[0.03, 0.2]"]
    assert run(["pareto", *asked, "--results", str(tmp_path)]) == 130
    out, err = capfd.readouterr()
    found = json.loads(out)
    assert len(found["points"]) == 2
    assert found["complete"] is False
    assert "what is finished is kept" in err
    assert len(list((Path(found["result_dir"]) / "points").iterdir())) == 2


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--against", "clearance"], "choose one of energy"),
        (["--against", "electrical_energy"], "winding_resistance"),
        (["--points", "2"], "at least 3 points"),
        (["--points", "1001"], "at most 1000"),
        (["--from", "-1"], "a clearance from 0 to 20 m"),
    ],
)
def test_wrong_usage(arguments: list[str], words: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["pareto", *arguments, "--results", str(tmp_path / "results")]) == 2
    assert words in capfd.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_front_cannot_begin_above_the_highest_hop() -> None:
    with pytest.raises(UsageError, match="at most"):
        ho.pareto(ho.load("paper"), "time", points=3, lowest=2.0, starts=1, processes=1)


def test_a_front_without_room_leaves_no_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--points", "3", "--from", "3", "--starts", "1", "--processes", "1", "--set", "solver.refine=false"]
    assert run(["pareto", *words, "--results", str(tmp_path)]) == 2
    assert "give a lowest clearance below that" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
