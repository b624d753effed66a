"""For tests of the Python interface: the paper's hop, and a comparison with it, as a user has them."""

import pytest

import hopopt as ho
from hopopt.planner import solution


@pytest.fixture(scope="module")
def hop(hop: solution.Solution) -> ho.Solution:
    return ho.Solution.with_methods(hop)


@pytest.fixture(scope="module")
def comparison(hop: ho.Solution) -> ho.Comparison:
    return hop.compare("force")
