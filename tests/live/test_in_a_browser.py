"""The live page in a real browser, by keyboard, at two widths, and what axe finds. Needs the extra ``browser`` and a Chromium."""

import json
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

api = pytest.importorskip("playwright.sync_api", reason="pages in a browser need pip install 'hopopt[browser]'")
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="pages in a browser need a Chromium on the PATH"),
]
WORD = "document.getElementById('word').textContent"
MOST_S = 120_000  # ms that a verification may take on a busy machine


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Of a page that the command serves."""
    home = tmp_path_factory.mktemp("live")
    options = ["--entry", "leg.gear.ratio", "--entry", "leg.body.mass", "--starts", "1", "--no-browser", "--json"]
    command = [sys.executable, "-m", "hopopt", "explore", "paper", *options, "--results", str(home / "results")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, cwd=home, text=True) as served:
        assert served.stdout is not None
        yield json.loads(served.stdout.readline())["address"]
        served.send_signal(signal.SIGINT)
        try:
            assert served.wait(30) == 0
        finally:
            served.kill()  # it does not hear the signal where this run itself was begun without it
    assert list(Path(home / "results").glob("paper-*/solution.nc"))


@pytest.fixture(scope="module")
def window(address: str) -> Iterator[Any]:
    """A window of it, once the first hop is verified; no message of an error."""
    faults = list[str]()
    with api.sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = chromium.new_context(bypass_csp=True, viewport={"width": 1280, "height": 900}).new_page()
        page.on("console", lambda message: faults.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on(
            "request", lambda asked: faults.append(asked.url) if not asked.url.startswith(("data:", address)) else None
        )
        page.goto(address)
        page.wait_for_function(f"{WORD} === 'verified'", timeout=MOST_S)
        yield page
        chromium.close()
    assert not faults


def test_a_number_is_dragged_by_keyboard(window: Any) -> None:
    """The word is preliminary at first and verified later, and the list has both designs."""
    before = window.inner_text("#value")
    window.locator("input[type=range]").first.focus()
    for _ in range(10):
        window.keyboard.press("ArrowLeft")
    window.wait_for_function(f"{WORD} === 'preliminary'", timeout=MOST_S)
    assert window.inner_text("#value") != before
    assert "estimated error" in window.inner_text("#error")
    window.wait_for_function(f"{WORD} === 'verified'", timeout=MOST_S)
    assert window.locator("#designs tr").count() == 2
    window.locator("#designs input").first.check()
    window.wait_for_function("document.querySelectorAll('.bones.beside').length === 1")
    window.locator("#undo").focus()
    window.keyboard.press("Enter")
    window.wait_for_function(
        f"{WORD} === 'verified' && document.getElementById('value').textContent === '{before}'", timeout=MOST_S
    )


@pytest.mark.parametrize("width", [1280, 390])
def test_nothing_is_wider_than_the_window_and_axe_finds_nothing(window: Any, width: int) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe needs pip install 'hopopt[browser]'")
    window.set_viewport_size({"width": width, "height": 900})
    assert window.evaluate("document.documentElement.scrollWidth") <= width
    assert [v["id"] for v in axe.Axe().run(window).response["violations"]] == []
