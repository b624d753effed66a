"""What amounts count as large or small on a leg: the range of a limit that has no other end, and its size beside the paper's leg."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import pinocchio as pin

from hopopt.design import GRAVITY, PAPERS_LENGTH, Design, Leg, Reserve, physical_parameters
from hopopt.drivetrain.motor import stall_torque, torque_cap
from hopopt.drivetrain.transmission import largest_ratios

FORCE_RANGE = 5.0  # [weights of the leg]: a push-off's peak
DESCENT_RANGE = 1.0  # [m/s] on the paper's leg: speed at which a body sinks into a counter-movement
PAPERS_MASS, PAPERS_STALL = 5.6 + 1.87 + 0.8, 200.0  # [kg, N m] of the paper's leg
RESERVED_FORCE, RESERVED_HEIGHT = 20.0, 0.005  # [N, m] of [reserve] on the paper's leg


@dataclass(frozen=True)
class Scale:
    """A leg's own units over those of the paper's leg, for which defaults are stated: there every factor is 1.

    length: of its reach. mass: of all it carries. stall: of what its drives give at standstill, on average. gravity: where it stands.
    """

    length: float
    mass: float
    stall: float
    gravity: float = 1.0

    @classmethod
    def of(cls, leg: Leg) -> Self:
        """The units of a leg."""
        mass = sum((leg.body.mass, *(link.mass for link in leg.link.values())))
        stall, gravity = (
            float((radians(leg) * standstill_torques(leg)).mean()) / PAPERS_STALL,
            float(np.linalg.norm(leg.fall)) / GRAVITY,
        )
        return cls(leg.length / PAPERS_LENGTH, mass / PAPERS_MASS, stall, gravity)

    @property
    def time(self) -> float:
        """Of sqrt(length / gravity); speeds of joints have its inverse."""
        return float(np.sqrt(self.length / self.gravity))

    @property
    def speed(self) -> float:
        """Of sqrt(length gravity), as for speeds along the ground."""
        return float(np.sqrt(self.length * self.gravity))

    @property
    def force(self) -> float:
        """Of its weight."""
        return self.mass * self.gravity

    def unit(self, name: str) -> float:
        """Of quantities in a unit; 1 for one that is not known."""
        work, time = self.force * self.length, self.time
        known = {
            "m": self.length,
            "s": time,
            "m/s": self.speed,
            "rad/s": 1 / time,
            "N": self.force,
            "N s": self.force * time,
        }
        return (known | {"N m": work, "J": work, "W": work / time}).get(name, 1.0)

    def states(self, leg: Leg) -> tuple[np.ndarray, np.ndarray]:
        """Of q and v (2 + n each) of the leg: the body's place and speed, then those of its joints."""
        joints, body = radians(leg), np.ones(2)
        return np.concatenate([self.length * body, joints]), np.concatenate([self.speed * body, joints / self.time])

    @property
    def inertia(self) -> float:
        """Of mass times length squared."""
        return self.mass * self.length**2


def reserve_of(design: Design) -> Reserve:
    """The problem's [reserve], with what it leaves out."""
    scale, r = Scale.of(design.leg), design.reserve
    default = {"ground_force": RESERVED_FORCE * scale.force, "height": RESERVED_HEIGHT * scale.length}
    return r.model_copy(update={name: x for name, x in default.items() if getattr(r, name) is None})


def radians(leg: Leg) -> np.ndarray:
    """What counts for each joint (n) as a radian does: 1, of one that slides the leg's length [m]."""
    return np.array([leg.length if joint in leg.sliding else 1.0 for joint in leg.joints])


def stall_torques(leg: Leg) -> np.ndarray:
    """Torque (n) [N m] that every joint's drive gives it at standstill: its motor's times its gear's ratio, and where another ratio
    comes between them, where that is highest."""
    p = physical_parameters(leg)
    return np.array([stall_torque(leg, joint, p) for joint in leg.joints], dtype=float) * largest_ratios(leg, p)


def standstill_torques(leg: Leg) -> np.ndarray:
    """What every joint's drive gives at standstill (n) [N m]: its stall torque, or less where motor or gear are capped."""
    highest = largest_ratios(leg, physical_parameters(leg))
    return np.minimum(stall_torques(leg), highest * [_least_cap(leg, joint) for joint in leg.joints])


def _least_cap(leg: Leg, joint: str) -> float:
    """The lowest cap on a joint's torque [N m]; infinite without one."""
    of_motor, of_gear = torque_cap(leg, joint, physical_parameters(leg)), leg.drive(joint, "gear", "torque_cap")[1]
    caps = (None if of_motor is None else leg.drive(joint, "gear", "ratio")[1] * of_motor, of_gear)
    return min((x for x in caps if x is not None), default=np.inf)


def weight(model: pin.Model) -> float:
    """Weight [N] of everything the model carries, in the model's own gravity."""
    return float(sum(i.mass for i in model.inertias) * np.linalg.norm(model.gravity.linear))


def time_scale(model: pin.Model, length: float) -> float:
    """sqrt(length / gravity) [s]: times of legs that differ in size alone are as these."""
    return float(np.sqrt(length / np.linalg.norm(model.gravity.linear)))


def force_range(model: pin.Model) -> float:
    """Ground force [N] by which excess is measured."""
    return FORCE_RANGE * weight(model)


def descent_range(leg: Leg) -> float:
    """Speed downwards [m/s] by which excess is measured."""
    return DESCENT_RANGE * Scale.of(leg).speed


def friction_needed(along: np.ndarray, up: np.ndarray, given: float | None, allowed: Any) -> float:
    """The coefficient of the narrowest friction cone around contact forces, ``along`` and ``up`` (k,) [N].

    given: the ground's coefficient, None where it grips without limit. Where its cone holds all of them but for ``allowed``
    [N, one number or (k,)], no more than it is needed: the ratio of two forces that are nearly nothing says nothing.
    """
    steepest = float((along / up).max(initial=0.0))
    kept = given is not None and bool(np.all(along - given * up <= allowed))
    return min(steepest, given) if kept and given is not None else steepest
