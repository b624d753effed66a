"""For all tests: functions are not compiled, and no user's cache is used, unless a test asks for it."""

from collections.abc import Iterator

import pytest


@pytest.fixture(scope="session", autouse=True)
def nothing_compiled() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HOPOPT_CACHE", "off")
        yield
