"""What a command says that refuses what it is given."""

from collections.abc import Sequence

import pytest

from hopopt.cli.main import run


def refusal(words: Sequence[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Its one sentence on standard error, beside exit code 2."""
    assert run(list(words)) == 2
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1
    return said
