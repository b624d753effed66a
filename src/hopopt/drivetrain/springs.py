"""Springs beside the drives of a leg: the torque and the energy of each, one law for planner, plant and verification.

A spring's angle is s = sum of c_i q_i over its joints, and it gives joint i the torque c_i T(s). T is a broken line,

    T(s) = level + slope s + sum of bend_k r(s - knot_k),    r(x) = (x + sqrt(x^2 + w^2)) / 2

whose corners are rounded over a width w, so that the program has smooth functions: r is a ramp from 0 to x. A linear spring
has no knot: T = -k (s - s_0). One that acts above its rest angle alone is -k r(s - s_0). A table has a knot at each point
between its ends. As r rises, T stays monotone where its table is. The stored energy is E = -integral of T ds, in closed form.
Plain Python on purpose: of numbers, arrays or CasADi symbols, and compiled as it is (drivetrain/kernels.py).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from hopopt.design import MOST_POINTS, MOST_SPRINGS, Leg, Spring, SpringTable

ROUND = 0.01  # share of the range of a spring's angle over which its corners are rounded
ANGLES = 4001  # between the ends of a spring's angle, where its least energy is looked for
WITHOUT_CORNERS = 1.0  # [rad] width of a law that has none


def torque_at(s: Any, level: Any, slope: Any, knots: Any, bends: Any, width: Any) -> Any:
    """T [N m] at the angle s [rad]: level [N m] at zero, slope [N m/rad], which changes by bends [N m/rad] at knots [rad]."""
    torque = level + slope * s
    for knot, bend in zip(knots, bends):  # noqa: B905 - compiled too, where zip knows no strict
        ahead = s - knot
        torque = torque + bend * (ahead + (ahead * ahead + width * width) ** 0.5) / 2
    return torque


def potential_at(s: Any, level: Any, slope: Any, knots: Any, bends: Any, width: Any) -> Any:
    """-integral of ``torque_at`` over the angle, up to a constant [J]; numbers or arrays."""
    stored = -s * (level + slope * s / 2)
    for knot, bend in zip(knots, bends, strict=True):
        ahead = s - knot
        size = (ahead * ahead + width * width) ** 0.5
        stored = stored - bend * (ahead * ahead + ahead * size + width * width * np.arcsinh(ahead / width)) / 4
    return stored


@dataclass(frozen=True)
class SpringLaw:
    """One spring: coefficients (n,) of the joints in its angle, the numbers of its law, the angle at which it is empty [rad]."""

    coefficients: tuple[float, ...]
    level: Any
    slope: Any
    empty: Any
    knots: tuple[Any, ...] = ()
    bends: tuple[Any, ...] = ()
    width: Any = WITHOUT_CORNERS

    @property
    def numbers(self) -> tuple[Any, ...]:
        """What ``torque_at`` takes after the angle."""
        return self.level, self.slope, self.knots, self.bends, self.width

    @property
    def steepest(self) -> Any:
        """What the slope of its torque [N m/rad] does not pass."""
        return abs(self.slope) + sum(abs(bend) for bend in self.bends)

    def angle(self, q: Sequence[Any]) -> Any:
        """Its angle [rad] at n joint angles [rad], each a number, an array or a symbol."""
        return sum(c * angle for c, angle in zip(self.coefficients, q, strict=True) if c)

    def torque(self, s: Any) -> Any:
        """T [N m] at its angle s [rad]."""
        return torque_at(s, *self.numbers)

    def energy(self, s: Any) -> Any:
        """Stored energy [J] at its angle s [rad], above that of the empty spring."""
        return potential_at(s, *self.numbers) - potential_at(self.empty, *self.numbers)

    @classmethod
    def of(cls, leg: Leg, name: str, p: Mapping[str, Any]) -> Self:
        """The law of one of the leg's springs, from parameter values or symbols by their paths."""
        spring: Spring = (leg.spring or {})[name]
        own = weights_of(name, spring)
        coefficients, width = tuple(float(own.get(joint, 0.0)) for joint in leg.joints), rounding(leg, name, spring)
        if spring.table is not None:
            return cls(coefficients, **_broken_line(spring.table), width=width)
        k, rest = p[f"leg.spring.{name}.stiffness"], p[f"leg.spring.{name}.rest_angle"]
        if spring.acts == "everywhere":
            return cls(coefficients, k * rest, -k, rest)
        if spring.acts == "above":
            return cls(coefficients, 0.0, 0.0, rest, (rest,), (-k,), width)
        return cls(coefficients, k * rest, -k, rest, (rest,), (k,), width)


def weights_of(name: str, spring: Spring) -> dict[str, float]:
    """The coefficient of each joint in a spring's angle."""
    return dict(zip(joints_of(name, spring), spring.coefficients or [1.0] * MOST_SPRINGS, strict=False))


def rounding(leg: Leg, name: str, spring: Spring) -> float:
    """Width [rad] over which a spring's corners are rounded."""
    own = weights_of(name, spring)
    return ROUND * sum(abs(c) * (leg.joint[j].upper - leg.joint[j].lower) for j, c in own.items())


def joints_of(name: str, spring: Spring) -> tuple[str, ...]:
    """The joints whose angles make a spring's angle."""
    return spring.joints or (name,)


def slides(leg: Leg, name: str, spring: Spring) -> bool:
    """Whether a spring is of joints that slide alone: then its angle is a travel [m] and its torque a force [N]."""
    return {*joints_of(name, spring)} <= {*leg.sliding}


def _broken_line(table: SpringTable) -> dict[str, Any]:
    """Entries of ``SpringLaw`` that a table gives; it counts as empty at the point of the least torque."""
    angle, torque = np.array(table.angle), np.array(table.torque)
    slopes = np.diff(torque) / np.diff(angle)
    return {
        "level": float(torque[0] - slopes[0] * angle[0]),
        "slope": float(slopes[0]),
        "empty": float(angle[np.argmin(np.abs(torque))]),
        "knots": tuple(angle[1:-1].tolist()),
        "bends": tuple(np.diff(slopes).tolist()),
    }


def _least_energy(law: SpringLaw, leg: Leg) -> float:
    """Below the least energy [J] of a spring within joint limits, by no more than its greatest torque over half a step."""
    ends = np.array([(leg.joint[joint].lower, leg.joint[joint].upper) for joint in leg.joints])
    lowest, highest = np.sort(ends * np.array(law.coefficients)[:, None], axis=1).sum(axis=0)
    angles = np.linspace(lowest, highest, ANGLES)
    torque, step = np.abs(law.torque(angles)).max(), angles[1] - angles[0]
    return float(law.energy(angles).min() - (torque + law.steepest * step) * step / 2)


@dataclass(frozen=True)
class Springs:
    """All springs of a leg of n joints, by their names; of a leg without springs nothing."""

    laws: Mapping[str, SpringLaw]

    def __bool__(self) -> bool:
        return bool(self.laws)

    @classmethod
    def of(cls, leg: Leg, p: Mapping[str, Any]) -> Self:
        """The springs of a leg, from parameter values or symbols by their paths."""
        return cls({name: SpringLaw.of(leg, name, p) for name in leg.spring or {}})

    def torques(self, q: Sequence[Any]) -> list[Any]:
        """What the springs give every joint (n) [N m] at its angles q (n) [rad], each a number, an array or a symbol."""
        given = [0.0 * angle for angle in q]
        for law in self.laws.values():
            torque = law.torque(law.angle(q))
            given = [tau + c * torque if c else tau for tau, c in zip(given, law.coefficients, strict=True)]
        return given

    def energy(self, q: Sequence[Any]) -> Any:
        """Energy [J] that all of them store at joint angles q (n) [rad]."""
        return sum((law.energy(law.angle(q)) for law in self.laws.values()), 0.0)

    def most_given(self, q: Sequence[float], leg: Leg) -> float:
        """Energy [J] that they can give at most from joint angles q (n) [rad] on, wherever the leg's joint limits let it go."""
        return sum(law.energy(law.angle(q)) - _least_energy(law, leg) for law in self.laws.values())

    def numbers(self, n: int) -> dict[str, Any]:
        """For compiled functions, with room for as many springs as a leg of n joints may have: how many there are, and of each
        the coefficients (n), level, slope and width, and knots and bends (MOST_POINTS - 2)."""
        room, corners = MOST_SPRINGS, MOST_POINTS - 2
        found = {name: np.zeros(room) for name in ("spring_level", "spring_slope")}
        found |= {"spring_width": np.ones(room), "spring_coefficients": np.zeros((room, n))}
        found |= {name: np.zeros((room, corners)) for name in ("spring_knots", "spring_bends")}
        for i, law in enumerate(self.laws.values()):
            found["spring_level"][i], found["spring_slope"][i], found["spring_width"][i] = (
                law.level,
                law.slope,
                law.width,
            )
            found["spring_coefficients"][i] = law.coefficients
            found["spring_knots"][i, : len(law.knots)], found["spring_bends"][i, : len(law.bends)] = (
                law.knots,
                law.bends,
            )
        return {"springs": len(self.laws), **found}
