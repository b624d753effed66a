"""For all tests: functions are not compiled, and no user's cache is used, unless a test asks for it; what is solved once
in a run; and the paper's hop, solved so."""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: threads only get in each other's way

import shutil
from collections.abc import Iterator
from tempfile import mkdtemp
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from hopopt.planner.solution import Solution

FOLDER = "HOPOPT_TESTS_ONCE"  # of once.py, which imports what the controller of pytest-xdist does not need


def pytest_configure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):  # workers of pytest-xdist find it in their environment
        os.environ[FOLDER] = mkdtemp(prefix="hopopt-tests-")


def pytest_unconfigure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):
        shutil.rmtree(os.environ.pop(FOLDER, ""), ignore_errors=True)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What is run rarely is slow too, and left out unless HOPOPT_TESTS=all asks for it, as before a release."""
    skipped = pytest.mark.skip(reason="half a minute and more for what rarely breaks: HOPOPT_TESTS=all runs it")
    for item in items:
        if item.get_closest_marker("rarely"):
            item.add_marker("slow")
            if os.environ.get("HOPOPT_TESTS") != "all":
                item.add_marker(skipped)


@pytest.fixture(scope="session", autouse=True)
def nothing_compiled() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HOPOPT_CACHE", "off")
        yield


@pytest.fixture(scope="session", autouse=True)
def compared_once() -> Iterator[None]:
    """What stands beside an answer, the same strategies on the same leg in many tests, is simulated once in a run."""
    from once import simulated_once

    with pytest.MonkeyPatch.context() as patch:
        for user in ("compare", "paper_control"):
            patch.setattr(f"hopopt.comparison.{user}.simulate", simulated_once)
        yield


@pytest.fixture(scope="session")
def hop() -> "Solution":
    """The paper's leg on its default settings, from one start."""
    from once import solved_once

    return solved_once()
