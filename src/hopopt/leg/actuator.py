"""The admissible operating region (AOR) of a joint's drive: an intersection of half-planes a tau + b w <= 1.

One object serves the path constraint, the controller's clamp, the saturation ratio and the plot. tau is the
joint torque [N m], w the joint speed [rad/s]; R is the gear ratio, tau_max and omega_max belong to the motor.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Literal

import numpy as np

from hopopt.design import Leg

Entry = tuple[Literal["motor", "gear"], str]


class Line(StrEnum):
    """What bounds an operating region; each is there forward and backward."""

    TORQUE_SPEED = "torque-speed line"
    BRAKING = "braking line"
    DRIVE_CAP = "drive torque cap"
    GEAR_CAP = "gear torque cap"
    SPEED_CAP = "gear speed cap"


FORWARD, BACKWARD = "forward", "backward"
CAPS: dict[str, tuple[Entry, ...]] = {  # lines that a cap draws -> its entry, then what carries it to the joint
    Line.DRIVE_CAP: (("motor", "torque_cap"), ("gear", "ratio")),
    Line.GEAR_CAP: (("gear", "torque_cap"),),
    Line.SPEED_CAP: (("gear", "speed_cap"), ("gear", "ratio")),
}
TORQUES: tuple[Entry, ...] = (("motor", "max_torque"), ("motor", "torque_cap"), ("gear", "torque_cap"))
SPEEDS: tuple[Entry, ...] = (("motor", "max_speed"), ("gear", "speed_cap"))  # entries of a drive that limit either
LINES: tuple[Entry, ...] = (("motor", "max_torque"), ("motor", "max_speed"), ("gear", "ratio"))  # behind the others


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
    """The torques and speeds one joint's drive can give, as half-planes that all hold."""

    planes: tuple[HalfPlane, ...]

    def use(self, w: Any, tau: Any) -> list[Any]:
        """a tau + b w of each half-plane: the drive is inside where every value is <= 1."""
        return [h.a * tau + h.b * w for h in self.planes]

    def binding(self, w: float, tau: float) -> str:
        """Name of the half-plane most used at speed w [rad/s] and torque tau [N m], without its direction."""
        return max(zip(self.use(w, tau), self.planes, strict=True), key=lambda pair: pair[0])[1].line

    def torque_bounds(self, w: Any) -> tuple[Any, Any]:
        """Smallest and largest torque [N m] at speed w [rad/s], shapes as w; a speed cap bounds no torque.

        Where the speed is so high that no torque is admissible (the paper's law above omega_max, eq.
        con_tsat), the drive gives nothing.
        """
        w = np.asarray(w, dtype=float)
        upper, lower = np.full(w.shape, np.inf), np.full(w.shape, -np.inf)
        for h in self.planes:
            if h.a > 0:
                upper = np.minimum(upper, (1 - h.b * w) / h.a)
            elif h.a < 0:
                lower = np.maximum(lower, (1 - h.b * w) / h.a)
        empty = lower > upper
        return np.where(empty, 0.0, lower), np.where(empty, 0.0, upper)

    def clamp(self, w: Any, tau: Any) -> Any:
        """tau [N m] brought into the region at speed w [rad/s] (eq. con_tdes)."""
        lower, upper = self.torque_bounds(w)
        return np.clip(tau, lower, upper)

    def saturation(self, w: Any, tau: Any) -> Any:
        """Saturation ratio C = |tau| / |tau_sat(w)| in the direction of tau (eq. sim_cact), shapes as w."""
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


def paper_law(torque: Any, speed: Any) -> list[HalfPlane]:
    """Eq. con_tsat without absolute values: +-tau/(R tau_max) +- R w/omega_max <= 1."""
    return [*_pair(Line.TORQUE_SPEED, torque, speed), *_pair(Line.BRAKING, torque, -speed)]


def four_quadrant_law(torque: Any, speed: Any) -> list[HalfPlane]:
    """+-(tau/(R tau_max) + R w/omega_max) <= 1: braking is not weakened by speed."""
    return _pair(Line.TORQUE_SPEED, torque, speed)


Law = Callable[[Any, Any], list[HalfPlane]]  # of 1 / stall torque [1/(N m)] and 1 / no-load speed [s/rad]
LAWS: dict[str, Law] = {"paper": paper_law, "four-quadrant": four_quadrant_law}


def operating_region(leg: Leg, joint: str, p: Mapping[str, Any]) -> OperatingRegion:
    """The AOR of one joint from the parameter values (or symbols) ``p``, paths as in the problem file."""

    def entry(part: Any, name: str) -> Any:
        return p.get(leg.drive(joint, part, name)[0])

    ratio, tau_max, omega_max = entry("gear", "ratio"), entry("motor", "max_torque"), entry("motor", "max_speed")
    torque, speed = 1 / (ratio * tau_max), ratio / omega_max  # 1/(stall torque), 1/(no-load speed) at the joint
    planes: list[HalfPlane] = []
    laws = leg.drive(joint, "motor", "laws")[1]
    for law in laws:
        planes += [plane for plane in LAWS[law](torque, speed) if plane.line not in {h.line for h in planes}]
    drive_cap, gear_cap, speed_cap = (
        entry("motor", "torque_cap"),
        entry("gear", "torque_cap"),
        entry("gear", "speed_cap"),
    )
    if drive_cap is not None:
        planes += _pair(Line.DRIVE_CAP, 1 / (ratio * drive_cap), 0.0)
    if gear_cap is not None:
        planes += _pair(Line.GEAR_CAP, 1 / gear_cap, 0.0)
    if speed_cap is not None:
        planes += _pair(Line.SPEED_CAP, 0.0, ratio / speed_cap)
    return OperatingRegion(tuple(planes))


def _pair(line: Line, a: Any, b: Any) -> list[HalfPlane]:
    return [HalfPlane(line, a, b, FORWARD), HalfPlane(line, -a, -b, BACKWARD)]
