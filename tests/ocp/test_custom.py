"""User-defined objectives and constraints: what they mean, how they are checked, what is reported of wrong ones."""

import json
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import hopopt as ho
from hopopt.cli.main import run
from hopopt.errors import UsageError
from hopopt.ocp.custom import Moment, as_objective, custom
from hopopt.ocp.hop import Hop
from hopopt.ocp.objectives.registry import find
from hopopt.planner.answer.extras import Functions
from hopopt.planner.checks.custom_check import custom_checks
from hopopt.planner.solution import Solution
from hopopt.problem.load import load
from hopopt.storage.seal.recheck import with_functions
from hopopt.verify.measures import positive_work

FORCE = 400.0  # N

MODULE = """
import hopopt as ho

@ho.constraint(upper=400.0, unit="N", scale=400.0, phases=("stance",))
def soft(now):
    return now.f[1]

def branches(now):
    return 1 if now.q[2] > 0 else 0

def stops(now):
    return now.nothing

def text(now):
    return "high"

def constant(now):
    return 3.0

def two(now):
    return [now.q[0], now.q[1]]

def torque(now):
    return now.tau[0]

def leaves(now):
    raise SystemExit

number = 3
"""


@ho.constraint(upper=FORCE, unit="N", scale=FORCE, phases=("stance",))
def soft(now: Moment) -> ca.SX:
    return now.f[1]


@ho.objective(unit="m")
def foot_height(end: Moment) -> ca.SX:
    return end.points["foot"][1]


@ho.objective(unit="s", maximize=False, running=True, clearance=True)
def lasting(now: Moment) -> ca.SX:
    return 1.0 + 0 * now.q[0] + 1e-9 * now.tau[0] ** 2


@pytest.fixture(scope="module")
def softly() -> Solution:
    return ho.solve(ho.load("paper"), constraints=[soft], starts=1, processes=1)


def test_a_constraint_of_ones_own_holds_and_costs(softly: Solution, hop: Solution) -> None:
    assert softly.verified, softly.summary.failed_checks
    assert softly.tables["stance"].f[..., 1].max() == pytest.approx(FORCE, rel=1e-3)
    assert hop.tables["stance"].f[..., 1].max() > 1.2 * FORCE
    assert softly.clearance < hop.clearance
    assert softly.summary.functions.constraints == (f"{__name__}:soft",)


@pytest.mark.parametrize(
    ("given", "lower", "upper"),
    [
        ({"upper": -5.0}, -np.inf, -5.0),
        ({"upper": 5.0}, -np.inf, 5.0),
        ({"lower": -5.0}, -5.0, np.inf),
        ({"lower": -5.0, "upper": -2.0}, -5.0, -2.0),
        ({}, 0.0, np.inf),
    ],
)
def test_one_bound_leaves_the_other_side_open(given: dict[str, float], lower: float, upper: float) -> None:
    """Of what may be negative too: the ground force along."""
    along = ho.constraint(phases=("stance",), unit="N", **given)(lambda now: now.f[0])
    hop = Hop(load("paper"), constraints=(custom(along),))
    own = [c for c in hop.problem.phases[0].path if c.unit == "N" and str(custom(along).name) in str(c.name)]
    assert [(c.lower, c.upper) for c in own] == [(lower, upper)]


def test_an_objective_is_no_constraint() -> None:
    with pytest.raises(UsageError, match="limits nothing"):
        Hop(load("paper"), constraints=(custom(foot_height),))


def test_a_constraint_of_ones_own_is_among_the_limits_where_it_acts(softly: Solution) -> None:
    stance = softly.tables["stance"]
    at, h = (stance.f[..., 1] > 0.999 * FORCE).mean(axis=1), softly.phases["stance"].lengths
    assert softly.summary.active_limits[f"{__name__}:soft (upper)"] == pytest.approx(h @ at / h.sum(), abs=0.03)


@pytest.mark.rarely
def test_more_of_a_constraint_of_ones_own_gives_what_is_said(softly: Solution) -> None:
    """One per cent, against solving with more and with less."""

    def best(force: float) -> float:
        other = ho.constraint(upper=force, unit="N", scale=FORCE, phases=("stance",))(lambda now: now.f[1])
        return ho.solve(ho.load("paper"), constraints=[other], starts=1, processes=1).clearance

    gained = (best(1.01 * FORCE) - best(0.99 * FORCE)) / 2
    assert softly.summary.gains[f"{__name__}:soft (upper)"] == pytest.approx(gained, rel=0.03)


def test_a_constraint_is_checked_between_the_nodes(softly: Solution) -> None:
    goal = find("clearance")
    (check,) = custom_checks(softly.robot, softly.tables, goal, [custom(soft)], None)
    assert check.passed
    strict = replace(custom(soft), terms=replace(custom(soft).terms, upper=0.99 * FORCE))
    (check,) = custom_checks(softly.robot, softly.tables, goal, [strict], None)
    assert not check.passed
    assert check.residual == pytest.approx(0.01, rel=0.05)


def test_the_checks_leg_is_pinocchios(softly: Solution) -> None:
    """Everything a function may use, at every instant, against the planner's own samples."""

    def everything(now: Moment) -> ca.SX:
        points = [now.points[name] for name in ("hip", "knee", "foot", "com")]
        return ca.vertcat(now.t, now.q, now.v, now.a, now.tau, now.f, *points, now.com_v)

    from hopopt.planner.checks.custom_check import along

    table = softly.tables["flight"]
    found = along(softly.robot, "flight", table, custom(everything), np.array([0.5]))[:, 0]
    t = 0.5 * (table.t[:, 0] + table.t[:, -1]) - table.t[0, 0]
    s = softly.sample_phase("flight", t)
    points = [s.points[name] for name in ("hip", "knee", "foot", "com")]
    expected = np.column_stack([t, s.q, s.v, s.a, s.tau, s.f, *points, s.com_v])
    np.testing.assert_allclose(found, expected, atol=1e-5, rtol=1e-5)


@pytest.mark.slow
def test_an_objective_of_ones_own_at_the_end() -> None:
    s = ho.solve(ho.load("paper", {"solver.max_refinements": 12}), foot_height, starts=1, processes=1)
    assert s.verified, s.summary.failed_checks
    height = s.tables["flight"].q[-1, -1]
    from hopopt.sim.machine import Machine

    assert s.summary.reached == pytest.approx(Machine(s.robot).points(height)["foot"][1], rel=1e-6)


@pytest.mark.rarely
def test_a_running_objective_is_the_integral() -> None:
    """The integral of one is the time: the same least time as the built-in objective's."""
    design = ho.load("paper", {"hop.clearance": 0.3})
    own, built_in = (ho.solve(design, o, starts=1, processes=1) for o in (lasting, "time"))
    assert own.verified, own.summary.failed_checks
    assert own.summary.reached == pytest.approx(built_in.summary.reached, rel=1e-4)
    assert own.clearance == pytest.approx(0.3, abs=1e-6)


def test_a_false_claim_is_found(softly: Solution) -> None:
    goal = as_objective(foot_height)
    height = Hop(softly.design, goal).objective
    (check,) = custom_checks(softly.robot, softly.tables, height, [], softly.clearance + 0.01)
    assert not check.passed
    assert positive_work(softly.robot, softly.tables, softly.design.hop) > 0


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("branches", "no if, while, min or max"),
        ("stops", "mine:stops stopped with AttributeError"),
        ("text", "mine:text returned str: a CasADi expression"),
        ("constant", "mine:constant does not depend on the hop"),
        ("two", "mine:two returned 2 values: an objective is one number"),
        ("leaves", "mine:leaves stopped with SystemExit"),
        ("torque", "a, tau and f are not there at the end"),
        ("number", "mine:number is not a function"),
        ("missing", "mine:missing cannot be imported: AttributeError"),
    ],
)
def test_wrong_functions_are_explained(
    name: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    assert run(["solve", "--objective", f"mine:{name}", "--starts", "1"]) == 2
    error = capfd.readouterr().err
    assert words in error
    assert "Traceback" not in error


def test_a_module_that_exits_is_no_success(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "script.py").write_text("import sys\nsys.exit()\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    assert run(["solve", "--objective", "script:f", "--starts", "1"]) == 2
    assert "script:f cannot be imported: SystemExit" in capfd.readouterr().err


def test_a_leg_that_leaves_the_plane_has_a_force_of_three_parts() -> None:
    def forces(now: Moment) -> ca.SX:
        assert now.f.numel() == 3
        return ca.vertcat(now.f[1], now.f[2] - now.f[-1] + now.f[0])

    tilted = {"leg.knee.axis": (0.3, 0.8, 0.2), "start.joint_angles": (0.3, -0.6)}
    hop = Hop(ho.load("paper", tilted), constraints=(custom(forces),))
    assert [str(c.name) for phase in hop.problem.phases for c in phase.path].count(custom(forces).name) == 2


@pytest.mark.slow
def test_a_stored_result_names_its_function_and_does_not_run_it(
    softly: Solution, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "ours.py").write_text(MODULE)
    monkeypatch.syspath_prepend(str(tmp_path))
    named, without = Functions(None, ("ours:soft",)), Functions(None, ())
    saved = ho.save(softly.with_summary(functions=named), tmp_path / "results")
    plain = ho.save(softly.with_summary(functions=without), tmp_path / "results")
    assert saved.result_dir is not None
    assert plain.result_dir is not None
    assert saved.result_dir != plain.result_dir
    assert "-2" not in plain.result_dir.name  # another question has another name
    assert run(["verify", str(saved.result_dir)]) == 2
    error = capfd.readouterr().err
    assert "needs their module: add --constraint ours:soft" in error
    run(["verify", str(saved.result_dir), "--constraint", "ours:soft", "--json"])
    found = json.loads(capfd.readouterr().out)
    assert "stance ours:soft" in {c["name"] for c in found["checks"]}
    checks = [*found["checks"], *found["checks_of_the_file"]]
    failed = {c["name"] for c in checks if not c["passed"]}  # the summary names the function as the test module's
    assert failed == {"figures of the summary as computed", "residuals of the summary as computed"}


def test_functions_given_again_leave_the_stored_plan_as_it_is(softly: Solution) -> None:
    """What is checked is what the file holds, not what follows from its collocation data."""
    stored, stance = replace(softly), softly.tables["stance"]
    stored.__dict__["tables"] = {**softly.tables, "stance": replace(stance, f=1.01 * stance.f)}
    again = with_functions(stored, None, [soft])
    np.testing.assert_array_equal(again.tables["stance"].f, 1.01 * stance.f)
    (check,) = custom_checks(again.robot, again.tables, find("clearance"), again.own[1], None)
    assert not check.passed


def test_problem_files_and_stored_names_never_run_code() -> None:
    with pytest.raises(UsageError, match="only run where it is given"):
        Hop(ho.load("paper"), "os:getcwd")
