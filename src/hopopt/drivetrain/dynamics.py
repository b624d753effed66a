"""Drives with states of their own: what lies in time between the command to a motor and the torque at its joint.

A winding's inductance, a spring in series, a lag: each is an entry of ``DYNAMICS``, a function of the leg, a joint and the
parameters that gives ``JointDynamics``, or None for a joint that it does not concern. The phases take states and controls
from there, the plant its rates, verification both, without knowing what they mean. Without any the command is the torque.

A series spring of stiffness k and damping d has the states s = theta - q, its deflection, and w_d = theta', its drive's speed:

    s' = w_d - w,    A w_d' = u - g(tau),    tau = k s + d (w_d - w)

u is the motor's torque, A what spins in front of the gear, and g what the gear takes to pass tau on, tau itself where it loses
nothing (Pratt and Williamson, Series elastic actuators, 1995). All behind the gear. s is 0 where the spring gives no torque.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hopopt.design import Leg, physical_parameters
from hopopt.drivetrain.gear import Gear, lossy
from hopopt.drivetrain.motor import electrical_time, motor_torque_and_speed, reflected_inertia, stall_torque
from hopopt.drivetrain.operating_region.half_planes import OperatingRegion
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.errors import UsageError


@dataclass(frozen=True)
class JointDynamics:
    """What the drive of one joint adds: states x (m), and how they move under a command u [N m] at joint speed w [rad/s].

    names, units, scales: of the states, m each; scales in these units
    rates: (x, u, w) -> their derivatives, a sequence of m; of numbers or CasADi symbols alike
    torque: (x, asked, w) -> torque at the joint [N m] of what the motor is asked for [N m], of numbers or symbols
    at_rest: (tau) -> states, m numbers, that hold a torque tau [N m] while nothing moves
    rate: None where u is the command, which is what the motor is asked for. Else the one state is what it is asked for, u its
        derivative, and this its bound [N m/s], number or symbol
    region: whose voltage bounds that derivative too, if the winding's inductance counts
    speed: which state is the drive's speed behind its gear [rad/s]; None where the drive turns as its joint does
    rotor: reflected inertia that turns with that speed [kg m^2]
    stored: (x) -> energy in the drive [J]; lost: (x, w) -> what a spring's damping turns into heat [W]
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    scales: tuple[float, ...]
    rates: Callable[[Any, Any, Any], Sequence[Any]]
    torque: Callable[[Any, Any, Any], Any]
    at_rest: Callable[[Any], Sequence[Any]]
    rate: Any = None
    region: OperatingRegion | None = None
    speed: int | None = None
    rotor: Any = 0.0
    stored: Callable[[Any], Any] = lambda x: 0.0
    lost: Callable[[Any, Any], Any] = lambda x, w: 0.0

    def bounds(self, w: float, tau: float) -> tuple[float, float]:
        """How fast a torque tau [N m] falls and rises at most at speed w [rad/s], [N m/s] each."""
        low, high = self.region.rate_bounds(w, tau) if self.region else (-self.rate, self.rate)
        return max(low, -self.rate), min(high, self.rate)


Dynamics = Callable[[Leg, str, Mapping[str, Any]], JointDynamics | None]  # of a leg, a joint, parameters by their paths
TORQUE_RATE = "torque_rate"  # entry of a motor
MOST_VOLTAGE = (
    4.0  # of the bus's: what R i, k omega and L di/dt come to at most together with it, whatever the winding does
)


def limited_rate(leg: Leg, joint: str, p: Mapping[str, Any]) -> JointDynamics | None:
    """The torque of a joint's motor, behind its gear, where the problem limits how fast it changes: a state, whose rate a plan
    controls. A winding's inductance limits it by the voltage."""
    path, given = leg.drive(joint, "motor", TORQUE_RATE)
    late = electrical_time(leg, joint, p)
    if given is None and late is None:
        return None
    ratio = p[leg.drive(joint, "gear", "ratio")[0]]
    most = MOST_VOLTAGE * stall_torque(leg, joint, p) / late if given is None else p[path] * ratio
    return JointDynamics(
        ("torque",), ("N m",), (float(stall_torque(leg, joint, physical_parameters(leg))),),
        rates=lambda x, rate, w: [rate],
        torque=lambda x, asked, w: asked,
        at_rest=lambda tau: [tau],
        rate=most,
        region=None if late is None else operating_region(leg, joint, p),
    )  # fmt: skip


def series_spring(leg: Leg, joint: str, p: Mapping[str, Any]) -> JointDynamics | None:
    """A spring between the drive and its joint: its deflection and the drive's speed are states, the motor's torque is the command."""
    if joint not in leg.elastic:
        return None
    path, numbers = f"leg.{joint}.series_spring", physical_parameters(leg)
    k, d = p[f"{path}.stiffness"], p.get(f"{path}.damping", 0.0)
    inertia, gear = reflected_inertia(leg, joint, p), Gear.of(leg, joint, p) if lossy(leg, joint) else None

    def torque(x: Any, asked: Any, w: Any) -> Any:
        return k * x[0] + d * (x[1] - w)

    def rates(x: Any, u: Any, w: Any) -> Sequence[Any]:
        tau = torque(x, u, w)
        load = tau if gear is None else gear.needed(tau, x[1])
        return [x[1] - w, (u - load) / inertia]

    ratio, (most, fastest) = numbers[leg.drive(joint, "gear", "ratio")[0]], motor_torque_and_speed(leg, joint, numbers)
    return JointDynamics(
        ("deflection", "drive speed"), ("rad", "rad/s"),
        (float(most) * ratio / numbers[f"{path}.stiffness"], float(fastest) / ratio),
        rates=rates,
        torque=torque,
        at_rest=lambda tau: [tau / k, 0.0 * tau],
        speed=1,
        rotor=inertia,
        stored=lambda x: (k * x[0] ** 2 + inertia * x[1] ** 2) / 2,
        lost=lambda x, w: d * (x[1] - w) ** 2,
    )  # fmt: skip


DYNAMICS: list[Dynamics] = [limited_rate, series_spring]


@dataclass(frozen=True)
class AddedStates:
    """The states that a leg's drives add, one after the other.

    of: dynamics by joint, those that have any, in the order of the joints
    joints: every joint of the leg
    """

    of: Mapping[str, JointDynamics]
    joints: tuple[str, ...]

    @property
    def size(self) -> int:
        """How many states they add."""
        return sum(len(d.names) for d in self.of.values())

    @property
    def at(self) -> list[int]:
        """Which joints have dynamics, by their place among all."""
        return [self.joints.index(joint) for joint in self.of]

    def labels(self) -> tuple[str, ...]:
        """A name for each state."""
        return tuple(f"{joint} {name}" for joint, d in self.of.items() for name in d.names)

    @property
    def limited(self) -> dict[int, Any]:
        """Largest rates [N m/s] of torques that are states, by the joint's place among all."""
        return {k: d.rate for d, k in zip(self.of.values(), self.at, strict=True) if d.rate is not None}

    @property
    def sprung(self) -> dict[int, int]:
        """Which state is the drive's speed, by the place among all of each joint whose drive does not turn as it does."""
        return {k: own[d.speed] for d, own, k in self._parts(range(self.size)) if d.speed is not None}

    @property
    def steady(self) -> int:
        """How many joints have a torque that cannot jump."""
        return len(self.limited) + len(self.sprung)

    @property
    def rotors(self) -> dict[int, Any]:
        """Reflected inertias [kg m^2] of those ``sprung``, by the joint's place among all."""
        return {k: d.rotor for d, k in zip(self.of.values(), self.at, strict=True) if d.speed is not None}

    def speeds(self, x: np.ndarray, w: np.ndarray) -> np.ndarray:
        """Speeds of all drives (..., n) [rad/s] at states x (..., size) and speeds w (..., n) of the joints."""
        if not self.sprung:
            return w
        found = np.array(w, dtype=float)
        found[..., list(self.sprung)] = x[..., list(self.sprung.values())]
        return found

    def stored(self, x: Any) -> Any:
        """Energy in the drives [J] at states x (size)."""
        return sum(d.stored(own) for d, own, _ in self._parts(x))

    def lost(self, x: Any, w: Any) -> Any:
        """What springs' damping turns into heat [W] at states x (size) and speeds w (n) of all joints."""
        return sum(d.lost(own, w[k]) for d, own, k in self._parts(x))

    def rates(self, x: Any, u: Any, w: Any) -> list[Any]:
        """Derivatives of all states x (size) under what is controlled, u (n), at speeds w (n) of all joints."""
        return [rate for d, own, k in self._parts(x) for rate in d.rates(own, u[k], w[k])]

    def asked(self, x: Any, u: Any) -> list[Any]:
        """What the motors (n) are asked for [N m]: u, or the state where the torque is one."""
        found = [u[k] for k in range(len(self.joints))]
        for d, own, k in self._parts(x):
            found[k] = found[k] if d.rate is None else own[0]
        return found

    def torques(self, x: Any, asked: Any, w: Any) -> list[Any]:
        """Torque [N m] of each joint that has dynamics, of what the motors (n) are asked for [N m]."""
        return [d.torque(own, asked[k], w[k]) for d, own, k in self._parts(x)]

    def bounds(self, x: Any, w: Any) -> tuple[np.ndarray, np.ndarray]:
        """How fast torques that are states fall and rise at most [N m/s], one of each for each, at speeds w (n) of all joints."""
        found = [d.bounds(w[k], own[0]) for d, own, k in self._parts(x) if d.rate is not None]
        low, high = np.array(found).reshape(-1, 2).T
        return low, high

    def followed(self, x: Any, command: Any, w: Any, lag: float) -> list[Any]:
        """What is controlled (n) where motors are commanded torques (n) [N m], in numbers: these, or the rate [N m/s] at which
        a torque that is a state approaches its command within ``lag`` [s], at speeds w (n)."""
        found = [command[k] for k in range(len(self.joints))]
        for d, own, k in self._parts(x):
            if d.rate is not None:
                low, high = d.bounds(w[k], own[0])
                found[k] = min(max((command[k] - own[0]) / lag, low), high)
        return found

    def at_rest(self, tau: Any) -> list[float]:
        """All states that hold torques tau (n) [N m] while nothing moves."""
        return [x for d, k in zip(self.of.values(), self.at, strict=True) for x in d.at_rest(tau[k])]

    def _parts(self, x: Any) -> list[tuple[JointDynamics, list[Any], int]]:
        parts, first = [], 0
        for d, k in zip(self.of.values(), self.at, strict=True):
            own = [x[first + i] for i in range(len(d.names))]
            parts.append((d, own, k))
            first += len(d.names)
        return parts


def added_states(leg: Leg, p: Mapping[str, Any]) -> AddedStates:
    """What the drives of a leg add, by the entry of ``DYNAMICS`` that concerns each joint; p: numbers or symbols by their paths.

    UsageError where two concern one joint.
    """
    found = {joint: [d for of in DYNAMICS if (d := of(leg, joint, p))] for joint in leg.joints}
    if twice := [joint for joint, dynamics in found.items() if len(dynamics) > 1]:
        raise UsageError(
            f"the drive of the {twice[0]} has two dynamics: leave out its motor's torque_rate or the other"
        )
    return AddedStates({joint: of[0] for joint, of in found.items() if of}, leg.joints)


def refuse_series_springs(leg: Leg, what: str) -> None:
    """UsageError where a leg has a series spring, for what does not know its states."""
    if leg.elastic:
        raise UsageError(f"{what} does not know series springs: leave out leg.{leg.elastic[0]}.series_spring")
