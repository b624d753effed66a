"""One road to a verdict: a solve, a study's point, a co-design and a stored result are verified by the same checks."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hopopt as ho
from hopopt.ocp.hop import Hop
from hopopt.planner import refine_and_verify as road
from hopopt.planner.checks.judge import judge
from hopopt.planner.checks.verdict import Verdict
from hopopt.planner.refine_and_verify import Answer, refine_and_verify
from hopopt.planner.search.multistart import run_chunk
from hopopt.planner.solution import Solution
from hopopt.problem.load import load
from hopopt.storage.seal.recheck import recheck
from hopopt.storage.solution import read, save
from hopopt.studies.sweep import point as sweep_point
from hopopt.studies.sweep.definition import define
from hopopt.studies.sweep.point import solve_point
from hopopt.verify.check import Check

OF_FILES = {  # checks that only files can fail: that they belong together
    "figures of the summary as computed",
    "tables agree with the collocation data", "the program is the problem's", "limits are the problem's or tighter",
    "error of the objective as stated", "residuals of the summary as computed", "files as they were written",
    "stored costates", "second order as stated",
}  # fmt: skip


def names(verdict: Verdict) -> list[str]:
    return [check.name for check in verdict.checks]


@pytest.fixture(scope="module")
def answer() -> Answer:
    """The paper's hop from one start, on the road that all verdicts come from."""
    hop = Hop(load("paper"), "clearance")
    return refine_and_verify(hop, run_chunk(hop, [0])[0], lambda text: None)


@pytest.mark.slow
def test_a_solve_a_point_and_a_stored_result_have_the_same_checks(
    answer: Answer, hop: Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Answer] = []
    monkeypatch.setattr(
        sweep_point, "refine_and_verify", lambda *given, **more: seen.append(road_to(*given, **more)) or seen[-1]
    )
    road_to = refine_and_verify
    point, _ = solve_point(define(load("paper"), {"leg.gear.ratio": [80, 90]}, starts=1), 0, [])
    stored = recheck(read(str(save(hop, tmp_path).result_dir)))
    assert hop.verdict is not None
    assert names(seen[0].verdict) == names(answer.verdict) == names(hop.verdict) == names(stored)
    assert [c.name for c in stored.conditions] == [c.name for c in answer.verdict.conditions]
    assert {check.name for check in stored.of_file} == OF_FILES
    assert "simulated in one piece" in names(answer.verdict)
    assert point.verified
    assert point.certified
    assert point.error == seen[0].verdict.error.too_high_by  # type: ignore[union-attr]
    assert stored.certified


def test_a_stored_result_is_judged_as_when_it_was_solved(hop: Solution, tmp_path: Path) -> None:
    stored, fresh = recheck(read(str(save(hop, tmp_path).result_dir))), hop.verdict
    assert fresh is not None
    assert stored.error is not None
    assert fresh.error is not None
    assert stored.error.too_high_by == pytest.approx(fresh.error.too_high_by, rel=1e-6)
    before = {check.name: check for check in fresh.checks}
    for check in stored.checks:
        assert check.tolerance == before[check.name].tolerance
        np.testing.assert_allclose(check.residual, before[check.name].residual, rtol=1e-3, atol=1e-9)


def test_a_point_whose_simulated_hop_fails_is_not_verified(monkeypatch: pytest.MonkeyPatch) -> None:
    """Planted: the hop simulated in one piece falls short, which a study's point did not look at before."""
    short = Check("simulated in one piece", 1e-2, 1e-4, "relative")

    def planted(*given: object) -> Verdict:
        return judge(*given).with_checks([short])  # type: ignore[arg-type]

    monkeypatch.setattr(road, "judge", planted)
    definition = define(load("paper", {"solver.refine": False}), {"leg.gear.ratio": [80, 90]}, starts=1)
    point, _ = solve_point(definition, 0, [])
    assert not point.verified
    assert point.clearance_m is None
    assert "simulated in one piece" in point.sentence


def test_a_verdict_holds_only_if_every_check_does(hop: Solution) -> None:
    verdict = hop.verdict
    assert verdict is not None
    assert verdict.verified
    assert verdict.certified
    bad = verdict.with_checks([Check("planted", 2.0, 1.0, "SI")])
    assert not bad.verified
    assert bad.failed_checks == ["planted"]
    assert bad.certified
    assert not replace(verdict, conditions=()).certified


@pytest.mark.slow
def test_a_co_design_has_the_checks_of_a_solve_and_its_own(answer: Answer) -> None:
    found = ho.solve(load("paper"), free={"leg.gear.ratio": (70.0, 90.0)}, starts=1)
    assert found.verdict is not None
    assert names(found.verdict) == [*names(answer.verdict), "co-design confirmed"]
    assert found.verified == found.verdict.verified
