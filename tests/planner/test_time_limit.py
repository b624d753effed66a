"""A search that is given little time: it ends in it, with the best hop so far or with the reason why there is none."""

import pickle
from collections.abc import Callable
from dataclasses import replace
from time import monotonic, process_time

import pytest

from hopopt.cli.screen.answer import short
from hopopt.cli.screen.console import show
from hopopt.errors import NotSolvedError
from hopopt.global_search import search
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.refinement.mesh_refinement import OUT_OF_TIME
from hopopt.nlp.solver.ipopt import LONGEST, NlpSolver, time_given
from hopopt.ocp.hop import Hop
from hopopt.planner.answer.summary import LATE
from hopopt.planner.refine_and_verify import refine_outcome
from hopopt.planner.search import first_mesh
from hopopt.planner.search.beside import Beside
from hopopt.planner.search.multistart import first_transcription, run_chunk, run_starts
from hopopt.planner.search.neighbours.relaxations import QUICK, relaxed_starts
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.problem.load import load
from hopopt.studies.codesign import codesign

OVER = Deadline(0.0)
GRACE = 2.0  # s of this process's own work, after the limit


def silent(text: str) -> None:
    pass


def test_a_deadline_is_a_value_that_is_never_put_off() -> None:
    assert NEVER.seconds_left == float("inf")
    soon = NEVER.within(50.0)
    assert 49.0 < soon.seconds_left <= 50.0
    assert soon.within(1000.0) == soon
    assert soon.within(0.0).passed
    assert not soon.passed
    assert pickle.loads(pickle.dumps(soon)) == soon


def test_nothing_is_solved_without_a_limit() -> None:
    assert time_given(NEVER) == LONGEST
    assert 0 < time_given(OVER) < 0.01


def test_ipopt_ends_in_time_and_is_given_more_again() -> None:
    """On one program: without a limit it converges, with none left it says so, and then it converges again."""
    hop = Hop(load("paper"), "clearance")
    solver = NlpSolver(first_transcription(hop), {"ipopt.max_iter": 500})
    free = run_chunk(hop, [0], solver)[0]
    stopped = run_chunk(hop, [0], solver.on(solver.transcription, OVER))[0]
    assert stopped.status == "Maximum_WallTime_Exceeded"
    assert not stopped.success
    again = run_chunk(hop, [0], solver)[0]
    assert (again.objective, again.iterations) == (free.objective, free.iterations)


def test_every_loop_of_the_search_asks_for_the_time() -> None:
    """Of many starts one is looked at, of relaxed problems and of the global method's steps none."""
    hop = Hop(load("paper"), "clearance")
    first_transcription(hop)
    began = process_time()
    assert len(run_starts(hop, 400, Beside(hop, 0), silent, until=OVER)) == 1
    assert relaxed_starts(hop, QUICK[0], until=OVER) == []
    with pytest.raises(TimeoutError):
        search(hop.design, size=81, until=OVER)
    assert process_time() - began < GRACE


def test_the_thread_of_the_global_method_sees_the_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    given = list[Deadline]()

    def late(*_: object, until: Deadline, **__: object) -> None:
        given.append(until)
        raise TimeoutError

    monkeypatch.setattr(first_mesh, "search", late)
    found = first_mesh.search_first_mesh(Hop(load("paper"), "clearance"), 2, 1, silent, until=OVER)
    assert given == [OVER]
    assert found.reason == "there was no time for it"


@pytest.mark.parametrize(
    "ask",
    [
        lambda limit: solve(load("paper"), starts=4, processes=1, time_limit=limit),
        lambda limit: solve(load("paper", ["hop.clearance=0.4"]), "energy", starts=4, processes=1, time_limit=limit),
        lambda limit: solve(load("paper", ['hop.kind="periodic"']), starts=4, processes=1, time_limit=limit),
        lambda limit: solve(load("paper", ['hop.kind="landing"']), starts=4, processes=1, time_limit=limit),
        lambda limit: solve(
            load("paper", ["hop.obstacle.width=0.2"]), "obstacle", starts=4, processes=1, time_limit=limit
        ),
        lambda limit: codesign(load("paper"), {"leg.gear.ratio": (5.0, 9.0)}, starts=4, processes=1, time_limit=limit),
    ],
    ids=["clearance", "energy", "periodic", "landing", "obstacle", "co-design"],
)
def test_no_time_for_any_start_is_the_reason(ask: Callable[[float], Solution]) -> None:
    began, here = monotonic(), process_time()
    with pytest.raises(NotSolvedError, match="the time limit was reached before there was an answer") as error:
        ask(0.01)
    assert not error.value.diagnosis
    # wall time that others take from this process is not its own
    assert min(monotonic() - began, process_time() - here) < 0.01 + GRACE


def test_a_refinement_ends_with_the_mesh_it_is_at() -> None:
    hop = Hop(load("paper"), "clearance")
    outcome = run_chunk(hop, [0])[0]
    refinement = refine_outcome(hop, outcome, silent, until=OVER)
    assert refinement.ended == OUT_OF_TIME
    assert refinement.solution.objective == pytest.approx(outcome.objective, rel=1e-9)


def test_the_limit_is_stated(hop: Solution) -> None:
    assert hop.summary.time_limit_s == 600
    assert not hop.summary.late


def test_what_the_limit_left_unverified_is_one_sentence(hop: Solution, capsys: pytest.CaptureFixture[str]) -> None:
    summary = replace(hop.summary, verified=False, failed_checks=("local error",), notes=(LATE,), time_limit_s=3.0)
    show(short(replace(hop, summary=summary)))
    shown = capsys.readouterr().out
    assert "the time limit of 3 s was reached" in shown.replace("\n", " ")
    assert "local error" not in shown
