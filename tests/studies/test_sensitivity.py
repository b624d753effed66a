"""Derivatives of the optimum: closed forms, identities that hold for every leg, solving again, what a user sees."""

import json
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

import hopopt as ho
from hopopt.cli.main import run
from hopopt.cli.studies.sensitivity import TABLE_ROWS, left_out, sentences, shown
from hopopt.design import physical_parameters
from hopopt.errors import UsageError
from hopopt.leg.kinematics import start_angles
from hopopt.nlp.mesh import PhaseMesh, mesh_of_arcs, uniform
from hopopt.nlp.schemes import Scheme, radau
from hopopt.nlp.solver.ipopt import NlpSolver
from hopopt.nlp.transcription import Guess, Transcription
from hopopt.ocp.problem import Control, Objective, Parameter, PathConstraint, Phase, Problem, State
from hopopt.optimality.directions.parametric_sensitivity import Slopes, slopes
from hopopt.planner.solution import Solution, stored_nlp
from hopopt.planner.solve import solve
from hopopt.problem.load import load
from hopopt.studies.finite_differences import chosen, confirmed, solve_again, with_entry
from hopopt.studies.influence import Difference, Influence
from hopopt.studies.sensitivity import as_dict, pose_slopes, sensitivity, settled_within
from known_problems import double_integrator, moved
from once import solved_once

G = 9.81
TIME: Mapping[str, Callable[[Any], Any]] = {"time": lambda s: ca.SX(1.0)}  # an integrand


def solved(
    problem: Problem, mesh: PhaseMesh, guess: tuple[float, list, list, float], scheme: Scheme | None = None
) -> Slopes:
    """Slopes of a problem of one phase, from a straight-line guess: duration, both ends, control."""
    duration, first, last, u = guess
    line = Guess(duration, np.array([0.0, 1.0]), np.array([first, last]), np.array([[u], [u]]))
    (phase,) = problem.phases
    solution = NlpSolver(Transcription(problem, scheme or radau(3), {phase.name: mesh}))({phase.name: line})
    assert solution.success
    return slopes(solution)


# ---- closed forms ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("d", "u"), [(1.0, 1.0), (2.0, 0.7), (0.3, 5.0)])
@pytest.mark.parametrize("maximize", [False, True], ids=["time", "minus time"])
def test_minimum_time(d: float, u: float, maximize: bool) -> None:
    """From rest to rest over d with |u| <= u_max: T = 2 sqrt(d / u_max), whichever sign the objective has."""
    sign, T = (-1 if maximize else 1), 2 * np.sqrt(d / u)
    states = (State("x", initial=0.0, final=d), State("v", initial=0.0, final=0.0))
    limit = PathConstraint("drive", lambda s: s.u / s.p["u_max"], -1.0, 1.0, scale=2.0)
    phase = Phase("move", states, (Control("u", scale=u),), double_integrator, (0.01, 20.0), (limit,), TIME)
    goal = Objective("time", lambda e: sign * e.integral["move"]["time"], maximize=maximize)
    by = solved(Problem("fast", (phase,), goal, (Parameter("u_max", value=u),)), uniform(6), (T, [0, 0], [d, 0], 0.0))
    assert sign * by.parameters["u_max"][0] == pytest.approx(-T / (2 * u), rel=1e-7)
    low, high = by.of_state("move", "x")
    assert sign * (low + high)[-1, 0] == pytest.approx(T / (2 * d), rel=1e-7)


@pytest.mark.parametrize("mesh", [uniform(4), mesh_of_arcs((0.0, 0.5, 1.0), (2, 2))], ids=["one arc", "two arcs"])
@pytest.mark.parametrize("side", [0, 1], ids=["shortest", "longest"])
def test_durations(mesh: PhaseMesh, side: int) -> None:
    """Least effort 12 / T^3, held back by the longest duration; most of it, by the shortest."""
    effort, T = {"effort": lambda s: s.u**2}, 1.3
    duration = (0.4, T) if side else (T, 3.0)
    price = 0.0 if side else 100.0  # time costs, so that the shortest is best
    phase = moved((-np.inf, np.inf), 1.0, duration, integrands=effort)
    goal = Objective("effort", lambda e: e.integral["move"]["effort"] + price * e.duration["move"])
    by = solved(Problem("effort", (phase,), goal), mesh, (T, [0, 0], [1, 0], 0.0)).of_duration("move")
    assert by[side] == pytest.approx(-36 / T**4 + price, rel=1e-6)
    assert by[1 - side] == pytest.approx(0.0, abs=1e-6)


HASTE = 0.1  # m/s, weight of the push's duration: waiting is never optimal


def rise_of_hopper() -> Callable[..., Any]:
    """Gradient of v_lo^2 / (2 g) - HASTE T by mass, F0, v0 and stroke: v = (a/b) (1 - exp(-b t)), T from x(T) = s."""
    m, F0, v0, s, t = (ca.SX.sym(name) for name in ("m", "F0", "v0", "s", "t"))
    a, b = F0 / m - G, F0 / (m * v0)
    x, v = a / b * t - a / b**2 * (1 - ca.exp(-b * t)), a / b * (1 - ca.exp(-b * t))
    numbers = ca.vertcat(m, F0, v0, s)
    lasts = ca.rootfinder("T", "newton", {"x": t, "p": numbers, "g": x - s}, {"abstol": 1e-14})
    T = lasts(0.2, ca.MX.sym("p", 4))
    p = ca.symvar(T)[0]
    rise = ca.Function("rise", [t, numbers], [v**2 / (2 * G) - HASTE * t])(T, p)
    return ca.Function("gradient", [p], [ca.gradient(rise, p), T])


@pytest.mark.parametrize("hopper", [(8.27, 500.0, 6.0, 0.2), (1.0, 100.0, 3.0, 0.1), (40.0, 900.0, 10.0, 0.5)])
def test_hopper_of_one_dimension(hopper: tuple[float, float, float, float]) -> None:
    """A push of F <= F0 (1 - v / v0) over a stroke: what mass, force, speed and stroke are worth."""
    m, F0, v0, s = hopper
    expected, T = (np.array(part).ravel() for part in rise_of_hopper()(np.array(hopper)))
    states = (State("x", lower=0.0, scale=s, initial=0.0, final=s), State("v", lower=0.0, scale=v0, initial=0.0))
    path = (
        PathConstraint("motor", lambda i: i.F / i.p["F0"] + i.v / i.p["v0"], upper=1.0),
        PathConstraint("only pushes", lambda i: i.F, lower=0.0, scale=F0, unit="N"),
    )
    rates: Any = lambda i: {"x": i.v, "v": i.F / i.p["m"] - G}  # noqa: E731
    phase = Phase("push", states, (Control("F", scale=F0),), rates, (1e-3, 5.0), path, TIME)
    goal = Objective(
        "rise", lambda e: e.final["push"].v ** 2 / (2 * G) - HASTE * e.integral["push"]["time"], maximize=True
    )
    parameters = tuple(Parameter(name, value=value) for name, value in (("m", m), ("F0", F0), ("v0", v0)))
    guess = (1.3 * float(T[0]), [0.0, 0.0], [s, 0.5 * v0], 0.5 * F0)
    by = solved(Problem("hopper", (phase,), goal, parameters), uniform(20), guess)
    low, high = by.of_state("push", "x")
    found = [*(float(by.parameters[name][0]) for name in ("m", "F0", "v0")), (low + high)[-1, 0]]
    np.testing.assert_allclose(found, expected, rtol=1e-5)


@pytest.mark.parametrize(
    "own",
    [{}, {"start.foot_x": 0.05}, {"start.hip_height": 0.5, "leg.thigh.length": 0.3},
     {"leg.knee": {"lower": 0.15, "upper": 2.4}, "leg.hip": {"lower": -1.3, "upper": 0.6}}],
    ids=["paper", "foot ahead", "high", "knee behind"],
)  # fmt: skip
def test_start_pose_follows_the_lengths(own: dict[str, Any]) -> None:
    design, step = load("paper", own), 1e-5
    by = dict(pose_slopes(design))
    assert set(by) == {"leg.thigh.length", "leg.shank.length", "start.hip_height", "start.foot_x"}
    values = physical_parameters(design.leg) | {"start.hip_height": design.start.hip_height, "start.foot_x": design.start.foot_x}  # fmt: skip
    for path, slope in by.items():
        up, down = (start_angles(with_entry(design, path, values[path] + h)) for h in (step, -step))
        np.testing.assert_allclose(slope, (up - down) / (2 * step), rtol=1e-6, atol=1e-7)


# ---- identities that hold for every leg --------------------------------------------------------------------------

CAPS = ["leg.gear.torque_cap=180", "leg.motor.torque_cap=1.9", "leg.gear.speed_cap=900"]
OTHER = [
    *CAPS, "leg.knee.gear.ratio=85", "leg.hip.motor.max_torque=2.4", "leg.thigh.com=0.15", "leg.thigh.inertia=0.03",
    "contact.friction=0.8", "contact.least_force=15", "hop.least_height=0.02", "hop.foot_window=0.05",
    "start.hip_height=0.31", "start.foot_x=0.02", "hop.stance_duration=[0.03, 0.3]",
]  # fmt: skip
ANGLES = ["start.joint_angles=[1.0, -2.1]", "leg.motor.laws=['four-quadrant']", "leg.motor.max_torque=1.5"]
LEGS = {"paper": [], "other": OTHER, "angles": ANGLES, "refined": OTHER}
EACH = [pytest.param(name, marks=[pytest.mark.slow] if name == "refined" else []) for name in LEGS]
TWO_CAPS = ["leg.gear.torque_cap=120", "leg.motor.torque_cap=1.2"]  # both 120 N m at the joint


@cache
def coarse(name: str) -> Solution:
    """An optimum on a coarse mesh: what follows holds for it as for any; and one on a refined mesh, where limits are enforced
    between the nodes."""
    mesh = (
        [] if name == "refined" else ["solver.stance_intervals=12", "solver.flight_intervals=6", "solver.refine=false"]
    )
    return solved_once([*(LEGS | {"two caps": TWO_CAPS})[name], *mesh])


def by_name(found: Iterable[Influence]) -> dict[str, Influence]:
    return {i.name: i for i in found}


def influences(solution: Solution) -> dict[str, Influence]:
    return by_name(sensitivity(solution))


@cache
def found_on(name: str) -> tuple[Influence, ...]:
    """What the entries of a coarse optimum are worth."""
    return tuple(sensitivity(coarse(name)))


def weighted(found: Mapping[str, Influence], weights: Mapping[str, float]) -> float:
    """Sum of power x value x derivative over all entries but joints' parts, the power by the ending of the path."""
    total = 0.0
    for name, i in found.items():
        power = next((w for ending, w in weights.items() if name.endswith(ending)), 0.0)
        total += power * i.value * i.per_unit if i.part_of is None else 0.0
    return total


@pytest.mark.parametrize("leg", EACH)
def test_scaling_masses_and_torques_together_changes_nothing(leg: str) -> None:
    """Masses, inertias, rotors, torques and forces by one factor: every motion stays possible (gravity is fixed)."""
    endings = ("mass", "inertia", "max_torque", "torque_cap", "least_force")
    found = by_name(found_on(leg))
    assert abs(weighted(found, dict.fromkeys(endings, 1.0))) < 1e-6
    assert abs(weighted(found, {"mass": 1.0})) > 1e-2  # the parts of the sum are not small


@pytest.mark.parametrize("leg", EACH)
def test_scaling_lengths_and_times_together_scales_the_clearance(leg: str) -> None:
    """Lengths by f, times by sqrt(f), torques by f, inertias by f^2: a hop in all f times as large.

    Only the tie-break, a speed times a time, does not keep up.
    """
    lengths = dict.fromkeys((".length", ".com", "foot_window", "least_height", "hip_height", "foot_x"), 1.0)
    drives = {"max_torque": 1.0, "torque_cap": 1.0, "max_speed": -0.5, "speed_cap": -0.5, "inertia": 2.0}
    times = dict.fromkeys(("duration[0]", "duration[1]"), 0.5)
    s = coarse(leg)
    total = weighted(by_name(found_on(leg)), lengths | drives | times)
    assert abs(total - s.clearance) < s.summary.bias


@pytest.mark.parametrize("leg", EACH)
def test_a_gear_is_worth_what_another_motor_is(leg: str) -> None:
    """For each joint: ratio by f equals motor torque by f, speed by 1/f, rotor inertia by f^2."""
    found, design = by_name(found_on(leg)), coarse(leg).design
    for joint in design.leg.joints:
        total = 0.0
        figures = {"gear.ratio": 1, "motor.max_torque": -1, "motor.torque_cap": -1, "motor.max_speed": 1,
                   "gear.speed_cap": 1, "motor.rotor_inertia": -2}  # fmt: skip
        for figure, power in figures.items():
            path, value = design.leg.drive(joint, *figure.split("."))  # type: ignore[arg-type]
            if value is not None:
                total += power * value * found.get(f"leg.{joint}.{figure}", found[path]).per_unit
        assert abs(total) < 1e-9


def test_parts_of_the_joints_sum_to_the_whole() -> None:
    """Against the program that has no parts."""
    s, found = coarse("paper"), by_name(found_on("paper"))
    whole = slopes(stored_nlp(s)).parameters
    for path in ("leg.gear.ratio", "leg.motor.max_torque", "leg.motor.max_speed", "leg.motor.rotor_inertia"):
        parts = [i for i in found.values() if i.part_of == path]
        assert {i.name.split(".")[1] for i in parts} == {"hip", "knee"}
        assert sum(i.per_unit for i in parts) == pytest.approx(whole[path][0], rel=1e-9)
        assert found[path].per_unit == pytest.approx(whole[path][0], rel=1e-9)


@pytest.mark.parametrize("leg", EACH)
def test_names_are_paths_of_the_problem_file(leg: str) -> None:
    s, found = coarse(leg), found_on(leg)
    assert len({i.name for i in found}) == len(found)
    assert set(physical_parameters(s.design.leg)) <= {i.name for i in found}
    for i in found:
        changed = with_entry(s.design, i.name, i.value)
        assert i.part_of or changed == s.design, i.name
        assert "[" in i.name or load("paper", {i.name: i.value})
    ranks = [abs(i.per_percent) for i in found]
    assert ranks == sorted(ranks, reverse=True)


ENTRIES = (
    "contact.friction", "contact.least_force", "hop.least_height", "hop.stance_duration[1]", "start.hip_height",
    "start.foot_x", "leg.knee.lower", "leg.knee.gear.ratio", "leg.hip.motor.max_torque", "leg.thigh.length",
    "leg.thigh.com", "leg.shank.length", "leg.motor.rotor_inertia",
)  # fmt: skip


@pytest.mark.slow
def test_derivatives_against_small_steps_on_the_same_mesh() -> None:
    """A leg on which nearly every limit is active; steps so small that the same ones stay active."""
    s, step = coarse("other"), 1e-5
    nlp, found = stored_nlp(s), by_name(found_on("other"))
    for name in ENTRIES:
        i = found[name]
        up, down = (
            solve_again(nlp, with_entry(s.design, name, i.value * (1 + h)), "clearance").objective
            for h in (step, -step)
        )
        assert i.per_unit == pytest.approx((up - down) / (2 * step * i.value), rel=2e-3, abs=1e-7), name


# ---- the paper's leg ---------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def paper(hop: Solution, tmp_path_factory: pytest.TempPathFactory) -> Solution:
    assert hop.verified
    return ho.save(hop, tmp_path_factory.mktemp("results"))


@pytest.fixture(scope="module")
def found(paper: Solution) -> list[Influence]:
    return sensitivity(paper)


def test_lengths_of_a_leg_with_shapes_are_left_out_and_it_is_said(
    paper: Solution, found: list[Influence], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What shapes have of a length is a number in the program, so multipliers do not tell what the length is worth."""
    monkeypatch.setattr("hopopt.studies.sensitivity.has_shape", lambda leg: True)
    left = sensitivity(paper)
    lengths = {"leg.thigh.length", "leg.shank.length"}
    assert {i.name for i in found} - {i.name for i in left} == lengths
    said = [line for line in shown({**as_dict(paper, left, []), "result_dir": ""}, left) if isinstance(line, str)]
    assert any(line.startswith("Lengths are left out") for line in said)


@pytest.mark.slow
def test_a_changed_length_changes_the_start(paper: Solution, found: list[Influence]) -> None:
    """Without the start pose the derivative by the thigh's length would be a quarter too small."""
    i = confirmed(paper, by_name(found)["leg.thigh.length"])
    assert i.difference is not None
    assert i.difference.central == pytest.approx(i.per_unit, rel=0.01)
    assert i.difference.verdict(i.per_unit).startswith("agrees")
    fixed_pose = slopes(stored_nlp(paper)).parameters["leg.thigh.length"][0]
    assert abs(fixed_pose / i.difference.central - 1) > 0.1


@pytest.mark.slow
def test_leading_derivatives_against_solving_again(paper: Solution, found: list[Influence]) -> None:
    for name in chosen(found, []):
        i = confirmed(paper, next(i for i in found if i.name == name))
        assert i.difference is not None
        assert i.difference.central == pytest.approx(i.per_unit, rel=0.01), name
        assert i.difference.noise < 0.01 * abs(i.per_unit)


def test_scaling_of_a_refined_optimum(paper: Solution, found: list[Influence]) -> None:
    """Limits that are tightened do not grow with the leg: the sum is off by no more than the tightening cost."""
    endings = ("mass", "inertia", "max_torque", "least_force")
    assert abs(weighted(by_name(found), dict.fromkeys(endings, 1.0))) < settled_within(paper)


def settled(s: Solution) -> Solution:
    """A solution of one mesh as if that were settled: no second mesh matters here."""
    unsettled = {"change of the objective": 0.0}
    checks = tuple(replace(c, residual=unsettled.get(c.name, c.residual)) for c in s.summary.verification)
    return s.with_summary(verification=checks)


@pytest.mark.slow
def test_one_sided_derivatives_are_called_so() -> None:
    """Two caps at the same torque: lowering one costs height, raising it gains nothing."""
    s = settled(coarse("two caps"))
    i = confirmed(s, influences(s)["leg.gear.torque_cap"])
    assert i.difference is not None
    assert i.less_per_unit is not None
    assert i.less_per_unit > 1e-5
    assert abs(i.per_unit) < 0.01 * i.less_per_unit
    assert i.difference.agrees(i.per_unit, i.less_per_unit)
    assert not i.difference.agrees(i.per_unit)
    assert i.difference.verdict(i.per_unit, i.less_per_unit).startswith("agrees: +")
    assert {w.partition("[")[2] for w in i.between} == {"drive torque cap]", "gear torque cap]"}
    assert sentences([i]) == ["No entry of the leg makes it better to first order."]


KINKS = {  # caps of the gear and of the drive that are the same torque at the joint
    "both joints": TWO_CAPS,
    "hip": ["leg.hip.gear.torque_cap=80", "leg.hip.motor.torque_cap=0.8"],
    "knee": ["leg.knee.gear.torque_cap=120", "leg.knee.motor.torque_cap=1.2"],
    "other ratio": ["leg.gear.ratio=80", "leg.gear.torque_cap=120", "leg.motor.torque_cap=1.5"],
    "joints apart": ["leg.hip.gear.torque_cap=90", "leg.hip.motor.torque_cap=0.9", "leg.knee.gear.torque_cap=140",
                     "leg.knee.motor.torque_cap=1.4"],
    "four quadrants": ["leg.motor.laws=['four-quadrant']", *TWO_CAPS],
    "heavy": ["leg.body.mass=7", "leg.gear.torque_cap=150", "leg.motor.torque_cap=1.5"],
    "friction": ["contact.friction=0.6", *TWO_CAPS],
    "long shank": ["leg.shank.length=0.45", "start.hip_height=0.4", *TWO_CAPS],
    "nearly": ["leg.gear.torque_cap=120.001", "leg.motor.torque_cap=1.2"],
}  # fmt: skip
QUICK = ("hip",)
ALIKE = (
    "both joints",
    "knee",
    "other ratio",
    "heavy",
    "long shank",
)  # only a share that fits one leg alone fails there
MARKS = {name: pytest.mark.rarely if name in ALIKE else pytest.mark.slow for name in KINKS if name not in QUICK}


@pytest.mark.parametrize("name", [pytest.param(name, marks=MARKS.get(name, ())) for name in KINKS])
def test_both_sides_of_a_kink_against_solved_optima(name: str) -> None:
    """Every entry that more and less of differ, each way, within 1 %."""
    mesh = ["solver.stance_intervals=12", "solver.flight_intervals=6", "solver.refine=false"]
    s = solved_once([*KINKS[name], *mesh])
    nlp, found = stored_nlp(s), [i for i in sensitivity(s) if i.kinked and i.part_of is None]
    assert {"torque_cap", "ratio"} <= {i.name.split(".")[-1] for i in found}
    here, step = solve_again(nlp, s.design, s.objective).objective, 2e-3 if name == "nearly" else 2e-4
    for i in found:
        h = step * i.value
        up, down = (solve_again(nlp, with_entry(s.design, i.name, i.value + x), s.objective).objective for x in (h, -h))
        largest = max(abs(i.per_unit), abs(i.less_per_unit or 0.0))
        assert (up - here) / h == pytest.approx(i.per_unit, rel=0.01, abs=0.01 * largest), i.name
        assert (here - down) / h == pytest.approx(i.less_per_unit, rel=0.01, abs=0.01 * largest), i.name


def test_verdicts() -> None:
    smooth = Difference(0.005, central=1.0, forward=1.01, backward=0.99, noise=0.001)
    assert smooth.verdict(1 / 1.005) == "agrees within 0.5%"
    assert smooth.verdict(1 / 1.02) == "differs by 2.0%"
    assert Difference(0.005, 0.0, 0.0, 0.0, noise=1e-3).verdict(1e-9) == "agrees: no more than noise"
    kink = replace(smooth, central=0.5, forward=0.0, backward=1.0)
    for slope in (0.0, 0.5, 1.0):  # whatever side the multipliers speak for
        assert not kink.agrees(slope)
        assert re.fullmatch(r"one-sided: \+0 upwards, \+1 downwards", kink.verdict(slope))
    noisy = replace(kink, noise=2.0)
    assert noisy.agrees(0.5)
    assert Difference(fault="no").verdict(1.0) == "no"


# ---- what a user sees --------------------------------------------------------------------------------------------


def influence(name: str, value: float, slope: float, unit: str = "m", part_of: str | None = None) -> Influence:
    return Influence(name, value, unit, slope, part_of)


def test_what_a_supply_is_worth_is_confirmed_by_the_name_that_problem_files_have() -> None:
    """[supply] is a table of its own there, and part of the leg in what is printed."""
    found = [influence("leg.supply.voltage", 48.0, 1.5e-3, "V"), influence("leg.body.mass", 5.6, -0.02, "kg")]
    assert chosen(found, ["supply.voltage"]) == chosen(found, ["leg.supply.voltage"]) == ["leg.supply.voltage"]
    with pytest.raises(UsageError, match="there is no such entry"):
        chosen(found, ["supply.voltages"])


def test_rows_that_are_left_out_are_counted() -> None:
    assert left_out([influence(f"leg.{k}", 1.0, 1.0) for k in range(TABLE_ROWS)]) == []
    assert left_out([influence(f"leg.{k}", 1.0, 1.0) for k in range(TABLE_ROWS + 3)]) == [
        "(3 more that matter less: --json)"
    ]


def test_sentences() -> None:
    ratio = [
        influence(f"leg.{j}.gear.ratio", 100, s, "1", "leg.gear.ratio") for j, s in (("knee", -3e-3), ("hip", 1e-3))
    ]
    found = [
        influence("hop.foot_window", 0.1, 0.9), influence("leg.thigh.length", 0.4, -0.2),
        influence("leg.gear.ratio", 100, -2e-3, "1"), *ratio,
    ]  # fmt: skip
    first, both, asked = sentences(found)
    assert first == "What to change first: leg.thigh.length 1 % less, from 0.4 to 0.396 m, gains 0.08 cm."
    assert both.startswith("leg.gear.ratio pulls both ways")
    assert "leg.knee.gear.ratio 1 % less, from 100 to 99, gains 0.30 cm" in both
    assert "leg.hip.gear.ratio 1 % more, from 100 to 101, gains 0.10 cm" in both
    assert asked == "Of what the hop is asked to be: hop.foot_window 1 % more, from 0.1 to 0.101 m, gains 0.09 cm."
    assert sentences([influence("start.foot_x", 0.0, 1.0)]) == ["No entry of the leg makes it better to first order."]


@pytest.mark.slow
def test_json_of_a_stored_optimum(paper: Solution, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    arguments = [
        "--result",
        str(paper.result_dir),
        "--confirm",
        "leg.thigh.length",
        "--results",
        str(tmp_path),
        "--json",
    ]
    assert run(["sensitivity", *arguments]) == 0
    out, err = capfd.readouterr()
    data = json.loads(out)
    assert err == ""
    assert data["clearance_m"] == paper.clearance
    assert data["verified"] is True
    first = data["parameters"][0]
    assert {"name", "value", "unit", "per_percent", "per_unit"} <= set(first)
    assert first["per_percent"] == pytest.approx(0.01 * first["value"] * first["per_unit"])
    assert first["objective_unit"] == "m"
    assert first["error_per_unit"] > 0
    again = [p for p in data["parameters"] if "finite_difference_per_unit" in p]
    assert [p["name"] for p in again] == ["leg.thigh.length"]
    assert again[0]["confirmed"] is True
    folder = Path(data["result_dir"])
    assert {p.name for p in folder.iterdir()} == {"sensitivity.json", "problem.toml", "figures"}
    assert json.loads((folder / "sensitivity.json").read_text())["parameters"] == data["parameters"]
    assert {p.name for p in (folder / "figures").iterdir()} == {"tornado.png", "tornado.svg"}


def test_screen(
    paper: Solution,
    found: list[Influence],
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("hopopt.studies.sensitivity.sensitivity", lambda solution: found)  # JSON is of its own finding
    assert run(["sensitivity", "--result", str(paper.result_dir), "--results", str(tmp_path), "--no-figures"]) == 0
    out = capfd.readouterr().out
    first = next(i for i in found if i.of_leg)
    assert f"clearance {paper.clearance:.4f} m, verified" in out
    assert f"What to change first: {first.name} 1 % " in out
    cells = [first.name, f"{first.value:g} {first.unit}", f"{100 * first.per_percent:+.3f} cm"]
    assert re.search(" +".join(map(re.escape, cells)), out)


def test_figure_shows_the_figures(paper: Solution, found: list[Influence]) -> None:
    from hopopt.plots.studies.sensitivity import tornado

    (ax,) = tornado(paper, found).axes
    widths = [bar.get_width() for bar in ax.patches]  # type: ignore[attr-defined]
    np.testing.assert_allclose(widths, [100 * i.per_percent for i in found[: len(widths)]])
    assert ax.get_yticklabels()[0].get_text().startswith(found[0].name)


def test_an_unverified_optimum_gives_no_numbers(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    rough = ["--starts", "1", "--results", str(tmp_path), "--set", "solver.refine=false"]
    rough += ["--set", "solver.stance_intervals=12", "--set", "solver.flight_intervals=6"]
    assert run(["sensitivity", *rough, "--json"]) == 3
    data = json.loads(capfd.readouterr().out)
    assert data["verified"] is False
    assert data["clearance_m"] is None
    assert data["parameters"] == []
    assert data["failed_checks"]
    assert not list(tmp_path.iterdir())
    assert run(["sensitivity", *rough]) == 3
    out = capfd.readouterr().out
    assert "NOT verified" in out
    assert "cm" not in out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--result", "nowhere"], "nowhere: there is no such folder"),
        (["paper", "--result", "nowhere"], "--result"),
        (["--result", "nowhere", "--set", "leg.gear.ratio=80"], "--set"),
        (["--starts", "0"], "--starts"),
        (["--set", "leg.gear.rato=80"], "leg.gear.rato is not a known key"),
    ],
)
def test_wrong_usage(
    arguments: list[str], words: str, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["sensitivity", *arguments]) == 2
    out, err = capfd.readouterr()
    assert words in err
    assert out == ""
    assert not list(tmp_path.iterdir())


def test_a_result_in_the_place_of_a_problem_is_told_where_to_go(
    paper: ho.Solution, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = str(paper.result_dir)
    assert run(["sensitivity", folder]) == 2
    assert (
        capsys.readouterr().err
        == f"hopopt: {folder} is a result, not a problem: hopopt sensitivity --result {folder}\n"
    )


def test_confirming_what_is_not_there(
    paper: Solution,
    found: list[Influence],
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("hopopt.studies.sensitivity.sensitivity", lambda solution: found)
    arguments = ["--result", str(paper.result_dir), "--results", str(tmp_path), "--confirm", "leg.thigh.lenght"]
    assert run(["sensitivity", *arguments]) == 2
    assert "did you mean leg.thigh.length?" in capfd.readouterr().err


OTHER_MESHES = (
    {"solver.stance_intervals": 64, "solver.flight_intervals": 16},
    {"solver.tolerance": 1e-6, "solver.objective_tolerance": 1e-5, "solver.price_tolerance": 1e-5},
)


@pytest.mark.slow
@pytest.mark.parametrize("problem", ["paper", pytest.param("go2_leg", marks=pytest.mark.rarely)])
def test_derivatives_are_known_within_their_errors(problem: str) -> None:
    """On other meshes they differ by no more; and solving anew with 1 % more and less gives what is said, within both errors."""
    at = solved_once(problem=problem)
    found = sensitivity(at)
    errors = {i.name: i.error_per_unit for i in found if i.error_per_unit is not None}
    assert {i.name for i in found if not i.value} == {i.name for i in found} - set(errors)
    assert all(errors[i.name] < 0.1 * abs(i.per_unit) for i in found[:5])
    for mesh in OTHER_MESHES:
        again = by_name(sensitivity(solved_once(mesh, problem=problem)))
        for i in found:
            assert i.name not in errors or abs(again[i.name].per_unit - i.per_unit) <= errors[i.name], (mesh, i)
    most = next(i for i in found if i.name == "leg.motor.max_torque")
    more, less = (solved_once({most.name: x * most.value}, problem=problem).clearance for x in (1.01, 0.99))
    of_mesh = settled_within(at) / (0.01 * most.value)
    assert abs((more - less) / (0.02 * most.value) - most.per_unit) <= errors[most.name] + of_mesh


@pytest.mark.rarely
def test_of_an_energy_too_in_joules() -> None:
    """What a clearance costs, and what one more of an entry saves: against solving again."""
    low, at, high = (solved_once({"hop.clearance": x}, "energy") for x in (0.295, 0.3, 0.305))
    found = by_name(sensitivity(at))
    cost = found["hop.clearance"]
    assert (cost.objective_unit, cost.maximize) == ("J", False)
    assert cost.per_unit == pytest.approx((high.summary.reached - low.summary.reached) / 0.01, rel=0.02)
    assert cost.best == pytest.approx(0.01 * 0.3 * cost.per_unit)
    frame = ho.Solution.with_methods(at).sensitivity().to_dataframe()
    assert list(frame.columns[:4]) == ["name", "value", "unit", "objective_unit"]
    assert frame.set_index("name").loc["hop.clearance", "per_unit"] == cost.per_unit


@pytest.mark.parametrize(
    ("name", "leg", "mu"),
    [
        pytest.param("paper", {}, 0.7, id="cone"),
        pytest.param("three_joint", {"leg.hip.axis": [0.0, -0.98, 0.199]}, 0.4, id="pyramid"),
    ],
)
@pytest.mark.slow
def test_friction(name: str, leg: dict, mu: float) -> None:
    """The gain of 1 % more friction against the same mesh solved with a little more and less, also of a foot that is held
    sideways, whose pyramid is flatter than the cone (3 %: on a mesh switches move from node to node); and as the sensitivity says it."""
    coarse = {**leg, "solver.refine": False, "contact.least_force": 1.0}
    less, here, more = (solve(load(name, {**coarse, "contact.friction": x * mu}), starts=1) for x in (0.995, 1, 1.005))
    gain = here.summary.gains["friction cone"]
    assert gain == pytest.approx(more.summary.objective_value - less.summary.objective_value, rel=0.03)
    (found,) = (i for i in sensitivity(here) if i.name == "contact.friction")
    assert found.per_unit * 0.01 * mu == pytest.approx(gain, rel=1e-6)


# ---- limits that are enforced between the nodes, where multipliers at the nodes have both signs ------------------------


@pytest.fixture(scope="module")
def held() -> Solution:
    """A refined optimum with friction and a least force, both of which act."""
    s = solved_once({"contact.friction": 0.7, "contact.least_force": 15.0})
    bounds = stored_nlp(s).bounds
    assert (bounds.high_g != stored_nlp(s).transcription.ubg).any()  # a lower limit that is tightened from above
    return s


@pytest.fixture(scope="module")
def held_found(held: Solution) -> list[Influence]:
    return sensitivity(held)


def test_the_gain_of_a_limit_is_what_its_entries_are_worth(
    held: Solution, held_found: list[Influence], hop: Solution, found: list[Influence]
) -> None:
    """1 % more of an operating region is 1 % more torque and speed; the friction cone's entry is the coefficient."""
    for s, known in ((held, by_name(held_found)), (hop, by_name(found))):
        gains = s.summary.gains
        for joint in s.design.leg.joints:
            whole = sum(known[f"leg.{joint}.motor.{figure}"].per_percent for figure in ("max_torque", "max_speed"))
            assert gains[f"{joint} operating region"] == pytest.approx(whole, rel=1e-3)
    assert held.summary.gains["friction cone"] == pytest.approx(
        by_name(held_found)["contact.friction"].per_percent, rel=1e-6
    )


@pytest.mark.parametrize(
    "name", ["contact.friction", "contact.least_force", pytest.param("hop.least_height", marks=pytest.mark.slow)]
)
def test_limits_that_are_held_are_worth_what_solving_again_says(
    held: Solution, held_found: list[Influence], name: str
) -> None:
    """The knee comes to the ground where the foot cannot slip."""
    s, found = held, held_found
    if name == "hop.least_height":
        found = sensitivity(s := solved_once({name: 0.01}))
    i = by_name(found)[name]
    more, less = (
        solve_again(stored_nlp(s), with_entry(s.design, name, x * i.value), "clearance") for x in (1.01, 0.99)
    )
    assert abs(i.per_percent) > 1e-6
    assert i.per_unit == pytest.approx((more.objective - less.objective) / (0.02 * i.value), rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize(("entry", "value"), [("hop.least_height", 0.0), ("leg.gear.ratio", 1.0)])
def test_entries_at_the_end_of_what_they_may_be(entry: str, value: float) -> None:
    """Solved again on the one side there is, by a parabola."""
    direct = {"leg.motor.max_torque": 200.0, "leg.motor.max_speed": 12.57, "leg.motor.rotor_inertia": 0.0}
    s = solved_once({"leg.gear.ratio": 1.0, **direct})
    found = confirmed(s, influences(s)[entry])
    assert found.value == value
    assert found.difference
    assert not found.difference.fault
    assert np.isnan(found.difference.backward)
    assert found.difference.central == pytest.approx(found.per_unit, rel=0.03)
