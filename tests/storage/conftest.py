"""What is stored here, for what storing asks of a hop: the shorter, the sooner it is written, read and checked again."""

import pytest

from hopopt.planner.solution import Solution
from once import solved_once


@pytest.fixture(scope="session")
def hop() -> Solution:
    """The paper's leg in a stance of at most 0.2 s, from one start."""
    return solved_once({"hop.stance_duration": [0.03, 0.2]})
