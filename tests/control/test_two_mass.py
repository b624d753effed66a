"""The two-mass hopper: every closed form against its integrated equations of motion, and against what is printed."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from hopopt.control.two_mass import PAPER, TwoMass

TIGHT = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-13}
G = 9.81


# ---- the model, integrated: x = (y_m, y_e, y_m', y_e'), no formula shared with hopopt -----------------------------


def spring(p: TwoMass, x: np.ndarray) -> float:
    return p.k * (p.l0 - x[0] + x[1])


def ground(p: TwoMass, x: np.ndarray) -> float:
    return spring(p, x) + p.m_e * p.g


def stance(p: TwoMass) -> Callable[[float, np.ndarray], list[float]]:
    return lambda t, x: [x[2], 0.0, spring(p, x) / p.m - p.g, 0.0]


def flight(p: TwoMass) -> Callable[[float, np.ndarray], list[float]]:
    return lambda t, x: [x[2], x[3], spring(p, x) / p.m - p.g, -spring(p, x) / p.m_e - p.g]


def falling(event: Callable[[np.ndarray], float], terminal: bool = True) -> Any:
    """An event of solve_ivp where the quantity falls through zero."""

    def happens(t: float, x: np.ndarray) -> float:
        return event(x)

    happens.terminal, happens.direction = terminal, -1  # pyright: ignore[reportFunctionMemberAccess]
    return happens


@dataclass
class Hop:
    """One hop from rest at mid-stance: both phases as solve_ivp gives them, flight ending at touchdown."""

    push: Any
    flight: Any
    tops: np.ndarray  # heights the foot turns at, m
    apex: np.ndarray  # state where the centre of mass turns


def integrate(p: TwoMass) -> Hop:
    rest = [p.l0 - p.C_amp - 2 * p.m * p.g / p.k, 0.0, 0.0, 0.0]  # as far below the loaded length as C_amp is above l0
    # steps short enough for no event to come and go within one
    short = {"max_step": 0.02 * np.sqrt(p.m / p.k), "dense_output": True, **TIGHT}
    push = solve_ivp(stance(p), (0, 1e3), rest, events=falling(lambda x: ground(p, x)), **short)
    assert push.t_events[0].size == 1
    events = [
        falling(lambda x: x[1]),
        falling(lambda x: x[3], terminal=False),
        falling(lambda x: p.m * x[2] + p.m_e * x[3], terminal=False),
    ]
    short["max_step"] = 0.3 * np.sqrt(p.m * p.m_e / (p.k * (p.m + p.m_e)))
    air = solve_ivp(flight(p), (0, 1e3), push.y_events[0][0], events=events, **short)
    assert air.t_events[0].size == 1
    return Hop(push, air, air.y_events[1][:, 1], air.y_events[2][0])


@st.composite
def hoppers(draw: Any) -> TwoMass:
    """Masses, lengths and a spring that pulls the foot up with 1.05 to 60 times its weight."""
    m, C_amp = draw(st.floats(0.5, 50)), draw(st.floats(0.02, 0.3))
    m_e = m * draw(st.floats(0.02, 2))
    k = draw(st.floats(1.05, 60)) * m_e * G / C_amp
    return TwoMass(m, m_e, k, draw(st.floats(0.2, 1.0)), C_amp, draw(st.floats(0, 0.5)))


LANDING = [replace(PAPER, k=PAPER.soft_landing_stiffness(n)) for n in (1, 2, 3, 4)]
FREE = [PAPER, replace(PAPER, k=170.0), replace(PAPER, k=17000.0)]


def agrees(p: TwoMass) -> None:
    """Every closed form against the integration, relative to the size of this hop."""
    hop, size = integrate(p), p.A + p.com_rise + p.l0
    speed = p.A * p.omega_s + p.g * p.t_f

    def close(a: Any, b: Any, scale: float) -> None:
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-8 * scale)

    close(p.t_lo, hop.push.t[-1], p.t_lo)
    t = np.linspace(0, hop.push.t[-1], 50)
    x = hop.push.sol(t)
    close(p.y_s(t), x[0], size)
    close(p.y_s_rate(t), x[2], speed)
    close(p.ground_force(t), ground(p, x), p.peak_ground_force)  # pyright: ignore[reportArgumentType]
    close(p.peak_ground_force, ground(p, x).max(), p.peak_ground_force)  # pyright: ignore[reportAttributeAccessIssue]
    close(p.stance_range, (x[0].min(), x[0].max()), size)
    close((p.y_lo, p.v_lo), hop.push.y[[0, 2], -1], max(size, speed))
    close(p.v_c, p.m * hop.push.y[2, -1] / (p.m + p.m_e), speed)

    air = solve_ivp(flight(p), (0, 1.01 * p.t_f), hop.push.y[:, -1], dense_output=True, **TIGHT)
    t = np.linspace(0, p.t_f, 400)
    x = air.sol(t)
    close(p.y_f(t), x[0] - x[1], size)
    close(p.y_f_rate(t), x[2] - x[3], speed)
    close(p.y_c(t), (p.m * x[0] + p.m_e * x[1]) / (p.m + p.m_e), size)
    close(p.y_m(t), x[0], size)
    close(p.y_e(t), x[1], size)
    close(p.y_e_rate(t), x[3], speed)
    assert abs(air.sol(p.t_f)[1]) < 1e-8 * size
    assert np.all(air.sol(np.linspace(0.1, 0.999, 500) * p.t_f)[1] > 0)  # not earlier
    assert air.sol(1.005 * p.t_f)[1] < 0

    close(p.clearance, hop.tops.max(), size)
    height = (p.m * hop.apex[0] + p.m_e * hop.apex[1]) / (p.m + p.m_e)
    close(p.com_rise, height - p.m * hop.push.y[0, -1] / (p.m + p.m_e), size)


@pytest.mark.parametrize("p", [*FREE, *LANDING], ids=lambda p: f"{p.k:.0f} N/m")
def test_closed_forms_are_the_integrated_model(p: TwoMass) -> None:
    agrees(p)


@settings(max_examples=25, deadline=None)
@given(hoppers())
def test_closed_forms_hold_for_any_hopper_that_lifts_off(p: TwoMass) -> None:
    agrees(p)


@pytest.mark.parametrize("p", FREE, ids=lambda p: f"{p.k:.0f} N/m")
def test_touchdown_is_where_the_integrated_foot_lands(p: TwoMass) -> None:
    hop = integrate(p)
    assert p.t_f == pytest.approx(hop.flight.t[-1], rel=1e-9)
    assert 2 * hop.push.t[-1] + hop.flight.t[-1] == pytest.approx(p.T, rel=1e-9)
    assert hop.flight.y[3, -1] < -1.0  # m/s: these three land hard


@settings(max_examples=200, deadline=None)
@given(hoppers())
def test_the_foot_touches_down_once(p: TwoMass) -> None:
    """Above the ground before t_f, below it ever after, in steps of a fiftieth of an oscillation."""
    step = 2 * np.pi / p.omega_f / 50
    assert np.all(p.y_e(np.linspace(0.05, 0.999, 5 + int(p.t_f / step)) * p.t_f) > 0)
    later = p.t_f * 1.001 + step * np.arange(int(3 * p.t_f / step) + 5)
    assert np.all(p.y_e(later) < 0)


@settings(max_examples=200, deadline=None)
@given(hoppers())
def test_clearance_is_the_greatest_of_all_tops(p: TwoMass) -> None:
    t = np.linspace(0, p.t_f, 20 * (5 + int(p.omega_f * p.t_f)))
    step, stiffest = t[1], p.g + p.v_lo * p.omega_f + (p.y_lo - p.l0) * p.omega_f**2  # bound of |y_e''|, m/s^2
    assert 0 <= p.clearance - p.y_e(t).max() + 1e-12 <= stiffest * step**2 / 8 + 2e-12


# k, t_lo, v_lo, COM rise, clearance, flight, period, shortest and longest leg, spring's peak force
TABLE = [
    (170, "0.464", "1.35", "0.071", "0.123", "0.312", "1.240", "-0.316", "0.496", "130", "0.007"),
    (1700, "0.104", "2.57", "0.259", "0.308", "0.480", "0.689", "0.265", "0.455", "314", "0.298"),
    (17000, "0.029", "6.79", "1.797", "1.835", "1.210", "1.268", "0.324", "0.450", "2150", "0.327"),
]


@pytest.mark.parametrize("row", TABLE, ids=lambda row: f"{row[0]} N/m")
def test_the_readings_of_the_stiffness(row: tuple[Any, ...]) -> None:
    p = replace(PAPER, k=float(row[0]))
    loaded = TwoMass.from_loaded_length(0.45, 5.6, 0.8, float(row[0]), C_amp=0.12, C_max=0.11)
    peak = float(p.ground_force(0.0)) - p.m_e * p.g
    found = [p.t_lo, p.v_lo, p.com_rise, p.clearance, p.t_f, p.T, *p.stance_range, peak, loaded.stance_range[0]]
    line = next(line for line in DOCUMENT.splitlines() if line.startswith(f"| {row[0]} |"))
    assert all(printed in re.findall(r"-?[\d.]+", line) for printed in row[1:])
    for value, printed in zip(found, row[1:], strict=True):
        digits = len(printed.partition(".")[2])
        assert round(value, -1 if printed == "2150" else digits) == float(printed)
    assert loaded.loaded_length == pytest.approx(0.45, rel=1e-15)
    assert (loaded.t_lo, loaded.t_f, loaded.clearance) == pytest.approx((p.t_lo, p.t_f, p.clearance), rel=1e-12)


def test_no_lift_off_is_said_with_what_it_takes() -> None:
    soft = replace(PAPER, k=17.0)
    for quantity in ("t_lo", "v_lo", "t_f", "T", "clearance", "com_rise"):
        with pytest.raises(
            ValueError, match=r"never lifts off: .* 2\.04 N.* 7\.85 N.* k > 65\.4 N/m or C_amp > 0\.4616 m"
        ):
            getattr(soft, quantity)
    limit = PAPER.m_e * G / PAPER.C_amp
    assert PAPER.soft_landing_stiffness(0) == pytest.approx(limit, rel=1e-14)
    assert replace(PAPER, k=limit * 1.001).clearance > 0
    with pytest.raises(ValueError, match="never lifts off"):
        _ = replace(PAPER, k=limit * (1 - 1e-9)).t_f
    assert float(soft.ground_force(np.pi / soft.omega_s)) > 0  # least at the oscillation's top, but not zero
    assert soft.stance_range == pytest.approx((soft.y_s(0.0), soft.y_s(np.pi / soft.omega_s)), rel=1e-14)


@pytest.mark.parametrize(
    "wrong", [{"m": 0.0}, {"m_e": -1.0}, {"k": float("nan")}, {"C_amp": 0.0}, {"C_max": 1.0}, {"C_max": -0.1}]
)
def test_values_out_of_range_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must be greater than 0"):
        replace(PAPER, **wrong)


# ---- soft landings --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("n", "k"), [(1, 524), (2, 1064), (3, 1626), (4, 2196)])
def test_soft_landing_ladder(n: int, k: int) -> None:
    p = replace(PAPER, k=PAPER.soft_landing_stiffness(n))
    assert round(p.k) == k
    phi = np.arccos((p.y_lo - p.l0) / np.hypot(p.y_lo - p.l0, p.v_lo / p.omega_f))
    assert 2 * p.v_c / p.g == pytest.approx((2 * np.pi * n + 2 * phi) / p.omega_f, rel=1e-12)
    # y_e, y_e' and y_e'' vanish together there, so the root is known to the cube root of the rounding only
    assert p.t_f == pytest.approx(2 * p.v_c / p.g, rel=1e-5)
    hop = integrate(p)
    assert hop.flight.t[-1] == pytest.approx(2 * p.v_c / p.g, rel=1e-3)
    end = solve_ivp(flight(p), (0, 2 * p.v_c / p.g), hop.push.y[:, -1], **TIGHT).y[:, -1]
    np.testing.assert_allclose(end, [p.y_lo, 0, -p.v_lo, 0], atol=1e-9)


@settings(max_examples=30, deadline=None)
@given(hoppers(), st.integers(1, 5))
def test_soft_landing_closes_the_hop(p: TwoMass, n: int) -> None:
    """Stance, flight and stance again end where they began, and no energy is lost on the way."""
    p = replace(p, k=p.soft_landing_stiffness(n))

    def energy(x: np.ndarray) -> np.ndarray:
        kinetic = p.m * x[2] ** 2 / 2 + p.m_e * x[3] ** 2 / 2
        return kinetic + p.g * (p.m * x[0] + p.m_e * x[1]) + p.k * (x[0] - x[1] - p.l0) ** 2 / 2

    rest = np.array([p.y_s(0.0), 0, 0, 0])
    x, t = rest, np.array([p.t_lo, 2 * p.v_c / p.g, p.t_lo])
    for law, duration in zip((stance(p), flight(p), stance(p)), t, strict=True):
        path = solve_ivp(law, (0, duration), x, **TIGHT).y
        scale = p.k * (p.l0 - rest[0]) ** 2 / 2
        np.testing.assert_allclose(energy(path), energy(rest), atol=1e-8 * scale)
        x = path[:, -1]
    np.testing.assert_allclose(x[:2], rest[:2], atol=1e-7 * p.A)
    np.testing.assert_allclose(x[2:], rest[2:], atol=1e-7 * p.A * p.omega_s)
    assert t.sum() == pytest.approx(p.T, rel=1e-4)  # a triple root, as above


def test_without_a_soft_landing_the_model_does_not_repeat_itself() -> None:
    """The paper's spring lands with 2.88 m/s on the foot and the leg near its shortest; the next hop is lower."""
    hop = integrate(PAPER)
    x = hop.flight.y[:, -1]
    assert x[3] == pytest.approx(-2.88, abs=0.005)
    assert x[0] - x[1] == pytest.approx(0.398, abs=0.0005)
    x = np.array([x[0], 0.0, x[2], 0.0])  # the foot stops
    again = solve_ivp(stance(PAPER), (0, 1), x, events=falling(lambda x: ground(PAPER, x)), **TIGHT)
    assert again.y[2, -1] < 0.95 * PAPER.v_lo


# ---- the reference ----------------------------------------------------------------------------------------------


@settings(max_examples=100, deadline=None)
@given(hoppers())
def test_reference_is_continuous_at_lift_off_apex_and_mid_stance(p: TwoMass) -> None:
    instants = np.array([p.t_lo, p.T / 2, p.T, p.T + p.t_lo, 1.5 * p.T])
    before, after = instants * (1 - 1e-12), instants * (1 + 1e-12)
    np.testing.assert_allclose(p.y_des(before), p.y_des(after), atol=1e-8 * (p.l0 + p.A))
    np.testing.assert_allclose(p.y_des_rate(before), p.y_des_rate(after), atol=1e-7 * (p.A + p.l0) * p.omega_f)
    end, start = p.stance_reference(p.t_lo), p.flight_reference(0.0)
    np.testing.assert_allclose(end[0], start[0], rtol=1e-12)
    np.testing.assert_allclose(end[1], start[1], rtol=1e-12)


@settings(max_examples=100, deadline=None)
@given(hoppers(), st.integers(1, 5))
def test_reference_is_continuous_at_a_soft_touchdown(p: TwoMass, n: int) -> None:
    p = replace(p, k=p.soft_landing_stiffness(n))
    end, start = p.flight_reference(p.t_f), p.touchdown_reference(0.0)
    np.testing.assert_allclose(end[0], start[0], rtol=1e-4)
    np.testing.assert_allclose(end[1], start[1], rtol=1e-3, atol=1e-3)


@settings(max_examples=100, deadline=None)
@given(hoppers(), st.one_of(st.floats(0, 0.999), st.floats(1.001, 3)))  # C_com stops with a kink at t_f
def test_rates_are_derivatives(p: TwoMass, at: float) -> None:
    h = 1e-6 / p.omega_f
    smooth: list[tuple[Callable[[Any], Any], Callable[[Any], Any]]] = [
        (p.C_com, p.C_com_rate),
        (p.y_s, p.y_s_rate),
        (p.y_f, p.y_f_rate),
        (p.y_e, p.y_e_rate),
        (lambda t: p.stance_reference(t)[0], lambda t: p.stance_reference(t)[1]),
        (lambda t: p.touchdown_reference(t)[0], lambda t: p.touchdown_reference(t)[1]),
        (lambda t: p.flight_reference(t)[0], lambda t: p.flight_reference(t)[1]),
    ]
    for value, rate in smooth:
        t = at * p.t_f
        slope = (value(t + h) - value(t - h)) / (2 * h)
        assert slope == pytest.approx(rate(t), abs=1e-4 * (p.v_lo + p.l0 * p.omega_f + p.g * p.t_f))


def test_reference_follows_the_contact_of_the_plant() -> None:
    """The model's own clock is push, flight and landing one after the other, and comes round after T."""
    p = PAPER
    push, air, land = np.linspace(0, p.t_lo, 20), np.linspace(0, p.t_f, 50)[1:-1], np.linspace(0, p.t_lo, 20)[1:]
    clock = np.concatenate([push[:-1], p.t_lo + air, p.T - p.t_lo + land])
    pieces = [p.stance_reference(push[:-1]), p.flight_reference(air), p.touchdown_reference(land)]
    for turn in (0, 1, 2):
        np.testing.assert_allclose(p.y_des(clock + turn * p.T), np.concatenate([y for y, _ in pieces]), rtol=1e-10)
        rates = np.concatenate([rate for _, rate in pieces])
        np.testing.assert_allclose(p.y_des_rate(clock + turn * p.T), rates, atol=1e-9)


@settings(max_examples=200, deadline=None)
@given(hoppers(), st.floats(0, 2))
@example(TwoMass(1.0, 0.0081, 7.4, 1.0, 0.1, 0.5), 1.0)  # its stance oscillation turns after T/2
def test_the_push_is_not_compensated(p: TwoMass, at: float) -> None:
    """From mid-stance on the stance reference is y_s alone, however late the plant lifts off."""
    t = at * np.pi / p.omega_s
    assert p.stance_reference(t)[0] == pytest.approx(p.y_s(min(t, np.pi / p.omega_s)), rel=1e-12)


def test_reference_of_a_plant_that_is_late() -> None:
    """Late at lift-off: up to the oscillation's top, never down. Late at touchdown: C_com waits."""
    p = PAPER
    y, rate = p.stance_reference(np.linspace(0, 1, 1000))
    assert np.all(np.diff(y) >= 0)
    assert np.all(rate >= -1e-12)
    assert y[-1] == pytest.approx(p.l0 + p.C_amp, rel=1e-12)
    t = p.t_f + np.linspace(0, 0.3, 100)
    np.testing.assert_allclose(p.flight_reference(t)[0] / p.y_f(t), p.C_com(p.T - p.t_lo), rtol=1e-12)


def test_compensation_shortens_the_leg_from_apex_to_mid_stance_only() -> None:
    p = PAPER
    assert p.C_com(p.T * np.array([0, 0.25, 0.5, 0.75, 1])) == pytest.approx([1, 1, 1, 1 - p.C_max, 1], abs=1e-12)
    C = p.C_com(np.linspace(0, p.T, 1001))
    assert C.max() == 1
    assert C.min() == pytest.approx(0.89, abs=1e-12)


# ---- the equations as they are printed, beside the corrected ones (docs/paper.md quotes these numbers) -------------

M, M_E, K, Y_NEU, C_AMP, C_MAX = 5.6, 0.8, 1700.0, 0.45, 0.12, 0.11  # tables 1 and 2; k_s as 17 N/cm
BOTH, AMPLITUDE = M + M_E, C_AMP + M * G / K
OMEGA_S, OMEGA_F = np.sqrt(K / M), np.sqrt(K * BOTH / (M * M_E))
LEG = 0.38 + 0.361  # m, thigh and shank
DOCS = Path(__file__).parents[2] / "docs"
DOCUMENT = "".join((DOCS / f"{page}.md").read_text(encoding="utf-8") for page in ("paper", "paper_equations"))


def printed_y_s(t: Any) -> Any:
    return AMPLITUDE * np.cos(OMEGA_S * t + np.pi) + Y_NEU


def printed_t_lo() -> float:
    return float(np.sqrt(M / K) * (np.arccos(M_E * G / (K * AMPLITUDE)) - np.pi))


def printed_amplitudes(y_s: float, v_s: float) -> tuple[float, float]:
    """Both square roots of the paper's eq. 4 for y_s(t_lo) [m] and y_s'(t_lo) [m/s]."""
    first = np.sqrt(M * v_s**2 * M_E**3 / (K * BOTH**3) + y_s**2 * M_E**2 / BOTH**2)
    second = np.sqrt(M * v_s**2 * M**3 / (K * BOTH**3) + y_s**2 * M**2 / BOTH**2)
    return float(first), float(second)


def printed_t_fs(y_s: float, v_s: float) -> float:
    root = np.sqrt(M * M_E**3 * v_s**2 / (K * BOTH**3) + M_E**2 * y_s**2 / BOTH**2)
    return float(-np.sqrt(M * M_E / (K * BOTH)) * np.arccos(y_s * M_E / BOTH * root))


def quoted(text: str, value: float) -> None:
    """Holds that the value, rounded to the digits it is quoted with in docs/paper.md, reads as there."""
    assert f"{value:.{len(text.partition('.')[2])}f}" == text
    assert re.search(rf"(?<![\d.]){re.escape(text)}(?!\d)", DOCUMENT), f"the pages on the paper do not quote {text}"


def test_printed_gravity_pulls_the_body_up() -> None:
    """The paper's eqs. 1 and 2 with y_s, y_s.neu and y_f as lengths, up positive: off by twice the weight."""
    p, t, h = PAPER, 0.03, 1e-4

    def acceleration(y: Callable[[float], Any]) -> float:
        return float((y(t + h) - 2 * y(t) + y(t - h)) / h**2)

    k_f_m, k_f_e = K * BOTH / M_E, K * BOTH / M
    assert np.sqrt(k_f_m / M) == pytest.approx(p.omega_f)
    assert np.sqrt(k_f_e / M_E) == pytest.approx(p.omega_f)
    stretch = p.y_f(t) - p.l0
    printed = [
        M * acceleration(p.y_s) - (M * G - K * (p.y_s(t) - Y_NEU)),
        M * acceleration(p.y_m) - (M * G - k_f_m * M_E / BOTH * stretch),
        M_E * acceleration(p.y_e) - (M_E * G - k_f_e * -M / BOTH * stretch),
    ]
    assert printed == pytest.approx([-2 * M * G, -2 * M * G, -2 * M_E * G], abs=0.01)
    quoted("109.9", 2 * M * G)
    quoted("7.8", M_E * G)
    # with y pointing down the flight equations and the landing condition hold, the foot's displacement being +M/M_tot
    assert -M_E * acceleration(p.y_e) == pytest.approx(M_E * G - k_f_e * M / BOTH * stretch, abs=0.01)
    soft = LANDING[2]
    assert M / BOTH * (soft.y_f(soft.t_f) - soft.l0) == pytest.approx(M_E * G / (soft.k * BOTH / M), rel=1e-3)


def test_printed_neutral_length_is_two_lengths() -> None:
    quoted("0.032", M * G / K)
    quoted("3.2", M * G / 17.0)
    # paper's eq. 3 oscillates about y_s.neu, so about the loaded length; lift-off then needs the foot's pull from l0
    assert printed_y_s(0.0) - PAPER.y_s(0.0) == pytest.approx(M * G / K)
    assert PAPER.ground_force(abs(printed_t_lo())) == pytest.approx(M * G)
    quoted("54.9", M * G)


def test_printed_lift_off_time_is_negative() -> None:
    quoted("-0.092", printed_t_lo())
    quoted("0.104", PAPER.t_lo)
    assert printed_y_s(printed_t_lo()) == pytest.approx(M_E * G / K + Y_NEU)  # the printed condition, on the way down
    assert printed_y_s(printed_t_lo() + 1e-6) < printed_y_s(printed_t_lo())


def test_printed_period_leaves_out_the_ballistic_flight() -> None:
    swing = 2 * np.pi / OMEGA_F
    quoted("0.127", swing)
    quoted("-0.056", 2 * printed_t_lo() + swing)
    quoted("0.336", 2 * PAPER.t_lo + swing)
    quoted("0.480", PAPER.t_f)
    quoted("0.689", PAPER.T)
    T = 2 * PAPER.t_lo + swing
    t = np.linspace(0, T, 1001)
    assert not np.any((t >= 0) & (t < PAPER.t_lo) & (t > T - PAPER.t_lo))  # the paper's eq. 9, first case: "and"
    unshifted = PAPER.y_s(PAPER.T - PAPER.t_lo)  # y_s on a clock that is not reset
    quoted("0.528", unshifted)
    quoted("0.455", PAPER.y_lo)


def test_printed_flight_amplitudes() -> None:
    stretch, v = PAPER.y_lo - PAPER.l0, PAPER.v_lo
    quoted("0.0046", stretch)
    first, second = printed_amplitudes(stretch, v)
    R_f = np.hypot(stretch, v / OMEGA_F)
    assert first == pytest.approx(M_E / BOTH * R_f)  # the body's is right
    quoted("0.121", second)
    quoted("0.0459", M / BOTH * R_f)
    first, second = printed_amplitudes(PAPER.y_lo, v)  # with the length, as printed
    quoted("0.92", Y_NEU + first + second)
    quoted("0.741", LEG)
    quoted("0.502", PAPER.l0 + R_f)
    quoted("0.398", PAPER.l0 - R_f)


def test_printed_flight_window() -> None:
    stretch, v = PAPER.y_lo - PAPER.l0, PAPER.v_lo
    right = -np.arccos(stretch / np.hypot(stretch, v / OMEGA_F)) / OMEGA_F
    quoted("-0.0301", right)
    quoted("-0.0318", printed_t_fs(PAPER.y_lo, v))
    R_f = np.hypot(stretch, v / OMEGA_F)

    def y_f(t: float) -> float:  # the paper's eq. 4, amplitudes corrected, its own clock
        return float(PAPER.l0 + R_f * np.cos(OMEGA_F * t))

    def y_f_rate(t: float) -> float:
        return float(-R_f * OMEGA_F * np.sin(OMEGA_F * t))

    t = np.linspace(0, 0.3, 7)
    np.testing.assert_allclose([y_f(right + s) for s in t], PAPER.y_f(t), rtol=1e-12)  # the time shift
    needed = float(PAPER.y_s_rate(-PAPER.t_lo))
    assert y_f_rate(right) == pytest.approx(PAPER.v_lo)
    quoted("5.1", y_f_rate(right + 2 * np.pi / OMEGA_F) - needed)
    assert y_f(-right + 2 * np.pi / OMEGA_F) == pytest.approx(PAPER.y_lo)
    assert y_f_rate(-right + 2 * np.pi / OMEGA_F) == pytest.approx(needed)
    quoted("0.502", y_f(0.0))  # unshifted, at lift-off
    quoted("0.472", y_f(PAPER.t_lo))  # the paper's eq. 9 as printed, on the clock of the stance


def test_corrected_reference_still_jumps_where_the_landing_is_hard() -> None:
    """At touchdown the flight oscillation of 1700 N/m is not in the phase that stance begins with."""
    p = PAPER
    (y, rate), (y_next, rate_next) = p.flight_reference(p.t_f), p.touchdown_reference(0.0)
    quoted("0.369", y)
    quoted("0.421", y_next)
    quoted("0.83", rate)
    quoted("-1.96", rate_next)
    quoted("2.88", -p.y_e_rate(p.t_f))


def test_printed_energy_equation_claims_too_much() -> None:
    """The paper's eq. 15 with the two-mass model's own spring as the actuator."""
    p = PAPER
    work = K / 2 * ((p.l0 - p.stance_range[0]) ** 2 - (p.y_lo - p.l0) ** 2)
    quoted("29.0", work)
    quoted("0.53", work / (M * G))
    quoted("0.308", p.clearance)
    stance_rise = M * G * (p.stance_range[1] - p.stance_range[0])
    quoted("10.4", stance_rise)
    assert work - stance_rise == pytest.approx(M * p.v_lo**2 / 2)  # and then both masses fly
    quoted("2.3", M * p.v_lo**2 / 2 - BOTH * p.v_c**2 / 2)  # into the leg's own oscillation


def test_printed_gains_and_percentages() -> None:
    quoted("1.6", np.rad2deg(150 / 5424))
    quoted("0.58", 0.38 / 0.24 - 1)
