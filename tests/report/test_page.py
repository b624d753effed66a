"""The page of a result: its numbers are those of the stored files, what moves on it is the hop, and it needs no network."""

import json
import math
import re
import shutil
import subprocess
import time
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hopopt.cli import main as cli
from hopopt.comparison.compare import Comparison, compare
from hopopt.planner.solution import Solution
from hopopt.report.chart import Chart, round_numbers
from hopopt.report.content import content_of, of_solutions
from hopopt.report.html import written
from hopopt.report.page import page
from hopopt.storage.runs import read_runs, save_runs
from hopopt.storage.solution import save

ROUNDED = 1e-4  # m, rad/s, N m: what is drawn
LARGEST = 1_500_000  # bytes
NODE = shutil.which("node")
COARSE = ["--starts", "1", "--no-figures", "--set", "solver.refine=false"]


class Numbers(HTMLParser):
    """Every ``data`` element: (key, value, text); and the text of the page."""

    def __init__(self, text: str):
        super().__init__()
        self.found: list[tuple[dict[str, str | None], str]] = []
        self.words: list[str] = []
        self.inside = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.inside = tag == "data"
        if self.inside:
            self.found.append((dict(attrs), ""))

    def handle_endtag(self, tag: str) -> None:
        self.inside = False

    def handle_data(self, data: str) -> None:
        self.words.append(data)
        if self.inside:
            self.found[-1] = (self.found[-1][0], data)


def at(data: Any, key: str) -> Any:
    """A figure of a JSON file by its dotted key."""
    for name in key.split("."):
        data = data[name]
    return data


def digits(text: str) -> float:
    """By how much a printed number may be off: half of its last digit."""
    mantissa, _, power = text.lower().partition("e")
    return 0.5 * 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2])) * (1 + 1e-9)


@pytest.fixture(scope="module")
def stored(hop: Solution, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A solved hop, in a folder with a space and an umlaut in its name."""
    folder = save(hop, tmp_path_factory.mktemp("Größe und Höhe")).result_dir
    assert folder is not None
    return folder


@pytest.fixture(scope="module")
def compared(hop: Solution) -> Comparison:
    return compare(hop.design, ["force"], bound=hop)


@pytest.fixture(scope="module")
def comparison(compared: Comparison, hop: Solution, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The paper's PD control beside the optimum, as hopopt compare stores it."""
    traces, results = {name: f.trace for name, f in compared.figures.items()}, tmp_path_factory.mktemp("compared")
    folder = save_runs("comparison", hop.design, compared.as_dict(), traces, results)
    save(hop, folder)
    return folder


def test_a_stored_comparison_is_shown_as_a_table(comparison: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["show", str(comparison)]) == 0
    shown, data = capsys.readouterr().out, json.loads((comparison / "comparison.json").read_text())
    for name, row in data["strategies"].items():
        assert re.search(rf"{name} +{row['clearance_m']:.3f}", shown)
    assert cli.run(["show", str(comparison), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["strategies"] == data["strategies"]


def test_a_second_report_names_another_file(
    stored: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.run(["report", str(stored.resolve())]) == 0
    assert cli.run(["report", str(stored.resolve())]) == 2
    assert "report.html exists already and is not overwritten: choose another name, such as -o report_2.html" in (
        capsys.readouterr().err
    )


@pytest.fixture(scope="module")
def text(stored: Path) -> str:
    return page(content_of([stored]))


# ---- numbers ------------------------------------------------------------------------------------------------


def test_every_number_is_that_of_the_summary(stored: Path, text: str) -> None:
    summary = json.loads((stored / "summary.json").read_text(encoding="utf-8"))
    found = Numbers(text).found
    keys = {str(attributes["data-key"]) for attributes, _ in found if "data-key" in attributes}
    assert {"parts.ballistic_rise_m", "lift_off.vertical_m_s", "peak_ground_force_N"} <= keys
    for attributes, shown in found:
        value = float(str(attributes["value"]))
        known = at(summary, key) if (key := attributes.get("data-key")) else None
        gain = summary["gain_per_percent_m"][name] if (name := attributes.get("data-gain")) else known
        assert value == gain
        assert float(shown) == pytest.approx(value, abs=digits(shown) if "g" not in shown else 0, rel=0.05)
    assert len([a for a, _ in found if "data-gain" in a]) == len(summary["gain_per_percent_m"])
    words = " ".join(Numbers(text).words)
    assert f"can lift its foot {summary['clearance_m']:.3f} m above the ground" in words
    assert f"{sum(c['passed'] for c in summary['verification'])} of {len(summary['verification'])} checks" in words
    assert all(check["name"] in words for check in summary["verification"])


def test_a_comparison_has_every_strategy_with_the_numbers_of_its_file(comparison: Path) -> None:
    data, numbers = json.loads((comparison / "comparison.json").read_text()), Numbers(page(content_of([comparison])))
    for attributes, _ in numbers.found:
        key = str(attributes.get("data-key", ""))
        if key.startswith("strategies."):
            assert float(str(attributes["value"])) == at(data, key)
    row = data["strategies"]["force"]
    sentence = f"The best controller that keeps all limits, force, reaches {row['clearance_m']:.3f} m"
    assert sentence in " ".join(numbers.words)
    assert "First-order optimality" in " ".join(numbers.words)  # of the optimum that lies in its folder


# ---- what moves ---------------------------------------------------------------------------------------------


def moving(text: str) -> list[dict[str, np.ndarray]]:
    """What the script moves."""
    found = re.search(r'<script type="application/json" id="hops">(.*?)</script>', text, re.S)
    assert found
    return [{name: np.array(rows) for name, rows in hop.items()} for hop in json.loads(found[1])]


def test_links_keep_their_lengths_and_the_last_instant_is_the_clearance(hop: Solution, text: str) -> None:
    (shown,) = moving(text)
    chain = shown["chain"].reshape(len(shown["t"]), -1, 2)
    lengths = np.hypot(*np.moveaxis(np.diff(chain, axis=1), -1, 0))
    expected = [hop.design.leg.link[name].length for name in hop.design.leg.links]
    np.testing.assert_allclose(lengths, np.broadcast_to(expected, lengths.shape), atol=2 * ROUNDED)
    assert chain[-1, :, 1].min() == pytest.approx(hop.clearance, abs=ROUNDED)
    stance = shown["t"] < hop.lift_off
    np.testing.assert_allclose(chain[stance, -1], 0.0, atol=ROUNDED)
    assert shown["t"][-1] == pytest.approx(hop.duration, abs=ROUNDED)
    np.testing.assert_array_equal(shown["force"][~stance], 0.0)


def test_operating_points_lie_in_their_regions(hop: Solution, comparison: Path) -> None:
    """The optimum and the paper's control, whose torques the drives clamp."""
    for shown in moving(page(content_of([comparison]))):
        for k, joint in enumerate(hop.design.leg.joints):
            use = np.array(hop.region(joint).use(shown["v"][:, k], shown["tau"][:, k]))
            assert use.max() < 1 + 1e-3


def test_runs_are_read_back_as_they_were(comparison: Path, compared: Comparison) -> None:
    runs = read_runs(comparison, "comparison")
    for name, figures in compared.figures.items():
        for array in ("t", "q", "v", "motor", "f", "contact"):
            np.testing.assert_array_equal(getattr(runs.traces[name], array), getattr(figures.trace, array))
        assert runs.traces[name].times_of("lift-off") == figures.trace.times_of("lift-off")
        assert runs.traces[name].outcome == figures.trace.outcome


SCRIPT = """
const fs = require("fs"), given = JSON.parse(fs.readFileSync(0, "utf8")), listeners = {};
class Element {
  constructor(dataset = {}, inner = {}) { this.dataset = dataset; this.inner = inner; this.attributes = {}; }
  setAttribute(name, value) { this.attributes[name] = value; }
  querySelector(name) { return this.inner[name]; }
  querySelectorAll(name) { return this.inner[name] ?? []; }
  addEventListener(kind, f) { (listeners[this.id] ??= {})[kind] = f; }
}
const named = (id, more) => Object.assign(new Element(), { id }, more);
const ids = { hops: { textContent: given.hops }, play: named("play"), scrub: named("scrub", { max: "0.7", value: "0" }),
  now: named("now"), speed: named("speed", { value: "1" }) };
const map = { x0: "10", xs: "100", y0: "200", ys: "-50" };
const scene = new Element({ hop: "0", ...map }, { ".leg": new Element(), ".body": new Element(), ".force": new Element() });
const dot = Object.assign(new Element({ hop: "0", joint: "1" }), { ownerSVGElement: new Element(map) });
const timed = new Element(map, { ".cursor": new Element() });
let frame = null, clock = 0;
global.performance = { now: () => clock };
global.requestAnimationFrame = (f) => { frame = f; };
global.document = { body: {}, getElementById: (id) => ids[id], addEventListener: (kind, f) => { listeners[kind] = f; },
  querySelectorAll: (what) => ({ "svg.scene": [scene], "circle.dot": [dot], "svg.timed": [timed] })[what] };
new Function(given.script)();
const out = [], note = () => out.push([Number(ids.scrub.value), dot.attributes.cx, dot.attributes.cy,
  scene.inner[".leg"].attributes.points, timed.inner[".cursor"].attributes.x1, ids.play.textContent ?? ""]);
note();
ids.scrub.value = "0.3"; listeners.scrub.input(); note();
listeners.keydown({ target: document.body, key: "ArrowRight", preventDefault() {} }); note();
ids.play.click = () => listeners.play.click();
listeners.keydown({ target: document.body, key: " ", preventDefault() {} });
clock = 100; frame(clock); note();
listeners.play.click(); note();
console.log(JSON.stringify(out));
"""


@pytest.mark.skipif(NODE is None, reason="the page's script needs node to be run here")
def test_the_script_moves_the_leg_by_slider_keys_and_play(text: str) -> None:
    """Under a stand-in for a browser's document: positions are those of the hop at the time shown."""
    given = {
        "hops": re.search(r'id="hops">(.*?)</script>', text, re.S)[1],  # type: ignore[index]
        "script": text.rpartition("<script>")[2].partition("</script>")[0],
    }
    assert NODE
    done = subprocess.run([NODE, "-e", SCRIPT], input=json.dumps(given), capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    noted, (hop,) = json.loads(done.stdout), moving(text)
    assert [round(row[0], 9) for row in noted] == [0.0, 0.3, 0.31, 0.41, 0.41]
    assert [row[5] for row in noted][-2:] == ["Pause", "Play"]
    for t, cx, cy, points, cursor, _ in noted:
        assert cx == pytest.approx(10 + 100 * np.interp(t, hop["t"], hop["v"][:, 1]))
        assert cy == pytest.approx(200 - 50 * np.interp(t, hop["t"], hop["tau"][:, 1]))
        assert cursor == pytest.approx(10 + 100 * t)
        foot = [float(x) for x in points.split(" ")[-1].split(",")]
        expected = [np.interp(t, hop["t"], hop["chain"][:, k]) for k in (-2, -1)]
        assert foot == pytest.approx([10 + 100 * expected[0], 200 - 50 * expected[1]])


# ---- the file -----------------------------------------------------------------------------------------------


def test_the_page_is_one_small_file_without_network(comparison: Path) -> None:
    began = time.process_time()
    text = page(content_of([comparison]))
    assert time.process_time() - began < 1.0
    assert len(text.encode()) < LARGEST
    assert not re.search(r"<(link|img|iframe)|<script[^>]*src|@import|url\(|(src|href)=", text)
    assert "fetch(" not in text


def test_what_a_user_wrote_is_text_and_not_markup(hop: Solution) -> None:
    evil = hop.noted(design=hop.design.model_copy(update={"title": "<script>alert(1)</script>"}))
    text = page(of_solutions([evil]))
    assert "<script>alert(1)" not in text
    assert "&lt;script&gt;alert(1)" in text


def test_parameters_are_written_as_a_problem_file_has_them() -> None:
    known = {None: "not set", 0.28 + 1e-16: "0.28", 1e-05: "1e-05", True: "true", ("hip", "knee"): "[hip, knee]"}
    assert [written(value) for value in known] == list(known.values())


def test_ticks_are_round_and_curves_keep_within_their_axes() -> None:
    assert round_numbers(0.0, 0.72) == [0.0, 0.2, 0.4, 0.6]
    assert round_numbers(-213.0, 213.0) == [-200.0, -100.0, 0.0, 100.0, 200.0]
    chart = Chart((-1.0, 3.0), (2.0, 7.0), 400, 300, "x", "y")
    left, right, top, bottom = chart.frame
    assert chart.line([-1.0, 3.0], [2.0, 7.0]) == f"{left:.1f},{bottom:.1f} {right:.1f},{top:.1f}"
    assert all(math.isclose((x - chart.x_zero) / chart.x_scale, float(label)) for x, label in chart.ticks("x"))


# ---- the commands -------------------------------------------------------------------------------------------


def test_report_writes_a_page_and_never_over_another(
    stored: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    file = tmp_path / "Höhe 1" / "report.html"
    assert cli.run(["report", str(stored), "-o", str(file), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"written": [str(file)], "exit_code": 0}
    written = file.read_text(encoding="utf-8")
    assert written.startswith("<!doctype html>")
    assert cli.run(["report", str(stored), "-o", str(file)]) == 2
    assert "is not overwritten" in capsys.readouterr().err
    assert file.read_text(encoding="utf-8") == written


def test_solve_writes_the_page_beside_the_answer(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """Of a hop that is not verified it states no answer."""
    assert cli.run(["solve", *COARSE, "--report", "--json", "--results", str(tmp_path)]) == 3
    folder = Path(json.loads(capsys.readouterr().out)["result_dir"])
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert "No answer is stated: the hop was not verified." in text
    assert "parts.ballistic_rise_m" not in text
    assert "better than the optimum" not in text


def test_what_has_no_page_is_said_in_a_sentence(
    stored: Path, comparison: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    study, broken = tmp_path / "study", tmp_path / "broken"
    study.mkdir()
    (study / "sweep.json").write_text("{")
    broken.mkdir()
    (broken / "comparison.json").write_text("{")
    cases = {
        (): "give a folder that hopopt solve or hopopt compare wrote",
        (str(study),): "the study cannot be read",
        (str(stored), str(study)): "a study fills a page of its own",
        (str(broken),): "cannot be read",
        (str(comparison), str(stored)): "a comparison fills a page of its own",
        (str(stored),) * 5: "5 results do not fit on one page",
        (str(tmp_path / "none"),): "there is no such folder",
    }
    for folders, message in cases.items():
        assert cli.run(["report", *folders, "-o", str(tmp_path / "page.html")]) == 2
        assert message in capsys.readouterr().err
    assert not (tmp_path / "page.html").exists()


def test_hops_in_folders_of_one_name_are_told_apart(hop: Solution, tmp_path: Path) -> None:
    kept = [save(hop, tmp_path / where) for where in ("mine", "yours")]
    names = [shown.name for shown in of_solutions(kept).hops]
    assert names == [str(s.result_dir) for s in kept]
    assert len(set(names)) == 2
