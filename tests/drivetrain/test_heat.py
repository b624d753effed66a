"""A motor's heat, against closed forms and SciPy; and an optimum whose windings have a limit."""

from dataclasses import replace
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hopopt.drivetrain.heat import COPPER, REFERENCE, Cycle, TwoBodies
from hopopt.drivetrain.supply import winding_heat
from hopopt.errors import ProblemFileError
from hopopt.leg.robot import build_robot
from hopopt.nlp.solver.ipopt import NlpSolver
from hopopt.nlp.solver.reuse import with_numbers_of
from hopopt.ocp.guesses.initial_guess import make_guess, starts_of
from hopopt.ocp.hop import Hop
from hopopt.optimality.directions.parametric_sensitivity import slopes
from hopopt.planner.search.multistart import first_transcription
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.problem.load import load
from hopopt.verify.hops.heat import heat_figures, motor_heat
from hopopt.verify.table import NORMALISED_TIMES, STANCE, Table

R_WH, R_HA, TAU_W, TAU_H = 2.6, 1.9, 40.0, 1200.0
BODIES = TwoBodies(R_WH, R_HA, TAU_W, TAU_H, ambient=25.0, copper=0.0)
THERMAL = {
    "leg.motor.winding_to_housing": R_WH, "leg.motor.housing_to_ambient": R_HA,
    "leg.motor.winding_time_constant": TAU_W, "leg.motor.housing_time_constant": TAU_H,
    "leg.motor.winding_resistance": 0.9167, "leg.motor.torque_constant": 0.0382,
}  # fmt: skip


def pulse(torque: float, duration: float, intervals: int = 20) -> dict[str, Table]:
    """A plan that holds a torque [N m] at the hip and nothing at the knee."""
    edges = np.linspace(0.0, duration, intervals + 1)
    t = edges[:-1, None] + np.diff(edges)[:, None] * NORMALISED_TIMES
    tau = np.stack([np.full_like(t, torque), np.zeros_like(t)], axis=-1)
    still, force = np.zeros((*t.shape, 4)), np.zeros((*t.shape, 2))
    return {STANCE: Table(t, still, still, still, tau, force)}


def two_exponentials(heat: float, t: float) -> np.ndarray:
    """Rises [K] after a heat [W] for t [s] from cold, by the eigenvalues of the two bodies, resistance constant."""
    C_w, C_h = TAU_W / R_WH, TAU_H / R_HA
    a, b, d = 1 / (R_WH * C_w), 1 / (R_WH * C_h), 1 / (R_HA * C_h)
    mean, apart = (a + b + d) / 2, np.sqrt(((a + b + d) / 2) ** 2 - a * d)
    end = np.array([heat * (R_WH + R_HA), heat * R_HA])
    rate = np.array([heat / C_w, 0.0])  # at the start
    slow, fast = -mean + apart, -mean - apart
    A = (rate + fast * end) / (slow - fast)  # of end + A exp(slow t) + B exp(fast t), zero with that rate at the start
    return end + A * np.exp(slow * t) + (-end - A) * np.exp(fast * t)


def pulsed(heat: float, duration: float, pause: float) -> Cycle:
    return Cycle(BODIES.cooling(duration), two_exponentials(heat, duration), BODIES.cooling(pause))


def test_a_pulse_warms_winding_and_housing_as_two_exponentials() -> None:
    """Through the table of a plan; h tau^2 is the heat."""
    design = load("paper", THERMAL)
    robot, lasts, torque = build_robot(design.leg), 7.0, 40.0
    heat = float(winding_heat(design.leg, "hip", robot.parameters)) * torque**2
    constant = replace(TwoBodies.of(design.leg, "hip", robot.parameters, 25.0), copper=0.0)  # type: ignore[type-var]
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(TwoBodies, "of", lambda *_: constant)
        found = motor_heat(design, robot, pulse(torque, lasts), "hip")
    assert found is not None
    np.testing.assert_allclose(found.end, two_exponentials(heat, lasts), rtol=1e-6)
    assert found.highest == pytest.approx(found.end[0])
    np.testing.assert_allclose(found.cycle.kept, BODIES.cooling(lasts), rtol=1e-6)


def test_copper_s_rise_against_scipy() -> None:
    design, torque, lasts = load("paper", {**THERMAL, "environment.temperature": 40.0}), 60.0, 30.0
    robot = build_robot(design.leg)
    h = float(winding_heat(design.leg, "hip", robot.parameters))

    def rates(_: float, x: np.ndarray) -> list[float]:
        heat = h * torque**2 * (1 + 0.0039 * (x[0] - 25.0))
        return [
            (heat - (x[0] - x[1]) / R_WH) * R_WH / TAU_W,
            ((x[0] - x[1]) / R_WH - (x[1] - 40) / R_HA) * R_HA / TAU_H,
        ]

    run = solve_ivp(rates, (0.0, lasts), [40.0, 40.0], "Radau", rtol=1e-10, atol=1e-10)
    found = motor_heat(design, robot, pulse(torque, lasts), "hip")
    assert found is not None
    np.testing.assert_allclose(40.0 + found.end, run.y[:, -1], rtol=1e-6)
    assert (COPPER, REFERENCE) == (0.0039, 25.0)


@pytest.mark.parametrize("hops", [1, 2, 7, 400])
def test_hops_with_pauses_are_pulses_that_add_up(hops: int) -> None:
    """By superposition: a pulse that began t ago is a step of heat that began t ago less one that began a pulse later."""
    heat, lasts, pause = 50.0, 0.7, 3.0
    ago = [k * (lasts + pause) + lasts for k in range(hops)]
    exact = sum((two_exponentials(heat, t) - two_exponentials(heat, t - lasts) for t in ago), np.zeros(2))
    np.testing.assert_allclose(pulsed(heat, lasts, pause).after(hops), exact, rtol=1e-6)


def test_the_steady_cycle_has_the_mean_heat_and_is_what_hopping_on_leads_to() -> None:
    heat, lasts, pause = 50.0, 0.7, 3.0
    cycle = pulsed(heat, lasts, pause)
    assert cycle.steady is not None
    np.testing.assert_allclose(cycle.after(100_000), cycle.steady, rtol=1e-6)
    mean = heat * lasts / (lasts + pause)
    assert cycle.steady[1] == pytest.approx(mean * R_HA, rel=2e-3)  # the housing hardly follows a hop
    np.testing.assert_allclose(cycle.kept @ cycle.cooled @ cycle.steady + cycle.gained, cycle.steady, rtol=1e-12)


def test_how_many_hops_from_cold_stay_within_a_limit() -> None:
    cycle = pulsed(50.0, 0.7, 3.0)
    assert cycle.steady is not None
    for most in (0.5, 10.0, 0.9 * cycle.steady[0]):
        n = cycle.hops_within(most)
        assert n is not None
        assert cycle.after(n)[0] <= most < cycle.after(n + 1)[0]
    assert cycle.hops_within(1.01 * cycle.steady[0]) is None


def test_a_winding_that_grows_hotter_without_end_has_no_steady_cycle() -> None:
    """Copper's resistance grows by 0.39 % a kelvin: above R_w i^2 0.0039 (R_wh + R_ha) = 1 nothing carries that away."""
    design = load("paper", {**THERMAL, "hop.pause": 0.0})
    robot = build_robot(design.leg)
    h = float(winding_heat(design.leg, "hip", robot.parameters))
    critical = np.sqrt(1 / (COPPER * (R_WH + R_HA)) / h)
    ends = [motor_heat(design, robot, pulse(share * critical, 1.0), "hip") for share in (0.99, 1.01)]
    assert [found is not None and bool(np.isfinite(found.highest)) for found in ends] == [True, False]


def test_the_mean_torque_is_told_beside_the_continuous_one() -> None:
    design = load("paper", {**THERMAL, "leg.motor.continuous_torque": 0.5, "hop.pause": 3.0})
    found = heat_figures(design, build_robot(design.leg), pulse(40.0, 1.0))
    assert found is not None
    hip = found["hip"]
    assert (hip.peak_torque_N_m, hip.rms_torque_N_m) == pytest.approx((0.4, 0.2))  # a quarter of the time
    assert hip.share_of_continuous == pytest.approx(0.4)
    assert hip.rms_current_A == pytest.approx(0.2 / 0.0382)
    plain = load("paper")
    assert heat_figures(plain, build_robot(plain.leg), pulse(40.0, 1.0)) is None


def test_rates_are_of_symbols_too() -> None:
    x = ca.SX.sym("x", 2)
    rates = ca.Function("rates", [x], [ca.vertcat(*BODIES.rates(x[0], x[1], 10.0))])
    np.testing.assert_allclose(np.array(rates([3.0, 1.0])).ravel(), BODIES.rates(3.0, 1.0, 10.0), rtol=1e-14)


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ({**THERMAL, "leg.motor.winding_limit": 20.0}, "winding_limit = 20 degC is not above environment.temperature = 25"),
        ({"leg.motor.winding_limit": 100.0}, "winding_limit = 100 tells .* give motor.winding_to_housing"),
        ({**THERMAL, "leg.motor.torque_constant": None}, "winding_to_housing = 2.6 tells .* give motor.torque_constant too"),
        ({"environment.temperature": 400}, "environment.temperature"),
    ],
)  # fmt: skip
def test_wrong_entries_get_one_sentence(entries: dict[str, float | None], words: str) -> None:
    with pytest.raises(ProblemFileError, match=words) as fault:
        load("paper", entries)
    assert len({text.split("=")[0] for text in fault.value.problems}) == len(fault.value.problems)


# ---- the optimum with it --------------------------------------------------------------------------------------------

PAUSE, LIMIT = 5.0, 125.0


@pytest.fixture(scope="module")
def for_ever() -> Solution:
    return solve(load("paper", {**THERMAL, "leg.motor.winding_limit": LIMIT, "hop.pause": PAUSE}), starts=1)


@pytest.mark.slow
def test_hopping_on_for_ever_heats_the_windings_to_their_limit(for_ever: Solution) -> None:
    assert for_ever.verified
    assert for_ever.summary.heat is not None
    hottest = [h.winding_temperature_C for h in for_ever.summary.heat.values() if h.winding_temperature_C is not None]
    assert max(hottest) == pytest.approx(LIMIT, abs=1e-4 * (LIMIT - 25.0))
    for joint in for_ever.robot.joints:  # by hopping, not by the fixed point
        found = motor_heat(for_ever.design, for_ever.robot, for_ever.tables, joint)
        assert found is not None
        assert 25.0 + found.cycle.after(1_000_000)[0] <= LIMIT + 1e-2


@pytest.mark.rarely
def test_less_time_to_cool_and_lower_limits_cost_height(for_ever: Solution) -> None:
    free = solve(load("paper", THERMAL), starts=1).clearance
    cooler = solve(load("paper", {**THERMAL, "leg.motor.winding_limit": 90.0, "hop.pause": PAUSE}), starts=1).clearance
    assert all(a > b + 1e-3 for a, b in pairwise([free, for_ever.clearance, cooler]))


@pytest.mark.slow
def test_a_periodic_hop_has_no_pause_and_no_cycle_that_grows_hotter_without_end() -> None:
    """An unstable cycle would repeat itself too, with windings far below ambient."""
    own = {"leg.motor.winding_limit": 150.0, "hop.kind": "periodic", "hop.clearance": 0.2}
    found = solve(load("paper", {**THERMAL, **own}), starts=1)
    assert found.verified
    assert found.summary.heat is not None
    for joint in found.summary.heat.values():
        assert joint.winding_temperature_C is not None
        assert joint.winding_temperature_C <= 150.0 + 0.0125


@pytest.mark.slow
def test_the_optimum_tells_what_pause_and_air_and_thermal_entries_are_worth() -> None:
    """By multipliers, and by solving the first mesh again with each a little more and less."""
    entries = {**THERMAL, "leg.motor.winding_limit": LIMIT, "hop.pause": PAUSE, "environment.temperature": 25.0}
    t = first_transcription(hop := Hop(load("paper", entries)))
    solver = NlpSolver(t)
    best = solver(make_guess(hop, starts_of(hop, 1)[0]))
    assert best.success
    told = slopes(best).parameters

    def height(**changed: float) -> float:
        again = with_numbers_of(t, Hop(load("paper", {**entries, **changed})).problem)
        found = NlpSolver(again).from_vector(best.z, (best.lam_g, best.lam_x))
        assert found.success
        return found.value

    known = {"hop.pause": PAUSE, "environment.temperature": 25.0}
    for entry in (*known, "leg.motor.winding_limit", "leg.motor.winding_to_housing"):
        value = known.get(entry, entries[entry])
        high, low = height(**{entry: 1.01 * value}), height(**{entry: 0.99 * value})
        assert told[entry][0] == pytest.approx((high - low) / (0.02 * value), rel=5e-3), entry
    assert told["hop.pause"][0] > 0 > told["environment.temperature"][0]
