"""The drives' operating region against the closed forms of its laws, for motors chosen at random."""

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from hopopt.design import Leg, physical_parameters
from hopopt.drivetrain.operating_region.half_planes import OperatingRegion
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.problem.load import load

many = settings(max_examples=100, deadline=None)
PAPER, FOUR_QUADRANT = "paper", "four-quadrant"
ratios, torques, speeds = st.floats(1, 200), st.floats(0.01, 50), st.floats(10, 3000)
shares = st.floats(-0.999, 0.999)
CLOSE = 1e-12


def region(
    ratio: float, torque: float, speed: float, *laws: str, joint: dict[str, Any] | None = None, **caps: dict[str, float]
) -> OperatingRegion:
    """Of a one-joint leg; ``caps`` by table: motor={...}, gear={...}."""
    motor = {"max_torque": torque, "max_speed": speed, "laws": laws or (PAPER,), **caps.get("motor", {})}
    data = {
        "joints": ("knee",), "links": ("shank",), "body": {"mass": 1.0}, "motor": motor,
        "gear": {"ratio": ratio, **caps.get("gear", {})},
        "knee": {"lower": -1.0, "upper": 1.0, **(joint or {})}, "shank": {"length": 0.3, "mass": 0.1},
    }  # fmt: skip
    leg = Leg.model_validate(data)
    return operating_region(leg, "knee", physical_parameters(leg))


# ---- the laws ---------------------------------------------------------------------------------------------


@many
@given(ratios, torques, speeds, shares, st.floats(-3, 3))
def test_paper_law(ratio: float, torque: float, speed: float, w_share: float, tau_share: float) -> None:
    """|tau| <= R tau_max (1 - R |w| / omega_max)."""
    r, stall, no_load = region(ratio, torque, speed), ratio * torque, speed / ratio
    w, tau = w_share * no_load, tau_share * stall
    bound = stall * (1 - abs(ratio * w) / speed)
    np.testing.assert_allclose(r.torque_bounds(w), (-bound, bound), rtol=CLOSE, atol=CLOSE * stall)
    np.testing.assert_allclose(r.clamp(w, tau), np.sign(tau) * min(abs(tau), bound), atol=CLOSE * stall)
    np.testing.assert_allclose(max(r.use(w, tau)), abs(tau_share) + abs(w_share), atol=CLOSE)
    np.testing.assert_allclose(r.saturation(w, tau), abs(tau) / bound, rtol=1e-9, atol=1e-300)


@many
@given(ratios, torques, speeds, st.floats(1.0001, 10), st.sampled_from((-1, 1)), st.floats(-3, 3))
def test_paper_law_gives_nothing_above_the_no_load_speed(
    ratio: float, torque: float, speed: float, over: float, side: int, tau_share: float
) -> None:
    r, w = region(ratio, torque, speed), side * over * speed / ratio
    assert r.torque_bounds(w) == (0.0, 0.0)
    assert r.clamp(w, tau_share * ratio * torque) == 0.0
    assert max(r.use(w, 0.0)) > 1


@many
@given(ratios, torques, speeds, st.floats(-1.999, 1.999), st.floats(-3, 3))
def test_four_quadrant_line(ratio: float, torque: float, speed: float, w_share: float, tau_share: float) -> None:
    """Driving as in the paper; braking is not weakened by speed: tau = +-R tau_max - R tau_max w / w_0."""
    r, stall, w = region(ratio, torque, speed, FOUR_QUADRANT), ratio * torque, w_share * speed / ratio
    bounds = stall * (-1 - w_share), stall * (1 - w_share)
    np.testing.assert_allclose(r.torque_bounds(w), bounds, rtol=1e-9, atol=CLOSE * stall)
    np.testing.assert_allclose(max(r.use(w, tau_share * stall)), abs(tau_share + w_share), atol=CLOSE)
    inside = region(ratio, torque, speed)
    low, high = inside.torque_bounds(w)
    if abs(w_share) < 1:  # the paper's law is the stricter one, by the braking quadrants only
        assert low >= bounds[0] - CLOSE * stall
        assert high <= bounds[1] + CLOSE * stall
        driving = high if w_share > 0 else -low
        np.testing.assert_allclose(driving, bounds[1] if w_share > 0 else -bounds[0], rtol=1e-9, atol=CLOSE * stall)


@many
@given(ratios, torques, speeds, shares)
def test_both_laws_together_are_the_stricter_one(ratio: float, torque: float, speed: float, w_share: float) -> None:
    w = w_share * speed / ratio
    both, paper = (region(ratio, torque, speed, *laws).torque_bounds(w) for laws in ((PAPER, FOUR_QUADRANT), (PAPER,)))
    np.testing.assert_allclose(both, paper, rtol=CLOSE)


# ---- caps -------------------------------------------------------------------------------------------------


@st.composite
def capped(draw: st.DrawFn) -> tuple[OperatingRegion, dict[str, float]]:
    """A region with any of the caps, and its stall torque, no-load speed and caps at the joint (inf: none)."""
    ratio, torque, speed = draw(ratios), draw(torques), draw(speeds)
    laws = draw(st.sampled_from(((PAPER,), (FOUR_QUADRANT,), (PAPER, FOUR_QUADRANT))))
    motor, gear = {}, {}
    cap = draw(st.none() | st.floats(0.1, 1.5))
    if cap is not None:
        motor["torque_cap"] = max(cap * torque, 1e-3)
    cap = draw(st.none() | st.floats(0.1, 1.5))
    if cap is not None:
        gear["torque_cap"] = min(max(cap * torque * ratio, 0.1), 1e4)
    cap = draw(st.none() | st.floats(0.1, 1.5))
    if cap is not None:
        gear["speed_cap"] = max(cap * speed, 1.0)
    at_joint = {
        "stall": ratio * torque,
        "no_load": speed / ratio,
        "torque": min(motor.get("torque_cap", np.inf) * ratio, gear.get("torque_cap", np.inf)),
        "speed": gear.get("speed_cap", np.inf) / ratio,
        "paper": float(PAPER in laws),
    }
    return region(ratio, torque, speed, *laws, motor=motor, gear=gear), at_joint


@many
@given(capped(), shares, st.floats(-3, 3))
def test_all_limits_hold_together(case: tuple[OperatingRegion, dict[str, float]], w_share: float, share: float) -> None:
    """Bounds, use and clamp of the intersection; a clamp is the nearest torque and leaves what is inside alone."""
    r, at = case
    w, tau = w_share * at["no_load"], share * at["stall"]
    line = abs(w_share) if at["paper"] else w_share
    high = min(at["stall"] * (1 - line), at["torque"])
    low = -min(at["stall"] * (1 - abs(w_share) if at["paper"] else 1 + w_share), at["torque"])
    np.testing.assert_allclose(r.torque_bounds(w), (low, high), rtol=1e-9, atol=CLOSE * at["stall"])
    motor_use = abs(share) + abs(w_share) if at["paper"] else abs(share + w_share)
    expected = max(motor_use, abs(tau) / at["torque"], abs(w) / at["speed"])
    np.testing.assert_allclose(max(r.use(w, tau)), expected, rtol=1e-9, atol=CLOSE)
    clamped = float(r.clamp(w, tau))
    assert clamped == r.clamp(w, clamped)
    torque_use = [u for u, h in zip(r.use(w, clamped), r.planes, strict=True) if h.a != 0]
    assert max(torque_use) <= 1 + 1e-9
    nearest = min(max(tau, low), high)
    np.testing.assert_allclose(clamped, nearest, rtol=1e-9, atol=CLOSE * at["stall"])
    assert 0 <= r.saturation(w, clamped) <= 1 + 1e-9


@many
@given(capped())
def test_corners_lie_on_the_boundary_in_order(case: tuple[OperatingRegion, dict[str, float]]) -> None:
    """Each corner on at least two sides of a convex polygon about the origin, counter-clockwise."""
    r, at = case
    corners = r.corners()
    if at["paper"]:
        for w, tau in corners:
            use = np.array(r.use(w, tau))
            assert abs(use.max() - 1) < 1e-6
            assert np.sum(use > 1 - 1e-6) >= 2
    scaled = corners / np.abs(corners).max(axis=0)
    nxt, after = np.roll(scaled, -1, axis=0), np.roll(scaled, -2, axis=0)
    assert np.all(_cross(nxt - scaled, after - nxt) > -1e-9)
    assert np.all(_cross(scaled, nxt) > -1e-9)
    gaps = np.abs(scaled[:, None] + scaled[None, :]).max(axis=2).min(axis=1)
    assert gaps.max() < 1e-9  # the limits are the same forward and backward


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """z of the cross products of rows of two (n, 2) arrays."""
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def area(r: OperatingRegion) -> float:
    corners = r.corners()
    return float(_cross(corners, np.roll(corners, -1, axis=0)).sum() / 2)


@many
@given(ratios, torques, speeds)
def test_diamond_has_its_four_corners_exactly(ratio: float, torque: float, speed: float) -> None:
    corners = region(ratio, torque, speed).corners()
    expected = np.array([[0, -ratio * torque], [speed / ratio, 0], [0, ratio * torque], [-speed / ratio, 0]])
    assert corners.shape == (4, 2)
    order = np.argsort(np.arctan2(corners[:, 1] / (ratio * torque), corners[:, 0] * ratio / speed) % (2 * np.pi))
    first = np.argsort(np.arctan2(expected[:, 1], expected[:, 0]) % (2 * np.pi))
    np.testing.assert_allclose(corners[order], expected[first], rtol=1e-9, atol=1e-9)


@many
@given(ratios, torques, speeds, st.floats(0.05, 1.0), st.floats(0.05, 1.0))
def test_area_of_a_capped_diamond(ratio: float, torque: float, speed: float, c: float, s: float) -> None:
    """2 T W less two triangles for each cap, or 4 c s where the caps leave only a rectangle."""
    c, s = max(c, 0.101 / (ratio * torque)), max(s, 1.001 / speed)
    assume(c < 1 and s < 1)
    T, W = ratio * torque, speed / ratio
    r = region(ratio, torque, speed, gear={"torque_cap": c * T, "speed_cap": s * speed})
    share = 2 - 2 * (1 - c) ** 2 - 2 * (1 - s) ** 2 if c + s > 1 else 4 * c * s
    np.testing.assert_allclose(area(r), share * T * W, rtol=1e-6)


# ---- bookkeeping ------------------------------------------------------------------------------------------


def test_arrays_give_what_their_elements_give() -> None:
    r = region(100, 2.0, 1200, gear={"torque_cap": 107.0})
    w, tau = np.meshgrid(np.linspace(-15, 15, 13), np.linspace(-250, 250, 11))
    for method in (r.clamp, r.saturation):
        one_by_one = [method(a, b) for a, b in zip(w.ravel(), tau.ravel(), strict=True)]
        np.testing.assert_array_equal(method(w, tau).ravel(), np.ravel(one_by_one))
    low, high = r.torque_bounds(w)
    assert low.shape == high.shape == w.shape


def test_a_joints_own_drive_goes_before_the_legs() -> None:
    own = ["leg.knee.motor.max_torque=3.0", "leg.knee.gear.ratio=50", "leg.knee.gear.torque_cap=60.0"]
    leg = load("paper", own).leg
    hip, knee = (operating_region(leg, joint, physical_parameters(leg)) for joint in ("hip", "knee"))
    stall_hip, no_load_hip, no_load_knee = 200.0, 1256.637 / 100, 1256.637 / 50
    np.testing.assert_allclose(hip.torque_bounds(0.0), (-stall_hip, stall_hip))
    np.testing.assert_allclose(knee.torque_bounds(0.0), (-60.0, 60.0))
    for r, no_load, stall in ((hip, no_load_hip, stall_hip), (knee, no_load_knee, 150.0)):
        np.testing.assert_allclose(r.torque_bounds(0.9 * no_load)[1], 0.1 * stall)


@pytest.mark.parametrize("law", [PAPER, FOUR_QUADRANT])
def test_a_joint_may_have_a_law_of_its_own(law: str) -> None:
    own = {"motor": {"laws": (law,)}}
    r = region(100, 2.0, 1000, PAPER, joint=own)
    braking = -r.torque_bounds(5.0)[0]  # half the no-load speed
    np.testing.assert_allclose(braking, {PAPER: 100.0, FOUR_QUADRANT: 300.0}[law])
