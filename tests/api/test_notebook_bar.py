"""What long calls do unasked and when asked: a bar in a notebook, a time limit, a folder for what was found."""

import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import hopopt as ho
from hopopt.api.asked import told
from hopopt.errors import ResultError, UsageError
from hopopt.planner import solution

CHEAP = {"solver.stance_intervals": 8, "solver.flight_intervals": 4, "solver.refine": False}


class Shell:
    """As much of a notebook's shell as a bar uses: what it shows, and functions that are called when a cell has ended."""

    def __init__(self) -> None:
        self.kernel, self.shown, self.ends = object(), list[dict[str, Any]](), list[Callable[[], None]]()
        self.display_pub = SimpleNamespace(publish=lambda **what: self.shown.append(what))
        self.events = SimpleNamespace(
            register=lambda name, function: self.ends.append(function),
            unregister=lambda name, function: self.ends.remove(function),
        )


def test_a_notebook_shows_a_bar_unasked_that_goes_with_its_cell(monkeypatch: pytest.MonkeyPatch) -> None:
    shell = Shell()
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    say = told(None)
    say("the highest <hop>")
    say("points: 2 of 8 done")
    assert "the highest &lt;hop&gt;" in shell.shown[0]["data"]["text/html"]
    assert '<progress value="2" max="8">' in shell.shown[1]["data"]["text/html"]
    assert [what["update"] for what in shell.shown] == [False, True]
    assert len({what["transient"]["display_id"] for what in shell.shown}) == 1
    for end in list(shell.ends):
        end()
    assert shell.shown[-1]["data"]["text/html"] == ""
    assert not shell.ends
    told(False)("nothing is said")
    said = list[str]()
    told(said.append)("to a function")
    assert (len(shell.shown), said) == (3, ["to a function"])


def test_elsewhere_nothing_is_said_unasked(capsys: pytest.CaptureFixture[str]) -> None:
    told(None)("a line")
    assert capsys.readouterr() == ("", "")


def test_a_study_ends_at_its_time_limit_and_goes_on(tmp_path: Path) -> None:
    """The time is up before a point is begun; resumed, the study is that of one go."""
    problem, vary = ho.load("paper", CHEAP), {"leg.gear.ratio": [95.0, 100.0]}
    begun = ho.sweep(problem, vary, starts=1, processes=1, results=str(tmp_path), time_limit=1e-6)
    assert not begun.points
    whole = ho.sweep(problem, vary, starts=1, processes=1, resume=str(begun.folder))
    assert len(whole.points) == 2
    assert ho.read(whole.folder, ho.Study).points == whole.points
    with pytest.raises(UsageError, match="time_limit = -1: seconds above 0 are needed"):
        ho.sweep(problem, vary, time_limit=-1.0)


def test_a_choice_ends_at_its_time_limit_and_says_what_was_not_begun(tmp_path: Path) -> None:
    pair = ["maxon-ec90-flat-260", "csf-25-50"]
    found = ho.choose("paper", 0.3, only=pair, processes=1, results=str(tmp_path), time_limit=1e-6)
    assert [(c.outcome, c.sentence) for c in found.candidates] == [
        ("not solved", "the time limit was reached before it")
    ]
    assert found.exit_code == 1
    assert found.folder is not None
    assert (found.folder / "sweep.json").is_file()  # from which it goes on


def test_a_comparison_is_kept_and_says_what_its_time_did_not_do(hop: solution.Solution, tmp_path: Path) -> None:
    found = ho.Solution.with_methods(hop).compare("force", "position", time_limit=1e-6, results=str(tmp_path))
    assert found.notes == tuple(f"the time limit was reached before {s} was simulated" for s in ("force", "position"))
    assert found.folder is not None
    assert ho.read(found.folder, ho.Comparison).notes == found.notes


def test_a_folder_that_cannot_be_written_is_said_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ResultError, match="results cannot be written"):
        ho.solve("paper", results=tmp_path / "file")
