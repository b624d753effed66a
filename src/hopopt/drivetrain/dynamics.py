"""Drives with states of their own: what lies in time between the command to a motor and the torque at its joint.

A winding's inductance, a spring in series, a lag: each is an entry of ``DYNAMICS``, a function of the leg, a joint and the
parameters that gives ``JointDynamics``, or None for a joint that it does not concern. The phases take states and controls
from there, the plant its rates, verification both, without knowing what they mean. Without any the command is the torque.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hopopt.design import Leg


@dataclass(frozen=True)
class JointDynamics:
    """What the drive of one joint adds: states x (m), and how they move under a command u [N m] at joint speed w [rad/s].

    names, units, scales: of the states, m each; scales in these units
    rates: (x, u, w) -> their derivatives, a sequence of m; of numbers or CasADi symbols alike
    torque: (x, u, w) -> torque at the joint [N m], of numbers or symbols
    at_rest: (tau) -> states, m numbers, that hold a torque tau [N m] while nothing moves
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    scales: tuple[float, ...]
    rates: Callable[[Any, Any, Any], Sequence[Any]]
    torque: Callable[[Any, Any, Any], Any]
    at_rest: Callable[[float], Sequence[float]]


Dynamics = Callable[[Leg, str, Mapping[str, Any]], JointDynamics | None]  # of a leg, a joint, parameters by their paths
DYNAMICS: list[Dynamics] = []


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

    def rates(self, x: Any, command: Any, w: Any) -> list[Any]:
        """Derivatives of all states x (size) under commands and at speeds (n) of all joints."""
        return [rate for d, own, k in self._parts(x) for rate in d.rates(own, command[k], w[k])]

    def torques(self, x: Any, command: Any, w: Any) -> list[Any]:
        """Torque [N m] of each joint that has dynamics, arguments as those of ``rates``."""
        return [d.torque(own, command[k], w[k]) for d, own, k in self._parts(x)]

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
    """What the drives of a leg add, by the first entry of ``DYNAMICS`` that concerns each joint; p: numbers or symbols by their paths."""
    found = {joint: next((d for of in DYNAMICS if (d := of(leg, joint, p))), None) for joint in leg.joints}
    return AddedStates({joint: d for joint, d in found.items() if d}, leg.joints)
