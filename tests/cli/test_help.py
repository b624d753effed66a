"""What a newcomer sees first: `hopopt` alone, and the commands in groups, one line each on 80 columns."""

import inspect
import re
import subprocess
import sys

import pytest

from hopopt.cli.main import COMMANDS, app, run

WIDE = 80  # columns of the terminal
FLAGS = ["--help", "--install-completion", "--version"]


@pytest.fixture(autouse=True)
def terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", str(WIDE))


def test_every_group_has_its_title_and_every_command_its_line(capsys: pytest.CaptureFixture[str]) -> None:
    """In the order of the table; a line that is too long would go on below, without a name."""
    assert run(["--help"]) == 0
    shown: dict[str, list[str]] = {}
    rows: list[str] = []
    for line in capsys.readouterr().out.splitlines():
        assert len(line) <= WIDE
        if title := re.fullmatch(r"╭─ (.+?) ─+╮", line):
            rows = shown.setdefault(title[1], [])
        elif row := re.fullmatch(r"│ (.*) │", line):
            name, _, text = row[1].partition("  ")
            assert text.strip().endswith("."), line
            rows.append(name.split()[0])
    expected = {title: list(commands) for title, commands in COMMANDS.items()}
    expected[next(reversed(expected))] += FLAGS
    assert shown == expected
    assert list(shown) == list(COMMANDS)
    assert sum(map(len, shown.values())) == len(set().union(*shown.values()))  # each in one group


def test_hopopt_alone_names_the_three_commands_to_begin_with(capsys: pytest.CaptureFixture[str]) -> None:
    assert run([]) == 0
    said = capsys.readouterr().out
    assert re.findall(r"^  hopopt (\w+)", said, re.M) == ["solve", "new", "compare"]
    assert "hopopt --help" in said
    assert all(len(line) <= WIDE for line in said.splitlines())


@pytest.mark.parametrize("name", [name for commands in COMMANDS.values() for name in commands])
def test_a_command_s_own_help_has_all_its_docstring_and_options(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Its line in the list, which is in the table so that the list imports nothing, is the first paragraph alone."""
    assert run([name, "--help"]) == 0
    said = re.sub(r"[│\s]+", " ", capsys.readouterr().out)
    docstring = inspect.getdoc(app[name].default_command)
    assert docstring is not None
    assert docstring.splitlines()[0] == next(commands[name][1] for commands in COMMANDS.values() if name in commands)
    assert " ".join(docstring.partition("Parameters\n")[0].split()) in said
    assert all(option in said for argument in app[name].assemble_argument_collection() for option in argument.names)


def test_a_command_is_imported_when_it_runs() -> None:
    """And no other; neither the list of commands nor a name that is none imports any."""
    modules = sorted({f"hopopt.cli.{module}" for commands in COMMANDS.values() for module, _ in commands.values()})
    code = (
        "import sys, hopopt.cli.main as c; c.run([]); c.run(['--version']); c.run(['--help']); c.run(['sovle']);"
        "c.run(['actuators', '--wrong']);"
        f"print([name for name in {modules} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "['hopopt.cli.setup.actuators']"
