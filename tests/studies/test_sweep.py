"""Design studies as a user runs them: the same answers as single solves, nothing lost, failures kept."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Never

import numpy as np
import pytest
import xarray as xr

import hopopt as ho
from command_line import said
from hopopt.errors import SolverError
from hopopt.planner.refine_and_verify import refine_and_verify
from hopopt.studies.sweep import point as sweep_point
from hopopt.studies.sweep.definition import Definition, define
from hopopt.studies.sweep.first_program import kinds, with_others
from hopopt.studies.sweep.point import Neighbour, solve_again, solve_point
from hopopt.studies.sweep.point_file import IMPOSSIBLE, NOT_SOLVED
from stored_results import stored_study
from waiting import beside_progress, wait_for

HOPOPT = [sys.executable, "-m", "hopopt.cli.main"]
SHORT = "hop.stance_duration=[0.03, 0.2]"
SWEEP = [
    "sweep",
    "--set",
    SHORT,
    "--set",
    "solver.tolerance=1e-4",
    "--starts",
    "1",
    "--vary",
    "leg.gear.ratio=115,130,145",
]

MANY = [  # points of which each takes a moment
    "sweep",
    *(word for entry in (SHORT, "solver.refine=false", "solver.stance_intervals=8") for word in ("--set", entry)),
    "--starts",
    "1",
    "--vary",
    "leg.gear.ratio=100:160:40",
]


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> ho.Study:
    """Ratios, one with a shank too short to stand on."""
    design = ho.load("paper", [SHORT])
    vary = {"leg.shank.length": [0.2, 0.361], "leg.gear.ratio": [110, 130]}
    return ho.sweep(design, vary, starts=1, processes=1, results=tmp_path_factory.mktemp("results"))


@pytest.mark.slow
def test_points_equal_single_solves(study: ho.Study) -> None:
    for k in (2, 3):
        alone = ho.solve(study.definition.design_at(k), starts=1)
        assert study.points[k].verified
        assert study.points[k].clearance_m == pytest.approx(alone.clearance, rel=1e-4)
    assert {(2, 0), (3, 0)} & {
        source for k in (2, 3) for source in study.points[k].tried
    }  # one began from the other too


def test_impossible_points_are_kept_with_a_sentence(study: ho.Study) -> None:
    for k in (0, 1):
        assert study.points[k].outcome == IMPOSSIBLE
        assert "below the ground" in study.points[k].sentence
        assert study.points[k].clearance_m is None
    assert study.exit_code == 0
    assert len(study.as_dict()["failures"]) == 2


def test_best_and_parts(study: ho.Study) -> None:
    best = study.best
    assert best is not None
    assert best.clearance_m == max(p.clearance_m for p in study.points if p.clearance_m is not None)
    assert best.parts is not None
    assert sum(best.parts.values()) == pytest.approx(best.clearance_m, abs=1e-9)


def test_files_and_figures(study: ho.Study) -> None:
    with xr.open_dataset(study.folder / "sweep.nc", engine="h5netcdf") as data:
        assert dict(data.sizes) == {"leg.shank.length": 2, "leg.gear.ratio": 2}
        assert np.isnan(data["clearance_m"].values[0]).all()
        assert float(data["clearance_m"].values[1, 0]) == study.points[2].clearance_m
        assert data["clearance_m"].attrs["units"] == "m"
    assert len((study.folder / "table.csv").read_text().splitlines()) == 5
    (figure,) = study.plot().values()
    hatched = [patch for patch in figure.axes[0].patches if patch.get_hatch()]
    assert len(hatched) == 2  # the two cells without a hop


def test_failed_points_are_drawn_where_there_is_no_height(tmp_path: Path) -> None:
    """Below the axis' scale, in a strip without ticks, and the one height that there is well above it."""
    found = ho.read(stored_study(tmp_path, {"leg.shank.length": [0.361, 0.2]}, [0.73, None]).folder, ho.Study)
    (figure,) = found.plot().values()
    figure.draw_without_rendering()
    ax = figure.axes[0]
    (failed,) = [line for line in ax.get_lines() if line.get_label() == IMPOSSIBLE]
    low, high = ax.get_ylim()
    strip = low + 0.1 * (high - low)
    assert low + np.asarray(failed.get_ydata(), dtype=float)[0] * (high - low) < strip
    assert min(ax.get_yticks()) > strip
    assert found.best is not None
    assert found.best.clearance_m is not None
    assert found.best.clearance_m > strip


def test_a_finished_study_is_resumed_without_work(study: ho.Study) -> None:
    began = times(study.folder)
    design = ho.load("paper", [SHORT])
    vary = {"leg.shank.length": [0.2, 0.361], "leg.gear.ratio": [110, 130]}
    again = ho.sweep(design, vary, starts=1, processes=1, resume=study.folder)
    assert again.points == study.points
    assert times(study.folder) == began


def times(folder: Path) -> dict[str, int]:
    """When each finished point was written [ns]."""
    return {path.name: path.stat().st_mtime_ns for path in (folder / "points").glob("[0-9]*.json")}


def heeding_interrupts() -> None:
    """What a shell begins in the background ignores Ctrl-C, and all that it begins in turn."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@contextmanager
def begun(cwd: Path, *words: str) -> Iterator[tuple[subprocess.Popen[bytes], Path]]:
    """A sweep of its own process group, as soon as it has finished a point; and its folder."""
    environment, command = {**os.environ, "OMP_NUM_THREADS": "1"}, [*HOPOPT, *(words or SWEEP), "--processes", "2"]
    with subprocess.Popen(
        command, cwd=cwd, env=environment, start_new_session=True, stderr=subprocess.PIPE, preexec_fn=heeding_interrupts
    ) as running:
        try:
            (folder,) = wait_for(lambda: [f for f in cwd.glob("results/paper-sweep-*") if times(f)], running)
            yield running, folder
        finally:
            running.kill()  # nothing if it has ended


@pytest.mark.slow
def test_killed_at_any_instant_it_goes_on(tmp_path: Path) -> None:
    with begun(tmp_path) as (running, folder):
        running.send_signal(signal.SIGKILL)
        running.communicate(timeout=60)  # its workers end with it: until then they hold its output open
    before = times(folder)
    assert 1 <= len(before) < 3
    done = said("sweep", "--resume", str(folder), "--json", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stderr == ""  # silent when piped
    after = times(folder)
    assert {name: after[name] for name in before} == before
    assert len(after) == 3
    assert len(json.loads(done.stdout)["points"]) == 3
    assert {p.name for p in folder.iterdir()} >= {"study.json", "table.csv", "sweep.nc", "figures"}


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_interrupted_it_says_how_to_go_on(number: signal.Signals, tmp_path: Path) -> None:
    """And its processes end with it, which would hold its output open, and complain."""
    with begun(tmp_path, *MANY) as (running, folder):
        running.send_signal(number)
        words = running.communicate()[1].decode()
    assert running.returncode == 130, words
    assert beside_progress(words)[-1].endswith(f"hopopt sweep --resume {folder.relative_to(tmp_path)}")
    assert len(beside_progress(words)) == 1, words
    assert len(times(folder)) >= 1


@pytest.mark.slow
def test_a_leg_that_cannot_stand_is_not_solved(tmp_path: Path) -> None:
    asked = ["--vary", "leg.motor.max_torque=0.05,0.1", "--processes", "1", "--no-figures", "--json"]
    done = said("sweep", *asked, cwd=tmp_path)
    assert done.returncode == 1
    answer = json.loads(done.stdout)
    assert [p["outcome"] for p in answer["points"]] == [NOT_SOLVED] * 2
    assert all("to hold the start pose" in p["sentence"] for p in answer["points"])
    assert answer["best"] is None


@pytest.mark.slow
def test_points_that_stay_unverified_are_not_stated(tmp_path: Path) -> None:
    mesh = "solver.refine=false", "solver.stance_intervals=12", "solver.flight_intervals=12"
    sets = [word for entry in (SHORT, *mesh) for word in ("--set", entry)]
    done = said("sweep", *sets, "--vary", "leg.gear.ratio=100,110", "--starts", "1", "--json", cwd=tmp_path)
    assert done.returncode == 3, done.stderr
    for point in json.loads(done.stdout)["points"]:
        assert point["outcome"] == "not verified"
        assert point["clearance_m"] is None
        assert point["unverified_clearance_m"] > 0
        assert point["sentence"].startswith("failed: ")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--vary", "leg.gear.ration=1:2:3"], "did you mean ratio"),
        (["--vary", "leg.gear.ratio=3:2:3"], "lower < upper"),
        ([], "nothing is varied"),
        (["--vary", "leg.gear.ratio=1:2:3", "--processes", "0"], "at least 1"),
        (["--resume", "nowhere"], "no study to resume"),
        (["--vary", "leg.shank.length=0.05,0.1"], "no point of the study is a possible problem"),
    ],
)
def test_wrong_use_exits_with_2_and_a_sentence(tmp_path: Path, arguments: list[str], words: str) -> None:
    done = said("sweep", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert words in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def two_points() -> tuple[Definition, Neighbour]:
    """Of a study of two points, and the first one's hop."""
    definition = define(ho.load("paper", [SHORT, "solver.tolerance=1e-4"]), {"leg.gear.ratio": [115, 118]}, starts=1)
    first, begin = solve_point(definition, 0, [])
    assert first.verified
    return definition, Neighbour(0, 0, begin)


@pytest.mark.slow
def test_a_point_in_a_lower_optimum_is_solved_again_from_its_neighbours(
    two_points: tuple[Definition, Neighbour], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Made to say that it ended lower than it did: from its neighbours the optimum is found again, and refined once."""
    definition, source = two_points
    second, own = solve_point(definition, 1, [source])
    assert second.verified
    same, nothing = solve_again(definition, second, own, [source], 1)
    assert second.tried == ((0, 0),)
    assert (same.objective_value, same.corrected, same.tried) == (second.objective_value, False, ((0, 0),))
    assert (same.after_pass, same.solved_in, nothing) == (1, 0, {})
    lower = replace(second, objective_value=0.5, clearance_m=0.5)
    refined, refine = [], refine_and_verify
    monkeypatch.setattr(
        sweep_point, "refine_and_verify", lambda *given, **more: refined.append(given[1].name) or refine(*given, **more)
    )
    both = [source, Neighbour(2, 0, source.begin)]
    again, found = solve_again(definition, lower, {**own, "objective": np.array(0.5)}, both, 1)
    assert refined == ["point 0"]
    assert again.corrected
    assert again.clearance_m == pytest.approx(second.clearance_m, rel=1e-6)
    assert again.solved_in == 1
    np.testing.assert_allclose(found["shape"], own["shape"], atol=1e-6)
    unsearched = replace(lower, searched=False)
    again, found = solve_again(definition, unsearched, {**own, "objective": np.array(0.5)}, [], 1, search=True)
    assert (again.corrected, again.searched, again.found_by_search, again.begun_from) == (True, True, True, None)
    assert again.clearance_m == pytest.approx(second.clearance_m, rel=1e-5)
    np.testing.assert_allclose(found["shape"], own["shape"], atol=1e-3)


@pytest.mark.slow
def test_an_unsearched_point_follows_each_kind_that_its_neighbour_hands_on() -> None:
    """Planted: a neighbour whose best is another kind of hop, the best one beside it; where nothing leads on, it is searched."""
    definition = define(ho.load("paper", [SHORT]), {"leg.gear.ratio": [100, 101]}, starts=1)
    first, begin = solve_point(definition, 0, [])
    best, other = kinds(begin)[0], dict(kinds(begin)[0])
    other["shape"] = other["shape"] + 1.0
    planted = with_others(other | {"x": np.ones(3)}, [best])  # which leads nowhere
    point, _ = solve_point(definition, 1, [Neighbour(0, 0, planted)], search=False)
    assert (point.verified, point.searched, point.begun_from) == (True, False, 0)
    assert 0.99 < (point.objective_value or 0.0) / (first.objective_value or 1.0) < 1.0  # another ratio by 1 %
    alone, _ = solve_point(definition, 1, [Neighbour(0, 0, other | {"x": np.ones(3)})], search=False)
    assert (alone.verified, alone.searched, alone.begun_from) == (True, True, None)
    assert alone.objective_value == pytest.approx(point.objective_value, rel=1e-5)


@pytest.mark.slow
def test_a_neighbour_that_stops_leaves_the_others(
    two_points: tuple[Definition, Neighbour], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Planted: the first refinement stops; the other neighbour, or else the starts, lead to the point's hop."""
    definition, source = two_points
    refine = refine_and_verify
    for sources, led in (([source, Neighbour(2, 0, source.begin)], 2), ([source], None)):
        calls = iter([True, False, False])
        monkeypatch.setattr(
            sweep_point,
            "refine_and_verify",
            lambda *given, calls=calls, **more: stop() if next(calls) else refine(*given, **more),
        )
        point, _ = solve_point(definition, 1, sources)
        assert (point.verified, point.begun_from) == (True, led)


def stop() -> Never:
    raise SolverError("planted")
