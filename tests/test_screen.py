"""What a person sees on a screen of a given width, and what a pipe gets."""

import io
import re
from contextlib import redirect_stdout

import pytest

from hopopt.compare import compare
from hopopt.screen import console, print_lines
from hopopt.screen_runs import print_comparison
from hopopt.solution import Solution

LONG = "hip: " + ", then ".join(f"torque-speed line backward until 0.{k:03d} s" for k in range(100, 120))


class Screen(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture(autouse=True)
def _narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in {"COLUMNS": "80", "NO_COLOR": "1", "TERM": "xterm"}.items():
        monkeypatch.setenv(name, value)


def test_long_lines_go_on_below_their_beginning() -> None:
    with redirect_stdout(Screen()) as screen:
        print_lines(console(), "structure", [LONG, "ground: free"])
    first, *more, last = screen.getvalue().splitlines()
    assert first.startswith("  structure hip: torque-speed")
    assert all(line.startswith(" " * 14) and line[14] != " " for line in more)
    assert last == " " * 12 + "ground: free"
    assert max(map(len, (first, *more))) <= 80
    assert " ".join(line.strip() for line in (first, *more)) == f"structure {LONG}"


def test_a_pipe_gets_whole_lines(capsys: pytest.CaptureFixture[str]) -> None:
    print_lines(console(), "structure", [LONG])
    assert capsys.readouterr().out == f"  structure {LONG}\n"


def test_a_comparison_fits_a_narrow_screen(hop: Solution) -> None:
    found = compare(hop.design, ["force"], bound=hop).as_dict()
    with redirect_stdout(Screen()) as screen:
        print_comparison(found, "results/here")
    lines = re.sub(r"\x1b\[[0-9;]*m", "", screen.getvalue()).splitlines()
    assert max(map(len, lines)) <= 80
    assert not any("…" in line for line in lines)
    assert [len(line.split()) for line in lines if line.startswith("force ")] == [7, 10, 5]
