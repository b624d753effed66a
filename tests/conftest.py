"""For all tests: libraries of compiled functions are kept beside pytest's own cache, not in the user's."""

import os

import pytest


def pytest_configure(config: pytest.Config) -> None:
    os.environ.setdefault("HOPOPT_CACHE", str(config.rootpath / ".pytest_cache" / "hopopt"))
