"""The page of a robust hop: the promise in words, and every number that its file has."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hopopt as ho
from hopopt.cli import main as cli
from hopopt.report.robust import answer, robust_page
from hopopt.storage.runs import save_runs
from stored_results import ROBUST


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return save_runs("robust", ho.load("paper"), ROBUST, {}, tmp_path / "Größe und Höhe")


def test_every_number_is_that_of_the_file(folder: Path) -> None:
    text, data = robust_page(folder), json.loads((folder / "robust.json").read_text())
    stated = {key: float(value) for value, key in re.findall(r'<data value="([^"]*)" data-key="([^"]*)"', text)}
    assert {
        "clearance_m",
        "share",
        "confidence",
        "draws",
        "fell",
        "bound_m",
        "ideal_bound_m",
        "plan_m",
    } <= stated.keys()
    assert {"pd.force_tuck", "pd_fell.position_tuck", "reserve.torque", "rank", "lowest_m", "median_m"} <= stated.keys()
    for key, value in stated.items():
        table, _, name = key.partition(".")
        assert value == (data[table][name] if name else data[table])
    assert "one program for several legs" in text
    assert "387.4, 242 N m s/rad" in text
    assert not re.search(r"<(link|img|iframe)|<script[^>]*src|@import|url\(|(src|href)=", text)
    assert len(text.encode()) < 1_500_000


def test_the_promise_comes_first_in_plain_words(folder: Path) -> None:
    words = answer(ROBUST)
    assert words[0] == (
        "95 % of all legs within the stated uncertainty lift their lowest point at least 0.612 m above the ground, with "
        "confidence 90 %."
    )
    assert words[1] == "Of 60 simulated legs 2 fell."
    assert words[2].startswith("That is 80% of the bound")
    assert words[3] == "With the paper's PD control (force_tuck) the same share reaches 0.510 m."
    assert all(sentence in robust_page(folder).replace("&#39;", "'") for sentence in words)


@pytest.mark.parametrize(
    "damage", [{"way": "odd"}, {"feedback": [1.0]}, {"pd_fell": {}}, {"share": None}, {"reserve": 1}]
)
def test_a_damaged_file_is_said_in_a_sentence(
    folder: Path, damage: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "robust.json").write_text(json.dumps(ROBUST | damage), encoding="utf-8")
    assert cli.run(["report", str(folder), "-o", str(folder.parent / "page.html")]) == 2
    assert "incomplete or its files do not fit together" in " ".join(capsys.readouterr().err.split())


def test_every_leg_is_drawn_where_its_clearance_is(folder: Path) -> None:
    """Equal steps of clearance are equal steps of pixels, and the promise lies among the legs that it was made of."""
    text = robust_page(folder)
    places = np.array(re.findall(r'<circle class="dot"[^>]*cx="([\d.]+)"', text), dtype=float).reshape(3, -1)
    for row, heights in zip(places, ROBUST["clearances_m"].values(), strict=True):
        slope, offset = np.polyfit(np.sort(heights), row, 1)
        np.testing.assert_allclose(slope * np.sort(heights) + offset, row, atol=0.11)  # what is rounded, twice
    assert np.polyfit(np.sort(ROBUST["clearances_m"]["track"]), places[0], 1)[0] > 0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"plan_verified": False}, "No answer is stated: the plan was not verified."),
        ({"bound_m": None}, "Of 60 simulated legs 2 fell."),
        ({"pd": {}, "pd_fell": {}, "clearances_m": {}}, "What the legs reach"),
    ],
)
def test_what_is_missing_is_left_out(tmp_path: Path, change: dict[str, Any], words: str) -> None:
    text = robust_page(save_runs("robust", ho.load("paper"), ROBUST | change, {}, tmp_path))
    assert words in text
    assert ("bound_m" in change) == (">not verified<" in text)
    assert ("plan_verified" in change) == ("(not verified)" in text)


def test_the_command_writes_the_page_of_a_robust_hop(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    file = tmp_path / "robust.html"
    assert cli.run(["report", str(folder), "-o", str(file)]) == 0
    assert file.read_text(encoding="utf-8") == robust_page(folder)
    (folder / "robust.json").write_text('{"share": 1}')
    assert cli.run(["report", str(folder), "-o", str(tmp_path / "other.html")]) == 2
    assert "incomplete or its files do not fit together" in capsys.readouterr().err
    assert cli.run(["report", str(folder), str(folder), "-o", str(tmp_path / "other.html")]) == 2
    assert "a robust plan fills a page of its own" in capsys.readouterr().err
