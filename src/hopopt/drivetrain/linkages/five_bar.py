"""A five-bar in the leg's plane: where crank and rod lie as the joints turn, by the law of cosines (Norton, Design of Machinery)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca

from hopopt.design import Leg, unit


@dataclass(frozen=True)
class SideLinks:
    """A five-bar's crank and rod, in the frame of what carries the crank: of the link two before the joint, or of the body.

    pivot, crank_end, arm_end: x and z (2) [m] from that frame's origin. angle: the crank's, forward from the x axis [rad]
    """

    pivot: tuple[Any, Any]
    crank_end: tuple[Any, Any]
    arm_end: tuple[Any, Any]
    angle: Any


def side_links(leg: Leg, joint: str, p: Mapping[str, Any], q: Any) -> SideLinks:
    """Where the chain of a joint's five-bar closes at joint angles q (n) [rad]: by the law of cosines on the chosen side."""
    k, path = leg.joints.index(joint), f"leg.{joint}.transmission.five_bar"
    crank, rod, arm, *pivot = (p[f"{path}.{name}"] for name in ("crank", "rod", "arm", "pivot_x", "pivot_z"))
    (along, toward), (_, onward) = (in_plane(leg, i) for i in (k - 1, k))
    line = forward(leg, k - 1) * q[k - 1] + toward  # of the link before the joint
    bend = forward(leg, k) * q[k] + onward + p[f"{path}.turned"] - toward
    back = _turned(pivot, -line)  # all in a frame along that link: its atan2 has no jump while the arm is shorter
    x = p[f"leg.{leg.links[k - 1]}.length"] * along + arm * ca.cos(bend) - back[0]
    z = arm * ca.sin(bend) - back[1]
    inner = ca.acos((crank**2 + x**2 + z**2 - rod**2) / (2 * crank * ca.sqrt(x**2 + z**2)))
    angle, start = line + ca.atan2(z, x) + side(leg, joint) * inner, crank_pivot(leg, joint, p)
    ends = ((start[0] + dx, start[1] + dz) for dx, dz in (_turned((crank, 0.0), angle), _turned((x, z), line)))
    return SideLinks(start, next(ends), next(ends), angle)


def side(leg: Leg, joint: str) -> int:
    """1 where the crank of a joint's five-bar is ahead, else -1."""
    between = leg.joint[joint].transmission
    return 1 if between and between.five_bar and between.five_bar.ahead else -1


def crank_pivot(leg: Leg, joint: str, p: Mapping[str, Any]) -> tuple[Any, Any]:
    """Where the crank of a joint's five-bar turns, x and z [m] in the frame of what carries it, whose origin is that link's joint."""
    k, path = leg.joints.index(joint), f"leg.{joint}.transmission.five_bar"
    x, z = p[f"{path}.pivot_x"], p[f"{path}.pivot_z"]
    if k == 1:  # the body, whose origin is the first joint
        return x, z
    ahead = heading(leg, k - 2, 0.0, p[f"leg.{leg.links[k - 2]}.length"] * in_plane(leg, k - 2)[0])
    return x + ahead[0], z + ahead[2]


def forward(leg: Leg, k: int) -> float:
    """1 where a positive angle of joint ``k`` of a planar leg swings forward, else -1."""
    return -unit(leg.joint[leg.joints[k]].axis)[1]


def heading(leg: Leg, k: int, turned: Any, length: Any) -> tuple[Any, ...]:
    """A vector of a length [m], turned forward [rad] from the direction of link ``k``, in that link's frame (x, y, z)."""
    x, z = _turned((length, 0.0), in_plane(leg, k)[1] + turned)
    return x, 0.0, z


def in_plane(leg: Leg, k: int) -> tuple[float, float]:
    """Share of a link's length that lies in the leg's plane, and its angle there, forward from the x axis, all joints at zero."""
    x, _, z = unit(leg.link[leg.links[k]].direction)
    return math.hypot(x, z), math.atan2(z, x)


def _turned(vector: Any, angle: Any) -> tuple[Any, Any]:
    """A vector (x, z) turned forward."""
    c, s = ca.cos(angle), ca.sin(angle)
    return c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]
