"""Hop after hop: runs cut into hops, errors that die out, and what is kept up beside the periodic bound."""

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import hopopt as ho
from hopopt.cli.main import run
from hopopt.cli.screen.console import show
from hopopt.cli.screen.hops import hops as shown_hops
from hopopt.comparison.hops.hop_after_hop import HopsComparison, compare_hops
from hopopt.comparison.hops.return_map import Fallen, ReturnMap, multipliers, state_at_landing
from hopopt.comparison.hops.trials import Hops, HopsTrial, apex_of, hop_on, hops_in_mujoco, hops_on_draws, moved
from hopopt.comparison.ladder import ladder, withheld
from hopopt.comparison.robust.robustness import drawn
from hopopt.control.closed_loop import simulate
from hopopt.control.strategies import find
from hopopt.design import Design
from hopopt.errors import UsageError
from hopopt.planner.reserve import reference_of
from hopopt.planner.solution import Solution
from hopopt.plots.hops import save_all
from hopopt.problem.load import load
from hopopt.sim.hop_metrics import HopFigures
from hopopt.sim.hop_sequence import hops_of, landings
from once import plan_with_reserve, solved_once

ROUGH = {"hop.kind": "periodic", "contact.friction": 0.6}


@cache
def leg() -> Design:
    return load("paper", ROUGH)


@cache
def three_hops() -> Hops:
    """Of the paper's force control with a full tuck, from rest."""
    trial = HopsTrial(leg(), "force_tuck")
    return Hops(trial.hop(3, trial.start), 3)


@cache
def bound() -> Solution:
    """The periodic hop of the paper's leg with friction, from one start."""
    return solved_once(ROUGH)


# ---- runs cut into hops ---------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_first_of_many_hops_is_the_hop_from_rest() -> None:
    alone = simulate(leg(), find("force_tuck")).figures
    first = three_hops().each[0]
    assert first.clearance == alone.clearance
    assert first.budget == alone.budget


def test_hops_follow_each_other_without_a_gap() -> None:
    trace, hops = three_hops().run.trace, hops_of(three_hops().run.trace)
    down = landings(trace)
    assert len(hops) == len(down) == 3
    np.testing.assert_allclose(np.cumsum([hop.t[-1] for hop in hops]), down, atol=1e-9)
    for hop in hops:
        assert hop.contact[0]
        assert not hop.contact[-1]
        assert hop.t[0] == 0.0
        assert hop.work[0].tolist() == [0.0] * 4
        assert hop.points["foot"][0, 0] == pytest.approx(0.0, abs=1e-12)
        assert hop.points["foot"][-1, 1] == pytest.approx(0.0, abs=1e-7)


def test_the_energy_of_every_hop_balances() -> None:
    """Motors' work is what the leg gains and loses, in each hop of its own; an impact belongs to none, as it lies between."""
    for hop in hops_of(three_hops().run.trace):
        assert hop.energy_error < 1e-6


def test_a_bounce_is_no_hop() -> None:
    run = three_hops().run
    trace = run.trace
    last = trace.events[-1]
    at_once = [replace(last, kind=kind) for kind in ("lift-off", "touchdown")]
    bounced = replace(trace, events=[*trace.events, *at_once])
    assert len(landings(bounced)) == 3
    short = [replace(last, kind="lift-off", t=last.t + 0.01), replace(last, kind="touchdown", t=last.t + 0.05)]
    assert len(landings(replace(trace, events=[*trace.events, *short]))) == 3
    longer = [short[0], replace(short[1], t=last.t + 0.2)]
    assert len(landings(replace(trace, events=[*trace.events, *longer]))) == 4


# ---- errors from hop to hop -----------------------------------------------------------------------------------


def linear(matrix: np.ndarray, fixed: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    return lambda z: fixed + matrix @ (z - fixed)


def test_multipliers_of_a_map_are_its_eigenvalues() -> None:
    """Six states as of a leg of two joints, with a pair of complex values."""
    values = np.diag([0.7, -0.3, 0.2, 0.1, 0.0, 0.0])
    values[:2, :2] = [[0.5, -0.4], [0.4, 0.5]]
    basis = np.random.default_rng(5).normal(size=(6, 6))
    fixed = np.array([0.8, -1.6, 0.1, -2.5, 1.0, 3.0])
    found = multipliers(linear(basis @ values @ np.linalg.inv(basis), fixed), fixed)  # type: ignore[arg-type]
    expected = sorted(np.linalg.eigvals(values), key=abs)
    np.testing.assert_allclose(sorted(map(abs, found.values)), np.abs(expected), atol=1e-8)
    assert found.largest == pytest.approx(np.hypot(0.5, 0.4))
    assert found.closure < 1e-12
    assert found.error < 1e-8


def test_a_bouncing_mass_has_its_known_multiplier() -> None:
    """A mass that leaves the ground at speed r u + p after landing at u: errors of u shrink by r."""
    r, push = 0.6, 1.2

    def hop(z: np.ndarray) -> np.ndarray:
        return np.array([0.0, 0.0, 0.0, -(r * -z[3] + push), 0.0, 0.0])

    found = multipliers(hop, np.array([0.0, 0.0, 0.0, -2.0, 0.0, 0.0]), settle=60)  # type: ignore[arg-type]
    assert found.largest == pytest.approx(r)
    assert abs(found.closure) < 1e-9


@pytest.mark.rarely
def test_errors_of_the_papers_control_shrink_as_its_multiplier_says() -> None:
    """From a start half a radian a second off, the error is followed through three hops: the mean ratio of the last two."""
    controller = three_hops().run.controller
    assert controller is not None
    on = ReturnMap(leg(), controller)
    z = state_at_landing(three_hops().run.trace)
    found = multipliers(on, z)
    assert found.closure < 1e-6
    for _ in range(6):
        z = on(z)
    off, errors = z + 0.4 * np.array([0.3, -0.2, 0.5, 1.0, 0.2, -1.0]), []
    for _ in range(3):
        off = on(off)
        errors.append(float(np.linalg.norm(off - z)))
    assert np.sqrt(errors[2] / errors[0]) == pytest.approx(found.largest, rel=0.25)


def test_a_leg_that_does_not_come_down_again_has_no_return() -> None:
    class Limp:
        def torque(self, now: object) -> np.ndarray:
            return np.zeros(2)

    with pytest.raises(Fallen):
        ReturnMap(leg(), Limp())(np.array([0.8, -1.6, 0.0, -2.0, 0.0, 0.0]))


# ---- strategies beside the bound ------------------------------------------------------------------------------


def made(*names: str, asked: int = 3, **more: object) -> HopsComparison:
    hops = {name: three_hops() for name in names}
    return HopsComparison(bound(), None, hops, asked, 0.02, **more)  # type: ignore[arg-type]


@pytest.mark.slow
def test_parts_of_the_gap_add_up_and_the_bound_holds() -> None:
    found = made("force_tuck")
    data = found.as_dict()
    row = data["strategies"]["force_tuck"]
    json.dumps(data)
    assert sum(row["gap"].values()) == pytest.approx(found.bound - row["median_m"], abs=1e-7)
    assert row["kept_m"] == min(row["clearances_m"][1:])
    assert row["share_of_bound"] == pytest.approx(row["kept_m"] / found.bound)
    assert 0.5 < row["share_of_bound"] < 1
    assert not found.beaten_by
    assert found.exit_code == 0


@pytest.mark.slow
def test_the_settled_hop_keeps_all_that_the_ladder_withholds() -> None:
    """So PD's own hop, its landing and its drift among them, is one that the first rung chooses from."""
    typical = made("force_tuck").without_plan["force_tuck"]
    freedoms = {f.allows: f for f in withheld(typical)}
    assert freedoms.keys() == {
        "a longer stance", "the body off the plumb line", "a harder landing", "no drift", "the leg drawn up fully"
    }  # fmt: skip
    trace = typical.trace
    assert sum(e.lost for e in trace.events) < freedoms["a harder landing"].entries["hop.touchdown_loss"]
    drift = freedoms["no drift"]
    assert drift.entries["hop.speed"] * trace.t[-1] == pytest.approx(trace.q[-1, 0] - trace.q[0, 0])
    assert not drift.widens
    (drawn_up,) = freedoms["the leg drawn up fully"].constraints
    length = np.linalg.norm(trace.points["hip"] - trace.points["foot"], axis=1)[typical.flight]
    assert length.min() > drawn_up.terms.lower


@pytest.mark.slow
def test_without_a_strategy_that_hops_on_there_is_no_ladder() -> None:
    fallen = Hops(replace(three_hops().run, trace=replace(three_hops().run.trace, outcome="it fell")), 5)
    with pytest.raises(UsageError, match="no PD strategy of this comparison hops within every limit"):
        ladder(replace(made("force_tuck"), hops={"force_tuck": fallen}))


def test_the_optimums_row_is_the_plan_with_its_descent() -> None:
    figures = made("force_tuck").optimum
    assert figures.clearance == pytest.approx(bound().clearance, abs=1e-6)
    assert figures.trace.t[-1] == pytest.approx(bound().summary.orbit.period_s)  # type: ignore[union-attr]


def test_a_leg_that_fell_keeps_nothing_up() -> None:
    run = three_hops().run
    fallen = Hops(replace(run, trace=replace(run.trace, outcome="the knee hit the ground")), 5)
    assert fallen.fell == "the knee hit the ground"
    assert fallen.kept == 0.0
    row = fallen.as_dict()
    assert row["hops"] == 3
    assert row["period_s"] is None


def test_what_is_said_and_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = three_hops().run
    fallen = Hops(replace(run, trace=replace(run.trace, outcome="the knee hit the ground")), 5)
    found = replace(
        made("force_tuck", drawn={"force_tuck": [(20, 0.55), (3, 0.0)]}),
        hops={"force_tuck": three_hops(), "track": fallen},
    )
    show(shown_hops(found.as_dict() | {"result_dir": "results/x", "wall_s": 1.0}))
    said = capsys.readouterr().out
    assert f"the bound is {found.bound:.4f} m every" in said
    assert "3/3" in said
    assert "track fell after 3 hops: the knee hit the ground; a softer landing" in said
    assert "1 of 2 drawn legs still hop after 20 hops, the lowest of them keeps up 0.550 m" in said
    assert {path.name for path in save_all(found, tmp_path)} == {
        f"{name}.{suffix}" for name in ("clearances", "orbit") for suffix in ("png", "svg")
    }


def test_wrong_questions_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(UsageError, match=r"needs hop\.kind"):
        compare_hops(load("paper"))
    with pytest.raises(UsageError, match="--hops must be at least 2"):
        compare_hops(leg(), hops=1)
    with pytest.raises(UsageError, match="needs ground with friction"):
        compare_hops(load("paper", {"hop.kind": "periodic"}), mujoco=True)
    assert run(["compare", "--hop", "periodic", "--tune", "24"]) == 2
    assert run(["compare", "--hop", "periodic", "--hops", "1"]) == 2
    said = capsys.readouterr().err
    assert "--tune and --reserve are for the hop from rest" in said
    assert "--hops must be at least 2" in said


def test_a_state_in_flight_is_moved_and_nothing_else() -> None:
    apex = apex_of(bound())
    other = moved(apex, 0.02, 0.3)
    assert other.q - apex.q == pytest.approx([0, 0.02, 0, 0])
    assert other.v - apex.v == pytest.approx([0.3, 0, 0, 0])
    assert (other.since, other.contact) == (apex.since, False)
    plan = bound().tables
    com = HopFigures(leg(), made("force_tuck").optimum.trace).trace.com_v
    assert np.abs(com[:, 1]).min() < 1e-2
    assert -apex.since == pytest.approx(plan["flight"].t[-1, -1] - plan["stance"].t[-1, -1])


# ---- the tracked orbit ----------------------------------------------------------------------------------------


@cache
def tracked() -> HopsTrial:
    plan = plan_with_reserve(ROUGH)
    assert plan.verified
    return HopsTrial(leg(), "track", reference_of(plan), apex_of(plan))


@pytest.mark.rarely
def test_the_tracked_orbit_is_kept_up_from_two_centimetres_off() -> None:
    trial = tracked()
    assert trial.reference is not None
    found = hop_on(trial, hops=8, offset=0.02)
    assert not found.fell
    assert np.abs(found.clearances / trial.reference.clearance - 1).max() < 0.03
    assert found.stable is not None
    assert found.stable.largest < 0.5
    elsewhere = hops_in_mujoco(trial, 8)
    np.testing.assert_allclose(elsewhere, found.clearances, rtol=0.02)


@pytest.mark.slow
def test_drawn_legs_are_tried_on_the_same_plan() -> None:
    trial, draws = (
        tracked(),
        drawn(leg(), leg().uncertainty.model_copy(update={"mass": 0.0, "torque_constant": 0.0}), 2, 0),
    )
    first, second = hops_on_draws(trial, draws, 3)
    assert first == second  # nothing is uncertain
    assert first[0] == 3
    alone = Hops(trial.hop(3, trial.start), 3)
    assert first[1] == pytest.approx(alone.kept, abs=1e-9)


@pytest.mark.rarely
def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = [
        "compare",
        "--hop",
        "periodic",
        "--set",
        "contact.friction=0.6",
        "--set",
        "solver.starts=1",
        "--strategies",
        "position_tuck",
        "--hops",
        "3",
    ]
    assert run([*words, "--results", str(tmp_path), "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["hop"] == "periodic"
    row = data["strategies"]["position_tuck"]
    assert len(row["clearances_m"]) == 3
    assert row["stability"]["largest_multiplier"] < 1
    folder = Path(data["result_dir"])
    assert json.loads((folder / "hops.json").read_text())["bound_m"] == data["bound_m"]
    assert {path.stem for path in (folder / "figures").iterdir()} == {"clearances", "orbit"}
    assert (folder / "runs.nc").exists()


def test_only_a_periodic_solution_is_compared_hop_after_hop(hop: Solution) -> None:
    with pytest.raises(UsageError, match=r'hop\.kind = "periodic"'):
        ho.Solution.with_methods(hop).compare_hops("force")
