"""For all tests: functions are not compiled, and no user's cache is used, unless a test asks for it; and the paper's hop,
solved once in each process."""

from collections.abc import Iterator

import pytest

from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.problem.load import load


@pytest.fixture(scope="session", autouse=True)
def nothing_compiled() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HOPOPT_CACHE", "off")
        yield


@pytest.fixture(scope="session")
def hop() -> Solution:
    """The paper's leg on its default settings, from one start."""
    return solve(load("paper"), starts=1, processes=1)
