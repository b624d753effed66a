"""Where the leg is: inverse kinematics of the start and of guesses, in plain numbers."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize
from scipy.stats import qmc

from hopopt.leg.design import Design, Leg

POSES = 1024  # among which the tucked pose is looked for
OUTSIDE = 1e3  # height [m] that a pose is thought worse for each metre beyond the foot window


def foot_offset(leg: Leg, q_j: Sequence[float] | np.ndarray) -> np.ndarray:
    """Foot position (x, z) [m] relative to the body for joint angles q_j [rad]."""
    angles = np.cumsum(np.asarray(q_j, dtype=float))
    lengths = np.array([leg.link[name].length for name in leg.links])
    return np.array([lengths @ np.sin(angles), -lengths @ np.cos(angles)])


def two_joint_angles(leg: Leg, foot: np.ndarray) -> list[np.ndarray]:
    """Both joint-angle solutions [rad] that put the foot at ``foot`` (x, z) [m] relative to the body.

    Two-joint legs only; empty if the foot is out of reach.
    """
    l1, l2 = (leg.link[name].length for name in leg.links)
    cosine = (foot @ foot - l1**2 - l2**2) / (2 * l1 * l2)
    if abs(cosine) > 1:
        return []
    solutions = []
    for knee in (-np.arccos(cosine), np.arccos(cosine)):
        along = np.arctan2(foot[0], -foot[1])
        hip = along - np.arctan2(l2 * np.sin(knee), l1 + l2 * np.cos(knee))
        solutions.append(np.array([(hip + np.pi) % (2 * np.pi) - np.pi, knee]))
    return solutions


def within_limits(leg: Leg, q_j: np.ndarray, margin: float = 0.0) -> bool:
    """Whether every joint angle lies within its limits."""
    return all(
        leg.joint[j].lower - margin <= angle <= leg.joint[j].upper + margin
        for j, angle in zip(leg.joints, q_j, strict=True)
    )


def start_angles(design: Design) -> np.ndarray:
    """Joint angles [rad] at the start; ValueError in a sentence if there are none within the limits."""
    start, leg = design.start, design.leg
    if start.joint_angles is not None:
        return np.array(start.joint_angles)
    height = start.hip_height
    assert height is not None
    solutions = two_joint_angles(leg, np.array([start.foot_x, -height]))
    allowed = [q for q in solutions if within_limits(leg, q)]
    if not allowed:
        raise ValueError(start_fault(design, solutions))
    return allowed[0]


def start_fault(design: Design, solutions: list[np.ndarray]) -> str:
    """Why no start pose exists, with what is allowed."""
    leg = design.leg
    if not solutions:
        reach = sum(leg.link[name].length for name in leg.links)
        return f"the leg reaches from {abs(_difference(leg)):.3f} to {reach:.3f} m"
    limits = ", ".join(f"{j} {leg.joint[j].lower:g} to {leg.joint[j].upper:g} rad" for j in leg.joints)
    poses = " or ".join("(" + ", ".join(f"{a:.3f}" for a in q) + ") rad" for q in solutions)
    return f"it needs joint angles {poses}, outside the limits ({limits})"


def _difference(leg: Leg) -> float:
    lengths = [leg.link[name].length for name in leg.links]
    return lengths[0] - lengths[1] if len(lengths) == 2 else 0.0


def tucked(leg: Leg, window: float, margin: float = 0.0) -> np.ndarray:
    """Joint angles [rad] at least ``margin`` [rad] within the limits that lift the foot highest, within the
    foot window ``window`` [m] of the hip's plumb line (or nearest to it).

    The best of quasi-random poses, refined: what it costs hardly depends on the number of joints.
    """
    lower, upper = (np.array([getattr(leg.joint[j], side) for j in leg.joints]) for side in ("lower", "upper"))
    lower, upper = lower + margin, upper - margin
    lengths = np.array([leg.link[name].length for name in leg.links])

    def foot(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        angles = np.cumsum(q, axis=-1)
        return np.sin(angles) @ lengths, -np.cos(angles) @ lengths

    def merit(q: np.ndarray) -> np.ndarray:
        x, z = foot(q)
        return z - OUTSIDE * np.maximum(np.abs(x) - window, 0.0)

    def room(q: np.ndarray) -> np.ndarray:
        x = foot(q)[0]
        return np.concatenate([q - lower, upper - q, [window - x, window + x]])

    drawn = qmc.scale(qmc.Sobol(len(leg.joints), scramble=False).random(POSES), lower, upper)
    best = drawn[np.argsort(-merit(drawn))[:4]]
    refined = [
        minimize(lambda q: -foot(q)[1], q, method="SLSQP", constraints={"type": "ineq", "fun": room}).x for q in best
    ]
    found = np.clip([*best, *refined], lower, upper)
    return found[np.argmax(merit(found))]
