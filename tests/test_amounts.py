"""What fills a computer is refused in a sentence, before the work; what may be asked for is not."""

from collections.abc import Callable

import pytest

import hopopt as ho
from hopopt import amounts
from hopopt.cli.main import run
from hopopt.errors import UsageError
from hopopt.global_search.search import LARGEST, NODE, check_size

TOO_MUCH = (
    "solve --starts 1001", "solve --processes 100000", "solve --draws 1000000", "families --starts 100000",
    "families --processes 100000", "pareto --starts 100000", "pareto --processes 100000",
    "sweep --vary leg.gear.ratio=80,100 --starts 100000", "sweep --vary leg.gear.ratio=80,100 --processes 100000",
    "sweep --vary leg.gear.ratio=80:100:1000000", "sweep --vary leg.gear.ratio=80:100 --sample lhs:1000000",
    "simulate --hops 1000000", "compare --draws 1000000", "compare --tune 1000000", "compare --hop periodic --hops 1000000",
    "evidence --starts 1000000", "evidence --processes 100000", "evidence --grids 100000", "evidence --global --nodes 1000",
    "robust --draws 1000000", "robust --evaluations 1000000", "robust --starts 1000000", "sensitivity --starts 1000000",
    "calibrate --processes 100000", "tune --evaluations 1000000", "tune --processes 100000", "pareto --points 1000000",
    "tune --seed -1", "robust --seed -1", "compare --draws 3 --seed -1", "compare --hop periodic --draws 3 --seed -1",
    "transition --starts 1000000", "transition --most 1000000", "animate x --slower 1000000",
)  # fmt: skip


@pytest.mark.parametrize("line", TOO_MUCH)
def test_too_much_is_refused_at_once(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(line.split()) == 2
    said = capsys.readouterr().err
    assert any(word in said for word in ("at most", "memory", " to ")), said


@pytest.mark.parametrize(
    "ask",
    [
        lambda: ho.solve("paper", starts=1001),
        lambda: ho.robust("paper", draws=1_000_000),
        lambda: ho.sweep("paper", {"leg.gear.ratio": [80.0, 100.0]}, starts=1001),
        lambda: ho.pareto("paper", points=1_000_000),
    ],
)
def test_so_it_is_in_python(ask: Callable[[], object]) -> None:
    with pytest.raises(UsageError, match=r"at most|possible"):
        ask()


def test_memory_is_estimated_and_compared_with_the_computers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(amounts, "memory", lambda: 4e9)
    check_size(61)
    with pytest.raises(UsageError, match=r"81 nodes on each axis would take about 6.9 GB .* has 4 GB: choose fewer"):
        check_size(LARGEST)
    amounts.check_processes(8)
    with pytest.raises(UsageError, match=r"--processes 100 would take about 25 GB .* ask for 13 at most"):
        amounts.check_processes(100)


def test_a_computer_that_does_not_say_its_memory_may_be_asked_for_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(amounts, "memory", lambda: float("inf"))
    check_size(LARGEST)
    amounts.check_processes(1000)


def test_the_memory_of_a_grid_is_what_it_takes() -> None:
    """Layers of 20 steps and the first, four second differences, three states of four numbers, all of four bytes."""
    assert 4 * (21 + 4 + 12) <= NODE <= 1.2 * 4 * (21 + 4 + 12)
