"""The command that writes a problem file to start from: new."""

import os
from pathlib import Path

from hopopt.cli.options import write_new
from hopopt.errors import UsageError
from hopopt.problem.load import template


def new(name: str) -> int:
    """Write a problem file for a leg of your own, with comments.

    It is NAME.toml. An existing file is never overwritten.

    Parameters
    ----------
    name
        Name of the problem, with or without .toml; may lie in a folder: legs/mine.
    """
    if name.endswith(("/", os.sep)) or Path(name).name in ("", "..", ".toml"):
        raise UsageError(f'"{name}" names no file: give a name such as mine, or legs/mine')
    path = Path(name if name.endswith(".toml") else f"{name}.toml")
    write_new(path, template(path.stem))
    print(f"{path} written. Change it, then: hopopt solve {path}")
    return 0
