"""Where the leg is: inverse kinematics of the start and of guesses, in plain numbers."""

from collections.abc import Sequence

import numpy as np

from hopopt.leg.design import Design, Leg


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
