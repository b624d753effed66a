"""For all tests: functions are not compiled, and no user's cache is used, unless a test asks for it; what is solved once
in a run; the paper's hop, solved so; and the order in which two workers take files."""

import gc
import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: threads only get in each other's way

import shutil
from collections.abc import Iterator
from tempfile import mkdtemp
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from hopopt.planner.solution import Solution

FIRST = (  # files of over ten seconds: two workers end together; the first two compile different loops, which others then find
    "comparison/test_compare.py", "global_search/test_search.py", "optimality/test_certificate_hop.py",
    "optimality/test_error_estimate.py", "nlp/test_compiled.py", "verify/test_plan.py", "plots/test_hop.py",
    "studies/test_sensitivity.py", "robot_data/test_identification.py", "cli/test_main.py", "sim/test_plant.py",
    "api/test_interface.py", "sim/test_rough_ground.py", "plots/test_runs.py", "control/test_tracking.py",
)  # fmt: skip
FOLDER = "HOPOPT_TESTS_ONCE"  # of once.py, which imports what the controller of pytest-xdist does not need
MADE = pytest.StashKey[str]()  # the folder, where this run made it and removes it


def pytest_configure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):  # workers of pytest-xdist find it in their environment
        if not os.environ.get(FOLDER):  # .ci/run gives one that its two suites share
            os.environ[FOLDER] = config.stash[MADE] = mkdtemp(prefix="hopopt-tests-")
        config.option.loadscopereorder = False  # of pytest-xdist, which would take files of many short tests first


def pytest_unconfigure(config: pytest.Config) -> None:
    if made := config.stash.get(MADE, None):
        del os.environ[FOLDER]
        shutil.rmtree(made, ignore_errors=True)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What is run rarely is slow too, and left out unless HOPOPT_TESTS=all asks for it, as before a release."""
    place = {f"tests/{name}": k for k, name in enumerate(FIRST)}
    items.sort(key=lambda item: place.get(item.nodeid.split("::")[0], len(FIRST)))
    skipped = pytest.mark.skip(reason="half a minute and more for what rarely breaks: HOPOPT_TESTS=all runs it")
    for item in items:
        if item.get_closest_marker("rarely"):
            item.add_marker("slow")
            if os.environ.get("HOPOPT_TESTS") != "all":
                item.add_marker(skipped)


def pytest_collection_finish() -> None:
    """Garbage is searched for as seldom as in a command (cli/main.py). Nothing is frozen: Hypothesis asks who refers to its
    random numbers, and a frozen module is not found."""
    gc.set_threshold(100_000)


@pytest.fixture(scope="session", autouse=True)
def nothing_compiled() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HOPOPT_CACHE", "off")
        yield


@pytest.fixture(scope="session", autouse=True)
def made_once() -> Iterator[None]:
    """What stands beside an answer, the same strategies on the same leg in many tests, is simulated once in a run; files of
    equal content are made once."""
    from once import file_once, simulated_once

    with pytest.MonkeyPatch.context() as patch:
        for user in ("compare", "paper_control"):
            patch.setattr(f"hopopt.comparison.{user}.simulate", simulated_once)
        patch.setattr("hopopt.storage.solution.to_bytes", file_once)
        yield


@pytest.fixture(scope="session")
def hop() -> "Solution":
    """The paper's leg on its default settings, from one start."""
    from once import solved_once

    return solved_once()
