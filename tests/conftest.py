"""For all tests: functions are not compiled, and no user's cache is used, unless a test asks for it; what is solved once
in a run; and the paper's hop, solved so."""

import os
import shutil
from collections.abc import Iterator
from tempfile import mkdtemp

import pytest

from hopopt.planner.solution import Solution
from once import FOLDER, solved_once


def pytest_configure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):  # workers of pytest-xdist find it in their environment
        os.environ[FOLDER] = mkdtemp(prefix="hopopt-tests-")


def pytest_unconfigure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):
        shutil.rmtree(os.environ.pop(FOLDER, ""), ignore_errors=True)


@pytest.fixture(scope="session", autouse=True)
def nothing_compiled() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HOPOPT_CACHE", "off")
        yield


@pytest.fixture(scope="session")
def hop() -> Solution:
    """The paper's leg on its default settings, from one start."""
    return solved_once()
