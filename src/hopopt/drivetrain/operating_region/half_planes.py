"""The admissible operating region (AOR) of a joint's drive: an intersection of half-planes a tau + b w <= 1.

One object serves the path constraint, the controller's clamp, the saturation ratio and the plot. tau is the
joint torque [N m], w the joint speed [rad/s].
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import Any

import numpy as np

from hopopt.drivetrain.operating_region.limits import BACKWARD, FORWARD, SAGGING, Line

UNBOUNDED = 1e12  # [N m] of a torque line that is not there
ON_AN_EDGE = 50  # points of an edge that a cap on power may bend, in figures
TOGETHER = 4  # lines that a compiled function reads: other shapes of arrays are compiled anew


@dataclass(frozen=True)
class HalfPlane:
    """a tau + b w <= 1.

    line: which line it is of; way: "forward" or "backward".
    a [1/(N m)] and b [s/rad]: floats, or CasADi symbols in the planner.
    """

    line: str
    a: Any
    b: Any
    way: str = ""

    @property
    def name(self) -> str:
        """The line with its direction."""
        return f"{self.line}, {self.way}" if self.way else str(self.line)


@dataclass(frozen=True)
class OperatingRegion:
    """The torques and speeds one joint's drive can give: half-planes that all hold, and |tau w| <= power [W] if that is not
    None, which is no half-plane. late: L / R_w of the winding [s], whose voltage bears a (tau + late tau') + b w <= 1 on the
    torque-speed line; None where current rises at once."""

    planes: tuple[HalfPlane, ...]
    power: Any = None
    late: Any = None

    def use(self, w: Any, tau: Any, voltage: Any = None, rate: Any = None) -> list[Any]:
        """a tau + b w of each half-plane: the drive is inside where every value is <= 1. voltage: of the bus, over what it is
        without load; torque-speed lines go with it. rate: of tau [N m/s]; without it tau counts as steady."""
        borne = tau if self.late is None or rate is None else tau + self.late * rate
        used = [h.a * (borne if h.line == Line.TORQUE_SPEED else tau) + h.b * w for h in self.planes]
        if voltage is None:
            return used
        return [x / voltage if h.line in SAGGING else x for x, h in zip(used, self.planes, strict=True)]

    def at(self, voltage: Any) -> "OperatingRegion":
        """The region at a bus voltage, over what it is without load, a number or an array (k,): torque-speed lines go with it."""
        if voltage is None:
            return self
        planes = (replace(h, a=h.a / voltage, b=h.b / voltage) if h.line in SAGGING else h for h in self.planes)
        return replace(self, planes=tuple(planes))

    @property
    def at_once(self) -> "OperatingRegion":
        """The region that torques keep at every instant: without the torque-speed line where that bounds their rates."""
        if self.late is None:
            return self
        return replace(self, planes=tuple(h for h in self.planes if h.line != Line.TORQUE_SPEED))

    def rate_bounds(self, w: float, tau: float) -> tuple[float, float]:
        """How fast a torque tau [N m] falls and rises at most at speed w [rad/s], [N m/s] each, by the voltage that is left."""
        if self.late is None:
            return -inf, inf
        lines = [h for h in self.planes if h.line == Line.TORQUE_SPEED]
        left = [(h.a, ((1 - h.b * w) / h.a - tau) / self.late) for h in lines]
        return max((x for a, x in left if a < 0), default=-inf), min((x for a, x in left if a > 0), default=inf)

    def binding(self, w: float, tau: float) -> str:
        """Name of the half-plane most used at speed w [rad/s] and torque tau [N m], without its direction."""
        return max(zip(self.use(w, tau), self.planes, strict=True), key=lambda pair: pair[0])[1].line

    def torque_bounds(self, w: Any) -> tuple[Any, Any]:
        """Smallest and largest torque [N m] at speed w [rad/s], shapes as w; a speed cap bounds no torque.

        Where the speed is so high that no torque is admissible (the paper's law above omega_max, its eq. 13), the
        drive gives nothing.
        """
        w = np.asarray(w, dtype=float)
        upper, lower = np.full(w.shape, np.inf), np.full(w.shape, -np.inf)
        for h in self.planes:
            if np.all(h.a > 0):
                upper = np.minimum(upper, (1 - h.b * w) / h.a)
            elif np.all(h.a < 0):
                lower = np.maximum(lower, (1 - h.b * w) / h.a)
        if self.power is not None:
            most = power_bound(w, float(self.power))
            upper, lower = np.minimum(upper, most), np.maximum(lower, -most)
        empty = lower > upper
        return np.where(empty, 0.0, lower), np.where(empty, 0.0, upper)

    def torques_at(self, w: Any) -> tuple[list[Any], list[Any]]:
        """What bounds the torque [N m] below and above at a speed w [rad/s], a number or a symbol; it is nothing where a bound
        below is greater than one above."""
        most = [] if self.power is None else [self.power / (w * w + (self.power / UNBOUNDED) ** 2) ** 0.5]
        below, above = ([(1 - h.b * w) / h.a for h in self.planes if sign * h.a > 0] for sign in (-1, 1))
        return [-UNBOUNDED, *below, *(-x for x in most)], [UNBOUNDED, *above, *most]

    def clamp(self, w: Any, tau: Any) -> Any:
        """tau [N m] brought into the region at speed w [rad/s] (the paper's eq. 14), arrays alike: ``within`` for figures."""
        lower, upper = self.torque_bounds(w)
        return np.clip(tau, lower, upper)

    def saturation(self, w: Any, tau: Any) -> Any:
        """Saturation ratio C = |tau| / |tau_sat(w)| in the direction of tau (the paper's eq. 17), shapes as w."""
        lower, upper = self.torque_bounds(w)
        bound = np.where(np.asarray(tau) >= 0, upper, -lower)
        return np.abs(tau) / np.maximum(bound, 1e-9)

    def corners(self) -> np.ndarray:
        """Corners (w [rad/s], tau [N m]) of the region in order, shape (n, 2); open sides are cut off.

        A region that no half-plane closes (the four-quadrant line alone) is cut at twice the no-load speed
        and stall torque.
        """
        planes = [(float(h.a), float(h.b)) for h in self.planes]
        a_max, b_max = max(abs(a) for a, _ in planes), max(abs(b) for _, b in planes)
        cuts = [(0.5 * a_max * s, 0.0) for s in (1, -1)] + [(0.0, 0.5 * b_max * s) for s in (1, -1)]
        return _vertices(np.array(planes + cuts))

    def outline(self) -> np.ndarray:
        """What a figure draws of it (w [rad/s], tau [N m]), (n, 2): its corners, and the curve of a cap on power."""
        corners = self.corners()
        if self.power is None:
            return corners
        along = np.linspace(0.0, 1.0, ON_AN_EDGE, endpoint=False)[:, None]
        points = np.concatenate(
            [a + along * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
        )
        most = power_bound(points[:, 0], float(self.power))
        return np.column_stack([points[:, 0], np.clip(points[:, 1], -most, most)])


def _vertices(planes: np.ndarray) -> np.ndarray:
    """Corners of {(w, tau): a tau + b w <= 1}, sorted by angle about the origin, which lies inside."""
    points = []
    for i in range(len(planes)):
        for j in range(i):
            pair = planes[[i, j]][:, ::-1]
            if abs(np.linalg.det(pair)) > 1e-15:
                point = np.linalg.solve(pair, np.ones(2))
                if np.all(planes[:, ::-1] @ point <= 1 + 1e-9):
                    points.append(point)
    corners = np.unique(np.round(points, 12), axis=0)
    return corners[np.argsort(np.arctan2(corners[:, 1] * np.max(np.abs(corners[:, 0])), corners[:, 0]))]


def pair(line: Line, a: Any, b: Any) -> list[HalfPlane]:
    return [HalfPlane(line, a, b, FORWARD), HalfPlane(line, -a, -b, BACKWARD)]


def power_bound(w: Any, power: float) -> Any:
    """Largest |tau| [N m] at speed w [rad/s], shapes alike, of which no more than a power [W] comes."""
    return power / np.maximum(np.abs(w), power / UNBOUNDED)


def capped(w: float, tau: float, power: float) -> float:
    """tau [N m] at speed w [rad/s], or so much of it that its power is no more than ``power`` [W]."""
    if abs(tau * w) <= power:
        return tau
    return power / abs(w) if tau > 0 else -power / abs(w)


def within(w: float, tau: float, upper: Any, lower: Any) -> float:
    """tau [N m] of one joint within torques c - d w of the lines (c, d) above and below, (k, 2) each; 0 where there are none:
    what is left of a command at a speed (paper's eq. 14). Plain Python on purpose: verification calls it, plants compile it."""
    high, low = inf, -inf
    for k in range(len(upper)):
        high = min(high, upper[k][0] - upper[k][1] * w)
    for k in range(len(lower)):
        low = max(low, lower[k][0] - lower[k][1] * w)
    return min(max(tau, low), high) if low <= high else 0.0


def torque_lines(regions: Sequence[OperatingRegion]) -> tuple[np.ndarray, np.ndarray]:
    """Lines c - d w of the greatest and of the least torque at once of every joint, as many for each, (n, k, 2) [N m, N m s/rad]."""
    bounding = [[(float(h.a), float(h.b)) for h in region.at_once.planes if h.a != 0] for region in regions]
    upper = _filled([[(1 / a, b / a) for a, b in planes if a > 0] for planes in bounding], UNBOUNDED)
    return upper, _filled([[(1 / a, b / a) for a, b in planes if a < 0] for planes in bounding], -UNBOUNDED)


def filled_up(lines: np.ndarray, none: float) -> np.ndarray:
    """Lines (n, k, 2) with as many that never bound as make k a multiple of TOGETHER; none: their torque [N m]."""
    more = np.broadcast_to([none, 0.0], (len(lines), -lines.shape[1] % TOGETHER or TOGETHER * (not lines.shape[1]), 2))
    return np.concatenate([lines, more], axis=1)


def _filled(of_joints: list[list[tuple[float, float]]], none: float) -> np.ndarray:
    most = max(len(each) for each in of_joints)
    full = [[*each, *[(none, 0.0)] * (most - len(each))] for each in of_joints]
    return np.array(full, dtype=float).reshape(len(of_joints), most, 2)
