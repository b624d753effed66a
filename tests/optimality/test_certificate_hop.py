"""The certificate and the switching structure of the paper's leg."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hopopt.cli.main import run
from hopopt.leg.kinematics import start_angles
from hopopt.leg.limit_id import JointWay, Kind, LimitId, kind_of
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.ocp.problem import Component
from hopopt.ocp.rules import LEAST_HEIGHT
from hopopt.optimality.certificate import COSTATE, STATIONARY, Certificate, certify, unresolved
from hopopt.optimality.minimum_principle.arcs import Activity
from hopopt.optimality.minimum_principle.switch_times import plan
from hopopt.optimality.minimum_principle.switching_structure import (
    Acting,
    described,
    runs,
    sentences,
    stretches,
    structure,
)
from hopopt.planner.attempts import with_tighter_tolerances
from hopopt.planner.solution import Solution, stored_nlp
from hopopt.planner.solve import solve
from hopopt.problem.load import load
from hopopt.storage.seal.recheck import recheck
from hopopt.storage.solution import read, save
from once import solved_once

COARSE = {"solver.refine": False, "solver.stance_intervals": 20, "solver.flight_intervals": 8}


@pytest.fixture(scope="module")
def coarse() -> Solution:
    return solved_once(COARSE)


def of(s: Solution) -> Certificate:
    return certify(stored_nlp(s))


def failed(c: Certificate) -> set[str]:
    return {check.name for check in c.checks if not check.passed}


def costates_of(c: Certificate) -> float:
    return max(check.residual for check in c.checks if check.name.endswith(" costates"))


# ---- certificate ------------------------------------------------------------------------------------------


def test_intervals_are_cut_where_costates_miss_and_nothing_else_fails(
    hop: Solution, coarse: Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Into more pieces where they miss by more, and nowhere where they fit."""
    good = of(hop)
    assert unresolved(good) == {}
    assert failed(of(coarse)) - {"stance costates", "flight costates"}
    assert unresolved(of(coarse)) == {}
    wrong = tuple(replace(c, residual=2 * COSTATE) if c.name == "stance costates" else c for c in good.checks)
    pieces = unresolved(replace(good, checks=wrong))
    assert all((each == 1).all() for each in pieces.values())  # none misses in truth
    misses = np.zeros(len(pieces["stance"]))
    misses[3] = 100 * COSTATE  # a scheme of order 5: a thousand times less with ceil(1000^(1/5)) = 4 pieces
    monkeypatch.setattr(good.phases["stance"], "costate_misses", lambda found: misses)
    pieces = unresolved(replace(good, checks=wrong))
    assert {k: int(n) for k, n in enumerate(pieces["stance"]) if n > 1} == {3: 4}
    gains = np.zeros(len(misses))
    gains[5] = 2 * STATIONARY  # 4 N times the share of one of N intervals in half of it
    monkeypatch.setattr(good.phases["stance"], "gains", lambda: gains)
    lost = tuple(replace(c, residual=2 * STATIONARY) if c.name == "stance controls stationary" else c for c in wrong)
    pieces = unresolved(replace(good, checks=lost))
    most = int(np.ceil((4 * len(gains)) ** 0.2))
    assert {k: int(n) for k, n in enumerate(pieces["stance"]) if n > 1} == {3: 4, 5: most}


def test_the_refined_optimum_is_certified(hop: Solution) -> None:
    c = of(hop)
    assert c.passed, failed(c)
    assert costates_of(c) < 1e-4
    assert hop.summary.certified is True
    assert hop.summary.certificate.keys() == {check.name.replace(" ", "_") for check in c.checks}
    assert hop.summary.timings_s["certificate"] < 5


@pytest.mark.slow
def test_hamiltonian_is_what_a_longer_stance_would_gain() -> None:
    """Autonomous phases: H is the derivative by the bound on the duration in stance, and zero in flight, which ends when
    it likes, but for the tie-break (at most its weight times the joints)."""
    hop = solve(with_tighter_tolerances(load("paper")), starts=1, processes=1)
    c, bias = of(hop), hop.design.solver.tie_break * 2
    gain = hop.summary.gains["longest stance"] / (0.01 * 0.4)
    stance, flight = c.phases["stance"], c.phases["flight"]
    assert abs(np.average(stance.mean_hamiltonian, weights=stance.h) / gain - 1) < 1e-6
    assert np.abs(np.median(stance.mean_hamiltonian) / gain - 1) < 0.01
    assert abs(np.average(flight.mean_hamiltonian, weights=flight.h)) < bias
    assert np.abs(flight.mean_hamiltonian[:-1]).max() < bias


def test_costates_of_the_flight_are_those_of_a_thrown_body(hop: Solution) -> None:
    """The height counts as it is; its speed is worth the time that is left: J = z + vz t - g t^2 / 2."""
    flight = of(hop).phases["flight"]
    left = flight.trajectory.duration - flight.trajectory.edges
    columns = list(hop.multipliers["flight"]["state"])
    z, vz = columns.index("com[z]"), columns.index("com_v[z]")
    away = flight.trajectory.edges > 0.01  # before, the ground holds the foot up
    np.testing.assert_allclose(flight.costate[away, z], 1, atol=1e-6)
    np.testing.assert_allclose(flight.costate[away, vz], left[away], atol=1e-6)


@pytest.mark.parametrize("entry", ["start.hip_height", pytest.param("start.foot_x", marks=pytest.mark.slow)])
def test_costate_at_the_start_is_what_another_start_brings(coarse: Solution, entry: str) -> None:
    """Against central differences of the same program with another pose at the start."""
    step, value = 1e-4, {"start.hip_height": 0.28, "start.foot_x": 0.0}[entry]
    moved = [load("paper", {**COARSE, entry: value + side * step}) for side in (1, -1)]
    up, down = (solve(design, starts=1).summary.objective_value for design in moved)
    turned = np.subtract(*(start_angles(design) for design in moved))
    predicted = of(coarse).phases["stance"].costate[0, :2] @ turned
    assert abs(predicted / (up - down) - 1) < 1e-3


def test_a_coarse_mesh_is_not_certified(coarse: Solution) -> None:
    assert coarse.summary.certified is False
    assert {"stance controls stationary", "stance Hamiltonian across switches"} <= failed(of(coarse))


@pytest.mark.parametrize("joint", [0, 1])
def test_other_torques_are_not_certified(hop: Solution, joint: int) -> None:
    """One per cent more acceleration of a joint for 20 ms of the push."""
    s = stored_nlp(hop)
    where, trajectory = s.transcription.variables["stance"].u, s.phases["stance"]
    interval, place = s.transcription.layouts["stance"].control_place
    t, z = trajectory.edges[interval] + place * trajectory.lengths[interval], s.z.copy()
    u = z[where].reshape(len(t), -1)
    u[(t > 0.30) & (t < 0.32), joint] *= 1.01
    z[where] = u.ravel()
    c = certify(replace(s, z=z, phases=s.transcription.unpack(z, s.p)[0]))
    assert failed(c) & {"stance costates", "stance Hamiltonian along arcs"}


@pytest.mark.rarely
def test_faults_are_found_beside_a_costate_that_is_large_for_an_instant() -> None:
    """The quickest hop's foot leaves the ground within microseconds of flight, where the costate is thousands of times
    larger than after it. One duration's multiplier and all later costates wrong."""
    s = stored_nlp(solved_once({"hop.clearance": 0.4}, "time"))
    t, flight = s.transcription, s.phases["flight"]
    ends = {"flight transversality at its end", "flight transversality of its duration"}
    sizes = np.abs(certify(s).phases["flight"].costate).max(axis=1)
    assert sizes[0] > 1000 * np.median(sizes)
    assert not failed(certify(s)) & ends
    lam_x, lam_g = s.lam_x.copy(), s.lam_g.copy()
    lam_x[t.variables["flight"].durations] += t.scale[t.variables["flight"].durations]
    assert "flight transversality of its duration" in failed(certify(replace(s, lam_x=lam_x)))
    (rows,) = (r for r in t.rows if r.kind == "defect" and r.phase == "flight")
    own = lam_g[rows.start : rows.stop].reshape(len(flight.lengths), -1)
    own[1:] *= 1.3
    assert "flight transversality at its end" in failed(certify(replace(s, lam_g=lam_g)))


@pytest.mark.slow
def test_stored_and_recomputed(hop: Solution, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = save(hop, tmp_path).result_dir
    assert run(["verify", str(folder), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["verified"] is True
    assert found["certified"] is True
    for name, entry in hop.summary.certificate.items():
        assert found["certificate"][name]["passed"] is True
        assert "name" not in found["certificate"][name]  # its key is the name
        assert found["certificate"][name]["tolerance"] == entry.tolerance
        np.testing.assert_allclose(found["certificate"][name]["residual"], entry.residual, rtol=1e-3, atol=1e-9)
    assert run(["verify", str(folder)]) == 0
    assert "first-order optimality certified" in capsys.readouterr().out


@pytest.mark.parametrize("what", [pytest.param("tau", marks=pytest.mark.slow), "u"])
def test_torques_and_controls_that_were_changed_in_the_file_are_found(hop: Solution, tmp_path: Path, what: str) -> None:
    again = read(str(save(hop, tmp_path).result_dir))
    owner = again.tables["stance"] if what == "tau" else again.phases["stance"]
    edges = again.phases["stance"].edges[:-1]
    getattr(owner, what)[(edges > 0.1) & (edges < 0.3), :, 0] *= 1.01
    verdict = recheck(again)
    assert "tables agree with the collocation data" in verdict.failed_checks
    wrong = {check.name for check in verdict.conditions if not check.passed}
    assert (what == "u") == bool(wrong & {"stance costates", "stance Hamiltonian along arcs"})


def test_rows_that_were_changed_in_the_file_are_computed_again(hop: Solution, tmp_path: Path) -> None:
    again = read(str(save(hop, tmp_path).result_dir))
    again.kkt["g"][:] = 0.0
    np.testing.assert_allclose(stored_nlp(again).g, stored_nlp(hop).g, atol=1e-12)


def test_costates_that_were_changed_in_the_file_are_found(hop: Solution, tmp_path: Path) -> None:
    again = read(str(save(hop, tmp_path).result_dir))
    again.multipliers["stance"]["costate"][3] *= 1.001
    verdict = recheck(again)
    assert verdict.failed_checks == ["stored costates"]
    assert not verdict.verified


# ---- switching structure ----------------------------------------------------------------------------------


def test_runs_join_what_is_equal_and_drop_what_is_short() -> None:
    t = np.array([0.05, 0.15, 0.25, 0.35, 0.45, 0.55, 0.65, 0.75, 0.85, 0.95])
    found = runs(list("aaabaacccc"), t, (0.0, 1.0), 0.15)
    assert [(r.limit, r.begin, r.end) for r in found] == [("a", 0.0, pytest.approx(0.6)), ("c", pytest.approx(0.6), 1)]


def acting(columns: dict[Component, Callable[[np.ndarray], np.ndarray]]) -> Activity:
    """100 intervals of one node over one second; which upper sides act when."""
    t = (np.arange(100)[:, None] + 0.5) / 100
    upper = np.stack([when(t) for when in columns.values()], axis=2)
    push = np.concatenate([upper, 0 * upper], axis=2).astype(float)
    on_controls = np.array([kind_of(name.of) is Kind.REGION for name in columns])
    met = np.concatenate([upper, np.zeros_like(upper)], axis=2)
    return Activity(t, upper, np.zeros_like(upper), push, met, tuple(columns), on_controls)


def test_structure_in_words_and_what_may_move() -> None:
    act = acting(
        {
            Component(LimitId(Kind.REGION, "hip"), "a line"): lambda t: t < 0.3,
            Component(LimitId(Kind.REGION, "hip"), "b line"): lambda t: (t > 0.31) & (t < 0.7),
            Component(LimitId(Kind.REGION, "hip"), "c line"): lambda t: t > 0.7,
            Component(LEAST_HEIGHT, "knee"): lambda t: (t > 0.71) & (t < 0.8),
        }
    )
    (words,) = [s for s in stretches(act, (0.0, 1.0)) if s.subject == "hip" and s.end == 1.0]
    assert words.limit == "c line forward"
    p = plan(act, 1.0, 1.0)
    np.testing.assert_allclose(p.switches, [0.305, 0.7], atol=1e-9)
    assert p.free == (True, False)  # the knee comes to the ground where the second one lies
    assert [(pin.begin, pin.end) for pin in p.pins] == [(0.0, p.switches[0]), p.switches, (p.switches[1], 1.0)]


def test_structure_tells_of_peaks_by_joint_and_nothing_of_how_work_is_counted() -> None:
    act = acting(
        {
            Component(LimitId(Kind.PEAK_TORQUE), JointWay("hip", "forward")): lambda t: t < 0.3,
            Component(LimitId(Kind.PEAK_TORQUE), JointWay("hip", "backward")): lambda t: (t > 0.31) & (t < 0.7),
            Component(LimitId(Kind.REGION, "hip"), "a line"): lambda t: t > 0.7,
            Component("drawn", "hip"): lambda t: t < 0.5,
            Component(LimitId(Kind.POWER), "hip"): lambda t: t > 0.5,
        }
    )
    told = [s.limit for s in stretches(act, (0.0, 1.0)) if s.subject == "hip"]
    assert told == ["at the peak torque forward", "at the peak torque backward", "a line forward"]
    assert {s.subject for s in stretches(act, (0.0, 1.0))} == {"hip"}
    assert described(Component(LimitId(Kind.SHARE, "knee"), "2"), "lower") == (
        "knee",
        Acting("at the peak share of its operating region"),
    )
    both = acting(
        {
            Component(LimitId(Kind.SHARE, "knee"), "0"): lambda t: t > 0.5,
            Component(LimitId(Kind.SHARE, "knee"), "2"): lambda t: t > 0.5,
        }
    )
    assert [s.limit for s in stretches(both, (0.0, 1.0))] == ["free", "at the peak share of its operating region"]


def test_structure_agrees_with_the_torques(hop: Solution) -> None:
    """Where the hip is said to be on one line throughout, its torque lies on the edge of the operating region."""
    found = structure(stored_nlp(hop))
    assert hop.summary.structure.words == tuple(sentences(found))
    region, checked = hop.region("hip"), 0
    for s in found["stance"]:
        if s.subject == "hip" and s.limit != "free":
            margin = 0.1 * (s.end - s.begin)
            samples = hop.sample(np.linspace(s.begin + margin, s.end - margin, 50))
            assert region.saturation(samples.v[:, 2], samples.tau[:, 0]).min() > 0.99
            checked += 1
    assert checked > 3


@pytest.mark.rarely
@pytest.mark.parametrize("name", ["paper", "paper_no_countermovement"])
def test_free_switching_times_lead_to_the_same_optimum(name: str) -> None:
    """Verified and certified, within the tightening cost; torques jump at edges of the mesh. The
    same tolerances, which free times make smaller than the problem's own."""
    refined, again = (
        solve(with_tighter_tolerances(load(name)), starts=1, processes=1, structure=s) for s in (False, True)
    )
    told = again.summary.structure
    assert solve(load(name), starts=1, processes=1, structure=True).summary.structure == told
    assert told.solved_again, told.note
    assert again.verified
    assert again.summary.certified
    a, b = refined.summary.objective_value, again.summary.objective_value
    price = max(c.residual for c in refined.summary.verification if c.name.startswith("tightening"))
    assert abs(a - b) / a < (1e-6 if name == "paper" else price)
    edges, jumps = again.phases["stance"].edges, (told.jumps_s or {})["stance"]
    assert len(jumps) >= 2
    for t in jumps:
        assert np.abs(edges - t).min() == 0
        sides, uses = again.sample(np.array([t - 1e-7, t + 1e-7])), []
        for k, joint in enumerate(("hip", "knee")):
            lines = np.array(again.region(joint).use(sides.v[:, 2 + k], sides.tau[:, k]))
            uses.append(lines.max(axis=0).min())  # on some line on both sides
        assert np.abs(np.diff(sides.tau, axis=0)).max() > 5  # N m, while positions and speeds go on
        np.testing.assert_allclose(sides.v[0], sides.v[1], atol=1e-3)
        assert max(uses) > 0.994


def test_a_hop_without_switches_that_may_move_says_so(coarse: Solution, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hopopt.optimality.minimum_principle.switch_times.DISTANCE_FROM_LIMITS", 10.0)
    s = solve(load("paper", COARSE), starts=1, structure=True)
    assert s.summary.structure.solved_again is False
    assert "no switch" in str(s.summary.structure.note)
    assert s.clearance == coarse.clearance


def test_certificate_of_a_solution_is_that_of_its_program(coarse: Solution) -> None:
    nlp: NlpSolution = stored_nlp(coarse)
    np.testing.assert_array_equal(of(coarse).phases["stance"].costate, coarse.multipliers["stance"]["costate"])
    assert len(coarse.multipliers["ends"]["multiplier"]) == sum(
        r.stop - r.start for r in nlp.transcription.rows if r.kind == "boundary"
    )


def test_a_foot_slips_against_the_force_that_holds_it() -> None:
    """Where the ground pushes forward as hard as friction lets it, the foot is about to slip backward."""
    s = solved_once({"contact.friction": 0.5, "contact.least_force": 20.0, **COARSE})
    found = [x for x in structure(stored_nlp(s))["stance"] if "slip" in x.limit]
    assert {x.limit for x in found} == {"about to slip forward", "about to slip backward"}
    for x in found:
        along, up = s.sample([(x.begin + x.end) / 2]).f[0]
        assert along == pytest.approx((0.5 if x.limit.endswith("backward") else -0.5) * up, rel=0.01), x
