"""Starting points: each is what its name says, and each another motion."""

from itertools import combinations
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.leg.kinematics import foot_offset, tucked
from hopopt.leg.robot import BASE, build_robot
from hopopt.ocp.guesses.initial_guess import NAMED_STARTS, make_guess, saturated_push, starts
from hopopt.ocp.hop import Hop
from hopopt.ocp.phases import FLIGHT, STANCE
from hopopt.problem.load import load
from hopopt.sim.machine import Machine

G = 9.81


def leg_of(limits: list[tuple[float, float]], lengths: list[float], window: float = 0.1) -> Hop:
    """A hop of a leg with these joint limits [rad] and link lengths [m]."""
    joints, links = [f"j{k}" for k in range(len(limits))], [f"l{k}" for k in range(len(limits))]
    leg = {
        **{j: {"lower": low, "upper": high} for j, (low, high) in zip(joints, limits, strict=True)},
        **{name: {"length": length, "mass": 1.0} for name, length in zip(links, lengths, strict=True)},
    }
    without = {f"leg.{name}": None for name in ("hip", "knee", "thigh", "shank")}
    angles = [0.5 * (low + high) for low, high in limits]
    more = {"leg": {"joints": joints, "links": links, **leg}, "start.joint_angles": angles}
    return Hop(load("paper", {**without, **more, "hop.foot_window": window, "hop.above_ground": ["foot"]}))


def random_leg(rng: np.random.Generator, n: int) -> Hop:
    middle, half = rng.uniform(-1.5, 1.5, n), rng.uniform(0.3, 1.5, n)
    limits = [(float(m - h), float(m + h)) for m, h in zip(middle, half, strict=True)]
    return leg_of(limits, rng.uniform(0.1, 0.5, n).tolist(), float(rng.uniform(0.02, 0.3)))


def heights(hop: Hop, poses: np.ndarray) -> np.ndarray:
    """Foot heights [m] of poses, minus infinity outside the foot window."""
    feet = np.array([foot_offset(hop.leg, q) for q in poses])
    return np.where(np.abs(feet[:, 0]) <= hop.design.hop.foot_window, feet[:, 1], -np.inf)


# ---- the tucked pose ----------------------------------------------------------------------------------------


def tucked_pose(hop: Hop) -> np.ndarray:
    """The pose that the guesses of a hop use."""
    return tucked(hop.leg, hop.design.hop.foot_window)


@pytest.mark.parametrize("seed", range(12))
def test_tucked_is_at_least_as_high_as_any_pose_of_a_grid(seed: int) -> None:
    hop = random_leg(np.random.default_rng(seed), 2)
    axes = [np.linspace(low, high, 61) for low, high in zip(*hop.limits, strict=True)]
    grid = np.stack(np.meshgrid(*axes), -1).reshape(-1, 2)
    best, q = heights(hop, grid).max(), tucked_pose(hop)
    assert np.all((q >= hop.limits[0]) & (q <= hop.limits[1]))
    if np.isfinite(best):
        foot = foot_offset(hop.leg, q)
        assert abs(foot[0]) <= hop.design.hop.foot_window + 1e-6
        assert foot[1] >= best - 1e-6


@pytest.mark.parametrize("n", [3, 5, 8])
def test_tucked_with_many_joints(n: int) -> None:
    """Allowed, and no small change of the angles lifts the foot any further."""
    rng = np.random.default_rng(n)
    hop = random_leg(rng, n)
    q = tucked_pose(hop)
    near = np.clip(q + rng.normal(scale=1e-2, size=(2000, n)), *hop.limits)
    assert heights(hop, near).max() <= foot_offset(hop.leg, q)[1] + 1e-6
    assert abs(foot_offset(hop.leg, q)[0]) <= hop.design.hop.foot_window + 1e-6


def test_tucked_pendulum() -> None:
    """One link swings until its foot is at the edge of the window."""
    (q,) = tucked_pose(leg_of([(-0.2, 1.3)], [0.4], window=0.1))
    assert q == pytest.approx(np.arcsin(0.1 / 0.4), abs=1e-6)


def test_tucked_where_no_pose_is_within_the_window() -> None:
    """Then as near to it as can be: here, both joints at their lower limits."""
    q = tucked_pose(leg_of([(0.5, 1.0), (0.1, 0.6)], [0.4, 0.3], window=0.1))
    np.testing.assert_allclose(q, [0.5, 0.1], atol=1e-3)


# ---- the saturated push -------------------------------------------------------------------------------------

MIRRORED = {
    "leg.hip.lower": -1.3, "leg.hip.upper": 0.6, "leg.knee.lower": 0.15, "leg.knee.upper": 2.4,
}  # fmt: skip


@pytest.mark.parametrize("overrides", [{}, MIRRORED], ids=["knee back", "knee forward"])
def test_saturated_push_is_saturated_and_upright(overrides: dict[str, Any]) -> None:
    """By Pinocchio's inverse dynamics: the knee's torque is its bound and no body or foot moves sideways."""
    design = load("paper", overrides)
    hop, machine = Hop(design), Machine(build_robot(design.leg))
    guess = saturated_push(hop)
    assert guess is not None
    region = operating_region(design.leg, "knee", hop.robot.parameters)
    for x, u in zip(guess.x, guess.u, strict=True):
        tau = torques(machine, x[:2], x[2:], u)
        assert min(abs(tau[1] / bound - 1) for bound in region.torque_bounds(x[3])) < 1e-6
        assert abs(foot_offset(design.leg, x[:2])[0]) < 1e-3


def torques(machine: Machine, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Joint torques [N m] of a stance with the foot at rest, from inverse dynamics and its base rows."""
    J = machine.foot_jacobian(np.concatenate([[0, 0], q]))[:, BASE:]
    h = 1e-6
    ahead, behind = (machine.foot_jacobian(np.concatenate([[0, 0], q + s * h * v]))[:, BASE:] for s in (1, -1))
    drift = (ahead - behind) @ v / (2 * h)
    pose = np.concatenate([[0, 0], q])
    forces = pin.rnea(
        machine.model, machine.data, pose, np.concatenate([-J @ v, v]), np.concatenate([-J @ a - drift, a])
    )
    return forces[BASE:] - J.T @ forces[:BASE]


def test_saturated_push_of_the_mirrored_leg_is_mirrored() -> None:
    one, other = (saturated_push(Hop(load("paper", changes))) for changes in ({}, MIRRORED))
    assert one is not None
    assert other is not None
    assert one.duration == pytest.approx(other.duration, rel=1e-6)
    np.testing.assert_allclose(one.x, -other.x, atol=1e-4)


# ---- all of them --------------------------------------------------------------------------------------------


def test_names_differ_and_a_seed_repeats_its_starts() -> None:
    names = [s.name for s in starts(20, seed=3)]
    assert len(set(names)) == 20
    assert starts(20, seed=3) == starts(20, seed=3)
    assert starts(20, seed=3)[:12] == starts(12, seed=3)
    assert starts(20, seed=4)[len(NAMED_STARTS) :] != starts(20, seed=3)[len(NAMED_STARTS) :]


WEAK = {"leg.motor.max_torque": 0.2}  # the knee cannot lift the leg: no saturated push


@pytest.mark.parametrize("overrides", [{}, MIRRORED, WEAK], ids=["paper", "mirrored", "weak"])
def test_no_two_named_starts_are_the_same_motion(overrides: dict[str, Any]) -> None:
    hop = Hop(load("paper", overrides))
    assert (saturated_push(hop) is None) == (overrides is WEAK)
    guesses = [make_guess(hop, start)[STANCE] for start in NAMED_STARTS]
    for a, b in combinations(guesses, 2):
        if abs(a.duration / b.duration - 1) < 0.1:
            assert np.abs(a.sample(np.linspace(0, 1, 9))[0] - b.sample(np.linspace(0, 1, 9))[0]).max() > 0.1


@pytest.mark.parametrize("start", starts(12, seed=0), ids=lambda s: s.name)
def test_guesses_keep_joint_limits_and_fall_in_flight(start: Any) -> None:
    hop = Hop(load("paper"))
    guess = make_guess(hop, start)
    lower, upper = hop.limits
    for phase, first in ((STANCE, 0), (FLIGHT, 2 * BASE)):
        q = guess[phase].x[:, first : first + hop.n]
        assert np.all((q >= lower - 1e-6) & (q <= upper + 1e-6))
    flight = guess[FLIGHT]
    t = flight.fraction * flight.duration
    fallen = flight.x[:, 1] - flight.x[0, 1] - t * flight.x[0, 3]
    np.testing.assert_allclose(fallen, -0.5 * G * t**2, atol=1e-12)
