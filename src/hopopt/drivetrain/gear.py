"""What a gear takes from the torque that passes its teeth: one law for planner, plant, verification and global search.

All at the joint side. The motor spins the rotor up and gives the rest to the teeth, tau_m = A a + tau_g; the leg feels
tau_out. With an efficiency eta, Coulomb friction tau_c and viscous friction b,

    tau_g = c1 tau_out + c2 |tau_out| + tau_c s + b w,    c1, c2 = (eta^-s +- eta^s) / 2,    s = sgn(w)

so that tau_out = eta tau_g where the gear drives, tau_g = eta tau_out where it brakes. At rest it holds whatever lies
between the two. The program needs smooth functions: s is w / (w^4 + slow^4)^(1/4), |tau| is sqrt(tau^2 + sharp^2). As s goes
to 0 the gear loses nothing, so that it gives power at no speed. An efficiency by the motor's speed runs straight between the
points of its table, level before and behind them, its corners rounded (``efficiency_at``). The factor that |tau_out| makes of it
is a monotone cubic spline through its points (``factor_at``). All of it plain Python on purpose (drivetrain/teeth/law.py).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import reduce
from itertools import zip_longest
from operator import or_
from typing import Any, Self

import numpy as np
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from hopopt.design import EfficiencyTable, Leg
from hopopt.drivetrain.motor import motor_torque_and_speed
from hopopt.drivetrain.teeth.law import each_driven, each_passed, efficiency_at, factor_at, passed_torque, teeth_torque

SLOW = 1e-2  # share of the no-load speed over which losses change their sign: 0.1 rad/s on the paper's leg
SHARP = 1e-3  # share of stall torque over which a gear goes from driving to braking
SOFTNESS = "gear softness"  # a number that gentler programs alone have: times SLOW and SHARP
ENTRIES = ("efficiency", "friction", "damping")
LOSSLESS = (1.0, 0.0, 0.0)
PIECE = 5  # numbers of a piece of the curve that a torque makes of an efficiency
NO_LOAD = "no_load_current"
TABLE, SCALE = "efficiency_table", "loss_scale"
NOTHING_LOST = {f"gear.{name}": value for name, value in zip(ENTRIES, LOSSLESS, strict=True)} | {
    f"{TABLE}.{SCALE}": 0.0,
    f"motor.{NO_LOAD}": 0.0,
}  # entries by the ends of their paths, with which gears and motors' bearings lose nothing


@dataclass(frozen=True)
class Gear:
    """The gears of a leg, each entry a number or an array (n,); of one joint also symbols.

    efficiency: share of the torque at its teeth that it passes on (0 to 1); with knots, at rest
    friction: Coulomb friction [N m]; damping: viscous friction [N m s/rad]
    slow: joint speed [rad/s] over which losses change their sign smoothly
    sharp: torque [N m] over which driving turns smoothly into braking
    lightest: least inertia [kg m^2] that friction is taken to stop
    knots, bends: joint speeds [rad/s] at which the slope of the efficiency changes, and by how much [s/rad], one each
    factor: pieces of what the torque at the joint makes of the efficiency, as of ``factor_at``
    """

    efficiency: Any = 1.0
    friction: Any = 0.0
    damping: Any = 0.0
    slow: Any = 0.02
    sharp: Any = 0.2
    lightest: float = 1e-3
    knots: tuple[Any, ...] = ()
    bends: tuple[Any, ...] = ()
    factor: tuple[Any, ...] = ()

    @property
    def ideal(self) -> bool:
        """Whether nothing is lost."""
        lost = np.any(self.friction) or np.any(self.damping) or self.tabled
        return bool(np.all(self.efficiency == 1.0) and not lost)

    @property
    def one_sided(self) -> Any:
        """Whether its losses turn round with the speed: not those of viscous friction alone."""
        losing = (self.efficiency != 1.0) | (self.friction != 0.0)
        return reduce(or_, (slope != 0.0 for slope in self._slopes), losing)

    @property
    def entries(self) -> tuple[Any, ...]:
        """Efficiency (at rest), friction, damping, and over which speed and torque they change smoothly."""
        return self.efficiency, self.friction, self.damping, self.slow, self.sharp

    @property
    def tabled(self) -> bool:
        """Whether its efficiency is no one number; of numbers alone."""
        return any(map(np.any, self._slopes))

    @property
    def _slopes(self) -> tuple[Any, ...]:
        """What changes its efficiency with speed and torque: all 0 where it is one number."""
        return *self.bends, *(power for piece in self.factor for power in piece[2:])

    @property
    def level(self) -> "Gear":
        """The gear with its best efficiency at every speed and torque."""
        behind = self.efficiency - sum(b * x for x, b in zip(self.knots, self.bends, strict=True))
        ends = [1.0, *(factor_at(start + span, self.factor, 0.0)[0] for start, span, *_ in self.factor)]
        return self.of_one(np.maximum(self.efficiency, behind) * max(ends))

    def of_one(self, efficiency: Any) -> "Gear":
        """The gear with one efficiency at every speed and torque."""
        return replace(self, efficiency=efficiency, knots=(), bends=(), factor=())

    def law(self, w: Any, out: Any = None) -> tuple[Any, ...]:
        """What ``teeth_torque`` takes after torque and speed, at joint speed w [rad/s] and torque out [N m] at the joint.

        Without ``out`` what ``passed_torque`` takes: the efficiency without its factor of the torque."""
        eta, *others = self.entries
        if self.knots:
            eta = efficiency_at(w, eta, self.knots, self.bends, self.slow)
        if out is not None and self.factor:
            eta = eta * factor_at(out, self.factor, self.sharp)[0]
        return eta, *others

    def needed(self, out: Any, w: Any) -> Any:
        """tau_g [N m] for a torque out [N m] at the joint, at joint speed w [rad/s]."""
        return teeth_torque(out, w, *self.law(w, out))

    def passed(self, tau: Any, w: Any) -> tuple[Any, Any]:
        """tau_out [N m] for a torque tau [N m] at the teeth, at joint speed w [rad/s], and its slope: the inverse of ``needed``.

        With a factor by torque of numbers of all joints (n) alone."""
        if not self.factor:
            return passed_torque(tau, w, *self.law(w))
        return each_passed(tau, w, *self.law(w), np.moveaxis(np.array(self.factor), -1, 0))

    @classmethod
    def of(cls, leg: Leg, joint: str, p: Mapping[str, Any]) -> Self:
        """The gear of a joint as its problem plans with it, from parameter values or symbols by their paths."""

        def entry(part: Any, name: str, default: Any = None) -> Any:
            return p.get(leg.drive(joint, part, name)[0], default)

        own = {name: entry("gear", name, default) for name, default in zip(ENTRIES, LOSSLESS, strict=True)}
        ratio, (torque, speed) = entry("gear", "ratio"), motor_torque_and_speed(leg, joint, p)
        own["friction"] += motor_friction(leg, joint, p)
        if (table := efficiency_table(leg, joint)) is not None:
            own |= _tabled(table, ratio, p[f"{leg.drive(joint, 'gear', TABLE)[0]}.{SCALE}"])
        soft = p.get(SOFTNESS, 1.0)
        return cls(**own, slow=soft * SLOW * speed / ratio, sharp=soft * SHARP * ratio * torque)


def motor_friction(leg: Leg, joint: str, p: Mapping[str, Any]) -> Any:
    """Coulomb friction R k i_0 [N m] of the motor itself, at the joint: what its no-load current overcomes."""
    current = p.get(leg.drive(joint, "motor", NO_LOAD)[0])
    if current is None:
        return 0.0
    return p[leg.drive(joint, "gear", "ratio")[0]] * p[leg.drive(joint, "motor", "torque_constant")[0]] * current


def gears_of(leg: Leg, p: Mapping[str, Any]) -> Gear:
    """The gears of all joints as the problem plans with them, entries (n,); p: numbers by their paths."""
    each = [Gear.of(leg, joint, p) for joint in leg.joints]
    efficiency, friction, damping, slow, sharp = np.array([gear.entries for gear in each], dtype=float).T
    knots, bends = (tuple(np.array(x) for x in zip_longest(*one, fillvalue=0.0)) for one in
                    ([gear.knots for gear in each], [gear.bends for gear in each]))  # fmt: skip
    factor = tuple(np.array(x).T for x in zip_longest(*(gear.factor for gear in each), fillvalue=(0.0,) * PIECE))
    return Gear(efficiency, friction, damping, slow, sharp, knots=knots, bends=bends, factor=factor)


def efficiency_table(leg: Leg, joint: str) -> EfficiencyTable | None:
    """The table of a joint's efficiency; None where there is none, or where the joint has an efficiency of its own instead."""
    (path, table), (of_number, number) = (leg.drive(joint, "gear", name) for name in (TABLE, ENTRIES[0]))
    shared, own = path == f"leg.gear.{TABLE}", number is not None and of_number != f"leg.gear.{ENTRIES[0]}"
    return None if shared and own else table


def factor_curve(table: EfficiencyTable) -> CubicHermiteSpline | None:
    """Its factor by the torque at the joint [N m]: a monotone cubic spline, level at both ends; None where it has none."""
    if table.torque is None or table.factor is None:
        return None
    slopes = PchipInterpolator(table.torque, table.factor).derivative()(table.torque)
    slopes[[0, -1]] = 0.0  # level beyond, without a corner
    return CubicHermiteSpline(table.torque, table.factor, slopes)


def worse_table(table: EfficiencyTable, lost: float) -> EfficiencyTable:
    """The table of a gear that loses a share more of its torque than its table says, with all that is lost: at a scale of 1.

    The scale counts what the table says, not what is lost beyond; so it goes into efficiencies and factors first."""
    scale, factor = table.loss_scale, table.factor
    efficiency = tuple(_left(share, scale) * (1 - lost) for share in table.efficiency)
    left = None if factor is None else tuple(_left(share, scale) for share in factor)
    return table.model_copy(update={"efficiency": efficiency, "factor": left, SCALE: 1.0})


def _left(share: Any, scale: Any) -> Any:
    """What passes of 1 where of the losses 1 - share that a table says only this scale counts."""
    return 1 - scale * (1 - share)


def _tabled(table: EfficiencyTable, ratio: Any, scale: Any) -> dict[str, Any]:
    """The entries of ``Gear`` that a table says, behind a gear of this ratio; of efficiency and factor each 1 - scale is 1."""
    slopes = np.diff(table.efficiency) / np.diff(table.speed)
    bends, curve = np.diff(slopes, prepend=0.0, append=0.0), factor_curve(table)
    first = 1.0 if table.factor is None else _left(table.factor[0], scale)
    return {
        "efficiency": first * _left(table.efficiency[0], scale),
        "knots": tuple(x / ratio for x in table.speed),
        "bends": tuple(first * scale * ratio * b for b in bends.tolist()),
        "factor": () if curve is None else _pieces(curve, scale / first),
    }


def _pieces(curve: CubicHermiteSpline, scale: Any) -> tuple[tuple[Any, ...], ...]:
    """The pieces of ``factor_at`` of a curve, its powers times a number."""
    ends = zip(curve.x[:-1].tolist(), np.diff(curve.x).tolist(), curve.c[-2::-1].T.tolist(), strict=True)
    return tuple((start, span, *(scale * power for power in powers)) for start, span, powers in ends)


def lossless_entries(p: Mapping[str, float]) -> dict[str, float]:
    """Entries by their paths with which gears and motors' bearings lose nothing, of those among p that lose."""
    own = {path: NOTHING_LOST[key] for path in p if (key := ".".join(path.split(".")[-2:])) in NOTHING_LOST}
    return {path: value for path, value in own.items() if p[path] != value}


def lossy(leg: Leg, joint: str) -> bool:
    """Whether the problem gives the gear of a joint, or the motor's bearings, losses to plan with, be they none."""
    return leg.drive(joint, "motor", NO_LOAD)[1] is not None or any(states(leg, joint, name) for name in ENTRIES)


def states(leg: Leg, joint: str, name: str) -> bool:
    """Whether the problem gives a joint's gear an efficiency (as a number or a table), friction or damping to plan with."""
    return leg.drive(joint, "gear", name)[1] is not None or (
        name == ENTRIES[0] and efficiency_table(leg, joint) is not None
    )


def any_lossy(leg: Leg) -> bool:
    """Whether any joint's gear is ``lossy``."""
    return any(lossy(leg, joint) for joint in leg.joints)


def motor_torque(gear: Gear, tau: Any, w: Any, a: Any, rotor: Any) -> Any:
    """tau_m [N m] for the torque tau = A a + tau_out [N m] on a joint and its rotor, at speed w [rad/s] and acceleration
    a [rad/s^2]; rotor: A, reflected inertia of what spins in front of the gear [kg m^2]."""
    return rotor * a + gear.needed(tau - rotor * a, w)


def joint_torque(gear: Gear, motor: Any, w: Any, a: Any, rotor: Any) -> Any:
    """tau [N m] for the motor's torque, the inverse of ``motor_torque``; arguments as there."""
    return rotor * a + gear.passed(motor - rotor * a, w)[0]


def driven_joints(gear: Gear, motor: np.ndarray, w: np.ndarray, a: np.ndarray, response: np.ndarray, rotor: np.ndarray) -> np.ndarray:  # fmt: skip
    """Torques tau (n) [N m] under which a leg moves as its motors' torques make it move, by Newton's method.

    The gear takes its share of what the rotor leaves, so tau depends on the acceleration that it leads to.
    motor, w (n): torques of the motors [N m], joint speeds [rad/s]
    a (n), response (n, n): accelerations without torques [rad/s^2], and by a unit of each [1/(kg m^2)]
    rotor (n): reflected inertias [kg m^2]
    """
    n = len(motor)
    entries = [np.zeros(n) + entry for entry in (motor, w, a, rotor, *gear.law(w))]
    pieces = np.moveaxis(np.array(gear.factor), -1, 0) if gear.factor else np.zeros((n, 0, PIECE))
    motor, w, a, rotor, *law = entries
    return each_driven(motor, w, a, np.ascontiguousarray(response), rotor, *law, np.ascontiguousarray(pieces))


def response_to(accelerate: Callable[[np.ndarray], np.ndarray], n: int) -> tuple[np.ndarray, np.ndarray]:
    """Accelerations of n joints without torques (n) and by a unit of each (n, n), of an affine function of the torques."""
    still = accelerate(np.zeros(n))
    return still, np.array([accelerate(unit) - still for unit in np.eye(n)]).T
