"""Pages in a real browser: no error, nothing from the network, nothing cut or overlapping, controls by mouse and
keyboard, and what axe finds of accessibility. Needs the extra ``browser`` and a Chromium on the PATH; nothing is downloaded."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import hopopt as ho
from hopopt.comparison.compare import compare
from hopopt.planner.solution import Solution
from hopopt.report.result import page_of
from hopopt.storage.runs import save_runs
from hopopt.storage.solution import save
from stored_results import ROBUST, stored_study

api = pytest.importorskip("playwright.sync_api", reason="pages in a browser need pip install 'hopopt[browser]'")
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="pages in a browser need a Chromium on the PATH"),
]
PAGES = ("solve", "comparison", "curve", "map", "robust")
WIDTHS = {"desktop": 1280, "phone": 390}
LEAST = 8.0  # [pixels]: text that is smaller cannot be read


@pytest.fixture(scope="module")
def pages(hop: Solution, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A page of each kind of result, in a folder with spaces and umlauts in its name."""
    home = tmp_path_factory.mktemp("Größe und Höhe")
    made = compare(hop.design, ["force"], bound=hop)
    traces = {name: figures.trace for name, figures in made.figures.items()}
    folders = {
        "solve": save(hop, home).result_dir,
        "comparison": save_runs("comparison", hop.design, made.as_dict(), traces, home),
        "curve": stored_study(home, {"leg.gear.ratio": "60:140:5"}, [0.81, 0.82, None, 0.79, None]).folder,
        "map": stored_study(
            home,
            {"leg.gear.ratio": [60, 80, 100], "leg.thigh.length": [0.3, 0.35]},
            [0.7, 0.71, 0.72, None, 0.74, 0.75],
        ).folder,
        "robust": save_runs("robust", ho.load("paper"), ROBUST, {}, home),
    }
    for name, folder in folders.items():
        assert folder is not None
        (home / f"{name} Höhe.html").write_text(page_of([folder]), encoding="utf-8")
    return {name: home / f"{name} Höhe.html" for name in folders}


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with api.sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield chromium
        chromium.close()


@contextmanager
def opened(browser: Any, file: Path, width: int = 1280) -> Iterator[Any]:
    """The page in a window of a width [pixels]; no message of an error, no request but for the file itself."""
    context, faults = browser.new_context(viewport={"width": width, "height": 900}), list[str]()
    window = context.new_page()
    window.on("console", lambda message: faults.append(message.text) if message.type in ("error", "warning") else None)
    window.on("pageerror", lambda error: faults.append(str(error)))
    window.on("request", lambda asked: faults.append(asked.url) if asked.url != file.as_uri() else None)
    window.goto(file.as_uri())
    yield window
    assert not faults
    context.close()


CUT = """() => [...document.querySelectorAll("svg text")].filter((text) => {
  const a = text.getBoundingClientRect(), b = text.ownerSVGElement.getBoundingClientRect();
  return a.left < b.left - 1 || a.right > b.right + 1 || a.top < b.top - 1 || a.bottom > b.bottom + 1;
}).map((text) => text.textContent)"""
OVERLAPPING = """() => [...document.querySelectorAll("svg")].flatMap((svg) => {
  const texts = [...svg.querySelectorAll(".tick, .label, .value")], found = [];
  const box = (text) => text.getBoundingClientRect();
  for (const [k, one] of texts.entries()) for (const other of texts.slice(k + 1)) {
    const a = box(one), b = box(other), inset = 2;
    if (a.left + inset < b.right && b.left + inset < a.right && a.top + inset < b.bottom && b.top + inset < a.bottom)
      found.push(one.textContent + " over " + other.textContent);
  }
  return found;
})"""
SMALL = """() => Math.min(99, ...[...document.querySelectorAll("svg text")].map((text) =>
  parseFloat(getComputedStyle(text).fontSize) * text.ownerSVGElement.getBoundingClientRect().width
  / text.ownerSVGElement.viewBox.baseVal.width))"""


@pytest.mark.parametrize("width", WIDTHS.values(), ids=WIDTHS)
@pytest.mark.parametrize("name", PAGES)
def test_nothing_is_cut_or_overlaps_and_text_can_be_read(
    browser: Any, pages: dict[str, Path], name: str, width: int
) -> None:
    """The page is as wide as its window; wide tables scroll on their own."""
    with opened(browser, pages[name], width) as window:
        assert window.evaluate("document.documentElement.scrollWidth") <= width
        assert window.evaluate(CUT) == []
        assert window.evaluate(OVERLAPPING) == []
        assert window.evaluate(SMALL) >= LEAST


@pytest.mark.parametrize("name", PAGES)
def test_print_shows_all_and_cuts_no_table(browser: Any, pages: dict[str, Path], name: str) -> None:
    with opened(browser, pages[name], 720) as window:
        assert window.pdf(format="A4").startswith(b"%PDF")
        window.emulate_media(media="print")
        assert window.evaluate("[...document.querySelectorAll('details')].every((d) => d.open)")
        assert window.evaluate("document.documentElement.scrollWidth") <= 720


def test_the_hop_moves_by_keyboard(browser: Any, pages: dict[str, Path]) -> None:
    """Space plays and pauses, the arrows go on and back; the leg is drawn elsewhere then, and the slider says when."""
    with opened(browser, pages["comparison"]) as window:
        legs = "[...document.querySelectorAll('.leg')].map((leg) => leg.getAttribute('points'))"
        before = window.evaluate(legs)
        window.keyboard.press("ArrowRight")
        assert window.locator("#now").inner_text() == "0.010 s"
        window.keyboard.press("ArrowLeft")
        assert window.evaluate(legs) == before
        window.keyboard.press("Space")
        assert window.locator("#play").get_attribute("aria-pressed") == "true"
        window.wait_for_function("Number(document.getElementById('scrub').value) > 0.05")
        window.keyboard.press("Space")
        assert window.locator("#play").inner_text() == "Play"
        moved = window.evaluate(legs)
        assert all(a != b for a, b in zip(before, moved, strict=True))
        order = []
        for _ in range(3):
            window.keyboard.press("Tab")
            order.append(window.evaluate("document.activeElement.id"))
        assert order == ["play", "scrub", "speed"]
        window.keyboard.press("ArrowUp")
        assert window.locator("#speed").input_value() == "1"


def test_the_hop_moves_by_mouse(browser: Any, pages: dict[str, Path]) -> None:
    with opened(browser, pages["solve"]) as window:
        box, end = window.locator("#scrub").bounding_box(), float(window.locator("#scrub").get_attribute("max"))
        window.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
        middle = float(window.locator("#scrub").input_value())
        assert middle == pytest.approx(0.5 * end, abs=0.02 * end)
        cursor = window.locator(".cursor").first
        assert window.evaluate(
            "Math.abs(Number(document.querySelector('.cursor').getAttribute('x1')) - Number(document.querySelector("
            "'svg.timed').dataset.x0) - Number(document.querySelector('svg.timed').dataset.xs) * Number("
            "document.getElementById('scrub').value)) < 0.01"
        )
        at = cursor.get_attribute("x1")
        window.click("#play")
        window.wait_for_function(f"Number(document.getElementById('scrub').value) > {middle + 0.03}")
        assert cursor.get_attribute("x1") != at
        window.click("#play")
        assert window.locator("#play").inner_text() == "Play"


def test_who_points_at_a_point_of_a_study_reads_what_it_is(browser: Any, pages: dict[str, Path]) -> None:
    with opened(browser, pages["curve"]) as window:
        titles = window.evaluate("[...document.querySelectorAll('svg g title')].map((title) => title.textContent)")
        assert titles[1] == "leg.gear.ratio = 80: 0.82 m, knee operating region"
        assert titles[2] == "leg.gear.ratio = 100: not verified"


@pytest.mark.parametrize("name", PAGES)
def test_axe_finds_nothing_serious(browser: Any, pages: dict[str, Path], name: str) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe needs pip install 'hopopt[browser]'")
    with opened(browser, pages[name]) as window:
        window.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
        found = axe.Axe().run(window).response["violations"]
        assert [f"{f['id']}: {f['nodes'][0]['html']}" for f in found if f["impact"] in ("serious", "critical")] == []
