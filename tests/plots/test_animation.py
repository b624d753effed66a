"""Moving pictures: they move as the hop does, loop, and are there whole or not at all."""

import json
import shutil
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from hopopt.cli import main as cli
from hopopt.errors import ResultError, UsageError
from hopopt.planner.solution import Solution
from hopopt.plots import animation
from hopopt.plots.animation import HOLD, PICTURE_RATE, animate, instants, moving_svg, poses
from hopopt.problem.load import changed
from hopopt.report.motion import ShownHop, planned
from hopopt.storage.solution import save

FAST = 0.5  # twice as fast as the hop: few pictures
SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def shown(hop: Solution) -> ShownHop:
    return planned(hop, "optimum & more")


def test_poses_are_those_of_the_plan(hop: Solution, shown: ShownHop) -> None:
    times = np.array([0.0, 0.123, 0.4567, hop.duration, 2.0])
    s = hop.sample(np.minimum(times, hop.end))  # the picture stays at the end
    expected = np.stack([s.points[name] for name in ("hip", "knee", "foot")], axis=1)
    np.testing.assert_allclose(poses(shown, times), expected, atol=1e-4)


def test_cranks_and_rods_move_with_the_leg(hop: Solution) -> None:
    """Lengths are kept and ends meet pivot and shank; SVG and report have a line for them."""
    links = {"crank": 0.06, "rod": 0.38, "arm": 0.06, "ahead": False}
    shown = planned(replace(hop, design=changed(hop.design, {"leg.knee.transmission.five_bar": links})), "five-bar")
    (bar,), chain = shown.bars.swapaxes(0, 1), shown.chain
    np.testing.assert_allclose(np.linalg.norm(np.diff(bar, axis=1), axis=2), [[0.06, 0.38]] * len(bar), atol=1e-9)
    along = chain[:, 2] - chain[:, 1]
    arm = chain[:, 1] + 0.06 * along / np.linalg.norm(along, axis=1, keepdims=True)
    np.testing.assert_allclose(bar[:, [0, 2]], np.stack([chain[:, 0], arm], axis=1), atol=1e-9)
    assert moving_svg([shown], "a leg", FAST).count('attributeName="points"') == 2


@pytest.mark.slow
def test_a_gif_has_a_picture_for_each_instant_and_loops(shown: ShownHop, tmp_path: Path) -> None:
    animate([shown], "a leg", tmp_path / "hop.gif", FAST)
    with Image.open(tmp_path / "hop.gif") as picture:
        lasts = 0.0
        for k in range(picture.n_frames):  # type: ignore[attr-defined]
            picture.seek(k)
            lasts += picture.info["duration"]
        assert picture.info["loop"] == 0
    assert lasts == pytest.approx(1000 * (FAST * shown.t[-1] + HOLD), abs=2 * 1000 / PICTURE_RATE)
    assert (tmp_path / "hop.gif").stat().st_size < 1_000_000
    assert [path.name for path in tmp_path.iterdir()] == ["hop.gif"]


def test_an_svg_moves_the_foot_from_the_ground_to_the_clearance(hop: Solution, shown: ShownHop) -> None:
    """In pixels: the last height of the foot over its first is the clearance, by the scale of the ticks of the axis."""
    root = ET.fromstring(moving_svg([shown, shown], "a leg", FAST))
    legs = [a for a in root.iter(f"{SVG}animate") if a.get("attributeName") == "points"]
    assert len(legs) == 2
    values = str(legs[0].get("values")).split(";")
    assert len(values) == len(instants([shown], FAST))
    foot = [float(value.split(" ")[-1].split(",")[1]) for value in (values[0], values[-1])]
    ticks = [
        (float(str(t.text)), float(str(t.get("y")))) for t in root.iter(f"{SVG}text") if t.get("text-anchor") == "end"
    ]
    (low, under), (high, over) = min(ticks), max(ticks)
    scale = (under - over) / (high - low)
    assert (foot[0] - foot[1]) / scale == pytest.approx(hop.clearance, abs=2e-3)
    assert f"optimum & more: {hop.clearance:.3f} m" in [t.text for t in root.iter(f"{SVG}text")]


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="an MP4 file needs ffmpeg")
def test_an_mp4_is_written(shown: ShownHop, tmp_path: Path) -> None:
    animate([shown], "a leg", tmp_path / "hop.mp4", FAST)
    assert b"ftyp" in (tmp_path / "hop.mp4").read_bytes()[:16]


@pytest.mark.parametrize(
    ("name", "message"),
    [("hop.mp4", "needs ffmpeg, which is not installed"), ("hop.avi", "is a .gif, .mp4 or .svg file")],
)
def test_what_cannot_be_written_is_said_before_it_is_drawn(
    shown: ShownHop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, message: str
) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(UsageError, match=message):
        animate([shown], "a leg", tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_what_fails_halfway_leaves_nothing(shown: ShownHop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> str:
        raise KeyboardInterrupt

    monkeypatch.setattr(animation, "moving_svg", fails)
    with pytest.raises(KeyboardInterrupt):
        animate([shown], "a leg", tmp_path / "hop.svg")
    assert not list(tmp_path.iterdir())


def test_the_command_writes_once(hop: Solution, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    folder, file = save(hop, tmp_path / "results").result_dir, tmp_path / "hop.svg"
    assert cli.run(["animate", str(folder), "-o", str(file), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"written": [str(file)], "exit_code": 0}
    assert cli.run(["animate", str(folder), "-o", str(file)]) == 2
    assert "is not overwritten" in capsys.readouterr().err
    assert cli.run(["animate", str(folder), "--slower", "0"]) == 2
    assert "from 1 to 100" in capsys.readouterr().err


def test_a_folder_that_is_a_file_is_not_called_the_file_that_is_there(shown: ShownHop, tmp_path: Path) -> None:
    (tmp_path / "films").write_text("", encoding="utf-8")
    with pytest.raises(ResultError, match="cannot be written"):
        animate([shown], "hop", tmp_path / "films" / "hop.svg")
