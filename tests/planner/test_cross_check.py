"""Cross-checks: another solver on the same program, other schemes; what they agree on, and a planted disagreement."""

import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from hopopt.cli import main as cli
from hopopt.cli.screen.checks import cross_check_lines
from hopopt.errors import SolverError
from hopopt.nlp.schemes import radau
from hopopt.ocp.hop import Hop
from hopopt.planner.answer.summary import Summary
from hopopt.planner.checks import cross_check
from hopopt.planner.checks.cross_check import (
    CrossCheck,
    CrossCheckAnswer,
    Failed,
    affordable,
    by_uno,
    cross_check_entries,
    cross_checked,
)
from hopopt.planner.search.multistart import first_transcription
from hopopt.planner.solution import Solution, stored_nlp
from hopopt.planner.solve import solve
from hopopt.problem.load import load
from hopopt.storage.solution import read, save
from once import solved_once
from waiting import beside_progress

COARSE = {"solver.refine": False, "solver.stance_intervals": 12, "solver.flight_intervals": 5}
UNREFINED = [word for entry, value in COARSE.items() for word in ("--set", f"{entry}={str(value).lower()}")]


@pytest.fixture(scope="module")
def answer() -> Solution:
    """The paper's leg on one coarse mesh, with all cross-checks of it."""
    return solve(load("paper", COARSE), starts=1, processes=1, cross_check=True)


def test_uno_agrees_on_the_same_program(answer: Solution) -> None:
    uno, *others = answer.summary.second_opinions
    assert "same program of 12 + 5 intervals" in uno.name
    assert uno.agrees, uno
    assert abs(uno.difference or 1.0) < 1e-6
    assert uno.compared_with == pytest.approx(answer.summary.objective_value, rel=1e-12)
    assert [o.name.split(",")[0] for o in others] == ["radau-5", "hermite-simpson"]


@pytest.mark.slow
def test_uno_agrees_on_a_periodic_hop_too() -> None:
    """Its impact, and the state that has to come back, are rows of the same program."""
    soft = {**COARSE, "hop.kind": "periodic", "hop.touchdown_loss": 1.0, "contact.friction": 0.6}
    uno = solve(load("paper", soft), starts=1, processes=1, cross_check=True).summary.second_opinions[0]
    assert "12 + 5 + 5 intervals" in uno.name
    assert uno.agrees, uno


def test_inaccurate_meshes_contradict_nothing(answer: Solution) -> None:
    """On one mesh schemes differ by their errors: that is said, and is no better hop."""
    for o in answer.summary.second_opinions[1:]:
        assert not o.agrees
        assert not o.contradicts
        assert "local error" in o.reason, o
    assert not answer.verified  # as without them
    assert answer.summary.exit_code == 3
    assert not [note for note in answer.summary.notes if "not the best" in note]


def test_cross_checks_are_stored_timed_and_shown(answer: Solution, tmp_path: Path) -> None:
    kept = read(save(answer, tmp_path).result_dir or tmp_path).summary
    assert kept.second_opinions == answer.summary.second_opinions
    assert kept.timings_s["second opinions"] < kept.wall_s
    lines = cross_check_lines(kept)
    assert len(lines) == 3
    assert f": {kept.objective_value:.5f} m, differs by " in lines[0]
    assert all("DISAGREES" in line for line in lines[1:])


def test_a_worse_hop_passed_off_as_the_answer_is_found_out(answer: Solution, monkeypatch: pytest.MonkeyPatch) -> None:
    """A hop of at most 0.38 s stance, as the answer to the problem that allows 0.4 s."""
    hop = Hop(answer.design)
    shortest = answer.design.hop.stance_duration[0]
    other = solved_once({**COARSE, "hop.stance_duration": [shortest, 0.38]})
    limits = {name: answer.kkt[name] for name in ("low_z", "high_z", "low_g", "high_g")}
    told = replace(other.summary, verified=True, exit_code=0)
    tampered = replace(answer, phases=other.phases, kkt={**other.kkt, **limits}, summary=told)
    monkeypatch.setattr(cross_check, "OTHER_SCHEMES", ())
    seen = replace(told, **cross_check_entries(hop, tampered, told.notes))
    (uno,) = seen.second_opinions
    assert uno.contradicts
    assert not uno.agrees
    assert (uno.difference or 0.0) > 1e-4
    assert uno.objective == pytest.approx(answer.summary.objective_value, rel=1e-6)
    assert seen.exit_code == 3
    assert seen.verified  # it is a true hop, but not the best
    assert any("not the best hop" in note for note in seen.notes)
    assert "DISAGREES" in cross_check_lines(seen)[0]
    assert "better by" in cross_check_lines(seen)[0]


def test_a_solver_that_fails_is_stated_with_its_reason(
    answer: Solution, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cross_check, "UNO", {**cross_check.UNO, "max_iterations": 1})
    with pytest.raises(Failed, match="not optimal point, constraints missed by"):
        by_uno(stored_nlp(answer), 0)
    assert capfd.readouterr() == ("", "")  # nor does Uno print anything


def test_a_program_too_large_gives_way_to_the_first_mesh_s(answer: Solution, monkeypatch: pytest.MonkeyPatch) -> None:
    """Solved by Ipopt from the answer: here that is the same program, and so the same optimum."""
    hop, stored = Hop(answer.design), stored_nlp(answer)
    assert affordable(hop, stored) is stored
    monkeypatch.setattr(cross_check, "AFFORDABLE", len(stored.z) - 1)
    first = affordable(hop, stored)
    assert first.iterations > 0
    assert first.transcription.mesh == first_transcription(hop).mesh
    assert first.objective == pytest.approx(stored.objective, rel=1e-8)


def raising(error: Exception) -> Callable[[], CrossCheckAnswer]:
    def ask() -> CrossCheckAnswer:
        raise error

    return ask


@pytest.mark.parametrize(
    "error", [Failed("no luck"), RuntimeError("Plugin 'uno'\n is not found"), SolverError("limits cross")]
)
def test_a_failing_cross_check_is_a_line(error: Exception) -> None:
    o = cross_checked("Uno", 1.0, 1e-6, 0.8, raising(error))
    assert not o.agrees
    assert not o.contradicts
    summary = SimpleNamespace(objective_unit="m", second_opinions=[o])
    (line,) = cross_check_lines(cast("Summary", summary))
    assert line == f"Uno: FAILED, {' '.join(str(error).split())} (0 s)"


@pytest.mark.parametrize(
    ("sign", "said", "agrees", "contradicts"),
    [
        (1.0, CrossCheckAnswer(2.0 * (1 + 9e-7)), True, False),
        (1.0, CrossCheckAnswer(2.0 * (1 + 5e-5)), False, False),
        (1.0, CrossCheckAnswer(2.1), False, True),
        (1.0, CrossCheckAnswer(1.9), False, False),  # another, worse optimum: no better hop
        (-1.0, CrossCheckAnswer(1.9), False, True),  # less of what is minimised is better
        (-1.0, CrossCheckAnswer(2.1), False, False),
        (1.0, CrossCheckAnswer(2.1, "its local error is 1e-02"), False, False),
        (1.0, CrossCheckAnswer(math.nan), False, False),
    ],
)
def test_who_agrees_and_who_contradicts(sign: float, said: CrossCheckAnswer, agrees: bool, contradicts: bool) -> None:
    o: CrossCheck = cross_checked("other", sign, 1e-6, 2.0, lambda: said)
    assert (o.agrees, o.contradicts) == (agrees, contradicts)


def test_it_goes_with_a_design_that_is_given(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["solve", "--cross-check", "--free", "leg.gear.ratio=80:120"]) == 2
    assert "--cross-check goes with a design that is given" in capsys.readouterr().err


@pytest.mark.slow
def test_on_the_command_line(
    answer: Solution, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cross_check, "OTHER_SCHEMES", (radau(5),))
    asked = ["solve", *UNREFINED, "--starts", "1", "--no-figures", "--results", str(tmp_path), "--cross-check"]
    assert cli.run([*asked, "--json"]) == 3
    out, err = capfd.readouterr()
    assert beside_progress(err) == []
    data = json.loads(out)  # one object and nothing else
    assert [o["agrees"] for o in data["second_opinions"]] == [True, False]
    monkeypatch.setattr("hopopt.planner.solve.solve", lambda *given, **more: answer)
    assert cli.run(asked) == 3
    out, err = capfd.readouterr()
    assert beside_progress(err) == []
    assert re.search(r"cross-check +Uno, .* of 12 \+ 5 intervals: 0\.\d{5} m, differs by \de-\d\d \(\d+ s\)\n", out), (
        out
    )
    assert re.search(r"radau-5, on one mesh: DISAGREES: .* its local error is \de-\d\d \(\d+ s\)\n", out), out


@pytest.mark.rarely
def test_who_agrees_on_the_paper_s_leg() -> None:
    s = solve(load("paper"), starts=1, cross_check=True)
    assert s.verified
    assert s.summary.exit_code == 0
    uno, fifth, hermite_simpson = s.summary.second_opinions
    assert " + ".join(str(n) for n in s.summary.mesh[-1].intervals.values()) in uno.name
    assert abs(uno.difference or 1.0) < 1e-6
    assert abs(fifth.difference or 1.0) < 1e-4
    assert uno.agrees
    assert fifth.agrees
    assert hermite_simpson.agrees or hermite_simpson.reason  # where Ipopt gives up on it, that is stated
