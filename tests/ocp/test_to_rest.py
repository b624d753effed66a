"""A hop that is landed: what impulse and energy say of it, the single hop beside it, and what is said where it is no use."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from hopopt.cli.main import run
from hopopt.errors import NotSolvedError, ProblemFileError, UsageError
from hopopt.leg.robot import BASE
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.problem.load import load
from hopopt.sim.machine import Machine
from hopopt.storage.seal.recheck import recheck
from hopopt.storage.solution import read, save
from hopopt.studies.sensitivity import sensitivity
from hopopt.verify.plan import verify_plan
from hopopt.verify.table import DESCENT, LANDING, STANCE
from once import solved_once

SOFT = {"hop.kind": "landing", "hop.touchdown_loss": 1.0}


@cache
def soft(**more: tuple[float, float]) -> Solution:
    """The paper's leg, landing softly."""
    return solved_once({**SOFT, **{f"hop.{name}": value for name, value in more.items()}})


def quick() -> Solution:
    """The same from a short push, which takes half as long to find."""
    return soft(stance_duration=(0.03, 0.12))


@pytest.mark.slow
def test_a_soft_landing_costs_no_height() -> None:
    """The hop that never lands bounds it from above: the same program without what follows the apex."""
    single = solved_once()
    assert soft().verified
    assert soft().summary.certified
    assert soft().clearance <= single.clearance + 1e-5
    assert soft().clearance == pytest.approx(single.clearance, abs=1e-4)


@pytest.mark.rarely
def test_with_free_switch_times_it_is_the_same_hop() -> None:
    again = solve(load("paper", SOFT), starts=1, processes=1, structure=True)
    assert again.verified
    assert again.summary.structure.solved_again, again.summary.structure.note
    assert again.clearance == pytest.approx(soft().clearance, abs=1e-5)


@pytest.mark.slow
def test_the_ground_gives_what_gravity_takes() -> None:
    """From rest to rest: the impulses of push, impact and landing are the weight's over the whole hop, and 0 along x."""
    plan, machine = quick(), Machine(quick().robot)
    given = np.zeros(BASE)
    for phase in (STANCE, LANDING):
        samples = plan.everywhere(phase, np.linspace(0, 1, 41))
        t, f = (x.reshape(-1, 41, *x.shape[1:]) for x in (samples.t, samples.f))
        given += np.trapezoid(f, t[..., None], axis=1).sum(axis=0)
    table = plan.tables[DESCENT]
    given += machine.impact(table.q[-1, -1], table.v[-1, -1])[1][:BASE]
    assert plan.summary.landing is not None
    taken = machine.mass * 9.81 * plan.summary.landing.rest_s
    assert given == pytest.approx([0.0, taken], abs=1e-3 * taken)


def test_it_ends_as_it_began() -> None:
    """At rest, the joints as at the start, the foot where it touched down; the joints' work is what the impact took."""
    plan, found = quick(), quick().summary.landing
    assert found is not None
    begin, end = plan.sample(0.0), plan.sample(plan.end)
    assert end.phase[0] == LANDING
    assert np.abs(end.v).max() < 1e-7
    assert end.q[0, BASE:] == pytest.approx(begin.q[0, BASE:], abs=1e-7)
    assert end.points["foot"][0] == pytest.approx([found.step_m, 0.0], abs=1e-7)
    assert end.q[0, 0] - begin.q[0, 0] == pytest.approx(found.step_m, abs=1e-7)
    assert found.work_J == pytest.approx(found.impact_loss_J, abs=1e-4)
    assert found.impact_loss_J == pytest.approx(1.0, rel=1e-3)
    at = plan.sample(np.nextafter([found.touchdown_s] * 2, [0.0, 9.0]))  # the leg is where it was, the foot stops
    assert at.q[0] == pytest.approx(at.q[1], abs=1e-6)
    assert list(at.phase) == [DESCENT, LANDING]


@pytest.mark.parametrize(
    ("part", "failed"),
    [("q", "rest"), ("v", "rest"), ("t", "descent begins as flight ends")],
    ids=["pose", "speed", "time"],
)
def test_a_perturbed_landing_fails(part: str, failed: str) -> None:
    plan = quick()
    table = plan.tables[LANDING]
    changed = getattr(table, part).copy()
    where = (-1, -1, -1) if part != "t" else (0, 0)
    changed[where] += 1e-5
    checks = verify_plan(plan.design, {**plan.tables, LANDING: replace(table, **{part: changed})}, plan.claims())
    assert failed in [c.name for c in checks if not c.passed]


def test_a_landing_that_does_not_begin_as_the_impact_ends_fails() -> None:
    plan = quick()
    table = plan.tables[LANDING]
    v = table.v.copy()
    v[0, 0, -1] += 1e-6
    checks = verify_plan(plan.design, {**plan.tables, LANDING: replace(table, v=v)}, plan.claims())
    assert "landing begins as the impact leaves the leg" in [c.name for c in checks if not c.passed]


@pytest.mark.slow
def test_a_stored_landing_is_checked_again(tmp_path: Path) -> None:
    folder = save(soft(), tmp_path).result_dir
    assert folder is not None
    again = recheck(read(folder))
    assert again.failed_checks == []


@pytest.mark.slow
def test_sensitivities_of_the_touchdown_and_of_the_landing() -> None:
    """A quick landing costs height: the longest landing gains; the same by solving again with 1 % more."""
    quick = {**SOFT, "hop.landing_duration": (0.03, 0.05)}
    plan = solved_once(quick)
    (slope,) = [e.per_unit for e in sensitivity(plan) if e.name == "hop.landing_duration[1]"]
    more = solved_once({**quick, "hop.landing_duration": (0.03, 0.0505)})
    assert (more.clearance - plan.clearance) / 0.0005 == pytest.approx(slope, rel=0.05)


@pytest.mark.rarely
def test_the_softest_and_the_quickest() -> None:
    """The softest loses next to nothing; the quickest is quicker, and no quicker than a fall from the clearance."""
    asked = {"hop.kind": "landing", "hop.clearance": 0.3}
    softest = solved_once(asked, "impact")
    quickest = solved_once(asked, "time")
    assert softest.verified
    assert quickest.verified
    assert softest.summary.landing is not None
    assert quickest.summary.landing is not None
    assert softest.summary.landing.impact_loss_J < 1e-3
    assert quickest.summary.landing.rest_s < softest.summary.landing.rest_s
    assert quickest.summary.landing.rest_s == pytest.approx(quickest.summary.time_s)


@pytest.mark.slow
def test_what_cannot_be_landed_is_named() -> None:
    """A leg that has 10 ms to stop: the landing's time, and the drives in it."""
    asked = {**SOFT, "hop.landing_duration": (0.01, 0.01), "hop.clearance": 0.3}
    with pytest.raises(NotSolvedError) as error:
        solve(load("paper", asked), "time", starts=1, processes=1)
    assert "longest landing (hop.landing_duration = [0.01, 0.01])" in str(error.value)


def test_it_is_refused_where_it_is_no_use() -> None:
    with pytest.raises(
        UsageError, match=r'hop\.kind = "landing" needs a leg in a plane whose body moves along x and z'
    ):
        solve(load("paper", {"hop.kind": "landing", "leg.guides": ["z"]}))
    with pytest.raises(ProblemFileError, match=r"hop\.landing_duration"):
        load("paper", {"hop.kind": "landing", "hop.landing_duration": (0.5, 0.1)})
    with pytest.raises(ProblemFileError, match=r"hop\.speed = 0\.5 is for periodic hops"):
        load("paper", {"hop.kind": "landing", "hop.speed": 0.5})


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hopopt.planner.solve.solve", lambda *asked, **more: quick())
    words = ["--hop", "landing", "--starts", "1", "--no-figures", "--results", str(tmp_path)]
    assert run(["solve", *words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["hop"] == "landing"
    assert found["verified"] is True
    assert found["landing"]["closure"] < 1e-8
    assert found["phases"].keys() == {"stance", "flight", "descent", "landing"}
    assert run(["show", found["result_dir"]]) == 0
    assert "at rest after" in capsys.readouterr().out
    assert run(["simulate", "--set", 'hop.kind="landing"']) == 2
    assert "does not know the hop that lands yet" in capsys.readouterr().err
