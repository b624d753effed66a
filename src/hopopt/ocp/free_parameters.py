"""Design parameters that the optimum may choose within bounds, and couplings between them: sums of powers."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from hopopt.design import Leg
from hopopt.errors import UsageError
from hopopt.leg.kinematics import TwoJoints, start_angles
from hopopt.ocp.guesses.motion import MovingLeg
from hopopt.ocp.problem import INF, BoundaryConstraint, Ends, Numbers, Parameter

DECIMAL_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
TERM = re.compile(
    rf"\s*([+-]?)\s*(?:({DECIMAL_NUMBER})\s*(?:\*\s*)?)?(?:([A-Za-z][\w.-]*[\w](?:\[\d+\])?)(?:\s*\^\s*(-?{DECIMAL_NUMBER}))?)?\s*"
)
LARGEST, STEEPEST = 1e12, 8.0  # factors and constants, and powers, of couplings: what they give stays finite
HOW_TO_FREE = (
    'write a sum of numbers times entries, such as "leg.thigh.length + leg.shank.length = 0.741"; '
    'an entry may have a power: "leg.motor.max_torque^0.8"'
)


@dataclass(frozen=True)
class Coupling:
    """sum of factor * entry and of factor * entry^exponent, at least ``lower`` and at most ``upper``.

    text: as it was given, or that a table keeps falling or rising; factors: {entry: factor}; powers: {(entry, exponent): factor}.
    """

    text: str
    factors: Mapping[str, float]
    lower: float
    upper: float
    powers: Mapping[tuple[str, float], float] = field(default_factory=dict)

    @property
    def terms(self) -> list[tuple[float, str, float]]:
        """(factor, entry, exponent) of every term."""
        powers = [(factor, entry, exponent) for (entry, exponent), factor in self.powers.items()]
        return [(factor, entry, 1.0) for entry, factor in self.factors.items()] + powers

    @property
    def entries(self) -> list[str]:
        """Every entry that is in it, once."""
        return list(dict.fromkeys(entry for _, entry, _ in self.terms))

    def value(self, p: Mapping[str, Any]) -> Any:
        """The sum, of numbers or of symbols."""
        return sum(
            factor * (p[entry] if exponent == 1 else p[entry] ** exponent) for factor, entry, exponent in self.terms
        )

    def equation(self) -> str:
        """The coupling written out with its numbers."""
        terms = [
            f"{'-' if f < 0 else '+'} {'' if abs(f) == 1 else f'{abs(f):.6g}*'}{entry}{'' if n == 1 else f'^{n:.6g}'}"
            for f, entry, n in self.terms
        ]
        sign, side = ("=", self.lower) if self.lower == self.upper else ("<=", self.upper)
        sign, side = (">=", self.lower) if self.upper == INF else (sign, side)
        return f"{' '.join(terms).removeprefix('+ ')} {sign} {side:.6g}"


@dataclass(frozen=True)
class FreeParameters:
    """bounds: entry -> (lowest, highest) of every design parameter that is free; what couples them."""

    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    couplings: tuple[Coupling, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.bounds)

    def parameters(self, values: Mapping[str, float]) -> tuple[Parameter, ...]:
        """Every physical parameter of the leg, the free ones within their bounds."""
        return tuple(self._parameter(path, value) for path, value in values.items())

    def _parameter(self, path: str, value: float) -> Parameter:
        if path not in self.bounds:
            return Parameter(path, value=value)
        low, high = self.bounds[path]
        return Parameter(
            path, lower=low, upper=high, scale=max(abs(low), abs(high)), value=float(np.clip(value, low, high)),
            free=True,
        )  # fmt: skip

    def moves_start(self, hop: MovingLeg) -> bool:
        """Whether the pose at the start depends on what is free: a hip height is given, and lengths are free. A
        periodic hop starts as it will."""
        lengths = {f"leg.{link}.length" for link in hop.leg.links}
        given = hop.design.start.hip_height is not None and not hop.design.hop.periodic
        return given and bool(lengths & self.bounds.keys())

    def start(self, hop: MovingLeg) -> Numbers | tuple[Numbers, Numbers]:
        """Joint angles at the start [rad]: given, or free on the side to which the second joint is folded.

        A hip height is the start of legs of two joints only.
        """
        q0 = start_angles(hop.design)
        if not self.moves_start(hop):
            return q0
        lower, upper = (side.copy() for side in hop.limits)
        geometry = TwoJoints.of(hop.leg)
        bend = geometry.bend(q0[1])
        ends = q0[1] + geometry.signs[1] * (np.array([0.0, np.copysign(np.pi, bend)]) - bend)  # straight, folded
        lower[1], upper[1] = max(lower[1], ends.min()), min(upper[1], ends.max())
        return lower.tolist(), upper.tolist()

    def boundary(self, hop: MovingLeg) -> Iterator[BoundaryConstraint]:
        """The couplings, and the hip where the problem starts."""
        for c in self.couplings:
            size = max(
                abs(c.lower) if np.isfinite(c.lower) else 0.0, abs(c.upper) if np.isfinite(c.upper) else 0.0, 1e-3
            )
            yield BoundaryConstraint(c.text, lambda e, c=c: c.value(e.p), c.lower, c.upper, size)
        if self.moves_start(hop):
            start = hop.design.start
            stands = [-start.foot_x, float(start.hip_height or 0.0)]

            def hip(e: Ends) -> ca.SX:
                s = e.initial["stance"]
                return hop.dynamics(s).stance_pose(s.q, s.v)[0][:2]

            yield BoundaryConstraint("hip at the start", hip, stands, stands, hop.scale.length, "m", ("x", "z"))


def parse_free(texts: Sequence[str]) -> dict[str, tuple[float, float]]:
    """{"leg.gear.ratio": (50.0, 200.0)} from "leg.gear.ratio=50:200"; UsageError in a sentence if it is not that."""
    bounds: dict[str, tuple[float, float]] = {}
    for text in texts:
        found = re.fullmatch(
            rf"\s*([\w.-]+(?:\[\d+\])?)\s*=\s*(-?{DECIMAL_NUMBER})\s*:\s*(-?{DECIMAL_NUMBER})\s*", text
        )
        if not found or not float(found[2]) < float(found[3]):
            raise UsageError(f"--free {text}: write lower:upper, the lower first, such as leg.gear.ratio=50:200")
        if found[1] in bounds:
            raise UsageError(f"--free {found[1]} is given twice: once is enough")
        bounds[found[1]] = (float(found[2]), float(found[3]))
    return bounds


def parse_coupling(text: str) -> Coupling:
    """A coupling from "2*a.b + c.d^0.5 = 3", also with <= or >=; UsageError in a sentence if it is not that."""
    sides = re.split(r"(<=|>=|=)", text)
    if len(sides) != 3:
        raise UsageError(f"--couple {text}: {HOW_TO_FREE}")
    found: dict[tuple[str, float], float] = {}
    constant = _add(text, sides[0], 1.0, found) + _add(text, sides[2], -1.0, found)
    if not found:
        raise UsageError(f"--couple {text}: no entry is in it; {HOW_TO_FREE}")
    for (entry, exponent), factor in found.items():
        if not 0 < abs(factor) <= LARGEST:
            why = "cancels out" if factor == 0 else f"has a factor that is not finite or beyond {LARGEST:g}"
            raise UsageError(f"--couple {text}: {entry} {why}; {HOW_TO_FREE}")
        if not 0 < abs(exponent) <= STEEPEST:
            words = f"has the power {exponent:g}: powers reach to {STEEPEST:g} and none is 0"
            raise UsageError(f"--couple {text}: {entry} {words}; {HOW_TO_FREE}")
    if not abs(constant) <= LARGEST:
        raise UsageError(f"--couple {text}: its constant is not finite or beyond {LARGEST:g}; {HOW_TO_FREE}")
    lower, upper = {"=": (-constant, -constant), "<=": (-INF, -constant), ">=": (-constant, INF)}[sides[1]]
    factors = {entry: factor for (entry, exponent), factor in found.items() if exponent == 1}
    powers = {key: factor for key, factor in found.items() if key[1] != 1}
    return Coupling(" ".join(text.split()), factors, lower, upper, powers)


def _add(text: str, side: str, sign: float, found: dict[tuple[str, float], float]) -> float:
    """Add the terms of one side to ``found``, {(entry, exponent): factor}; what stands there without an entry."""
    at, constant, first = 0, 0.0, True
    side = side.strip()
    while at < len(side) or first:
        term = TERM.match(side, at)
        if not term or not (term[2] or term[3]) or (not first and not term[1]):
            raise UsageError(f"--couple {text}: {side[at:] or 'nothing'!r} is not understood; {HOW_TO_FREE}")
        value = sign * (-1.0 if term[1] == "-" else 1.0) * float(term[2] or 1.0)
        if term[3]:
            key = term[3], float(term[4] or 1.0)
            found[key] = found.get(key, 0.0) + value
        else:
            constant += value
        at, first = term.end(), False
    return constant


def monotone(leg: Leg, bounds: Mapping[str, Any]) -> Iterator[Coupling]:
    """That a table of ratios of which some are free still falls or rises as it does: for each two neighbours of which one is free.
    UsageError for a level table, which tells neither."""
    for joint in leg.joints:
        between, path = leg.joint[joint].transmission, f"leg.{joint}.transmission.table.ratio"
        if between is None or between.table is None:
            continue
        (first, *_, last), entries = between.table.ratio, [f"{path}[{k}]" for k in range(len(between.table.ratio))]
        if (free := [entry for entry in entries if entry in bounds]) and first == last:
            level = f"{path} is level, so that nothing tells whether it is to fall or to rise"
            raise UsageError(f"--free {free[0]}: {level}: let it begin with a little of either")
        for less, more in pairwise(entries if last > first else entries[::-1]):
            if {less, more} & bounds.keys():
                yield Coupling(f"{more} - {less} >= 0", {more: 1.0, less: -1.0}, 0.0, INF)
