"""Onto an orbit in the fewest hops: momentum, both ends, what is asked of each hop, and what is said where no way leads."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from hopopt.cli.main import run
from hopopt.comparison.hops.transition import Transition, transition
from hopopt.errors import NotSolvedError
from hopopt.leg.robot import BASE
from hopopt.nlp.solver.ipopt import NlpSolver
from hopopt.ocp.hop import Hop
from hopopt.ocp.hops.sequence import PhaseSequence
from hopopt.ocp.objectives.registry import find
from hopopt.ocp.phases import FLIGHT, STANCE, flight, stance
from hopopt.ocp.transitions import lift_off
from hopopt.planner.search.multistart import first_transcription
from hopopt.planner.several_hops import state_of
from hopopt.planner.solution import Solution
from hopopt.plots.transition import heights
from hopopt.problem.load import load
from hopopt.sim.machine import Machine
from hopopt.storage.solution import save
from hopopt.verify.hops.several_hops import several_hops_checks
from hopopt.verify.table import DESCENT
from once import solved_once

ROUGH = {"hop.kind": "periodic", "contact.friction": 0.6, "hop.touchdown_loss": 3.0}


@cache
def orbit(**more: float) -> Solution:
    """The paper's leg, hop after hop."""
    return solved_once({**ROUGH, **{k.replace("__", "."): x for k, x in more.items()}})


@cache
def from_rest() -> Transition:
    return transition(orbit().design, orbit=orbit())


@cache
def two_hops() -> Transition:
    """At 3 m/s one push from rest is not enough."""
    fast = orbit(hop__speed=3.0)
    return transition(fast.design, orbit=fast)


def momentum_is_what_was_given(found: Transition) -> None:
    """From rest: impulses of ground and weight over all hops make the momentum with which the orbit's stance begins."""
    machine = Machine(found.orbit.robot)
    given = np.zeros(BASE)
    for hop in found.plan.hops:
        samples = hop.everywhere(STANCE, np.linspace(0, 1, 41))
        t, f = (x.reshape(-1, 41, *x.shape[1:]) for x in (samples.t, samples.f))
        given += np.trapezoid(f, t[..., None], axis=1).sum(axis=0)
        table = hop.tables[DESCENT]
        given += machine.impact(table.q[-1, -1], table.v[-1, -1])[1][:BASE]
    given[1] -= machine.mass * 9.81 * found.plan.duration
    table = found.orbit.tables[STANCE]
    momentum = machine.mass * machine.com_velocity(table.q[0, 0], table.v[0, 0])
    assert given == pytest.approx(momentum, abs=1e-3 * machine.mass * 9.81 * found.plan.duration)


@pytest.mark.slow
def test_one_hop_leads_from_rest_onto_the_orbit() -> None:
    found = from_rest()
    assert found.verified
    assert found.plan.verdict.certified
    assert len(found.plan.hops) == 1
    assert not found.fewer
    momentum_is_what_was_given(found)


@pytest.mark.rarely
def test_a_fast_orbit_takes_two_hops() -> None:
    found = two_hops()
    assert found.verified
    assert found.plan.verdict.certified
    assert len(found.plan.hops) == 2
    assert [why.split(" is missed")[0] for why in found.fewer] == ["orbit[v hip]"]
    momentum_is_what_was_given(found)
    assert [a.get_text() for a in heights(found).axes[0].get_xticklabels()]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("phase", "part", "failed"),
    [
        (STANCE, "v", "start"),
        (DESCENT, "v", "the last impact leads to the orbit"),
        (DESCENT, "t", "hop 1: descent begins as flight ends"),
    ],
)
def test_a_perturbed_way_fails(phase: str, part: str, failed: str) -> None:
    found = from_rest()
    tables = dict(found.plan.hops[0].tables)
    changed = getattr(tables[phase], part).copy()
    changed[(-1, -1, -1) if failed.startswith("the last") else (0, 0)] += 1e-5
    tables[phase] = replace(tables[phase], **{part: changed})
    end = state_of(found.orbit)
    start = np.r_[from_rest().plan.hops[0].tables[STANCE].q[0, 0, BASE:], 0, 0]
    checks = several_hops_checks(found.orbit.robot, found.design, [tables], start, np.r_[end.q, end.v])
    assert failed in [check.name for check in checks if not check.passed]


@pytest.mark.slow
def test_every_hop_clears_what_is_asked_of_it() -> None:
    found = transition(orbit().design, orbit=orbit(), clearances=[0.3, 0.5])
    assert found.verified
    assert found.plan.clearances == pytest.approx([0.3, 0.5], abs=1e-4)


@pytest.mark.slow
def test_a_start_on_the_orbit_does_no_worse_in_one_hop() -> None:
    """The orbit's own hop is one of those that it may choose; and once it may be higher."""
    begin = state_of(orbit())

    def from_orbit(leg, free_parameters):
        return PhaseSequence((stance(leg, begin.q, begin.v), flight(leg)), lift_off(leg, STANCE, FLIGHT))

    single = load("paper", {"contact.friction": 0.6})
    hop = Hop(single, replace(find("clearance"), sequence=from_orbit))
    program = first_transcription(hop)
    highest = NlpSolver(program, {})(program.guess_from({name: orbit().phases[name] for name in (STANCE, FLIGHT)}))
    assert highest.success
    assert highest.objective > orbit().clearance - 1e-4


@pytest.mark.rarely
def test_from_one_orbit_to_another_and_back() -> None:
    low = solved_once({**ROUGH, "hop.clearance": 0.3}, "peak_force")
    for begin, end in ((low, orbit()), (orbit(), low)):
        found = transition(orbit().design, begin=begin, orbit=end)
        assert found.verified
        assert len(found.plan.hops) == 1


@pytest.mark.slow
def test_what_is_stated_is_the_problem_of_the_hops() -> None:
    """Not that of the orbit on which they end, whose ground may be another."""
    gripping = orbit().design.model_copy(
        update={"contact": orbit().design.contact.model_copy(update={"friction": 0.7})}
    )
    found = transition(gripping, orbit=orbit())
    assert found.verified
    assert found.design.contact.friction == 0.7


@pytest.mark.rarely
def test_no_way_is_said_with_what_is_missed() -> None:
    """Half a metre a hop and 3 m/s at once is too much for one hop."""
    fast = orbit(hop__speed=3.0)
    with pytest.raises(NotSolvedError, match="no way onto the orbit in 1 hop was found"):
        transition(fast.design, orbit=fast, most=1)


@pytest.mark.slow
def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    folder = save(orbit(), tmp_path).result_dir
    with monkeypatch.context() as known:
        known.setattr("hopopt.comparison.hops.transition.transition", lambda *asked, **more: from_rest())
        assert run(["transition", "--to", str(folder), "--json", "--results", str(tmp_path)]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["hops"] == 1
    assert answer["from"] is None
    assert answer["to"]["clearance_m"] == pytest.approx(orbit().clearance)
    assert {path.name for path in Path(answer["result_dir"]).iterdir()} >= {"transition.json", "runs.nc", "figures"}
    assert (
        run(["transition", "--to", str(folder), "--from", str(folder), "--no-figures", "--results", str(tmp_path)]) == 0
    )
    assert "from the periodic hop of" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--most", "0"], "0 hops: from 1 to 20 are looked for"),
        (["--clearance", "0.1"] * 21, "21 hops: from 1 to 20 are looked for"),
        (["--clearance", "-1"], "clearances -1: heights in metres from 0 on are needed"),
        (["a1_leg", "--to", "ORBIT"], "this hop is of another leg than the problem a1_leg"),
        (["--set", 'leg.guides=["z"]'], "needs a leg in a plane whose body moves along x and z"),
    ],
)
def test_what_is_wrong_is_said(words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = str(save(orbit(), tmp_path).result_dir)
    assert (
        run(["transition", *(folder if word == "ORBIT" else word for word in words), "--results", str(tmp_path)]) == 2
    )
    assert said in capsys.readouterr().err
