"""Files that commands write: whole or not at all."""

import resource
from pathlib import Path

import pytest

from hopopt.cli.main import run
from hopopt.cli.options import write_new
from hopopt.errors import UsageError


def test_a_file_that_cannot_be_written_whole_is_not_there(tmp_path: Path) -> None:
    """As on a disk that is full: the system refuses more than a thousand bytes."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(UsageError, match="cannot be written"):
            write_new(tmp_path / "plan.csv", 100_000 * "x")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert not list(tmp_path.iterdir())


def test_a_file_that_is_there_stays_as_it_is(tmp_path: Path) -> None:
    file = tmp_path / "plan.csv"
    write_new(file, "mine")
    with pytest.raises(UsageError, match="is not overwritten"):
        write_new(file, "other")
    assert file.read_text(encoding="utf-8") == "mine"


def test_a_folder_that_is_a_file_is_not_called_the_file_that_is_there(tmp_path: Path) -> None:
    (tmp_path / "legs").write_text("", encoding="utf-8")
    with pytest.raises(UsageError, match="cannot be written"):
        write_new(tmp_path / "legs" / "mine.toml", "mine")


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["--friction", "0.6"], "Try: --set contact.friction=0.6,"),
        (["--hip-height=0.3"], "Try: --set start.hip_height=0.3,"),
        (["--ratio", "80"], "Try: --set leg.gear.ratio=80,"),
        (["--frction", "0.6"], "Try: hopopt solve --help"),
    ],
)
def test_an_entry_given_as_an_option_is_told_how_to_set(
    words: list[str], meant: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["solve", "paper", *words]) == 2
    assert meant in capsys.readouterr().err


@pytest.mark.parametrize("words", [["solve", "--objective", "energi"], ["pareto", "--against", "energi"]])
def test_a_misspelt_objective_is_told_the_nearest(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(words) == 2
    assert "(did you mean energy?)" in capsys.readouterr().err
