"""How long a command is expected to take: from its parts, from commands before it, and from itself."""

import json
from contextlib import nullcontext
from pathlib import Path

import pytest

from hopopt.cli.expected_time import FILE, PARTS, SHORTEST, ExpectedTime
from hopopt.cli.screen import console
from hopopt.problem.load import load


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache folder of this test alone."""
    monkeypatch.setenv("HOPOPT_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def expected(points: float = 8.0, within: float | None = None, problem: str = "paper") -> ExpectedTime:
    return ExpectedTime("pareto", load(problem), {"solve": 1.0, "point of a front": points}, within)


def test_the_same_question_takes_as_long_as_the_last_time(cache: Path) -> None:
    parts = PARTS["solve"] + 8 * PARTS["point of a front"]
    assert expected().seconds == pytest.approx(parts)
    assert not cache.exists()  # nothing was run: nothing is kept
    expected().keep(300.0)
    assert expected().seconds == 300.0
    assert expected().first == "about 5 min, as the last time"


def test_another_question_takes_longer_where_commands_take_longer(cache: Path) -> None:
    """Four times as long the last time counts as twice as long the next: one command may have been an exception."""
    before = expected(20.0).seconds
    expected().keep(4 * expected().seconds)
    assert expected(20.0).seconds == pytest.approx(2 * before, rel=1e-3)
    assert expected(problem="a1_leg").seconds == pytest.approx(2 * (PARTS["solve"] + 8 * PARTS["point of a front"]))


def test_a_limit_of_its_own_bounds_it_and_is_no_measure(cache: Path) -> None:
    assert expected(within=25.0).seconds == 25.0
    expected(within=25.0).keep(26.0)
    assert not cache.exists()


def test_what_is_short_is_not_spoken_of() -> None:
    short = ExpectedTime("tune", load("paper"), {"simulated hop": 0.5 * SHORTEST / PARTS["simulated hop"]})
    assert short.first == short.left(1.0) == ""


@pytest.mark.parametrize("text", ["", "[]", '{"pace": "x", "last": {}}', '{"pace": 1e9, "last": {}}', '{"pace": 1}'])
def test_a_file_that_is_not_that_counts_as_none(text: str, cache: Path) -> None:
    known = expected().seconds
    cache.mkdir(mode=0o700)
    (cache / FILE).write_text(text)
    assert expected().seconds == known
    expected().keep(50.0)
    assert json.loads((cache / FILE).read_text())["last"]


def test_it_is_said_first_and_counted_down(
    cache: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """On standard error; what is left of the whole goes down, whatever a step says of itself."""
    told, clock = list[str](), iter([0.0, 10.0, 40.0, 200.0, 200.0])
    monkeypatch.setattr(console, "_one_line", lambda quiet: nullcontext(told.append))
    monkeypatch.setattr(console.time, "monotonic", lambda: next(clock))
    with console.progress(False, expected()) as say:
        assert capsys.readouterr().err == f"hopopt: about {expected().seconds:.0f} s\n"
        for _ in range(3):
            say("point 1 of 8")
    assert [words.split(":")[0] for words in told] == [
        "about 57 s left in all", "about 27 s left in all", "longer than expected"
    ]  # fmt: skip
    assert expected().seconds == 200.0


def test_what_was_stopped_is_not_kept(cache: Path) -> None:
    with pytest.raises(KeyboardInterrupt), console.progress(True, expected()):
        raise KeyboardInterrupt
    assert not cache.exists()
