"""What the planner does where an answer is not verified at first."""

from dataclasses import replace

import pytest

from hopopt.answer_notes import notes_on
from hopopt.multistart import run_starts
from hopopt.ocp.hop import Hop
from hopopt.planner import CALMER, LARGEST_TIE_BREAK, _calmer, finish
from hopopt.problem_file import load
from hopopt.stopwatch import Stopwatch


def silent(text: str) -> None:
    pass


def test_what_is_not_verified_is_solved_again_with_a_larger_tie_break_and_said_so() -> None:
    """The same hop, its bias stated by the larger weight; not for ever larger weights, nor where nothing is refined."""
    hop, clock = Hop(load("paper"), "clearance"), Stopwatch()
    outcomes = run_starts(hop, 1, 1, silent)
    verified = finish(hop, outcomes[0], outcomes, silent, clock)
    unverified = replace(verified, summary={**verified.summary, "verified": False})
    found = _calmer(hop, unverified, outcomes, silent, clock)
    assert found is not None
    other, again = found
    asked = hop.design.solver.tie_break
    assert other.design.solver.tie_break == pytest.approx(CALMER * asked)
    assert again.verified
    assert again.design.solver.tie_break == other.design.solver.tie_break
    assert again.clearance == pytest.approx(verified.clearance, abs=other.tie_break_bias + 1e-5)
    assert any(f"{asked:g}" in note and "tie_break" in note for note in notes_on(other, asked, again, None))
    for change in (f"solver.tie_break={1.1 * LARGEST_TIE_BREAK}", "solver.refine=false"):
        assert _calmer(Hop(load("paper", [change]), "clearance"), unverified, outcomes, silent, clock) is None
