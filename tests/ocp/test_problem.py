"""What a multi-phase problem means by what it is given."""

import numpy as np
import pytest

from hopopt.ocp.problem import State

BOTH = {"lower": -1.0, "upper": 2.0}


@pytest.mark.parametrize(
    ("given", "lower", "upper"),
    [
        (None, [-1, -1], [2, 2]),
        (0.5, [0.5, 0.5], [0.5, 0.5]),
        ([0.0, 1.0], [0, 1], [0, 1]),
        (np.array([0.0, 1.0]), [0, 1], [0, 1]),
        (([0.0, 0.5], [1.0, 3.0]), [0, 0.5], [1, 2]),  # within the state's own bounds
        ((np.array([-5.0, 0.0]), [1.0, 1.0]), [-1, 0], [1, 1]),
    ],
)
@pytest.mark.parametrize("end", ["initial", "final"])
def test_bounds_at_an_end(end, given, lower, upper):
    found = State("q", 2, **BOTH, **{end: given}).end_bounds(end)
    np.testing.assert_array_equal(found, [lower, upper])


@pytest.mark.parametrize("given", [(0.0, 1.0), (0, [1.0]), (np.zeros(2),), ([0.0], [1.0], [2.0]), ()])
@pytest.mark.parametrize("end", ["initial", "final"])
def test_a_tuple_that_may_be_values_or_bounds_is_refused(end, given):
    with pytest.raises(TypeError, match="values as a list, bounds as two lists"):
        State("q", 2, **{end: given})
