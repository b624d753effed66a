"""Co-design: closed forms, optimality of what was free, couplings, bounds, and what is said of impossible wishes."""

import json
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import hopopt as ho
from hopopt.cli import run
from hopopt.errors import UsageError
from hopopt.leg.kinematics import TwoJoints, start_angles
from hopopt.nlp.ipopt import NlpSolver
from hopopt.nlp.mesh import uniform
from hopopt.nlp.schemes import radau
from hopopt.nlp.transcribe import Transcription
from hopopt.ocp.freedom import Coupling, Freedom, parse_coupling, parse_free
from hopopt.ocp.guess import Guess
from hopopt.ocp.hop import Hop
from hopopt.ocp.problem import BoundaryConstraint, Control, Objective, PathConstraint, Phase, Problem, State
from hopopt.sensitivity import sensitivity
from hopopt.solution import Solution

G, STROKE = 9.81, 0.3  # m/s^2, m
FORCE, SPEED = 40.0, 12.0  # of the motor at ratio 1 [N, m/s]: F <= R FORCE (1 - R v / SPEED)


def lift_off_speed(ratio: float, mass: float) -> float:
    """Full force from rest over the stroke: v(t) = (a/b)(1 - exp(-b t)), x(t) = (a/b) t - (a/b^2)(1 - exp(-b t))."""
    a, b = ratio * FORCE / mass - G, ratio**2 * FORCE / (mass * SPEED)
    t = np.linspace(0, 3, 300001)
    x = a / b * t - a / b**2 * (1 - np.exp(-b * t))
    return float(a / b * (1 - np.exp(-b * np.interp(STROKE, x, t))))


def hopper(coupling: Coupling | None) -> dict[str, float]:
    """The 1-D hopper with its gear ratio free, and its mass too if it is coupled to the ratio."""

    def value(s: Any) -> Any:
        return s.u / (s.p["ratio"] * FORCE) + s.p["ratio"] * s.v / SPEED

    freedom = Freedom({"ratio": (1.0, 12.0)} | ({"mass": (1.0, 20.0)} if coupling else {}))
    phase = Phase(
        "push",
        (State("x", lower=0.0, initial=0.0, final=STROKE, scale=0.3), State("v", initial=0.0, scale=2.0)),
        (Control("u", lower=0.0, scale=100.0),),
        lambda s: {"x": s.v, "v": s.u / s.p["mass"] - G},
        (0.01, 2.0),
        (PathConstraint("motor", value, upper=1.0),),
    )
    boundary = (
        (BoundaryConstraint("coupling", lambda e: coupling.value(e.p), coupling.lower, coupling.upper),)
        if coupling
        else ()
    )
    parameters = freedom.parameters({"ratio": 3.0, "mass": 4.0})
    goal = Objective("speed", lambda e: e.final["push"].v, maximize=True)
    t = Transcription(Problem("hopper", (phase,), goal, parameters, boundary), radau(4), {"push": uniform(12)})
    guess = Guess(0.3, np.array([0.0, 1.0]), np.array([[0.0, 0.0], [STROKE, 2.0]]), np.full((2, 1), 60.0))
    s = NlpSolver(t)({"push": guess})
    assert s.success
    return {"speed": s.objective, **{name: float(s.parameters[name][0]) for name in ("ratio", "mass")}}


def test_free_ratio_of_the_one_dimensional_hopper() -> None:
    found = hopper(None)
    known: Any = minimize_scalar(lambda r: -lift_off_speed(r, 4.0), bounds=(1.5, 12), method="bounded")
    assert found["ratio"] == pytest.approx(known.x, rel=1e-3)
    assert found["speed"] == pytest.approx(-known.fun, rel=1e-6)


def test_mass_that_grows_with_the_ratio() -> None:
    """A heavier gear: mass - 0.5 ratio = 2.5."""
    found = hopper(parse_coupling("mass - 0.5*ratio = 2.5"))
    known: Any = minimize_scalar(lambda r: -lift_off_speed(r, 2.5 + 0.5 * r), bounds=(1.5, 12), method="bounded")
    assert found["mass"] == pytest.approx(2.5 + 0.5 * found["ratio"], rel=1e-8)
    assert found["ratio"] == pytest.approx(known.x, rel=1e-3)
    assert found["speed"] == pytest.approx(-known.fun, rel=1e-6)


# ---- the leg ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def lengths() -> Solution:
    """Thigh and shank free, their sum kept."""
    free = {"leg.thigh.length": (0.3, 0.45), "leg.shank.length": (0.3, 0.45)}
    total = "leg.thigh.length + leg.shank.length = 0.741"
    return ho.codesign(ho.load("paper"), free, couple=[total], starts=1, processes=1)


def chosen(s: Solution) -> dict[str, float]:
    return {p["entry"]: p["optimal"] for p in s.summary["codesign"]["parameters"]}


@pytest.mark.slow
def test_lengths_meet_their_coupling_and_gain(lengths: Solution) -> None:
    assert lengths.verified, lengths.summary["failed_checks"]
    found = chosen(lengths)
    assert sum(found.values()) == pytest.approx(0.741, abs=1e-9)
    assert lengths.design.leg.link["thigh"].length == found["leg.thigh.length"]
    assert lengths.clearance > ho.solve(ho.load("paper"), starts=1, processes=1).clearance + 0.005
    assert lengths.clearance == pytest.approx(lengths.summary["codesign"]["objective_value"], rel=1e-4)
    assert lengths.summary["codesign"]["couplings"][0]["active"]


@pytest.mark.slow
def test_no_exchange_of_length_gains_any_more(lengths: Solution) -> None:
    """At the optimum of a kept sum both lengths have the same derivative, by the multipliers of the fixed design."""
    slopes = {i.name: i.m_per_unit for i in sensitivity(lengths)}
    thigh, shank = slopes["leg.thigh.length"], slopes["leg.shank.length"]
    assert abs(thigh) > 0.1
    assert thigh == pytest.approx(shank, rel=0.02)


@pytest.mark.slow
def test_start_stands_where_the_problem_says(lengths: Solution) -> None:
    q = lengths.tables["stance"].q[0, 0]
    assert q[1] == pytest.approx(0.28, abs=1e-7)
    assert q[0] == pytest.approx(0.0, abs=1e-7)
    assert q[3] < 0


@pytest.mark.slow
def test_ratio_at_its_bound_on_the_command_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    free = ["--free", "leg.gear.ratio=80:120", "--starts", "1", "--no-figures", "--results", str(tmp_path)]
    assert run(["solve", *free, "--json"]) == 0
    s = json.loads(capfd.readouterr().out)
    (p,) = s["codesign"]["parameters"]
    assert (p["optimal"], p["at_bound"], p["was"], p["unit"]) == (80.0, "lower", 100.0, "1")
    assert p["gain_per_unit_of_the_bound"] < 0  # a higher bound would cost
    again = ho.load(f"{s['result_dir']}/problem.toml")
    assert again.leg.gear.ratio == 80.0
    assert ho.solve(again, starts=1, processes=1).clearance == pytest.approx(s["clearance_m"], rel=1e-4)
    assert "co-design confirmed" in {c["name"] for c in s["verification"]}


@pytest.mark.parametrize("height", [0.2, 0.28, 0.5])
@pytest.mark.parametrize(
    ("zero", "sense", "side"), [(z, s, k) for z in (0, -1.5, 2.5) for s in (-1, 1) for k in (-1, 1)]
)
def test_the_start_stays_folded_to_its_side(height: float, zero: float, sense: int, side: int) -> None:
    """The paper's leg with a knee that is straight at another angle than 0, counted in either sense, bent to either
    side: of all knee angles within the bounds none is bent to the other side, and every one of this side is allowed."""
    limits = sorted((sense * (zero + side * 0.05), sense * (zero + side * 3.0)))
    turned = {
        "leg.knee.axis": (0.0, -float(sense), 0.0), "leg.knee.lower": limits[0] - 0.5, "leg.knee.upper": limits[1] + 0.5,
        "leg.shank.direction": (-np.sin(zero), 0.0, -np.cos(zero)), "start.hip_height": height, "leg.hip.lower": -3.0,
        "leg.hip.upper": 3.0,
    }  # fmt: skip
    design = ho.load("paper", turned)
    freedom = Freedom({"leg.shank.length": (0.3, 0.45)})
    hop = Hop(design, freedom=freedom)
    bounds: Any = freedom.start(hop)
    lower, upper = bounds
    geometry, chosen = TwoJoints.of(design.leg), start_angles(design)[1]
    assert lower[1] < chosen < upper[1]
    was = np.sign(geometry.bend(chosen))
    allowed = np.linspace(limits[0] - 0.5, limits[1] + 0.5, 400)
    for q in allowed:
        if np.abs(q - chosen) < 3.0:
            folded = np.sign(geometry.bend(q)) == was
            assert folded == (lower[1] <= q <= upper[1]), q


# ---- words --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "factors", "lower", "upper"),
    [
        ("a.b + c.d = 0.741", {"a.b": 1, "c.d": 1}, 0.741, 0.741),
        (
            "leg.body.mass - 0.9*leg.motor.max_torque = 3.8",
            {"leg.body.mass": 1, "leg.motor.max_torque": -0.9},
            3.8,
            3.8,
        ),
        ("2 a.b <= 3 - c.d", {"a.b": 2, "c.d": 1}, -np.inf, 3),
        ("-1e-2*a.b + 1 >= .5", {"a.b": -0.01}, -0.5, np.inf),
        ("a.b = 2*a.b + c.d", {"a.b": -1, "c.d": -1}, 0, 0),
    ],
)
def test_couplings_are_sums(text: str, factors: dict[str, float], lower: float, upper: float) -> None:
    c = parse_coupling(text)
    assert c.factors == pytest.approx(factors)
    assert (c.lower, c.upper) == pytest.approx((lower, upper))
    value = c.value({name: ca.SX(k + 2.0) for k, name in enumerate(c.factors)})
    assert float(ca.DM(ca.evalf(value))) == pytest.approx(sum(f * (k + 2) for k, f in enumerate(factors.values())))


@pytest.mark.parametrize(
    "text",
    ["", "=", "a.b", "a.b + = 3", "a.b * c.d = 3", "a.b = 3 = 4", "__import__('os') = 1", "3 = 4", "a.b c.d = 3"],
)
def test_anything_else_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="--couple"):
        parse_coupling(text)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1e999*a.b = 1", "a.b has a factor that is not finite"),
        ("1e999*a.b = 1e999*a.b", "a.b has a factor that is not finite"),
        ("a.b <= 1e999", "its constant is not finite"),
        ("a.b = a.b", "a.b cancels out"),
        ("a.b = a.b + c.d", "a.b cancels out"),
        ("0*a.b = 0", "a.b cancels out"),
    ],
)
def test_factors_that_bind_nothing_are_refused(text: str, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        parse_coupling(text)


@pytest.mark.parametrize(
    "text", ["leg.gear.ratio", "leg.gear.ratio=3", "leg.gear.ratio=9:3", "leg.gear.ratio=a:b", "=1:2"]
)
def test_bounds_that_are_none(text: str) -> None:
    with pytest.raises(UsageError, match="write lower:upper"):
        parse_free([text])


@pytest.mark.parametrize(
    ("free", "couple", "words"),
    [
        ({"leg.gear.ration": (50, 200)}, [], "did you mean leg.gear.ratio"),
        ({"leg.gear.ratio": (0, 200)}, [], "leg.gear.ratio = 0"),
        ({"hop.foot_window": (0.1, 0.2)}, [], "no such number of the leg"),
        ({"leg.gear.ratio": (50, 200)}, ["leg.thigh.length = 0.4"], "none of its entries is free"),
        ({"leg.gear.ratio": (50, 200)}, ["leg.gear.ratios = 60"], "did you mean leg.gear.ratio"),
        ({"leg.gear.ratio": (50, 200)}, ["leg.gear.ratio = 300"], "no values within the bounds"),
        ({}, [], "nothing is free"),
    ],
)
def test_impossible_wishes(free: dict[str, tuple[float, float]], couple: list[str], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        ho.codesign(ho.load("paper"), free, couple=couple)


@pytest.mark.parametrize(
    ("free", "words"),
    [
        ({"leg.shank.length": (0.3, 0.38)}, "leg.shank.com = 0.35 m is set, .* 0.35 m or above"),
        ({"leg.shank.length": (0.3, 0.38), "leg.shank.com": (0.1, 0.33)}, "leg.shank.com can be 0.33 m"),
    ],
)
def test_a_link_cannot_get_shorter_than_its_centre_of_mass_is_far(free: dict[str, Any], words: str) -> None:
    """Said before anything is solved, whatever a coupling would exclude."""
    design = ho.load("paper", {"leg.shank.com": 0.35})
    with pytest.raises(UsageError, match=words):
        ho.codesign(design, free, couple=["leg.shank.length <= 0.34"])
    with pytest.raises(UsageError, match="no values within the bounds"):  # now the coupling is what cannot be met
        ho.codesign(design, {"leg.shank.length": (0.35, 0.38)}, couple=["leg.shank.length <= 0.34"])


def test_couplings_need_freedom(capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["solve", "--couple", "leg.thigh.length = 0.4"]) == 2
    assert "--free leg.thigh.length" in capfd.readouterr().err
