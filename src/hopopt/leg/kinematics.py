"""Where the leg is: inverse kinematics of the start and of guesses, in plain numbers."""

from cmath import phase, rect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import acos
from typing import Any

import numpy as np
from scipy.linalg import qr
from scipy.optimize import minimize

from hopopt.design import Design, Leg, unit
from hopopt.errors import UsageError

PLANE, SPACE = (0, 2), (0, 1, 2)  # world axes
POSES, REFINED = 1024, 4  # among which the best is looked for, and of the best of them that are refined
IN_PLANE_SHARE = 1e-9  # share of a link in the plane, below which it has no direction there
WINDOW_PENALTY = 1e3  # height [m] that a pose is thought worse for each metre beyond the foot window


def joint_positions(leg: Leg, q_j: Sequence[float] | np.ndarray) -> np.ndarray:
    """Positions (x, y, z) [m] of every joint and of the foot relative to the body, shape (..., n + 1, 3), for joint
    angles q_j (..., n) [rad]."""
    return np.stack(joint_frames(leg, q_j)[0], axis=-2)


def joint_frames(leg: Leg, q_j: Sequence[float] | np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Positions (..., 3) [m] of every joint and of the foot from the body, and rotations (..., 3, 3) of every joint, for
    joint angles q_j (..., n) [rad]."""
    q = np.asarray(q_j, dtype=float)
    turn, points, turns = np.broadcast_to(np.eye(3), (*q.shape[:-1], 3, 3)), [np.zeros((*q.shape[:-1], 3))], []
    for at, link in zip(leg.link_joints, leg.links, strict=True):
        place = at.place(q[..., at.coordinate])
        if at.slides:
            points[-1] = points[-1] + (turn @ at.axis) * place[..., None]
        else:
            turn = turn @ _rotation(at.axis, place)
        points.append(points[-1] + turn @ _vector(leg, link))
        turns.append(turn)
    return points, turns


def _rotation(axis: Sequence[float], angle: np.ndarray) -> np.ndarray:
    """Rodrigues' formula, (..., 3, 3)."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = angle[..., None, None]
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K)


def _vector(leg: Leg, link: str) -> np.ndarray:
    """From a link's joint to the next one, or to the foot, all joint angles zero, (3,) [m]."""
    return leg.link[link].length * np.array(unit(leg.link[link].direction))


def link_ends(leg: Leg) -> np.ndarray:
    """From each link's joint to the next one, or to the foot, in the link's own frame, (links, 3) [m]."""
    if leg.follows:
        return np.array([_vector(leg, link) for link in leg.links])
    return np.diff(joint_positions(leg, np.zeros(len(leg.joints))), axis=0)


def foot_offset(leg: Leg, q_j: Sequence[float] | np.ndarray) -> np.ndarray:
    """Foot position (x, z) [m] relative to the body for joint angles q_j [rad]."""
    return joint_positions(leg, q_j)[..., -1, [0, 2]]


def planar(leg: Leg) -> bool:
    """Whether the leg moves in a plane along x and z: every joint turns about the y axis, or slides across it."""
    return all(abs(at.axis[1]) == (0 if at.slides else 1) for at in leg.link_joints)


def can_slip(leg: Leg) -> bool:
    """Whether slipping is simulated for a leg: on x and z guides, every joint turning in their plane by its own drive, without
    five-bars, and all motors on the body. Other feet stay, and the friction that this needs is reported."""
    apart = leg.follows or leg.sliding or leg.five_bars or leg.riding
    return planar(leg) and "x" in leg.guides and not apart


def two_joints(leg: Leg) -> bool:
    """Whether the leg is one of two joints that moves, with both links, in the plane: what ``TwoJoints`` needs."""
    across = [np.hypot(*np.array(unit(leg.link[name].direction))[[0, 2]]) for name in leg.links]
    apart = leg.follows or leg.sliding
    return len(leg.joints) == 2 and not apart and planar(leg) and min(across) >= IN_PLANE_SHARE


def unlike_two_joints(leg: Leg) -> str:
    """What a leg that is not one of ``two_joints`` has, in words."""
    if len(leg.joints) != 2:
        return "with other than two joints"
    unlike = leg.follows or leg.sliding
    return "whose joints slide or follow others" if unlike else "whose links or joints leave the x-z plane"


def contact_axes(leg: Leg) -> tuple[int, ...]:
    """World axes along which a pinned foot takes a force: x and z, and y where the leg leaves the plane."""
    return PLANE if planar(leg) else SPACE


def loop_axes(leg: Leg) -> tuple[int, ...]:
    """World axes along which the guides do not let the body follow the foot: there a pinned foot closes a loop."""
    return tuple(axis for axis in contact_axes(leg) if axis == 1 or (axis == 0 and "x" not in leg.guides))


def dependent_joints(design: Design) -> tuple[int, ...]:
    """Joints whose accelerations follow from the others' while the foot is pinned, one for each axis of a loop: those
    that move the foot most along them at the start."""
    axes, q = loop_axes(design.leg), start_angles(design)
    if not axes:
        return ()
    jacobian = foot_jacobian(design.leg, q)[list(axes)]
    pivots: Any = qr(jacobian, mode="r", pivoting=True)[-1]
    return tuple(sorted(int(k) for k in pivots[: len(axes)]))


def foot_jacobian(leg: Leg, q_j: Sequence[float] | np.ndarray) -> np.ndarray:
    """Derivative of the foot's place from the body by the joint angles, (3, n) [m/rad], or by the travel of one that slides."""
    q, found = np.asarray(q_j, dtype=float), np.zeros((3, len(leg.joints)))
    points, turns = joint_frames(leg, q)
    for at, place, turn in zip(leg.link_joints, points, turns, strict=False):
        axis = turn @ at.axis
        found[:, at.coordinate] += at.ratio * (axis if at.slides else np.cross(axis, points[-1] - place))
    return found


def reach(leg: Leg) -> float:
    """Length of the stretched leg [m], or more."""
    return sum(link.length for link in leg.link.values()) + sum(map(longest_travel, map(leg.joint.get, leg.sliding)))


def longest_travel(joint: Any) -> float:
    """How far a prismatic joint slides at most from where it is at zero [m]."""
    return max(abs(joint.lower), abs(joint.upper))


@dataclass(frozen=True)
class TwoJoints:
    """A planar leg of two joints in the complex plane x + i z: a positive turn swings forward, a hanging link is -i.

    ends: where each link ends, from its joint, at zero angles [m]; signs: of the joints' turns; middle: of their
    limits [rad].
    """

    ends: tuple[complex, complex]
    signs: np.ndarray
    middle: np.ndarray

    @classmethod
    def of(cls, leg: Leg) -> "TwoJoints":
        """The geometry of ``leg``; ValueError if it is none of ``two_joints``."""
        if not two_joints(leg):
            raise ValueError("needs a leg of two joints that moves in a plane")
        first, second = (complex(*_vector(leg, link)[[0, 2]]) for link in leg.links)
        signs = np.array([-unit(leg.joint[name].axis)[1] for name in leg.joints])
        middle = np.array([(leg.joint[name].lower + leg.joint[name].upper) / 2 for name in leg.joints])
        return cls((first, second), signs, middle)

    @cached_property
    def bend_at_zero(self) -> float:
        """How far the second link is turned from the direction of the first when both angles are zero [rad]."""
        return phase(self.ends[1] / self.ends[0])

    def bend(self, q: float) -> float:
        """How far the leg is from stretched at angle q of its second joint, -pi to pi [rad], + forward."""
        return float(_wrapped(self.signs[1] * q + self.bend_at_zero))

    def angles(self, foot: np.ndarray) -> list[np.ndarray]:
        """Both joint-angle solutions [rad], bent backward and forward, that put the foot at (x, z) [m] relative to
        the body; empty if it is out of reach. Of equal angles those nearest to the middle of the limits."""
        (first, second), wanted = self.ends, complex(*foot)
        l1, l2, signs, middle = self._numbers
        cosine = (abs(wanted) ** 2 - l1**2 - l2**2) / (2 * l1 * l2)
        if abs(cosine) > 1:
            return []
        solutions = []
        for bend in (-acos(cosine), acos(cosine)):  # plain numbers: controllers ask in every period
            knee = bend - self.bend_at_zero
            hip = phase(wanted / (first + second * rect(1.0, knee)))
            q = zip(signs, (hip, knee), middle, strict=True)
            solutions.append(np.array([middle + _wrapped(sign * angle - middle) for sign, angle, middle in q]))
        return solutions

    @cached_property
    def _numbers(self) -> tuple[float, float, list[float], list[float]]:
        """The links' lengths [m], and signs and middle as plain numbers."""
        return abs(self.ends[0]), abs(self.ends[1]), self.signs.tolist(), self.middle.tolist()


def _wrapped(angle: Any) -> Any:
    return (angle + np.pi) % (2 * np.pi) - np.pi


def within_limits(leg: Leg, q_j: np.ndarray, margin: float = 0.0) -> bool:
    """Whether every joint angle lies within its limits."""
    return all(
        leg.joint[j].lower - margin <= angle <= leg.joint[j].upper + margin
        for j, angle in zip(leg.joints, q_j, strict=True)
    )


def start_angles(design: Design) -> np.ndarray:
    """Joint angles [rad] at the start; UsageError in a sentence if there are none within the limits."""
    start, leg = design.start, design.leg
    if start.joint_angles is not None:
        return np.array(start.joint_angles)
    height = start.hip_height
    assert height is not None
    solutions = TwoJoints.of(leg).angles(np.array([start.foot_x, -height]))
    allowed = [q for q in solutions if within_limits(leg, q)]
    if not allowed:
        raise UsageError(start_fault(design, solutions))
    return allowed[0]


def start_place(design: Design) -> np.ndarray:
    """Where the body starts, (x, z) [m] from the foot; on a slider it stays at that x."""
    return -foot_offset(design.leg, start_angles(design))


def start_fault(design: Design, solutions: list[np.ndarray]) -> str:
    """Why no start pose exists, with what is allowed."""
    leg = design.leg
    if not solutions:
        l1, l2 = map(abs, TwoJoints.of(leg).ends)
        return f"the leg reaches from {abs(l1 - l2):.3f} to {l1 + l2:.3f} m"
    limits = ", ".join(f"{j} {leg.joint[j].lower:g} to {leg.joint[j].upper:g} rad" for j in leg.joints)
    poses = " or ".join("(" + ", ".join(f"{a:.3f}" for a in q) + ") rad" for q in solutions)
    return f"it needs joint angles {poses}, outside the limits ({limits})"


def tucked(leg: Leg, window: float, slack: Callable[[np.ndarray], np.ndarray] | None = None) -> np.ndarray:
    """Joint angles [rad] within the limits that lift the foot highest, within the
    foot window ``window`` [m] of the hip's plumb line (or nearest to it).

    Not the pose that clears most at the apex: that depends on masses and on every joint (ocp/guesses/posture.py).
    """
    lower, upper = (np.array([getattr(leg.joint[j], side) for j in leg.joints]) for side in ("lower", "upper"))

    def foot(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        offset = foot_offset(leg, q)
        return offset[..., 0], offset[..., 1]

    def score(q: np.ndarray) -> np.ndarray:
        x, z = foot(q)
        inside = 0.0 if slack is None else np.maximum(-slack(q), 0.0)
        return z - WINDOW_PENALTY * (np.maximum(np.abs(x) - window, 0.0) + inside)

    def room(q: np.ndarray) -> np.ndarray:
        x = foot(q)[0]
        clear = np.zeros(0) if slack is None else slack(q)
        return np.concatenate([q - lower, upper - q, [window - x, window + x], clear])

    def refined(q: np.ndarray) -> np.ndarray:
        return minimize(lambda q: -foot(q)[1], q, method="SLSQP", constraints={"type": "ineq", "fun": room}).x

    return best_pose(lower, upper, score, refined)


def best_pose(
    lower: np.ndarray, upper: np.ndarray, score: Callable[[np.ndarray], np.ndarray],
    refined: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:  # fmt: skip
    """The best pose (n,) [rad] within limits: the best of quasi-random ones, refined, whatever the number of joints.

    score: of poses (k, n) [rad], more is better, (k,)
    refined: from a pose (n,) [rad] the nearest optimum
    """
    drawn = lower + (upper - lower) * spread(POSES, len(lower))
    begun = drawn[np.argsort(-score(drawn))[:REFINED]]
    found = np.clip([*begun, *(refined(q) for q in begun)], lower, upper)
    return found[np.argmax(score(found))]


def spread(count: int, dimensions: int) -> np.ndarray:
    """Points that fill the unit cube evenly, (count, dimensions): Roberts' sequence of the generalised golden ratio,
    good as Sobol's for this; scipy.stats takes a third of a second to import, and its points would be others."""
    ratio = np.roots([1.0, *np.zeros(dimensions - 1), -1.0, -1.0]).real.max()  # x^(d + 1) = x + 1
    return np.arange(count)[:, None] * ratio ** -np.arange(1.0, dimensions + 1) % 1.0
