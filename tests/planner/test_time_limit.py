"""A search that is given little time: it ends in it, with the best hop so far or with the reason why there is none."""

from time import monotonic

import pytest

from hopopt.errors import NotSolvedError
from hopopt.nlp.ipopt import NlpSolver
from hopopt.nlp.mesh_refinement import OUT_OF_TIME
from hopopt.nlp.time_limit import limited, seconds_left, time_is_up
from hopopt.ocp.hop import Hop
from hopopt.planner.multistart import first_transcription, run_chunk
from hopopt.planner.refine_and_verify import refine_outcome
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.problem.load import load


def test_an_inner_limit_never_lengthens_an_outer_one() -> None:
    assert seconds_left() == float("inf")
    with limited(50.0):
        with limited(1000.0):
            assert 49.0 < seconds_left() <= 50.0
        with limited(0.0):
            assert time_is_up()
        assert not time_is_up()
    assert not time_is_up()


def test_ipopt_ends_in_time_and_is_given_more_again() -> None:
    """On one program: without a limit it converges, with none left it says so, and then it converges again."""
    hop = Hop(load("paper"), "clearance")
    solver = NlpSolver(first_transcription(hop), {"ipopt.max_iter": 500})
    free = run_chunk(hop, [0], solver)[0]
    with limited(0.0):
        stopped = run_chunk(hop, [0], solver)[0]
    assert stopped.status == "Maximum_WallTime_Exceeded"
    assert not stopped.success
    again = run_chunk(hop, [0], solver)[0]
    assert (again.objective, again.iterations) == (free.objective, free.iterations)


def test_no_time_for_any_start_is_the_reason() -> None:
    began = monotonic()
    with pytest.raises(NotSolvedError, match="the time limit was reached, and no start led to a feasible hop") as error:
        solve(load("paper"), starts=1, processes=1, time_limit=0.01)
    assert "conflict" not in str(error.value)
    assert monotonic() - began < 30


def test_a_refinement_ends_with_the_mesh_it_is_at() -> None:
    hop = Hop(load("paper"), "clearance")
    outcome = run_chunk(hop, [0])[0]
    with limited(0.0):
        refinement = refine_outcome(hop, outcome, lambda text: None)
    assert refinement.ended == OUT_OF_TIME
    assert refinement.solution.objective == pytest.approx(outcome.objective, rel=1e-9)


def test_the_limit_is_stated(hop: Solution) -> None:
    assert hop.summary.time_limit_s == 600
