"""Tests of a minute and more for what hardly a change breaks: run with HOPOPT_TESTS=all, as before a release."""

import os

import pytest

rarely = pytest.mark.skipif(
    os.environ.get("HOPOPT_TESTS") != "all", reason="a minute and more for what rarely breaks: HOPOPT_TESTS=all runs it"
)
