"""Direct refinement: the same answers as refinement, against closed forms and on the leg."""

import numpy as np
import pytest

from hopopt.nlp.accuracy import interval_errors
from hopopt.nlp.backoff import PRICE, passed, price, tightened
from hopopt.nlp.ipopt import Bounds, NlpSolver
from hopopt.nlp.mesh import uniform
from hopopt.nlp.refine import Aims
from hopopt.nlp.refine_direct import DirectRefinement
from hopopt.nlp.schemes import Scheme, radau
from known_problems import SCHEMES, Known, brachistochrone, bryson_denham
from test_refine import ALLOWED, bang_bang, first

each_scheme = pytest.mark.parametrize("method", SCHEMES, ids=lambda s: s.name)


@each_scheme
@pytest.mark.parametrize("intervals", [7, 10])
def test_bang_bang_is_neither_beaten_nor_missed(method: Scheme, intervals: int) -> None:
    """The double integrator has no error: what keeps the limits cannot be faster, and gives away the price at most."""
    known = bang_bang()
    refinement = DirectRefinement(first(known, method, uniform(intervals)), Aims(1e-6, 1e-4, ALLOWED, 20, 300))
    refinement.run()
    end = refinement.history[-1]
    assert refinement.reached
    assert end.excess <= ALLOWED
    assert known.optimum * (1 - ALLOWED) <= end.objective <= known.optimum * (1 + 2 * PRICE)
    assert price(refinement.solution) <= PRICE


@pytest.mark.parametrize(
    "known", [brachistochrone(), bryson_denham(path=True)], ids=["brachistochrone", "bryson-denham"]
)
def test_aims_are_met_or_it_says_so(known: Known) -> None:
    refinement = DirectRefinement(first(known, radau(3), uniform(8)), Aims(1e-7, 1e-5, ALLOWED, 20, 300))
    refinement.run()
    assert refinement.reached
    errors = [interval_errors(refinement.solution, name) for name in refinement.solution.phases]
    assert max(e.local.max() for e in errors) <= 1e-7
    assert max(e.excess.max() for e in errors) <= ALLOWED
    assert refinement.history[-1].objective == pytest.approx(known.optimum, rel=1e-4)


def test_without_meshes_nothing_is_reached() -> None:
    refinement = DirectRefinement(first(bang_bang(), radau(3), uniform(7)), Aims(1e-6, 1e-4, ALLOWED, 0, 300))
    refinement.run()
    assert len(refinement.history) == 1
    assert not refinement.reached
    assert refinement.change == float("inf")


def test_bounds_are_drawn_in_by_what_is_given_interval_by_interval() -> None:
    known = bang_bang()
    s = first(known, radau(3), uniform(6))
    t = s.transcription
    amounts = np.zeros_like(passed(interval_errors(s, "move"), 0.0))
    amounts[1, 2, -1] = 0.25  # the upper limit of the control in the third interval
    own = Bounds(*t.bounds(t.guess_from(s.phases)), t.lbg, t.ubg)
    drawn = tightened(own, t, {"move": amounts})
    moved = np.flatnonzero(drawn.high_z != own.high_z)
    controls = t.variables["move"].u.start + t.layouts["move"].controls_of[2]
    np.testing.assert_array_equal(moved, controls)
    np.testing.assert_allclose(own.high_z[moved] - drawn.high_z[moved], 0.25)
    np.testing.assert_array_equal(drawn.low_z, own.low_z)
    held = NlpSolver(t).again(s, drawn)
    assert held.success
    assert held.objective > s.objective  # slower where less is allowed
