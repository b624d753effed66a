"""What a simulation did: its samples, its events, and the figures that are read off them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hopopt.leg.robot import Robot
from hopopt.sim.machine import Machine

SAME_INSTANT = 1e-8  # [s] samples and events nearer than this are at one instant


@dataclass(frozen=True)
class Event:
    """What happened at one instant.

    kind: a lift-off, touchdown, slip, stick or jam of the foot, or "<joint> strikes"
    t: since the run began [s]
    lost: energy that an impact took [J]
    """

    kind: str
    t: float
    lost: float


@dataclass(frozen=True)
class Trace:
    """A simulated run at k instants. A change of contact has a sample just before it and one just after, if it lasts.

    robot: the leg
    t: since the run began (k,) [s]
    q: place of the body x, z [m], then joint angles [rad], (k, 2 + n)
    v: velocity of the body [m/s], then joint speeds [rad/s], (k, 2 + n)
    command: joint torques that the controller asks for (k, n) [N m]
    motor: the drives' torques behind their gears after their limits (k, n) [N m]
    tau: joint torques after the gears' losses (k, n) [N m]
    f: contact force x, z (k, 2) [N]
    contact: whether the foot is on the ground (k,)
    work: done by the motors, lost in the gears, taken by end stops, lost in friction at the foot so far (k, 4) [J]
    events: lift-offs, touchdowns, slips and strikes, in order
    outcome: how the run ended, in words
    """

    robot: Robot
    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    command: np.ndarray
    motor: np.ndarray
    tau: np.ndarray
    f: np.ndarray
    contact: np.ndarray
    work: np.ndarray
    events: Sequence[Event]
    outcome: str

    @cached_property
    def machine(self) -> Machine:
        return Machine(self.robot)

    @cached_property
    def points(self) -> dict[str, np.ndarray]:
        """name -> (k, 2) x, z [m] of every joint, "foot" and "com"."""
        return {**self.machine.paths(self.q), "com": self.machine.com_path(self.q)}

    @cached_property
    def com_v(self) -> np.ndarray:
        """Velocity of the centre of mass (k, 2) [m/s]."""
        return np.array([self.machine.com_velocity(q, v) for q, v in zip(self.q, self.v, strict=True)])

    @cached_property
    def lowest(self) -> np.ndarray:
        """Height of the leg's lowest point (k,) [m]."""
        return np.min([self.points[name][:, 1] for name in self.robot.point_names], axis=0)

    @cached_property
    def w(self) -> np.ndarray:
        """Speeds of the drives behind their gears (k, n) [rad/s]."""
        return self.robot.drive_speeds(self.q, self.v)

    @cached_property
    def energy(self) -> np.ndarray:
        """Kinetic and potential energy (k,) [J]."""
        return np.array([self.machine.energy(q, v) for q, v in zip(self.q, self.v, strict=True)])

    def times_of(self, kind: str) -> list[float]:
        """When the foot lifted off, or landed [s]."""
        return [e.t for e in self.events if e.kind == kind]

    @property
    def energy_error(self) -> float:
        """Largest error of motors' work = gain in energy + losses, relative to the largest energy turned over."""
        spent = self.work[:, 0] - self.work[:, 1:].sum(axis=1) - (self.energy - self.energy[0])
        before, after = (
            self._impacts(self.t + gap) for gap in (-SAME_INSTANT, SAME_INSTANT)
        )  # both at an impact's own instant
        wrong = np.minimum(np.abs(spent - before), np.abs(spent - after))
        return float(wrong.max()) / max(float(np.abs(self.work[:, 0]).max()), float(np.ptp(self.energy)), 1e-9)

    def _impacts(self, t: np.ndarray) -> np.ndarray:
        """Energy [J] that impacts have taken up to times t."""
        so_far = np.cumsum([0.0, *(e.lost for e in self.events)])
        return so_far[np.searchsorted([e.t for e in self.events], t, side="right")]


class TraceWriter:
    """Collects what a run does: rows in the order of Trace's fields, and events."""

    def __init__(self, robot: Robot):
        self.robot = robot
        self.rows: list[tuple[Any, ...]] = []
        self.events: list[Event] = []

    def trace(self, outcome: str) -> Trace:
        """Everything noted, as arrays."""
        columns = [np.array(column) for column in zip(*self.rows, strict=True)]
        return Trace(self.robot, *columns, events=tuple(self.events), outcome=outcome)
