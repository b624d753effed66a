"""Figures that README and docs state, measured again by the command that they are of."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from hopopt.cli.main import run

ROOT = Path(__file__).parents[2]
QUICK = ("--no-figures", "--json")
ONE = ("--starts", "1", *QUICK)
PAPER = ("solve", *ONE)
SOFT = ("solve", "--hop", "periodic", "--set", "hop.touchdown_loss=1", *ONE)
ONTO = ("transition", "--set", "contact.friction=0.6", "--set", "hop.touchdown_loss=3", *QUICK)
GEAR = ("solve", "--free", "leg.gear.ratio=50:200", *ONE)
STATED = (  # the page, words with a figure in them, the command, and where in its answer the figure is
    ("README", r"clearance (0\.\d+) m, verified", PAPER, "clearance_m"),
    ("README", r"COM height at lift-off (0\.\d+)", PAPER, "parts.com_height_at_lift_off_m"),
    ("README", r"ballistic rise (0\.\d+)", PAPER, "parts.ballistic_rise_m"),
    ("README", r"simulation: (0\.\d+) m", PAPER, "paper_strategy.clearance_m"),
    (
        "README",
        r"(0\.\d+) in place of 0\.80 m",
        ("solve", "--set", "contact.friction=0.7", "--starts", "2", *QUICK),
        "clearance_m",
    ),
    ("error", r"controls (\d\S+) ", PAPER, "objective_error.estimate.controls"),
    ("error", r"sum (\d\S+) m", PAPER, "objective_error.estimate.too_high_by"),
    ("structure", r"The paper's hop has (\d+) directions", PAPER, "second_order.*"),
    ("structure", r"directions\. (\d+) are flat", PAPER, "second_order.flat"),
    ("method", r"between the nodes: (\d+) \+", PAPER, "mesh.-1.intervals.stance"),
    ("method", r"between the nodes: \d+ \+ (\d+)", PAPER, "mesh.-1.intervals.flight"),
    ("bound", r"and lower than (\d\.\d+) m", PAPER, "upper_bound.clearance_m"),
    ("periodic", r"hop\.touchdown_loss=1` \| (0\.\d+) m", SOFT, "clearance_m"),
    ("periodic", r"in place \| 0\.662 m \| 1 \| (0\.\d+) s", ONTO, "duration_s"),
    ("codesign", r"becomes 50, and the clearance (\d\.\d+) m", GEAR, "clearance_m"),
)
LATELY = {"error": 0.3, "method": 0.1}  # relative: errors and meshes differ a little between machines
answers: dict[tuple[str, ...], dict[str, Any]] = {}


def answer(words: tuple[str, ...], capfd: pytest.CaptureFixture[str]) -> dict[str, Any]:
    """What a command prints as JSON; each is run once."""
    if words not in answers:
        assert run([*words]) == 0
        answers[words] = json.loads(capfd.readouterr().out)
    return answers[words]


def at(data: Any, path: str) -> float:
    """The number at a path of keys and places; a star adds up the counts of a table."""
    for key in path.split("."):
        if key == "*":
            return float(sum(data[name] for name in ("worse", "flat", "better")))
        data = data[int(key)] if isinstance(data, list) else data[key]
    return float(data)


DEAR = ("periodic",)  # pages of which a command takes half a minute


@pytest.mark.slow
@pytest.mark.parametrize(
    ("page", "words", "command", "path"),
    [pytest.param(*row, marks=[pytest.mark.rarely] if row[0] in DEAR else []) for row in STATED],
    ids=lambda x: x if isinstance(x, str) else "",
)
def test_a_stated_figure_is_that_of_its_command(
    page: str,
    words: str,
    command: tuple[str, ...],
    path: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """To the digits that are stated."""
    monkeypatch.chdir(tmp_path)
    place = ROOT / "README.md" if page == "README" else ROOT / "docs" / f"{page}.md"
    text = re.sub(r"\s+", " ", place.read_text(encoding="utf-8"))
    found = re.search(words, text)
    assert found, words
    stated, digits = float(found[1]), len(found[1].partition(".")[2])
    allowed = LATELY[page] * stated if page in LATELY else 0.6 * 10.0**-digits
    assert at(answer(command, capfd), path) == pytest.approx(stated, abs=allowed)
