"""Limits that never act, and what a stored hop leaves open."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hopopt as ho
from hopopt.cli.main import run
from hopopt.design import Design
from hopopt.errors import ResultError
from hopopt.evidence.diagnosis import diagnose
from hopopt.optimality.directions.flat_directions import NotInvertible
from hopopt.planner.answer.limit_use import IdleLimit, idle_limits
from hopopt.planner.answer.motion_figures import SAMPLES_OF_INTERVAL, active_limits
from hopopt.planner.solution import Solution
from hopopt.problem.load import load
from hopopt.storage.solution import save
from once import solved_once

pytestmark = pytest.mark.filterwarnings("error")
MARGIN = 1e-6
CAPS = {"leg.gear.torque_cap": 250.0, "leg.gear.speed_cap": 1500.0}  # more than the motors reach


def solved(design: Design) -> Solution:
    return ho.solve(design, starts=1, processes=1)


@pytest.fixture(scope="module")
def plan(hop: Solution) -> Solution:
    """The paper's hop with caps that change nothing, as the search for it would never meet them."""
    capped = replace(hop, design=load("paper", {**CAPS, "solver.starts": hop.design.solver.starts}))
    fine = {phase: capped.everywhere(phase, SAMPLES_OF_INTERVAL) for phase in capped.phases}
    return capped.with_summary(idle_limits=idle_limits(capped, fine))


@pytest.fixture(scope="module")
def found_so() -> Solution:
    """The hop that is found within them."""
    return solved(load("paper", CAPS))


@pytest.mark.slow
def test_a_solve_says_what_its_limits_are_used_of(found_so: Solution) -> None:
    shares_are_those_by_hand(found_so)


def test_shares_of_the_limits(plan: Solution) -> None:
    shares_are_those_by_hand(plan)


def shares_are_those_by_hand(plan: Solution) -> None:
    """By hand: a cap of 250 N m that drives of 200 N m cannot reach, a window that the foot passes."""
    idle, own = plan.summary.idle_limits, plan.apex.points
    off = abs(own["foot"][0, 0] - own["hip"][0, 0])
    assert idle["foot window"].used == pytest.approx(off / 0.1)
    assert off <= idle["foot window"].enough <= off * 1.001
    assert idle["hip and knee gear torque cap"].used == pytest.approx(0.8, abs=2e-3)
    assert idle["hip and knee gear torque cap"].entry == "leg.gear.torque_cap"
    lasted = plan.phases["flight"].duration
    assert lasted <= idle["longest flight"].enough <= lasted * 1.001
    assert lasted * 0.999 <= idle["shortest flight"].enough <= lasted
    assert "longest stance" not in idle  # it acts


def of_entry(plan: Solution, entry: str) -> list[IdleLimit]:
    """The lines about one entry."""
    fine = {phase: plan.everywhere(phase, SAMPLES_OF_INTERVAL) for phase in plan.phases}
    return [limit for limit in idle_limits(plan, fine).values() if limit.entry == entry]


def test_an_entry_that_joints_share_is_one_limit(plan: Solution) -> None:
    """The joint with more torque decides; a cap that only the other one leaves idle is not idle."""
    tau = np.abs(np.concatenate([plan.everywhere(phase, SAMPLES_OF_INTERVAL).tau for phase in plan.phases])).max(axis=0)
    assert len(tau) == 2
    for cap, lines in ((1.1 * tau.max(), 1), (tau.max(), 0)):
        gear = plan.design.leg.gear.model_copy(update={"torque_cap": cap})
        leg = plan.design.leg.model_copy(update={"gear": gear})
        capped = replace(plan, design=plan.design.model_copy(update={"leg": leg}))
        found = of_entry(capped, "leg.gear.torque_cap")
        assert len(found) == lines
        assert all(tau.max() <= use.enough <= 1.001 * tau.max() for use in found)


def test_entries_that_flight_and_descent_share(plan: Solution) -> None:
    """Flight once more as a descent, slower: the shorter of both decides how long at least, the longer how long at most."""
    flight = plan.phases["flight"]
    slow = replace(flight, edges=flight.edges * 1.25, xdot=flight.xdot / 1.25)
    both = replace(plan, phases={**plan.phases, "descent": slow})
    (shortest,), (longest,) = (of_entry(both, f"hop.flight_duration[{k}]") for k in (0, 1))
    assert 0.999 * flight.duration <= shortest.enough <= flight.duration
    assert slow.duration <= longest.enough <= 1.001 * slow.duration


def test_the_window_of_the_foot_holds_at_touchdown_too(plan: Solution) -> None:
    """Flight once more as a descent, with the hip turned to either side: the end further off decides."""
    hop = plan.design.hop.model_copy(update={"foot_window": 1.0})
    wide, flight, hip = replace(plan, design=plan.design.model_copy(update={"hop": hop})), plan.phases["flight"], 4
    offs = []
    for turn in (0.0, 0.2, -0.2):
        turned = replace(flight, x_start=flight.x_start + turn * np.eye(flight.x_start.shape[1])[hip])
        both = replace(wide, phases={**plan.phases, "descent": turned})
        end = both.sample_phase("descent", np.array([turned.duration])).points
        offs.append(abs(end["foot"][0, 0] - end["hip"][0, 0]))
        (window,) = of_entry(both, "hop.foot_window")
        assert max(offs[0], offs[-1]) <= window.enough <= 1.001 * max(offs[0], offs[-1])
    assert max(offs) > 1.5 * offs[0]


def test_one_line_for_each_entry(plan: Solution) -> None:
    entries = [use.entry for use in plan.summary.idle_limits.values() if use.entry]
    assert len(entries) == len(set(entries)) >= 5


@pytest.mark.slow
def test_tightening_idle_limits_has_no_effect(found_so: Solution) -> None:
    """All of them at once, to what the hop uses of them: as high, but for what limits may cost."""
    plan = found_so
    idle, entries = plan.summary.idle_limits, {}
    for use in idle.values():
        if use.entry.startswith("leg."):
            slack = MARGIN if use.enough > 0 else -MARGIN
            slack = -MARGIN if use.entry.endswith("lower") else MARGIN if use.entry.endswith("upper") else slack
            entries[use.entry] = use.enough + slack
    entries["hop.foot_window"] = idle["foot window"].enough + MARGIN
    entries["hop.flight_duration"] = [
        idle["shortest flight"].enough - MARGIN,
        idle["longest flight"].enough + MARGIN,
    ]
    assert len(entries) >= 5
    tight = solved(load("paper", CAPS | entries))
    assert tight.summary.objective_value == pytest.approx(
        plan.summary.objective_value, rel=plan.design.solver.price_tolerance
    )


def test_a_friction_cone_says_what_it_needs(plan: Solution) -> None:
    """A push of 30 N along for every 100 N down needs a coefficient of 0.3; a foot that carries nothing does not count."""
    fine = {phase: plan.everywhere(phase, SAMPLES_OF_INTERVAL) for phase in plan.phases}
    f = np.tile([-30.0, 100.0], (len(fine["stance"].t), 1))
    f[::7] = [50.0, 0.0]
    fine["stance"] = replace(fine["stance"], f=f)
    sideways = np.insert(f, 1, 0.0, axis=1) * [np.sqrt(0.5), 1.0, 1.0]  # on one side of the pyramid in the cone
    in_space = fine | {"stance": replace(fine["stance"], f=sideways)}
    for friction, idle in ((0.6, True), (0.3, False)):
        contact = plan.design.contact.model_copy(update={"friction": friction})
        cone = idle_limits(replace(plan, design=plan.design.model_copy(update={"contact": contact})), fine)
        assert ("friction cone" in cone) is idle
        if idle:
            found = cone["friction cone"]
            assert (found.entry, found.limit) == ("contact.friction", 0.6)
            assert (found.used, found.enough) == pytest.approx((0.5, 0.3))
        design = plan.design.model_copy(update={"contact": contact})
        space = idle_limits(replace(plan, design=design), in_space)
        assert ("friction cone" in space) is idle
        assert not idle or space["friction cone"].enough == pytest.approx(0.3, rel=1e-3)
        acts = active_limits(replace(plan, design=design), in_space["stance"]).get("friction cone", 0.0)
        assert (acts > 0.5) is not idle


@pytest.mark.rarely
def test_diagnose_says_what_a_stored_hop_leaves_open(found_so: Solution, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:  # fmt: skip
    folder = str(save(found_so, tmp_path, None).result_dir)
    assert run(["diagnose", folder, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["idle_limits"].keys() == found_so.summary.idle_limits.keys()
    assert {(f["phase"], f["name"]) for f in found["flat"]} == {("flight", "a[hip]"), ("flight", "a[knee]")}
    assert {str(f.name) for f in found_so.summary.flat or ()} == {
        f["name"] for f in found["flat"]
    }  # the tie-break hides none
    assert found["durations"]["stance"]["longer"] is None  # at its longest
    assert found["durations"]["stance"]["shorter"] > 1e-3
    assert found["durations"]["flight"]["shorter"] > 1e-3
    assert run(["diagnose", folder]) == 0
    shown = capsys.readouterr().out
    assert (
        "insensitive: the objective does not depend on the torque of the hip and the torque of the knee in flight"
        in shown
    )
    assert "could be tightened to" in shown


@pytest.mark.slow
def test_diagnose_keeps_the_rest_where_matrices_are_singular(found_so: Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:  # fmt: skip
    def fails(error: Exception) -> None:
        def raised(*_: object) -> None:
            raise error

        monkeypatch.setattr("hopopt.evidence.diagnosis.flat", raised)

    saved = save(found_so, tmp_path, None)
    fails(RuntimeError("Error in Function::call"))
    with pytest.raises(ResultError, match="do not fit together"):
        diagnose(saved)
    fails(NotInvertible("Factor is exactly singular"))
    found = diagnose(saved)
    assert found["flat"] is None
    assert found["words"][0] == "what the objective does not depend on cannot be computed: Factor is exactly singular"
    assert found["durations"]["stance"]["shorter"] > 1e-3
    assert found["idle_limits"]


def test_diagnose_of_what_is_no_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["diagnose", str(tmp_path)]) == 2
    assert capsys.readouterr().err.startswith("hopopt: ")


@pytest.mark.slow
def test_what_drives_use_is_no_idle_limit_where_it_is_the_objective() -> None:
    """Caps are part of the share that is made small: tightened to what is used they would be wholly used."""
    rules = {"leg.gear.torque_cap": 150.0, "leg.gear.speed_cap": 1200.0, "hop.clearance": 0.25, "solver.refine": False}
    s = solved_once(rules, "saturation")
    assert s.summary.idle_limits
    assert not [use.entry for use in s.summary.idle_limits.values() if "cap" in use.entry]
    assert not [name for name in s.summary.idle_limits if "line" in name]
