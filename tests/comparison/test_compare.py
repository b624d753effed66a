"""The bound beside what controllers make of it, on the paper's leg."""

import dataclasses
import json
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import hopopt as ho
from hopopt.cli.main import run
from hopopt.cli.screen.answer import short as short_answer
from hopopt.cli.screen.console import show
from hopopt.cli.screen.runs import comparison as shown_comparison
from hopopt.comparison.compare import (
    OPTIMUM,
    TUNED_PD,
    Comparison,
    chosen_names,
    compare,
    integrals_to,
    planned_trace,
)
from hopopt.comparison.control_recheck import control_check
from hopopt.comparison.paper_control import paper_strategy
from hopopt.comparison.robust.robustness import can_be_had, drawn, spread
from hopopt.control.closed_loop import clearance_in_mujoco, make_plant, simulate
from hopopt.control.strategies import BUILT_IN, find
from hopopt.design import Design, Uncertainty
from hopopt.drivetrain.motor import rated
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.errors import UsageError
from hopopt.leg.kinematics import start_angles
from hopopt.paper.paper_results import is_the_papers
from hopopt.planner.answer.extras import Attained, CanBeHad, Functions
from hopopt.planner.reserve import reference_of, reserved
from hopopt.planner.solution import Solution
from hopopt.problem.load import changed, load
from hopopt.record import as_data
from hopopt.storage.runs import save_runs
from hopopt.storage.solution import save
from once import plan_with_reserve, simulated_once
from refusals import refusal
from similar_legs import similar


@pytest.fixture(scope="module")
def solution(hop):
    return hop


@pytest.fixture(scope="module")
def comparison(solution):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hopopt.comparison.compare.plan_to_track", lambda design, *rest: plan_with_reserve())
        return compare(solution.design, ["track", "force", "force_tuck", "position"], bound=solution)


def test_a_foot_that_leaves_before_the_plan_says_so(comparison):
    assert [comparison.left_early(name) for name in comparison.figures] == [""] * 5
    left = comparison.figures["track"].lift_off["time_s"]
    other = dataclasses.replace(comparison, plan=SimpleNamespace(lift_off=2 * left))
    assert other.left_early("track") == f"the foot left the ground at {left:.3f} s, not at {2 * left:.3f} s as planned"
    assert not other.left_early("force")  # it follows no plan


def test_every_row_says_what_a_script_needs(comparison):
    data = comparison.as_dict()
    assert data["bound_m"] == comparison.solution.clearance
    assert list(data["strategies"]) == [OPTIMUM, "track", "force", "force_tuck", "position"]
    for row in data["strategies"].values():
        assert {"clearance_m", "share_of_bound", "parts", "saturation_mean", "lift_off"} <= set(row)
    json.dumps(data)


def test_parts_gaps_and_shares_add_up(comparison):
    best, steps = comparison.bound, comparison.as_dict()["gap_steps"]
    assert [step["reaches"] for step in steps[:2]] == ["plan", "track"]
    highest = max(comparison.figures[name].clearance for name in ("force", "force_tuck", "position"))
    assert sum(step["costs_m"] for step in steps) == pytest.approx(best - highest, abs=1e-12)
    for row in comparison.as_dict()["strategies"].values():
        assert sum(row["parts"].values()) == pytest.approx(row["clearance_m"], abs=1e-12)
        assert sum(row["budget"].values()) == pytest.approx(row["clearance_m"], abs=1e-12)
        assert sum(row["gap"].values()) == pytest.approx(best - row["clearance_m"], abs=1e-7)
        assert row["share_of_bound"] == pytest.approx(row["clearance_m"] / best)


def test_the_papers_figures_stand_beside_its_leg_alone(comparison, monkeypatch):
    assert "paper" in comparison.row("force")
    monkeypatch.setattr("hopopt.comparison.compare.is_the_papers", lambda leg: False)
    assert "paper" not in comparison.row("force")
    assert is_the_papers(load("paper", ["leg.gear.ratio=60"]).leg)  # it prints no figures of its motors
    mirrored = ["leg.knee.axis=[0, 1, 0]", "leg.knee.lower=0.15", "leg.knee.upper=2.4"]
    changes = (["leg.body.mass=5"], ["leg.shank.length=0.3"], ['leg.guides=["z"]'], mirrored)
    for other in (*(load("paper", change) for change in changes), load("three_joint")):
        assert not is_the_papers(other.leg)


@pytest.fixture
def told(solution, monkeypatch, tmp_path, capsys):
    """Runs hopopt solve where the planner is done: exit code and what is printed."""
    monkeypatch.setattr("hopopt.planner.solve.solve", lambda *a, **k: solution)

    def told(*more):
        code = run(["solve", "--starts", "1", "--no-figures", "--results", str(tmp_path / "results"), *more])
        return code, capsys.readouterr().out

    return told


def test_the_answer_says_what_the_papers_control_reaches(comparison, told):
    row = comparison.row("force")
    code, shown = told()
    (line,) = [line for line in shown.splitlines() if "force control" in line]
    assert code == 0
    assert f"{row['clearance_m']:.3f} m, {row['share_of_bound']:.0%} of the optimum" in line
    found = json.loads(told("--json")[1])["paper_strategy"]
    assert found["clearance_m"] == pytest.approx(row["clearance_m"], abs=1e-9)
    assert found["share_of_bound"] == pytest.approx(row["share_of_bound"], abs=1e-9)
    assert (found["name"], found["fault"], found["beyond_bound"]) == ("force", "", False)
    assert "force control" not in told("--no-control")[1]


@pytest.mark.parametrize("fault", [KeyboardInterrupt, ValueError, ZeroDivisionError, UsageError])
def test_nothing_beside_the_answer_loses_it(fault, told, monkeypatch, tmp_path):
    def simulate(*a, **k):
        raise fault

    monkeypatch.setattr("hopopt.comparison.paper_control.simulate", simulate)
    code, shown = told()
    assert code == 0
    assert "verified" in shown
    assert "force control" not in shown
    assert len(list((tmp_path / "results").glob("*/summary.json"))) == 1


def test_a_control_that_passes_the_answer_is_an_alarm(solution, told, monkeypatch):
    monkeypatch.setattr(Solution, "clearance", 0.4)
    code, shown = told()
    assert code == 3
    assert "it passes the optimum within every limit" in shown


def test_a_hop_that_is_none_has_no_share(solution, told, monkeypatch):
    fast = load("paper", ["leg.gear.speed_cap=600"])  # 6 rad/s at the joints, which the control overruns
    monkeypatch.setattr(
        "hopopt.comparison.paper_control.simulate",
        lambda design, *a, **k: simulated_once(fast, find("force"), past_apex=True),
    )
    found = json.loads(told("--json")[1])["paper_strategy"]
    assert found["clearance_m"] is None
    assert found["share_of_bound"] is None
    assert "faster than its drive may turn" in found["fault"]
    assert f"no hop within this leg's limits ({found['fault']})" in told()[1]


def test_no_share_is_told_of_what_is_no_bound_for_it(solution):
    assert paper_strategy(dataclasses.replace(solution, objective="apex")) is None
    functions = Functions(None, ("module:stay_low",))
    assert paper_strategy(solution.with_summary(functions=functions)) is None
    assert paper_strategy(solution.with_summary(verified=False)) is None
    assert paper_strategy(dataclasses.replace(solution, design=load("three_joint"))) is None  # the strategy needs two


@pytest.mark.rarely
def test_a_leg_on_a_slider_tracks_its_optimum_and_no_strategy_passes_it():
    found = compare(load("paper", ['leg.guides=["z"]', "leg.body.mass=5", "solver.starts=1"]), ["track", "force_tuck"])
    rows = found.as_dict()["strategies"]
    best = rows[OPTIMUM]["clearance_m"]
    assert 0.97 * best < rows["track"]["clearance_m"] <= best
    assert 0.5 * best < rows["force_tuck"]["clearance_m"] < best


def test_the_optimum_is_measured_as_a_simulation_is(comparison, solution):
    """The simulator's figures of the plan's own samples are those that the planner printed."""
    row, s = comparison.as_dict()["strategies"][OPTIMUM], solution.summary
    assert row["clearance_m"] == pytest.approx(s.clearance_m, abs=1e-7)
    assert row["parts"] == pytest.approx(as_data(s.parts), abs=1e-7)
    assert row["saturation_mean"] == pytest.approx(s.saturation_mean, abs=2e-3)
    assert row["energy"]["stance_net_J"] == pytest.approx(s.energy["stance_net_J"], rel=1e-4)
    assert planned_trace(solution).energy_error < 1e-5
    assert row["limits_exceeded"] == []


def test_integrals_of_a_polynomial_are_exact():
    places = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
    assert integrals_to(places) @ places**4 == pytest.approx(places**5 / 5, abs=1e-14)


def test_nobody_passes_the_bound(comparison):
    assert comparison.solution.verified
    assert comparison.beaten_by == []
    assert comparison.exit_code == 0
    assert max(f.clearance for f in comparison.figures.values()) <= comparison.bound + 1e-4


def test_a_bound_that_is_passed_is_called_wrong(comparison, solution):
    low = solution.with_summary(clearance_m=0.3)
    wrong = Comparison(low, comparison.plan, comparison.runs)
    within = [n for n, f in comparison.figures.items() if n != OPTIMUM and not f.limits_exceeded and f.clearance > 0.31]
    assert within, "some strategy must keep every limit, or this test shows nothing"
    assert wrong.beaten_by == within
    assert wrong.exit_code == 3


def test_an_unverified_bound_is_not_stated(comparison, solution):
    doubtful = solution.with_summary(verified=False)
    data = Comparison(doubtful, comparison.plan, comparison.runs).as_dict()
    assert data["bound_m"] is None
    assert data["exit_code"] == 3
    assert "not verified" in data["strategies"][OPTIMUM]["meaning"]


def test_the_optimum_can_be_tracked(comparison):
    """4 kHz, 14-bit encoders, no mismatch."""
    clearance = comparison.figures["track"].clearance
    assert clearance >= 0.97 * comparison.plan.clearance
    assert clearance >= 0.97 * comparison.bound


def test_energy_balances_close(comparison):
    for name, f in comparison.figures.items():
        if name != OPTIMUM:
            assert f.trace.energy_error < 1e-6, name


@pytest.mark.parametrize("name", [pytest.param("track", marks=pytest.mark.slow), "force_tuck"])
def test_mujoco_agrees(comparison, name):
    elsewhere = clearance_in_mujoco(comparison.solution.design, find(name), reference_of(comparison.plan))
    assert elsewhere == pytest.approx(comparison.figures[name].clearance, rel=0.01)


def test_a_reserve_is_taken_off_every_limit():
    design = load("paper", ["leg.motor.torque_cap=1.5", "leg.gear.torque_cap=107", "reserve.torque=0.1"])
    plan = reserved(design)
    assert plan.contact.least_force == 20.0
    assert plan.hop.least_height == 0.005
    w = np.linspace(-12, 12, 25)
    for joint in design.leg.joints:
        before, after = design.leg.joint[joint], plan.leg.joint[joint]
        assert after.lower >= before.lower + design.reserve.angle - 1e-9
        assert after.upper <= before.upper - design.reserve.angle + 1e-9
        inner, outer = (operating_region(d.leg, joint, _parameters(d)).torque_bounds(w)[1] for d in (plan, design))
        assert inner == pytest.approx(0.9 * outer)
    slower = reserved(load("paper", ["leg.gear.speed_cap=1000", "reserve.speed=0.1", "reserve.torque=0"])).leg
    torque, speed = rated(design.leg, "hip")
    assert rated(slower, "hip") == pytest.approx((torque, 0.9 * speed))
    assert slower.gear.speed_cap == pytest.approx(900)
    start_at_limit = load("paper", ["leg.knee.lower=-2.37"])
    assert reserved(start_at_limit).leg.joint["knee"].lower < start_angles(start_at_limit)[1]  # it must stay possible


def test_a_reserve_that_leaves_no_problem_is_said_before_the_work(monkeypatch):
    for module in ("hopopt.comparison.compare", "hopopt.planner.reserve"):
        monkeypatch.setattr(f"{module}.solve", lambda *_, **__: pytest.fail("solved"))
    design = load("paper", ["leg.gear.speed_cap=5", "reserve.speed=0.9"])
    with pytest.raises(UsageError, match=r"\[reserve\] leaves leg.gear.speed_cap = 0.4"):
        compare(design, ["force", "track"])


def _parameters(design):
    from hopopt.design import physical_parameters

    return physical_parameters(design.leg)


def test_draws_are_seeded_and_within_what_was_asked():
    design = load("paper")
    first, again, other = (drawn(design, Uncertainty(mass=0.05, torque_constant=0.1), 20, seed) for seed in (3, 3, 4))
    assert [d.leg for d in first] == [d.leg for d in again]
    assert [d.leg for d in first] != [d.leg for d in other]
    masses = np.array([[d.leg.leg.body.mass, d.leg.leg.link["shank"].mass] for d in first])
    assert np.abs(masses / [5.6, 0.8] - 1).max() <= 0.05
    gains = np.array([d.torque_gain for d in first])
    assert 0.05 < np.abs(gains - 1).max() <= 0.1


@pytest.mark.slow
def test_no_mismatch_loses_nothing(comparison):
    """Draws of no width are the believed leg: the distribution is one number."""
    only = Comparison(comparison.solution, comparison.plan, {"track": comparison.runs["track"]})
    found = spread(only, 2, 0, Uncertainty(mass=0, torque_constant=0), 2)["track"]
    assert found["clearances_m"] == pytest.approx([comparison.figures["track"].clearance] * 2)
    assert found["failed"] == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["force", "position"])
def test_tuned_gains_clear_more_than_the_printed_ones_and_less_than_the_bound(name, solution):
    printed, tucked, tuned = (
        simulate(solution.design, find(f"{name}{variant}")).figures for variant in ("", "_tuck", "_tuned")
    )
    assert not tuned.limits_exceeded
    assert printed.clearance < tucked.clearance < tuned.clearance < 0.8 * solution.clearance


@pytest.mark.rarely
def test_mismatched_legs_hop_if_enough_is_held_back(solution, monkeypatch):
    """5 % of mass and 10 % of torque constant: a drive with too large a constant is as much slower, so speed is held back."""
    overrides = ["reserve.torque=0.12", "reserve.speed=0.1", "reserve.ground_force=80", "reserve.height=0.02"]
    monkeypatch.setattr("hopopt.comparison.compare.plan_to_track", lambda design, *rest: plan_with_reserve(overrides))
    robust = compare(load("paper", overrides), ["track"], bound=solution)
    found = spread(robust, 12, 0, Uncertainty(), 2)["track"]
    assert found["draws"] == len(found["clearances_m"]) == 12
    assert found["failed"] == 0
    assert robust.plan is not None
    assert found["p05_m"] > 0.9 * robust.plan.clearance


@pytest.mark.rarely
def test_what_can_be_had_stands_in_the_answer_and_is_verified_by_simulating_again(solution, monkeypatch):
    had = can_be_had(solution, 3, processes=2)
    assert had.bound_m == had.ideal_bound_m == solution.clearance  # no friction is given
    assert had.pd is not None
    assert had.tracked is not None
    assert had.tracked.strategy in ("track", "track_mpc")
    assert had.pd.clearance_m < solution.clearance
    assert had.confidence == pytest.approx(1 - 0.95**3)
    monkeypatch.setattr(
        "hopopt.comparison.control_recheck.can_be_had", lambda *asked: had
    )  # the same seed: the same legs
    stated = solution.with_summary(can_be_had=had)
    assert all(check.passed for check in control_check(stated))
    more = replace(had, pd=replace(had.pd, clearance_m=had.pd.clearance_m + 0.01))
    wrong = [check for check in control_check(solution.with_summary(can_be_had=more)) if not check.passed]
    assert [(check.name, check.where) for check in wrong] == [
        ("what can be had as simulated", "can_be_had.pd.clearance_m")
    ]


def test_the_answer_says_what_can_be_had_in_a_line(solution, tmp_path, capsys):
    had = CanBeHad(0.8, 0.69, 0.95, 0.95, 60, 0, Attained("track", 0.5), Attained("position_tuned", 0.55))
    show(short_answer(save(solution.with_summary(can_be_had=had), tmp_path)))
    out = " ".join(capsys.readouterr().out.split())
    assert "95% of all legs within [uncertainty] reach 0.500 m with track and 0.550 m with position_tuned" in out
    assert "hopopt robust finds a better one" in out


@pytest.mark.parametrize("more", [["--objective", "apex"], ["--hop", "periodic"], ["--draws", "-2"]])
def test_legs_are_not_drawn_for_a_hop_that_is_no_bound_of_theirs(more, tmp_path, capsys):
    assert run(["solve", "--draws", "10", *more, "--results", str(tmp_path)]) == 2
    assert "draws" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_the_command_prints_one_object(comparison, solution, tmp_path, capsys):
    """And --strategies may be given again, as other options may."""
    folder, where = str(save(solution, tmp_path).result_dir), ["--results", str(tmp_path)]
    named = ["--strategies", "force", "--strategies", "force_tuck"]
    assert run(["compare", "--bound", folder, *named, *where, "--no-figures", "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["bound_m"] == pytest.approx(comparison.bound)
    assert data["strategies"]["force"]["clearance_m"] == pytest.approx(comparison.figures["force"].clearance)
    assert data["strategies"]["force"]["options"]["k_p"] == 5424.0  # what it ran with, not only what was given
    assert list(data["strategies"]) == ["optimum", "force", "force_tuck"]
    kept = json.loads((tmp_path / data["result_dir"].rsplit("/", 1)[1] / "comparison.json").read_text())
    assert kept["strategies"].keys() == data["strategies"].keys()


def test_the_command_speaks_plainly(comparison, solution, tmp_path, capsys):
    folder = str(save(solution, tmp_path).result_dir)
    arguments = ["--bound", folder, "--strategies", "force", "--tune", "0", "--results", str(tmp_path)]
    assert run(["compare", *arguments, "--no-figures"]) == 0
    out = capsys.readouterr().out
    assert "the bound is 0.79" in out
    assert "where the centimetres to the bound are lost (+)" in out
    assert "paper, force: foot 0.44 m simulated" in out


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["compare", "--strategies", "forse"], "there is no strategy 'forse': choose one of force, "),
        (["compare", "--draws", "-1"], "--draws must be at least 0 and at most 10000"),
        (["compare", "--basin"], "--basin is for the hop that repeats itself"),
        (["simulate", "--strategy", "no.such:Thing"], "cannot be imported"),
        (["simulate", "--option", "k_p"], "write it as name=value"),
        (["simulate", "--option", "k_q=3"], "k_q"),
        (["simulate", "--hops", "0"], "--hops must be at least 1"),
        (["simulate", "--plan", "nowhere"], "--plan is for strategies that follow one"),
        (["simulate", "--plant", "leg.body.mas=5"], "leg.body.mas"),
    ],
)
def test_wrong_use_is_one_sentence(arguments, sentence, tmp_path, capsys):
    assert run([*arguments, "--results", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert sentence in error
    assert "Traceback" not in error


def test_a_bound_of_another_problem_is_refused(solution, tmp_path, capsys):
    folder = str(save(solution, tmp_path).result_dir)
    assert run(["compare", "--set", "leg.gear.ratio=90", "--bound", folder, "--results", str(tmp_path)]) == 2
    assert "it was solved for another problem" in capsys.readouterr().err


@pytest.mark.slow
def test_the_command_that_the_answer_names_runs_on_its_leg(solution, tmp_path, capsys):
    """Whatever the problem was, and however accurately it was solved."""
    design = changed(solution.design, {"name": "mine", "solver.max_iterations": 4000})
    kept = save(dataclasses.replace(solution, design=design).with_summary(problem="mine"), tmp_path)
    show(short_answer(kept.with_summary(paper_strategy=paper_strategy(kept))))
    shown = " ".join(capsys.readouterr().out.split())
    assert f"hopopt compare --bound {kept.result_dir} has" in shown
    more = ["--strategies", "force", "--no-figures", "--json", "--results", str(tmp_path)]
    assert run(["compare", "--bound", str(kept.result_dir), *more]) == 0
    assert json.loads(capsys.readouterr().out)["problem"] == "mine"


def test_a_bound_holds_for_other_reserves_and_encoders(solution):
    """They do not touch the optimum, and the simulations are of the problem that was asked for."""
    design = load("paper", ["reserve.torque=0.1", "simulation.encoder_bits=12"])
    found = compare(design, ["force"], bound=solution)
    assert found.bound == solution.clearance
    assert found.solution.design == found.runs["force"].design == design


def test_a_stored_bound_is_verified_again(solution, tmp_path, capsys):
    folder = save(solution, tmp_path).result_dir
    assert folder is not None
    summary = json.loads((folder / "summary.json").read_text())
    (folder / "summary.json").write_text(json.dumps(summary | {"clearance_m": summary["clearance_m"] + 0.01}))
    arguments = ["--bound", str(folder), "--strategies", "force", "--tune", "0", "--results", str(tmp_path)]
    assert run(["compare", *arguments, "--no-figures", "--json"]) == 3
    data = json.loads(capsys.readouterr().out)
    assert data["bound_m"] is None
    assert {row["share_of_bound"] for row in data["strategies"].values()} == {None}


def test_strategies_that_do_not_suit_the_leg_are_refused_before_the_work(monkeypatch):
    for module in ("hopopt.comparison.compare", "hopopt.planner.reserve"):
        monkeypatch.setattr(f"{module}.solve", lambda *_, **__: pytest.fail("solved in vain"))
    data = load("paper").model_dump(exclude_none=True)
    data["leg"] |= {"joints": ("hip", "knee", "ankle"), "links": ("thigh", "shank", "toe")}
    data["leg"] |= {"ankle": {"lower": -1.0, "upper": 1.0}, "toe": {"length": 0.1, "mass": 0.2}}
    data["start"] = {"joint_angles": (1.12, -2.3, 1.0)}
    with pytest.raises(UsageError, match="need a leg of two joints"):
        compare(Design.model_validate(data), ["track", "force"])
    sideways = "leg.hip.axis=[0.6, -0.8, 0.0]"
    with pytest.raises(UsageError, match="leaves the x-z plane"):
        compare(load("three_joint", [sideways]))
    assert run(["simulate", "three_joint", "--strategy", "track", "--set", sideways]) == 2


def test_by_default_a_reader_gets_six_rows_and_all_on_request(solution):
    """The optimum, the tracked one, force control plain and with a tuck, the counter-movement, and the better of the two tuned ones."""
    names, notes = chosen_names(load("paper"), None)
    assert names == ["track", "force", "force_tuck", "counter_movement", "force_tuned", "position_tuned"]
    for given in (None, ["all"]):
        assert "counter_movement" not in chosen_names(load("paper_no_countermovement"), given)[0]
    assert not notes
    names, notes = chosen_names(load("paper"), ["all", "mine:Own"])
    assert set(names) == {*BUILT_IN, "mine:Own"}
    assert names[:3] == ["track", "track_mpc", "track_pd"]
    for given, kept in ((None, ["track"]), (["all"], ["track", "track_mpc", "track_pd"])):
        names, notes = chosen_names(load("three_joint"), given)
        assert names == kept
        assert "left out" in notes[0]


@pytest.mark.slow
def test_the_best_tuned_strategy_is_shown_and_the_other_named(solution, monkeypatch):
    monkeypatch.setattr("hopopt.comparison.compare.DEFAULT", ("force",))  # tracking needs a plan of its own
    found = compare(solution.design, bound=solution)
    heights = {name: simulate(solution.design, find(name)).figures.clearance for name in TUNED_PD}
    best, worse = sorted(heights, key=lambda name: -heights[name])
    assert list(found.runs) == ["force", best]
    assert found.notes == (f"{worse}, the lesser of the tuned two, clears {heights[worse]:.3f} m",)


@pytest.mark.slow
def test_an_overshoot_is_told_beside_the_number_and_the_braked_servo_has_none(solution, capsys):
    """The paper's 0.44 m is what its reference alone gives: the leg as short as y_f when the foot is highest."""
    found = compare(solution.design, ["force", "force_braked", "force_tuck"], bound=solution)
    assert found.runs["force_tuck"].overshoot is None
    short = {name: found.runs[name].overshoot or np.nan for name in ("force", "force_braked")}
    assert short["force"] > 0.03
    assert abs(short["force_braked"]) < 0.005
    assert found.figures["force_braked"].foot_height == pytest.approx(0.44, abs=0.01)
    f = found.figures["force"]
    length = np.hypot(*(f.trace.points["hip"] - f.trace.points["foot"])[f.highest])
    assert length + f.clearance == pytest.approx(
        f.trace.points["hip"][f.highest, 1], abs=0.01
    )  # it hangs below the hip
    show(shown_comparison(found.as_dict() | {"result_dir": "here", "wall_s": 1.0}))
    shown = capsys.readouterr().out
    assert f"force: its servo overshoots: at the clearance the leg is {100 * short['force']:.1f} cm shorter" in shown
    assert "force_braked: its" not in shown
    assert "force clears less than half" not in shown


def test_a_strategy_far_from_the_bound_says_what_is_in_its_way(solution, capsys):
    """Position control as soft as in the paper's figures pushes too little."""
    found = compare(solution.design, ["position_soft"], bound=solution)
    gap = found.gap("position_soft")
    most = max(gap, key=lambda part: gap[part])
    show(shown_comparison(found.as_dict() | {"result_dir": "here", "wall_s": 1.0}))
    said = capsys.readouterr().out
    words = {"push_m": "push", "timing_m": "timing", "retraction_m": "fold"}[most]
    assert (
        f"position_soft clears less than half of the bound: it loses most by {words}, {100 * gap[most]:.1f} cm" in said
    )


def test_a_strategy_that_does_not_hop_has_no_share(solution):
    limp = replace(find("force"), options={"k_s": 1700.0}, make=lambda setting: Limp())
    run = simulate(solution.design, limp)
    row = Comparison(solution, None, {"limp": run}).row("limp")
    assert row["share_of_bound"] is None
    assert "never leaves the ground" in row["no_hop"]


class Limp:
    """No torque at all."""

    def torque(self, now):
        return 0 * now.q


@pytest.mark.slow
def test_a_hop_faster_than_a_gear_may_turn_does_not_disprove_the_bound():
    """The plant has no brake on a gear's speed cap, the planner keeps it: the hop is not within the same limits."""
    overrides = ["leg.motor.laws=[]", "leg.gear.torque_cap=107", "leg.gear.speed_cap=680"]
    design = load("paper", overrides)
    f = simulated_once(design, find("force"), past_apex=True).figures
    assert np.abs(f.trace.v[:, -1]).max() > 6.8
    assert any("faster than its drive may turn" in words for words in f.limits_exceeded)
    of_the_paper = simulated_once(load("paper"), find("force"), past_apex=True)
    assert not any("faster" in words for words in of_the_paper.figures.limits_exceeded)


def test_a_bound_of_another_objective_is_refused(solution):
    with pytest.raises(UsageError, match="compared by clearance"):
        compare(solution.design, ["force"], bound=dataclasses.replace(solution, objective="apex"))


def test_simulating_is_told_in_words_and_numbers(tmp_path, capsys):
    assert run(["simulate", "--strategy", "force", "--results", str(tmp_path), "--no-figures", "--json"]) == 0
    row = json.loads(capsys.readouterr().out)
    assert row["strategy"] == "force"
    assert row["lift_offs"]
    assert row["clearance_m"] == pytest.approx(sum(row["parts"].values()))


@pytest.mark.slow
def test_a_weaker_plant_than_believed_clears_less(tmp_path, capsys):
    heights = []
    for extra in ([], ["--plant", "leg.motor.max_torque=1.6"]):
        run(["simulate", "--strategy", "force_tuck", *extra, "--results", str(tmp_path), "--no-figures", "--json"])
        heights.append(json.loads(capsys.readouterr().out)["clearance_m"])
    assert heights[1] < heights[0] - 0.02


def test_every_built_in_strategy_has_words():
    assert all(strategy.meaning for strategy in BUILT_IN.values())


def test_a_figure_that_fails_loses_nothing(comparison, tmp_path, caplog):
    def fails(folder):
        raise RuntimeError("no ink")

    runs = {"force": comparison.runs["force"].trace}
    folder = save_runs("comparison", comparison.solution.design, comparison.as_dict(), runs, tmp_path, fails)
    assert {p.name for p in folder.iterdir()} >= {"comparison.json", "runs.nc", "problem.toml"}
    assert "no ink" in caplog.text
    again = save_runs("comparison", comparison.solution.design, comparison.as_dict(), runs, tmp_path)
    assert again != folder


@pytest.mark.slow
def test_a_leg_that_only_stands_is_said_to(tmp_path, capsys, monkeypatch):
    (tmp_path / "standing.py").write_text(
        "class Stand:\n"
        "    def __init__(self, setting):\n"
        "        assert setting.plan is None\n"
        "        self.rest = setting.start\n\n"
        "    def torque(self, now):\n"
        "        return 800 * (self.rest - now.q) - 20 * now.v\n"
    )
    monkeypatch.setattr("sys.path", [path for path in sys.path if path not in ("", str(tmp_path))])
    monkeypatch.chdir(tmp_path)  # where it is found, as a user-defined objective is
    assert run(["simulate", "--strategy", "standing:Stand", "--results", str(tmp_path), "--no-figures"]) == 0
    assert "the foot never left the ground" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("rules", "said"),
    [
        ({"hop.flight_duration": [0.03, 0.12]}, "flight of 0.2"),
        ({"hop.stance_duration": [0.2, 0.4]}, "stance of 0.1"),
        ({"hop.least_height": 0.2}, "knee down to 0.1"),
        ({"hop.least_height": 0.2, "hop.above_ground": ["hip", "foot"]}, ""),
    ],
)
def test_a_hop_that_lasts_too_long_or_hangs_too_low_is_not_within_the_limits(rules, said):
    """Such a hop does not disprove a bound; a joint that need not stay above the ground may hang as low as it likes."""
    run = simulated_once(load("paper"), find("force_tuck"))  # the rules are none of the plant's
    found = replace(run, design=load("paper", rules)).figures.limits_exceeded
    assert [words[: len(said)] for words in found] == [said] * bool(said)


def test_a_joint_that_may_pass_the_ground_does_not_end_a_run():
    for above, stops in ((["hip", "knee"], "the knee hit the ground"), (["hip", "foot"], "")):
        plant = make_plant(load("paper", {"hop.above_ground": above}))
        start = plant.stance_start(np.array([1.3, -2.4]))
        q = start.q.copy()
        q[1] = plant.machine.points(np.array([0, 0, *q[2:]]))["knee"][1] * -1 - 0.01  # the knee 1 cm below the ground
        assert plant.fault(dataclasses.replace(start, q=q)) == stops


def test_a_bound_with_limits_of_one_s_own_bounds_no_strategy(solution):
    limited = solution.with_summary(functions=Functions(None, ("module:stay_low",)))
    with pytest.raises(UsageError, match="keeps limits of your own"):
        compare(solution.design, ["force"], bound=limited)


def test_a_plan_that_suits_no_simulation_of_the_leg_is_refused(solution, tmp_path, monkeypatch, capsys):
    periodic = dataclasses.replace(solution, design=solution.design.of_kind("periodic"))
    for problem, plan, why in (("paper", periodic, "begins as it lands"), ("three_joint", solution, "other joints")):
        with pytest.raises(UsageError, match=why):
            ho.simulate(problem, "track", plan=plan)
        monkeypatch.setattr("hopopt.storage.solution.read", lambda folder, plan=plan: plan)
        words = [problem, "--strategy", "track", "--plan", str(tmp_path), "--results", str(tmp_path)]
        assert why in refusal(["simulate", *words], capsys)


@pytest.mark.rarely
def test_all_rows_of_a_similar_leg_are_the_papers(solution, monkeypatch):
    """A quarter as large: nothing is given but what makes it a copy, and what is asked of it. Tuned rows are each leg's own."""
    names = ["force", "force_tuck", "position_tuck", "track", "track_pd"]
    small = compare(load("paper", {**similar(0.25), "solver.starts": 1}), names)
    monkeypatch.setattr("hopopt.comparison.compare.plan_to_track", lambda design, *rest: plan_with_reserve())
    of = compare(solution.design, names, bound=solution)
    assert not small.notes
    assert small.plan is not None
    assert of.plan is not None
    assert small.plan.clearance == pytest.approx(0.25 * of.plan.clearance, rel=1e-3)
    for name in (OPTIMUM, *names):
        assert small.figures[name].clearance == pytest.approx(0.25 * of.figures[name].clearance, rel=1e-3), name
        assert len(small.figures[name].limits_exceeded) == len(of.figures[name].limits_exceeded)
