"""A command line as a user gives it, run in this process: to import what a command needs takes longer than most do."""

from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

from hopopt.cli.main import run


@dataclass(frozen=True)
class Said:
    """What a command ended with: its exit code, and what it wrote."""

    returncode: int
    stdout: str
    stderr: str


def said(*arguments: str, cwd: Path) -> Said:
    """Of a command run in a folder."""
    out, error = StringIO(), StringIO()
    with chdir(cwd), redirect_stdout(out), redirect_stderr(error):
        code = run([*arguments])
    return Said(code, out.getvalue(), error.getvalue())
