"""The plant's state, and how often a controller is asked."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

SENSELESS = 1e3  # [rad/s, m/s] on the paper's leg: beyond this the simulation has broken down

ACCOUNTS = (
    4  # of work [J]: by the motors; lost in the gears, taken by the joints' end stops, lost in friction at the foot
)

BOUNCE = 0.02  # [s] on the paper's leg: a foot off the ground for less has not hopped, its stance goes on


@dataclass(frozen=True)
class Timing:
    """period [s] between two calls of the controller, the torque held in between; delay [s] before a command acts.

    With ``hold`` False the controller is asked at every stage of every step instead: perfect, and only for plans.
    """

    period: float = 1 / 4000
    delay: float = 0.0
    hold: bool = True


@dataclass(frozen=True)
class State:
    """Where the leg is: q, v (BASE + n); on the ground the foot is at (foot, 0), or slips (+1 forward, -1 backward);
    in this phase since ``since``, in the one before it since ``before`` [s]; drive: states of the drives (m); halted: why the run must end here."""

    q: np.ndarray
    v: np.ndarray
    contact: bool
    foot: float
    t: float = 0.0
    since: float = 0.0
    before: float = 0.0
    landings: int = 0
    work: np.ndarray = field(default_factory=lambda: np.zeros(ACCOUNTS))
    drive: np.ndarray = field(default_factory=lambda: np.zeros(0))
    slip: int = 0
    halted: str = ""

    def sane(self, fastest: float) -> bool:
        """Whether all speeds are below the fastest [rad/s, m/s], not those of a simulation that has broken down."""
        return all(-fastest < speed < fastest for speed in self.v.tolist())

    def lifted(self) -> "State":
        """In the phase that begins with a lift-off here."""
        return replace(self, since=self.t, before=self.since)

    def landed(self, bounce: float) -> "State":
        """In the phase that a landing here begins; in the one before the flight if that took less than a bounce [s]."""
        if self.t - self.since < bounce:
            return replace(self, since=self.before)
        return replace(self, since=self.t, landings=self.landings + 1)


Torque = Callable[[float, np.ndarray, np.ndarray], np.ndarray]  # (t, q_j, v_j) -> command
Command = Callable[[State], Torque]  # what is asked for from a state on
