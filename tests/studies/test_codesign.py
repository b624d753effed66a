"""Co-design: closed forms, optimality of what was free, couplings, bounds, and what is reported of impossible wishes."""

import json
import re
from dataclasses import asdict, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import hopopt as ho
from hopopt.cli.main import run
from hopopt.errors import NotSolvedError, UsageError
from hopopt.leg.kinematics import TwoJoints, start_angles
from hopopt.nlp.deadline import NEVER
from hopopt.nlp.mesh import uniform
from hopopt.nlp.refinement.mesh_refinement import UNSOLVED
from hopopt.nlp.schemes import radau
from hopopt.nlp.solver.ipopt import NlpSolver
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.free_parameters import Coupling, FreeParameters, parse_coupling, parse_free
from hopopt.ocp.guesses.guess import Guess
from hopopt.ocp.guesses.initial_guess import NAMED_STARTS, make_guess
from hopopt.ocp.hop import Hop
from hopopt.ocp.objectives.registry import find
from hopopt.ocp.problem import BoundaryConstraint, Control, Objective, PathConstraint, Phase, Problem, State
from hopopt.planner.answer.extras import CoDesign
from hopopt.planner.search.from_known import from_motion
from hopopt.planner.search.multistart import first_transcription
from hopopt.planner.solution import Solution
from hopopt.planner.stopwatch import Stopwatch
from hopopt.problem.checking.mass_law import mass_law
from hopopt.storage.seal.recheck import co_design_checks, recheck
from hopopt.storage.solution import read, save
from hopopt.studies import codesign
from hopopt.studies.mass_coupling import catalogue_coupling
from hopopt.studies.sensitivity import sensitivity

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

    free_parameters = FreeParameters({"ratio": (1.0, 12.0)} | ({"mass": (1.0, 20.0)} if coupling else {}))
    phase = Phase(
        "push",
        (
            State("x", lower=0.0, initial=0.0, final=STROKE, scale=0.3),
            State("v", lower=0.0, initial=0.0, scale=2.0),  # else it swings below x = 0 between nodes
        ),
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
    parameters = free_parameters.parameters({"ratio": 3.0, "mass": 4.0})
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


def test_mass_that_is_a_power_of_the_ratio() -> None:
    """Mass 2.5 + 0.2 ratio^1.6: the program meets the closed form as it does for a line."""
    found = hopper(parse_coupling("mass = 0.2*ratio^1.6 + 2.5"))
    known: Any = minimize_scalar(lambda r: -lift_off_speed(r, 2.5 + 0.2 * r**1.6), bounds=(1.5, 12), method="bounded")
    assert found["mass"] == pytest.approx(2.5 + 0.2 * found["ratio"] ** 1.6, rel=1e-8)
    assert 1.5 < found["ratio"] < 11
    assert found["ratio"] == pytest.approx(known.x, rel=1e-3)
    assert found["speed"] == pytest.approx(-known.fun, rel=1e-6)


# ---- what torque weighs -------------------------------------------------------------------------------------

MASS_BY_TORQUE = "catalogue: leg.body.mass by leg.motor.max_torque"
TORQUE_AND_MASS = {"leg.motor.max_torque": (1.0, 3.0), "leg.body.mass": (4.5, 7.0)}


def body_mass(c: Coupling, torques: dict[str, float]) -> float:
    """The mass that meets a coupling of the catalogue at these torques."""
    return c.lower - float(c.value({**torques, next(iter(c.factors)): 0.0}))


def test_the_catalogue_changes_nothing_at_the_present_design() -> None:
    """Whatever the torque in the problem is, its own mass goes with it; twice the law's difference elsewhere."""
    law = mass_law("motor")
    for torque, mass in ((2.0, 5.6), (0.5, 3.0), (7.0, 9.0)):
        leg = ho.load("paper", {"leg.motor.max_torque": torque, "leg.body.mass": mass}).leg
        c = catalogue_coupling(MASS_BY_TORQUE, leg, TORQUE_AND_MASS)
        assert body_mass(c, {"leg.motor.max_torque": torque}) == pytest.approx(mass, rel=1e-12)
        for other in (1.0, 2.7):
            expected = mass + 2 * (law.mass(other) - law.mass(torque))  # hip and knee
            assert body_mass(c, {"leg.motor.max_torque": other}) == pytest.approx(expected, rel=1e-12)


def test_the_derivative_of_the_law_is_that_of_differences() -> None:
    c = catalogue_coupling(MASS_BY_TORQUE, ho.load("paper").leg, TORQUE_AND_MASS)
    torque, mass, law = ca.SX.sym("torque"), ca.SX.sym("mass"), mass_law("motor")
    value = c.value({"leg.motor.max_torque": torque, "leg.body.mass": mass})
    slope = ca.Function("slope", [torque, mass], [ca.jacobian(value, ca.vertcat(torque, mass))])
    for at in (0.4, 2.0, 5.0):
        by_torque, by_mass = np.array(slope(at, 5.6)).ravel()
        h = 1e-6 * at
        assert by_mass == 1
        assert by_torque == pytest.approx(-2 * (law.mass(at + h) - law.mass(at - h)) / (2 * h), rel=1e-7)
        assert by_torque == pytest.approx(-2 * law.exponent * law.mass(at) / at, rel=1e-12)


def test_every_joint_counts_by_the_motor_it_has() -> None:
    """A knee with a torque of its own leaves the hip alone to the leg's motor; both may have their price at once."""
    leg = ho.load("paper", {"leg.knee.motor.max_torque": 1.5}).leg
    free = {**TORQUE_AND_MASS, "leg.knee.motor.max_torque": (1.0, 3.0)}
    law, at = mass_law("motor"), {"leg.motor.max_torque": 2.8, "leg.knee.motor.max_torque": 2.5}
    hip, knee = law.mass(2.8) - law.mass(2.0), law.mass(2.5) - law.mass(1.5)
    alone = catalogue_coupling(MASS_BY_TORQUE, leg, free)
    assert body_mass(alone, at) == pytest.approx(5.6 + hip)
    both = catalogue_coupling(f"{MASS_BY_TORQUE} and leg.knee.motor.max_torque", leg, free)
    assert body_mass(both, at) == pytest.approx(5.6 + hip + knee)
    assert "leg.knee.motor.max_torque^" in both.equation()


def test_gears_and_links_have_their_price_too() -> None:
    leg = ho.load("paper", {"leg.gear": "csg-20-100", "leg.motor": "maxon-ec45-250"}).leg
    free = {"leg.thigh.mass": (1.0, 3.0), "leg.gear.torque_cap": (50.0, 200.0), "leg.motor.torque_cap": (1.0, 3.0)}
    text = "catalogue: leg.thigh.mass by leg.gear.torque_cap and leg.motor.torque_cap"
    c = catalogue_coupling(text, leg, free)
    motor, gear = mass_law("motor"), mass_law("gear")
    at = {"leg.gear.torque_cap": 150.0, "leg.motor.torque_cap": 3.0}
    expected = 1.87 + 2 * (gear.mass(150) - gear.mass(107) + motor.mass(3) - motor.mass(2))
    assert body_mass(c, at) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("overrides", "free", "couple", "words"),
    [
        ({}, TORQUE_AND_MASS, ["catalogue: leg.body.mass"], 'write "catalogue: leg.body.mass by'),
        ({}, TORQUE_AND_MASS, ["catalogue leg.body.mass by leg.motor.max_torque"], 'write "catalogue: leg.body.mass by'),
        ({}, TORQUE_AND_MASS, ["catalogue: leg.body.mas by leg.motor.max_torque"], "did you mean leg.body.mass"),
        ({}, TORQUE_AND_MASS, ["catalogue: leg.thigh.length by leg.motor.max_torque"], "leg.thigh.length is not a mass"),
        ({}, TORQUE_AND_MASS, ["catalogue: leg.body.mass by leg.motor.max_speed"], "no law of mass by leg.motor.max_speed"),
        ({}, TORQUE_AND_MASS, ["catalogue: leg.body.mass by leg.thigh.mass"], "no law of mass by leg.thigh.mass"),
        ({}, TORQUE_AND_MASS, [f"{MASS_BY_TORQUE} and leg.motor.max_torque"], "named twice"),
        ({"leg.motor.torque_cap": 2.0}, {**TORQUE_AND_MASS, "leg.motor.torque_cap": (1.0, 3.0)},
         [f"{MASS_BY_TORQUE} and leg.motor.torque_cap"],
         "leg.motor.max_torque and leg.motor.torque_cap are both of the hip's motor"),
        ({"leg.knee.motor.torque_cap": 2.0}, {**TORQUE_AND_MASS, "leg.knee.motor.torque_cap": (1.0, 3.0)},
         [f"{MASS_BY_TORQUE} and leg.knee.motor.torque_cap"], "are both of the knee's motor"),
        ({}, TORQUE_AND_MASS, [MASS_BY_TORQUE, MASS_BY_TORQUE], "name their torques in one"),
        ({}, TORQUE_AND_MASS, ["catalogue: leg.body.mass by leg.gear.torque_cap"], "no entry leg.gear.torque_cap that is"),
        ({}, {"leg.motor.max_torque": (1.0, 3.0)}, [MASS_BY_TORQUE], "add --free leg.body.mass=4.7:6.5"),
        ({}, {"leg.body.mass": (5.0, 7.0)}, [MASS_BY_TORQUE], "leg.motor.max_torque is not free"),
        ({}, {**TORQUE_AND_MASS, "leg.body.mass": (8.0, 9.0)}, [MASS_BY_TORQUE], "no values within the bounds"),
        ({"leg.motor": "maxon-ec45-250"}, TORQUE_AND_MASS, [MASS_BY_TORQUE], "leg.motor.torque_cap = 2 N m is less"),
        (
            {"leg.hip.motor.max_torque": 1.0, "leg.knee.motor.max_torque": 1.0}, TORQUE_AND_MASS, [MASS_BY_TORQUE],
            "no joint has leg.motor.max_torque",
        ),
        ({"leg.knee.gear.inertia": 0.0}, {"leg.knee.gear.inertia": (0.0, 1e-4)}, ["leg.knee.gear.inertia^0.5 <= 1"],
         "needs it above 0"),
    ],
)  # fmt: skip
def test_impossible_prices(overrides: dict[str, Any], free: dict[str, Any], couple: list[str], words: str) -> None:
    with pytest.raises(UsageError, match=re.escape(words)):
        ho.solve(ho.load("paper", overrides), free=free, couple=couple)


@pytest.mark.rarely
def test_torque_that_weighs_on_the_command_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """The optimum ends within its bounds or says which it is at, and no fixed torque of the law is better."""
    free = ["--free", "leg.motor.max_torque=0.3:2.4", "--free", "leg.body.mass=4.5:7", "--couple", MASS_BY_TORQUE]
    rest = ["--starts", "1", "--no-figures", "--results", str(tmp_path), "--json"]
    assert run(["solve", *free, *rest]) == 0
    s = json.loads(capfd.readouterr().out)
    found = {p["entry"]: p for p in s["codesign"]["parameters"]}
    torque, mass, law = found["leg.motor.max_torque"], found["leg.body.mass"], mass_law("motor")
    assert mass["at_bound"] is None
    assert mass["optimal"] == pytest.approx(5.6 + 2 * (law.mass(torque["optimal"]) - law.mass(2.0)), rel=1e-7)
    if torque["at_bound"]:
        assert torque["optimal"] == torque[torque["at_bound"]]
        assert torque["gain_per_unit_of_the_bound"] * (1 if torque["at_bound"] == "upper" else -1) > 0
    (c,) = s["codesign"]["couplings"]
    assert (c["coupling"], c["active"]) == (MASS_BY_TORQUE, True)
    assert "leg.motor.max_torque^" in c["equation"]
    assert s["codesign"]["mass_laws"] == {"motor": json.loads(json.dumps(asdict(law)))}
    assert any("fitted from 0.328 to 3 N m; leg.motor.max_torque may be 0.3 to 2.4" in note for note in s["notes"])
    for other in (1.6, 2.2):
        by_hand = 5.6 + 2 * (law.mass(other) - law.mass(2.0))
        fixed = ["--set", f"leg.motor.max_torque={other}", "--set", f"leg.body.mass={by_hand!r}"]
        assert run(["solve", *fixed, *rest]) == 0
        assert s["clearance_m"] > json.loads(capfd.readouterr().out)["clearance_m"] * (1 - 1e-4)


@pytest.mark.rarely
def test_a_gear_as_strong_as_its_mass_is_worth() -> None:
    """The law of gears ends within the bounds, where a little more torque gains what its mass costs: the derivatives by
    both, from the multipliers of the fixed design, cancel along the law."""
    design = ho.load("paper", {"leg.gear": "csg-20-100"})
    free = {"leg.gear.torque_cap": (50.0, 204.0), "leg.body.mass": (3.0, 9.0)}
    text = "catalogue: leg.body.mass by leg.gear.torque_cap"
    s = ho.solve(design, free=free, couple=[text], starts=1, processes=1)
    assert s.verified, s.summary.failed_checks
    torque, law = chosen(s)["leg.gear.torque_cap"], mass_law("gear")
    assert 60 < torque < 200
    slopes = {i.name: i.per_unit for i in sensitivity(s)}
    gain = slopes["leg.gear.torque_cap"]
    cost = slopes["leg.body.mass"] * 2 * law.exponent * law.mass(torque) / torque
    assert gain > 1e-4  # m/(N m)
    assert gain == pytest.approx(-cost, rel=0.02)


# ---- the leg ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def lengths() -> Solution:
    """Thigh and shank free, their sum kept."""
    free = {"leg.thigh.length": (0.3, 0.45), "leg.shank.length": (0.3, 0.45)}
    total = "leg.thigh.length + leg.shank.length = 0.741"
    return ho.solve(ho.load("paper"), free=free, couple=[total], starts=1, processes=1)


def chosen(s: Solution) -> dict[str, float]:
    return {p.entry: p.optimal for p in codesign_of(s).parameters}


def codesign_of(s: Solution) -> CoDesign:
    assert s.summary.codesign is not None
    return s.summary.codesign


@pytest.mark.slow
def test_verify_asks_again_whether_the_design_confirms_the_co_design(lengths: Solution, tmp_path: Path) -> None:
    goal, found, value = find("clearance"), codesign_of(lengths), lengths.summary.objective_value
    (check,) = co_design_checks(goal, value, found)
    assert check.passed
    assert check.name in [c.name for c in recheck(read(str(save(lengths, tmp_path).result_dir))).checks]
    more = replace(found, objective_value=1.001 * found.objective_value)
    (check,) = co_design_checks(goal, value, more)
    assert not check.passed
    assert check.residual == pytest.approx(1e-3, rel=0.2)


@pytest.mark.slow
def test_lengths_meet_their_coupling_and_gain(lengths: Solution, hop: Solution) -> None:
    assert lengths.verified, lengths.summary.failed_checks
    found = chosen(lengths)
    assert sum(found.values()) == pytest.approx(0.741, abs=1e-9)
    assert lengths.design.leg.link["thigh"].length == found["leg.thigh.length"]
    assert lengths.clearance > hop.clearance + 0.005
    assert lengths.clearance == pytest.approx(codesign_of(lengths).objective_value, rel=1e-4)
    assert codesign_of(lengths).couplings[0].active


@pytest.mark.slow
def test_no_exchange_of_length_gains_any_more(lengths: Solution) -> None:
    """At the optimum of a kept sum both lengths have the same derivative, by the multipliers of the fixed design."""
    slopes = {i.name: i.per_unit for i in sensitivity(lengths)}
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


def test_the_design_that_came_out_is_solved_from_the_whole_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its height too, which the trajectories alone leave to the first guess."""
    hop = Hop(ho.load("paper", ["solver.stance_intervals=16", "solver.flight_intervals=4"]))
    motion, asked = NlpSolver(first_transcription(hop))(make_guess(hop, NAMED_STARTS[0])), []

    class Noting(NlpSolver):
        def __call__(self, guess: Any, parameters: Any = None, *more: Any) -> Any:
            asked.append(parameters)
            return super().__call__(guess, parameters, *more)

    monkeypatch.setattr("hopopt.planner.search.from_known.NlpSolver", Noting)
    assert from_motion(hop, motion).objective == pytest.approx(motion.objective, rel=1e-7)
    assert asked[0]["clearance"] == motion.parameters["clearance"]


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
    free_parameters = FreeParameters({"leg.shank.length": (0.3, 0.45)})
    hop = Hop(design, free_parameters=free_parameters)
    bounds: Any = free_parameters.start(hop)
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
        ("a.b^1 = 2 c.d^1.0 - 3", {"a.b": 1, "c.d": -2}, -3, -3),
    ],
)
def test_couplings_are_sums(text: str, factors: dict[str, float], lower: float, upper: float) -> None:
    c = parse_coupling(text)
    assert c.factors == pytest.approx(factors)
    assert (c.lower, c.upper) == pytest.approx((lower, upper))
    value = c.value({name: ca.SX(k + 2.0) for k, name in enumerate(c.factors)})
    assert float(ca.DM(ca.evalf(value))) == pytest.approx(sum(f * (k + 2) for k, f in enumerate(factors.values())))


def test_couplings_have_powers() -> None:
    c = parse_coupling("a.b - 2*c.d^0.5 + 3 c.d ^ -1.5 + c.d^0.5 <= 4")
    assert c.factors == {"a.b": 1}
    assert c.powers == {("c.d", 0.5): -1, ("c.d", -1.5): 3}
    assert (c.lower, c.upper) == (-np.inf, 4)
    assert c.value({"a.b": 7.0, "c.d": 4.0}) == pytest.approx(7 - 2 + 3 / 8)
    assert c.equation() == "a.b - c.d^0.5 + 3*c.d^-1.5 <= 4"
    assert parse_coupling(c.equation()) == replace(c, text=c.equation())


@pytest.mark.parametrize(
    "text",
    ["a.b^ = 3", "2^3 = a.b", "a.b^c.d = 3", "a.b^2*c.d = 1", "a.b^^2 = 1", "a.b^0 = 1", "a.b^1e999 = 1",
     "a.b^2 = a.b^2"],
)  # fmt: skip
def test_powers_that_are_none(text: str) -> None:
    with pytest.raises(UsageError, match="--couple"):
        parse_coupling(text)


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
        ("a.b^1e9 = 1", "a.b has the power"),
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


def test_a_linkage_is_looked_at_between_its_bounds_too() -> None:
    """A full turn of a parallelogram's arm: one linkage at both bounds, and dead points between."""
    four_bar = {"ground": 0.38, "crank": 0.05, "rod": 0.38, "arm": 0.05, "stretched": 0.28, "ahead": False}
    path = "leg.knee.transmission.four_bar"
    design, entry = ho.load("paper", {path: four_bar}), f"{path}.stretched"
    with pytest.raises(UsageError, match=rf"--free: {entry} = -[0-9.]+: {path} has a dead point"):
        codesign.checked(design, {entry: (0.28 - 2 * np.pi, 0.28)})
    codesign.checked(design, {entry: (0.2, 0.28)})


def test_free_points_of_a_table_of_ratios_still_fall() -> None:
    """Each two neighbours of which one is free; bounds that leave no order, and a level table, which tells none, are refused."""
    path = "leg.knee.transmission.table.ratio"

    def couplings(*ratio: float, free: tuple[float, float]) -> list[str]:
        table = {"angle": np.linspace(-2.4, -0.2, len(ratio)).tolist(), "ratio": list(ratio)}
        design = ho.load("paper", {"leg.knee.transmission.table": table})
        return [c.equation() for c in codesign.checked(design, {f"{path}[1]": free}).couplings]

    falls = [f"{path}[2] - {path}[3] >= 0", f"{path}[1] - {path}[2] >= 0", f"{path}[0] - {path}[1] >= 0"]
    assert couplings(1.2, 1.1, 1.0, 0.9, free=(0.5, 1.5)) == falls[1:]
    keeps = rf"^--free {re.escape(path)}\[1\]: a table keeps %s, and no values within the bounds"
    with pytest.raises(UsageError, match=keeps % "falling"):
        couplings(1.2, 1.1, 1.0, free=(1.3, 1.5))
    with pytest.raises(UsageError, match=keeps % "rising"):
        couplings(1.0, 1.1, 1.2, free=(1.3, 1.5))
    with pytest.raises(UsageError, match=rf"--free {re.escape(path)}\[1\]: {path} is level"):
        couplings(1.0, 1.0, 1.0, free=(0.5, 1.5))


@pytest.mark.rarely
def test_free_points_of_a_table_beat_a_ratio_that_is_one_for_all_angles(tmp_path: Path) -> None:
    """Against the best fixed ratio; the leg that comes out is written, read and verified as any other."""
    table = {"angle": [-2.4, -1.3, -0.15], "ratio": [0.5, 0.35, 0.2]}
    design = ho.load("paper", {"leg.knee.transmission.table": table})
    free = {f"leg.knee.transmission.table.ratio[{k}]": (0.02, 2.5) for k in range(3)}
    s = ho.solve(design, free=free, starts=1, processes=1)
    assert s.verified, s.summary.failed_checks
    found = s.design.leg.joint["knee"].transmission
    assert found is not None
    assert found.table is not None
    assert (np.diff(found.table.ratio) <= 0).all()
    own = ho.load("paper", {"leg.knee.gear.ratio": 100.0})
    fixed = ho.solve(own, free={"leg.knee.gear.ratio": (15, 250)}, starts=1, processes=1)
    assert s.clearance > fixed.clearance
    assert recheck(save(s, tmp_path)).verified


@pytest.mark.parametrize(
    ("free", "couple", "words"),
    [
        ({"leg.gear.ration": (50, 200)}, [], "did you mean leg.gear.ratio"),
        ({"leg.gear.ratio": (0, 200)}, [], "leg.gear.ratio = 0"),
        (
            {"hop.foot_window": (0.1, 0.2)},
            [],
            "no such number of the leg that is set; it has leg.body.mass, leg.motor.",
        ),
        (
            {"leg.hip.gear.ratio": (50, 150)},
            [],
            "no number of its own there but leg.gear.ratio: add --set leg.hip.gear.ratio=100",
        ),
        ({"leg.gear.ratio": (50, 200)}, ["leg.thigh.length = 0.4"], "none of its entries is free"),
        ({"leg.gear.ratio": (50, 200)}, ["leg.gear.ratios = 60"], "did you mean leg.gear.ratio"),
        ({"leg.gear.ratio": (50, 200)}, ["leg.gear.ratio = 300"], "no values within the bounds"),
        ({}, [], "nothing is free"),
    ],
)
def test_impossible_wishes(free: dict[str, tuple[float, float]], couple: list[str], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        ho.solve(ho.load("paper"), free=free, couple=couple)


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
        ho.solve(design, free=free, couple=["leg.shank.length <= 0.34"])
    with pytest.raises(UsageError, match="no values within the bounds"):  # now the coupling is what cannot be met
        ho.solve(design, free={"leg.shank.length": (0.35, 0.38)}, couple=["leg.shank.length <= 0.34"])


def test_lengths_of_a_leg_with_shapes_are_not_free() -> None:
    shaped = ho.load("paper", ["leg.thigh.radius=0.03"])
    with pytest.raises(UsageError, match=r"--free leg\.thigh\.length: shapes do not follow a free length: sweep it"):
        ho.solve(shaped, free={"leg.thigh.length": (0.3, 0.4)})


def test_couplings_need_freedom(capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["solve", "--couple", "leg.thigh.length = 0.4"]) == 2
    assert "--free leg.thigh.length" in capfd.readouterr().err


# ---- between two limits ------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_ratio_between_the_drives_cap_and_the_gears() -> None:
    """Below a ratio of 65 the drive's cap acts, 1 N m times the ratio, above it the gear's, 65 N m: the best is there, and
    without either it lies on that one's side."""
    fast = ["leg.motor.max_speed=2000", "leg.motor.max_torque=3", "leg.motor.torque_cap=1"]
    mesh = ["solver.stance_intervals=12", "solver.flight_intervals=6", "solver.refine=false"]
    design = ho.load("paper", [*fast, "leg.gear.torque_cap=65", *mesh])
    found = ho.solve(design, free={"leg.gear.ratio": (60, 140)}, starts=1, processes=1).summary.codesign
    assert found is not None
    (ratio,) = found.parameters
    assert ratio.optimal == pytest.approx(65, rel=1e-4)
    assert ratio.between is not None
    assert ratio.between.gain_per_unit_more < 0 < ratio.between.gain_per_unit_less
    without = {w.limit: w for w in ratio.between.without}
    assert set(without) == set(ratio.between.limits) == {"drive torque cap", "gear torque cap"}
    assert without["gear torque cap"].optimal > 65 + 1 > without["drive torque cap"].optimal + 1
    gains = [w.objective_value for w in ratio.between.without]
    assert found.objective_value < gains[0] < gains[1]  # the lesser first
    alone = {"gear torque cap": "leg.gear.torque_cap=200", "drive torque cap": "leg.motor.torque_cap=2.9"}
    for limit, loose in alone.items():
        other = ho.load("paper", [*fast, "leg.gear.torque_cap=65", *mesh, loose])
        again = ho.solve(other, free={"leg.gear.ratio": (30, 140)}, starts=1, processes=1).summary.codesign
        assert again is not None
        assert again.objective_value >= without[limit].objective_value - 1e-5


def test_an_attempt_is_kept_if_the_time_ends_before_another(monkeypatch: pytest.MonkeyPatch) -> None:
    summary = SimpleNamespace(certified=False, refinement_ended=UNSOLVED, objective_value=0.8)
    attempt, calls = SimpleNamespace(verified=False, summary=summary), list[int]()

    def confirmed(*given: Any, **more: Any) -> Any:
        calls.append(1)
        if len(calls) > 1:
            raise NotSolvedError("the time limit was reached")
        return attempt

    monkeypatch.setattr(codesign, "_confirmed", confirmed)
    monkeypatch.setattr(codesign, "_begun", lambda *given: [])
    hop_found = SimpleNamespace(success=True, objective=0.8, signed_value=0.8)
    monkeypatch.setattr(codesign, "search_first_mesh", lambda *given: SimpleNamespace(outcomes=(hop_found,)))
    monkeypatch.setattr(codesign, "solved_from", lambda *given: hop_found)
    found = codesign._found(Hop(ho.load("paper")), 1, 1, Stopwatch(), lambda text: None, NEVER, None)
    assert found is attempt
    assert len(calls) == 2
