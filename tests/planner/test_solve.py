"""What the planner does where an answer is not verified at first."""

import os
import signal
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from hopopt.cli.screen.answer import _headline
from hopopt.cli.screen.search import global_line
from hopopt.errors import UsageError
from hopopt.global_search import applies
from hopopt.nlp.refinement import mesh_refinement as refine
from hopopt.nlp.refinement import solving
from hopopt.ocp.guesses.initial_guess import starts
from hopopt.ocp.hop import Hop
from hopopt.planner import refine_and_verify as finishing
from hopopt.planner import solve as planner
from hopopt.planner.answer.extras import GlobalMethod
from hopopt.planner.answer.notes import notes_on
from hopopt.planner.answer.summary import Summary
from hopopt.planner.attempts import (
    CALMER,
    LARGEST_TIE_BREAK,
    PRICE_TOLERANCE,
    REFINEMENT,
    TOLERANCE,
    AttemptOutcome,
    with_larger_tie_break,
)
from hopopt.planner.checks.global_verdict import GRID_TOO_COARSE
from hopopt.planner.refine_and_verify import refined_and_verified
from hopopt.planner.search.beside import Beside
from hopopt.planner.search.first_mesh import search_first_mesh
from hopopt.planner.search.multistart import distinct, run_starts, solved_from
from hopopt.planner.solution import Solution
from hopopt.planner.solve import once_more, solve
from hopopt.planner.stopwatch import Stopwatch
from hopopt.problem.load import load
from hopopt.verify.check import Check
from once import solved_once

ONE_PUSH = {"hop.stance_duration": [0.03, 0.2]}


@pytest.fixture(scope="module")
def one_push() -> Solution:
    return solved_once(ONE_PUSH)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tie_break", "then"),
    [(1e-6, "solving again with solver.tie_break = 1e-05"), (2e-5, "with restarts")],
)
def test_a_refinement_that_needs_restarts_is_tried_calmer_first(
    tie_break: float, then: str, one_push: Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Too little patience for carried multipliers: a larger tie-break or, where it is large already, restarts."""
    monkeypatch.setattr(solving, "CARRIED_ITERATIONS", 5)
    said: list[str] = []
    design = load("paper", ONE_PUSH | {"solver.tie_break": tie_break})
    s = solve(design, starts=1, processes=1, progress=said.append)
    assert [line for line in said if line.startswith("not verified")] == [
        next(line for line in said if line.endswith(then))
    ]
    assert s.verified
    assert s.summary.refinement_ended == refine.MET
    assert s.design.solver.tie_break == (CALMER * tie_break if tie_break == 1e-6 else tie_break)
    assert s.clearance == pytest.approx(one_push.clearance, rel=1e-4)


def claim(name: str, height: float, verified: bool) -> Solution:
    """An answer as far as choosing among answers looks at it."""
    seen = SimpleNamespace(
        title=name, objective_value=height, verified=verified, failed_checks=() if verified else ("one",)
    )
    seen = cast("Summary", seen)
    return Solution(load("paper"), "clearance", {}, seen)


@pytest.mark.parametrize(
    ("finished", "again", "best", "better"),
    [
        ([("A", 0.500, True), ("B", 0.505, False)], {"B": (0.300, True)}, "A", None),
        ([("A", 0.500, True), ("B", 0.505, False)], {"B": (0.503, True)}, "B", None),
        ([("A", 0.500, True), ("B", 0.505, False)], {"B": (0.504, False)}, "A", "B"),
        ([("A", 0.500, True), ("B", 0.490, False)], {}, "A", None),
        ([("A", 0.505, False), ("B", 0.500, False)], {"A": (0.505, False), "B": (0.4995, True)}, "B", "A"),
        ([("A", 0.505, False), ("B", 0.500, False)], {"A": (0.504, True)}, "A", None),
        ([("A", 0.505, False), ("B", 0.500, False)], {"A": (0.499, False), "B": (0.498, False)}, "A", None),
    ],
)
def test_the_highest_verified_hop_is_chosen(
    finished: list[tuple[str, float, bool]],
    again: dict[str, tuple[float, bool]],
    best: str,
    better: str | None,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Only hops that claim more than the best verified one are solved again, and what comes of them is compared."""
    hop = Hop(load("paper"), "clearance")

    def once_more(hop: Hop, doubtful: Solution, *_: object) -> tuple[Hop, Solution]:
        name = doubtful.summary.title
        return hop, claim(name, *again[name])

    monkeypatch.setattr(planner, "once_more", once_more)
    _, chosen, other = planner.settled(hop, [claim(*each) for each in finished], [], silent, Stopwatch())
    assert chosen.summary.title == best
    assert (other and other.summary.title) == better


@pytest.mark.slow
@pytest.mark.parametrize(("again_too", "told"), [(False, ["further"]), (True, ["further", "again"])])
def test_a_hop_that_meets_its_aims_and_fails_is_solved_with_smaller_tolerances_and_says_so(
    again_too: bool, told: list[str], one_push: Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Planted: what was solved with the problem's own tolerances fails, and what went on from its last mesh may."""

    def failing(hop: Hop, *given: Any) -> finishing.Answer:
        found = own(hop, *given)
        closer = hop.design.solver.tolerance <= TOLERANCE
        if not closer or (again_too and not any("refining again" in words for words in said)):
            return replace(found, verdict=found.verdict.with_checks([Check("planted", 1.0, 0.0, "SI")]))
        return found

    own, said = finishing.judged, list[str]()
    monkeypatch.setattr(finishing, "judged", failing)
    s = solve(load("paper", ONE_PUSH), starts=1, processes=1, progress=said.append)
    words = [f"not verified: refining {how}, with tighter tolerances" for how in told]
    assert [line for line in said if line.startswith("not verified")] == words
    assert s.verified
    assert s.clearance == pytest.approx(one_push.clearance, rel=5e-5)
    note = f"solved with solver.tolerance = {TOLERANCE:g} and solver.price_tolerance = {PRICE_TOLERANCE:g}"
    assert any(
        note in words and "not verified and certified with the problem's own" in words for words in s.summary.notes
    )
    assert not any("solver.tolerance" in words for words in one_push.summary.notes)


@pytest.mark.parametrize(
    ("verified", "ended", "entries"),
    [
        (True, refine.MET, {}),
        (False, refine.UNSOLVED, {}),
        (False, refine.MET, {"solver.tolerance": TOLERANCE, "solver.price_tolerance": PRICE_TOLERANCE}),
    ],
)
def test_smaller_tolerances_are_for_hops_that_met_larger_ones(
    verified: bool, ended: str, entries: dict[str, float]
) -> None:
    hop, found = Hop(load("paper", entries)), AttemptOutcome(verified, verified, ended, 0.5)
    assert not any(attempt.may_help(found) and attempt.problem(hop) for attempt in REFINEMENT)


def test_what_plays_no_part_and_what_is_in_the_way_of_nothing_is_said(
    one_push: Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A clearance to reach beside an objective that asks for none; a foot above the body, which is a point."""
    hop, design = Hop(load("paper", ONE_PUSH)), load("paper", {**ONE_PUSH, "hop.clearance": 0.4})
    assert not any("plays no part" in note or "ends" in note for note in one_push.summary.notes)
    noted = notes_on(hop, design, False, replace(one_push, design=design), None)
    assert any(note.startswith("hop.clearance = 0.4 plays no part") for note in noted)
    end = one_push.apex
    end.points["foot"][0, 1] = end.q[0, 1] + 0.1
    monkeypatch.setattr(Solution, "apex", property(lambda self: end))
    noted = notes_on(hop, design, False, one_push, None)
    assert any(note.startswith("the foot ends 0.10 m above the hip") for note in noted)


def test_work_that_is_not_verified_names_the_larger_tie_break_not_a_smaller_one(one_push: Solution) -> None:
    hop = Hop(load("paper", {**ONE_PUSH, "hop.clearance": 0.4}), "absolute_work")
    failed = replace(one_push, summary=replace(one_push.summary, verified=False, tie_break_weighs=1.0))
    noted = notes_on(hop, hop.design, False, failed, None)
    assert any(note.startswith("not verified") and "solver.tie_break = 1e-05" in note for note in noted)
    assert not any("smaller solver.tie_break" in note for note in noted)


def test_a_hop_that_waits_and_is_not_verified_says_which_entry_to_try(one_push: Solution) -> None:
    """It may wait for as long as hop.stance_duration allows, or is given no choice."""
    hop, lasted = Hop(load("paper", ONE_PUSH)), one_push.lift_off
    assert not any("stance lasts" in note for note in one_push.summary.notes)
    failed = replace(one_push.summary.leans_on, stance_at_its_limit="longest")
    waits = one_push.with_summary(verified=False, leans_on=failed)

    def said(stance: tuple[float, float]) -> list[str]:
        design = load("paper", {**ONE_PUSH, "hop.stance_duration": list(stance)})
        return [
            note
            for note in notes_on(hop, hop.design, False, replace(waits, design=design), None)
            if "stance lasts" in note
        ]

    (note,) = said((0.03, lasted))
    assert note.endswith(f"such as hop.stance_duration = [0.03, {0.03 + 2 / 3 * (lasted - 0.03):.3g}]")
    (note,) = said((0.75 * lasted, lasted))  # still a range, within the one that was given
    lower, upper = map(float, note.rpartition("[")[2].rstrip("]").split(","))
    assert 0.74 * lasted < lower < upper < lasted
    assert not said((lasted, lasted))


def test_what_is_no_problem_is_a_sentence() -> None:
    with pytest.raises(UsageError, match="a problem is needed, not 3: give its name or file"):
        solve(cast("Any", 3))


def test_a_solution_is_shown_on_one_line(one_push: Solution) -> None:
    shown = repr(one_push)
    assert shown.startswith(f"<Solution of paper, objective clearance: clearance_m {one_push.clearance:.6g}")
    assert shown.endswith("m, verified>")


def silent(text: str) -> None:
    pass


def test_one_start_is_no_search_and_the_first_line_says_so(one_push: Solution) -> None:
    assert one_push.summary.searched is False
    assert "not searched" in _headline(one_push.summary)
    assert "not searched" not in _headline(one_push.with_summary(searched=True).summary)


def test_a_result_that_states_no_verdict_is_judged_by_its_numbers(one_push: Solution) -> None:
    promised = GlobalMethod("some", (15,), 0.5 * one_push.clearance, False, motion_m=0.6 * one_push.clearance)
    assert global_line(one_push.with_summary(global_=promised).summary)[0].endswith(GRID_TOO_COARSE)


def test_why_a_search_had_no_global_method_is_said(one_push: Solution, tmp_path: Path) -> None:
    """Of a trunk on a vertical slider; nothing where one start was asked for."""
    (tmp_path / "trunk.toml").write_text(
        'extends = "paper"\n[leg]\nguides = ["z"]\n[leg.body.shapes.trunk]\nbox = [0.1, 0.1, 0.1]\n'
    )
    unused = GlobalMethod(None, None, None, False, reason=applies(load(tmp_path / "trunk.toml")))
    searched = one_push.with_summary(global_=unused, searched=True)
    (line,) = global_line(searched.summary)
    assert line == "no global method was used: on a vertical slider it does not know what shape body and links have"
    assert not global_line(one_push.with_summary(global_=unused).summary)


@pytest.mark.slow
def test_what_is_not_verified_is_solved_again_with_a_larger_tie_break_and_said_so() -> None:
    """The same hop, its bias stated by the larger weight; not for ever larger weights, nor where nothing is refined."""
    hop, clock = Hop(load("paper"), "clearance"), Stopwatch()
    outcomes = run_starts(hop, 1, Beside(hop, 0), silent)
    verified = refined_and_verified(hop, outcomes[0], outcomes, silent, clock)
    unverified = replace(verified, summary=replace(verified.summary, verified=False))
    other, again = once_more(hop, unverified, outcomes, silent, clock)
    asked = hop.design.solver.tie_break
    assert other.design.solver.tie_break == pytest.approx(CALMER * asked)
    assert again.verified
    assert again.design.solver.tie_break == other.design.solver.tie_break
    assert again.clearance == pytest.approx(verified.clearance, abs=other.tie_break_bias + 1e-5)
    assert any(f"{asked:g}" in note and "tie_break" in note for note in notes_on(other, hop.design, False, again, None))
    for change in (f"solver.tie_break={1.1 * LARGEST_TIE_BREAK}", "solver.refine=false"):
        unchanged = Hop(load("paper", [change]), "clearance")
        assert once_more(unchanged, unverified, outcomes, silent, clock) == (unchanged, unverified)


DRAWN = {  # a leg whose best hop no start leads to
    "leg.thigh.length": 0.24329, "leg.shank.length": 0.24909, "leg.body.mass": 4.51498, "leg.thigh.mass": 0.40749,
    "leg.shank.mass": 0.14909, "leg.hip.lower": -0.61315, "leg.hip.upper": 1.07078, "leg.knee.lower": -2.59463,
    "leg.knee.upper": -0.15337, "leg.gear.ratio": 50.0, "leg.motor.max_torque": 0.95829, "leg.motor.max_speed": 423.48762,
    "leg.motor.rotor_inertia": 0.0, "leg.motor.laws": ["four-quadrant"], "leg.motor.torque_cap": 0.95829,
    "start.hip_height": 0.32079, "start.foot_x": 0.0018, "hop.stance_duration": [0.02, 0.356366],
    "hop.foot_window": 0.05298, "hop.flight_duration": [0.01, 1.5], "contact.friction": 0.95647,
}  # fmt: skip


@pytest.mark.slow
def test_a_larger_tie_break_does_not_lead_to_another_optimum() -> None:
    """Each hop of the first mesh keeps its clearance, those of the relaxed problems too."""
    hop = Hop(load("paper", DRAWN), "clearance")
    larger, kept = with_larger_tie_break(hop), distinct(search_first_mesh(hop, 2, 1, silent).outcomes)
    assert larger is not None
    assert kept[0].signed_value > kept[-1].signed_value + 0.01
    for outcome in kept:
        again = solved_from(larger, outcome)
        assert again.success
        assert again.signed_value == pytest.approx(outcome.signed_value, abs=larger.tie_break_bias + 1e-5)


def test_starts_end_alike_in_one_process_and_side_by_side() -> None:
    """However they are divided, in their order."""
    hop, found = Hop(load("paper", {"solver.stance_intervals": 12, "solver.flight_intervals": 4})), []
    for more in (0, 1):
        with Beside(hop, more) as beside:
            found.append(run_starts(hop, 4, beside, silent))
    assert [o.name for o in found[0]] == [s.name for s in starts(4, 0)]
    for one, other in zip(*found, strict=True):
        assert (one.name, one.iterations, one.objective) == (other.name, other.iterations, other.objective)
        assert (one.vectors["z"] == other.vectors["z"]).all()


def test_a_process_that_dies_at_a_start_is_replaced_by_this_one() -> None:
    def killed_unless(hop: Hop, pid: int) -> int:
        if os.getpid() != pid:
            os.kill(os.getpid(), signal.SIGKILL)
        return pid

    here = os.getpid()
    with Beside(Hop(load("paper")), 1) as beside:
        assert [beside.task(killed_unless, here).result() for _ in range(2)] == [here, here]
