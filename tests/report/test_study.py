"""The page of a study: numbers of its files, the best first, colours by limit; nothing that failed is left out."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

import hopopt as ho
from hopopt.cli import main as cli
from hopopt.report.study import answer, study_page
from hopopt.studies.sweep.definition import define
from hopopt.studies.sweep.point_file import NOT_SOLVED, VERIFIED
from hopopt.studies.sweep.run import Study, study_in
from hopopt.studies.sweep.shown import colors
from hopopt.studies.sweep.store import open_folder, save_point
from stored_results import point, stored_study

LARGEST = 1_500_000  # bytes


class Parts(HTMLParser):
    """Figures by key, rows of tables as texts, marks of points, titles, and all words of a page."""

    def __init__(self, text: str):
        super().__init__()
        self.figures: dict[str, float] = {}
        self.rows: list[list[str]] = []
        self.marks: list[dict[str, str | None]] = []
        self.fills: list[tuple[str, str]] = []
        self.words = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        given = dict(attrs)
        if tag == "data" and "data-key" in given:
            self.figures[given["data-key"]] = float(given["value"])
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th") and self.rows:
            self.rows[-1].append("")
        if tag == "g":
            self.marks.append(given)
        if tag in ("rect", "circle") and self.marks and "fill" in given.get("style", ""):
            self.fills.append((str(self.marks[-1].get("data-limit")), given["style"]))

    def handle_endtag(self, tag: str) -> None:
        if tag == "tr":
            self.rows[-1].append("")  # for what follows the row

    def handle_data(self, data: str) -> None:
        self.words += f" {data}"
        if self.rows and self.rows[-1]:
            self.rows[-1][-1] += data


@pytest.fixture
def curve(tmp_path: Path) -> Study:
    """Over one entry, two points of it without a hop, in a folder with a space and an umlaut in its name."""
    return stored_study(
        tmp_path / "Größe und Höhe", {"leg.gear.ratio": "60:140:5"}, [0.81, 0.8234567, None, 0.79, None]
    )


def test_a_stored_study_is_shown_as_a_table(curve: Study, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["show", str(curve.folder)]) == 0
    shown = capsys.readouterr().out
    assert "0.8235" in shown
    assert "best: leg.gear.ratio = 80" in shown


def test_every_number_is_that_of_the_study(curve: Study) -> None:
    data, found = json.loads((curve.folder / "study.json").read_text()), Parts(study_page(curve.folder))
    known = {f"points.{p['index']}.clearance_m": p["clearance_m"] for p in data["points"] if p["clearance_m"]}
    assert found.figures == known
    assert [row[0] for row in found.rows if row[0][:1].isdigit()] == ["1 (best)", "0", "3", "2", "4"]
    assert [row[1] for row in found.rows if row[0][:1].isdigit()] == ["80", "60", "120", "100", "140"]
    for p in data["points"]:
        (row,) = [row for row in found.rows if row[0].split(" ")[0] == str(p["index"])]
        assert row[-2] == p["outcome"]
        assert p["outcome"] == VERIFIED or f"Point {p['index']}, {p['outcome']}: {p['sentence']}" in found.words
        assert row[3] == (p["limit"] or "")


def test_the_best_point_comes_first_in_plain_words(curve: Study) -> None:
    words = answer(study_in(curve.folder))
    assert words[0] == "Best is leg.gear.ratio = 80: the leg lifts its lowest point 0.8235 m above the ground."
    assert words[1:] == ["What holds it back most: knee operating region.", "3 of 5 points have a verified hop."]
    assert all(sentence in Parts(study_page(curve.folder)).words for sentence in words)


def test_the_best_at_an_end_is_said_to_be_there(tmp_path: Path) -> None:
    study = stored_study(tmp_path, {"leg.gear.ratio": "60:100:3"}, [0.9, 0.8, 0.7])
    assert "It has leg.gear.ratio at the least that was tried: better may lie beyond." in answer(study)


def test_marks_have_the_colour_of_their_limit_and_failures_are_drawn(curve: Study) -> None:
    found, by_limit = Parts(study_page(curve.folder)), colors(curve)
    assert [mark.get("data-limit") for mark in found.marks] == [p.limit or None for p in curve.points]
    assert found.fills == [(limit, f"fill:{by_limit[limit]}") for p in curve.points if (limit := p.limit)]
    assert len(set(by_limit.values())) == 2


def test_a_map_has_a_cell_for_each_point_where_its_values_are(tmp_path: Path) -> None:
    """Wider values lie further to the right, longer ones further up; the table in the file is the same."""
    vary = {"leg.gear.ratio": [100, 60, 80], "leg.thigh.length": [0.3, 0.35]}
    study = stored_study(tmp_path, vary, [0.7, 0.71, 0.72, None, 0.74, 0.75])
    text = study_page(study.folder)
    cells = re.findall(r'class="cell[^>]*x="([\d.]+)" y="([\d.]+)" width="([\d.]+)" height="([\d.]+)"', text)
    assert len(cells) == len(study.points)
    for p, cell in zip(study.points, cells, strict=True):
        x, y, width, height = map(float, cell)
        (a, ax), (b, bx) = ((q, float(c[0])) for q, c in zip(study.points[2:6:2], cells[2:6:2], strict=True))
        assert width > 0
        assert height > 0
        if a.values["leg.gear.ratio"] < b.values["leg.gear.ratio"]:
            assert ax < bx
        others = [float(c[1]) for q, c in zip(study.points, cells, strict=True) if q.values["leg.thigh.length"] == 0.35]
        assert y >= max(others)
        assert x + width <= 640
        assert (p.values["leg.thigh.length"] == 0.35) == (y in others)


def test_an_unfinished_study_says_what_is_missing(curve: Study) -> None:
    for path in (curve.folder / "points").glob("000[34]-0.json"):
        path.unlink()
    assert answer(study_in(curve.folder))[-1] == (
        "2 of 5 points have a verified hop. Not finished: 2 (hopopt sweep --resume goes on)."
    )
    assert "points.1.clearance_m" in Parts(study_page(curve.folder)).figures


def test_a_study_without_a_verified_hop_states_no_best(tmp_path: Path) -> None:
    study = stored_study(tmp_path, {"leg.gear.ratio": "60:100:3"}, [None, None, None])
    words, page = answer(study), study_page(study.folder)
    assert words == ["No best point is stated: no point has a verified hop.", "0 of 3 points have a verified hop."]
    assert not Parts(page).figures
    assert "no verified hop" in page


def test_another_objective_is_stated_with_its_unit(tmp_path: Path) -> None:
    study = stored_study(tmp_path, {"leg.gear.ratio": "60:100:3"}, [20.0, 30.0, 25.0], objective="energy")
    found = Parts(study_page(study.folder))
    assert found.figures["points.0.objective_value"] == 20.0
    assert "Best is leg.gear.ratio = 60, with the least energy: 20 J." in found.words


def test_entries_that_vary_say_so_among_the_parameters(tmp_path: Path) -> None:
    vary = {"leg.gear.ratio": [80, 100], "hop.stance_duration[1]": [0.2, 0.3]}
    study = stored_study(tmp_path, vary, [0.7, 0.71, 0.72, 0.73])
    rows = {row[0]: row[1] for row in Parts(study_page(study.folder)).rows if len(row) > 1}
    assert rows["leg.gear.ratio"] == "varied: 80, 100"
    assert rows["hop.stance_duration"] == "varied [1]: 0.2, 0.3"
    assert rows["leg.body.mass"] == f"{study.definition.design.leg.body.mass:g}"


@pytest.mark.parametrize(("name", "points"), [("large", 1100), ("five entries", 1100)])
def test_a_large_study_stays_a_small_page_without_network(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, points: int
) -> None:
    monkeypatch.setattr("os.fsync", lambda descriptor: None)  # a thousand files
    entries = ["leg.gear.ratio", "leg.thigh.length", "leg.shank.length", "leg.body.mass", "leg.shank.mass"]
    count = 2 if name == "large" else 5
    vary = {
        entry: (0.9 * ho.load("paper").leg.gear.ratio, 120) if "ratio" in entry else (0.3, 0.4)
        for entry in entries[:count]
    }
    definition = define(ho.load("paper"), vary, sample=f"lhs:{points}")
    kept = tuple(point(definition, k, 0.6 + 1e-5 * k) for k in range(points))
    text = _page_of(Study(definition, kept, tmp_path, 0.0), tmp_path)
    assert len(text.encode()) < LARGEST
    assert not re.search(r"<(link|img|iframe)|<script[^>]*src|@import|url\(|(src|href)=", text)
    assert Parts(text).figures[f"points.{points - 1}.clearance_m"] == kept[-1].clearance_m
    if points > 500:
        assert f"{points - 500} more points are in table.csv" in text


def _page_of(study: Study, results: Path) -> str:
    """The page of a study of which only the last points are in files of their own; the others are read as from them."""
    folder = open_folder(study.definition, results)
    for p in study.points:
        save_point(folder, p, {})
    return study_page(folder)


def test_a_point_that_was_changed_is_not_shown(curve: Study, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    path = curve.folder / "points" / "0001-0.json"
    path.write_text(path.read_text().replace("0.8234567", "0.9234567"))
    assert cli.run(["report", str(curve.folder), "-o", str(tmp_path / "page.html")]) == 2
    assert "was changed after it was written" in capsys.readouterr().err


def test_what_a_user_wrote_is_text_and_not_markup(tmp_path: Path) -> None:
    definition = define(ho.load("paper"), {"leg.gear.ratio": "60:100:3"})
    folder = open_folder(definition, tmp_path)
    save_point(folder, replace(point(definition, 0, None, NOT_SOLVED), sentence="<script>alert(1)</script>"), {})
    assert "<script>alert(1)" not in study_page(folder)


def test_the_command_writes_the_page(curve: Study, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    file = tmp_path / "study.html"
    assert cli.run(["report", str(curve.folder), "-o", str(file), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"written": [str(file)], "exit_code": 0}
    assert file.read_text(encoding="utf-8") == study_page(curve.folder)
    assert cli.run(["animate", str(curve.folder), "-o", str(tmp_path / "hop.gif")]) == 2
    assert "this is a study" in capsys.readouterr().err
