"""A counter-movement before the push: down along a smooth reference, then up to the stretched leg, both by PD, clamped.

The paper's strategies push from the start upwards. A leg with room below its start gains by going down first: the push is
longer, and so the same drives give more work. How deep is chosen on the believed leg, when the strategy is made: pushes from
several depths are computed along the plumb line, with the same law and the same clamp. Of the optimum nothing is known here.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hopopt.control.draw_up import MARGIN
from hopopt.control.paper_pd import Force
from hopopt.control.setting import Setting
from hopopt.errors import UsageError
from hopopt.leg.geometry.above import points_above_ground
from hopopt.leg.kinematics import foot_offset
from hopopt.leg.scales import Scale
from hopopt.sim.controller import Measurement
from hopopt.sim.hop_metrics import HopFigures
from hopopt.sim.machine import StanceTerms

DEPTHS = 6  # that are tried, evenly from none to all the room there is
SINKING = 0.5  # share of gravity at which the reference is accelerated downwards, and slowed down again
STEP = 2e-3  # [s] on the paper's leg, of a computed push
IN_TIME = 0.95  # share of the longest stance, within which a computed push ends
LIGHT = 2.0  # [N] on the paper's leg, below which the ground's force counts as gone: speeds are measured late
LAST = 1e-3  # share of the leg's reach that a computed push ends below the stretched leg


@dataclass(frozen=True)
class Sink:
    """Down by ``depth`` [m] in ``duration`` [s], at rest at both ends, and then up."""

    depth: float
    duration: float

    def down(self, t: float) -> tuple[float, float, float]:
        """Height over the beginning [m], its rate [m/s] and its acceleration [m/s^2] at a time [s] from its beginning, before its end."""
        w = np.pi / self.duration
        return (
            -self.depth * float(1 - np.cos(w * t)) / 2,
            -self.depth * float(w * np.sin(w * t)) / 2,
            -self.depth * float(w**2 * np.cos(w * t)) / 2,
        )


class CounterMovement(Force):
    """Down as ``sink`` says, then the paper's force control towards the stretched leg."""

    def __init__(self, setting: Setting, **gains: Any):
        """gains: options on the paper's leg in place of the printed ones. UsageError where the problem allows no counter-movement."""
        super().__init__(setting, **gains)
        if not setting.design.hop.counter_movement:
            raise UsageError("hop.counter_movement is false: simulate force_tuck, or leave that entry out")
        self.design, self.pace = setting.design, STEP * Scale.of(self.leg).time
        self.stretched = self.angles(np.inf)
        self.watched = points_above_ground(setting.design)
        self.light = LIGHT * Scale.of(self.leg).force
        self.sink = self._best()

    def push(self, now: Measurement, s: StanceTerms) -> np.ndarray:
        """On the way down the body's height by PD on the reference; then -k_p (theta - theta_des) - k_d theta' at the knee."""
        since = now.t - (self.pushed or 0.0)
        if since < self.settled:
            self.aim = None
        if since >= self.sink.duration:
            return self._risen(now, s)
        y, rate, rise = self.sink.down(since)
        k, d = self.options.plumb_k, self.options.plumb_d
        return self.lifted(s, rise + k * (self.lowest + y - s.q[1]) + d * (rate - s.v[1]))

    def _risen(self, now: Measurement, s: StanceTerms) -> np.ndarray:
        """Torques (n) [N m] of the push; once the ground would have to pull on a leg that rises, those that draw it up."""
        tau = self.upright(s, self._knee(now.q, now.v))
        if self.aim is None and s.v[1] > 0 and s.contact_force(self.drive.at(now.q).clamp(now.v, tau))[1] < self.light:
            self.aim = self._aim(now)
        return self.drawing_up.torque(now.q, now.v, self.aim.pose) if self.drawing_up and self.aim else tau

    def _knee(self, q: np.ndarray, v: np.ndarray) -> float:
        """The knee's torque [N m] that is asked for towards the stretched leg (the paper's eq. 10)."""
        return float((self.options.k_p * (self.stretched - q) - self.options.k_d * v)[1])

    def _best(self) -> Sink:
        """That from which the computed push throws the body highest in the time there is; of equal ones the least deep."""
        depths = np.unique(np.linspace(0.0, self._room(), DEPTHS))
        times = np.pi * np.sqrt(depths / (2 * SINKING * self.two_mass.g))
        return max((Sink(float(d), float(t)) for d, t in zip(depths, times, strict=True)), key=self._thrown)

    def _room(self) -> float:
        """How far the leg may go down from the start on the plumb line [m]: joint limits, and heights above the ground."""
        depths = np.linspace(0.0, self.lowest, 100)
        for k, depth in enumerate(depths):
            q = self.angles(self.lowest - depth)
            near = np.minimum(q - self.lower, self.upper - q).min() < (MARGIN if k else 0.0)
            if near or not self._stands(q, self.lowest - depth):
                return float(depths[max(k - 1, 0)])
        return float(depths[-1])

    def _stands(self, q: np.ndarray, length: float) -> bool:
        """Whether the foot is that far below the first joint, and all high enough that is to stay above the ground."""
        x, z = foot_offset(self.leg, q)
        points = self.machine.points(self.machine.stance_terms(q, np.zeros(2)).q)
        low = min((points[point][1] for point in self.watched), default=np.inf)
        return abs(x) + abs(z + length) < LAST * length and low >= self.design.hop.least_height

    def _thrown(self, sink: Sink) -> float:
        """How high the centre of mass comes [m] after a push as computed from the bottom."""
        stretched = float(-foot_offset(self.leg, self.stretched)[1])
        y, rate, t = self.lowest - sink.depth, 0.0, sink.duration
        while t < IN_TIME * self.design.hop.stance_duration[1] and y < (1 - LAST) * stretched:
            q, v = self.with_rates(y, rate)
            s = self.machine.stance_terms(q, v)
            tau = self.drive.at(q).clamp(v, self.upright(s, self._knee(q, v)))
            a = s.acceleration(tau)
            if s.contact_force(tau)[1] < 0:
                break
            rise = -float((s.jacobian @ a + s.drift)[1])
            y, rate, t = y + self.pace * (rate + self.pace * rise / 2), rate + self.pace * rise, t + self.pace
        s = self.machine.stance_terms(*self.with_rates(y, rate))
        height, speed = self.machine.points(s.q)["com"][1], self.machine.com_velocity(s.q, s.v)[1]
        return float(height + max(speed, 0.0) ** 2 / (2 * self.two_mass.g))

    def limited_by(self, hop: HopFigures) -> str:
        """What held a hop down, in words; empty where there is none."""
        words = super().limited_by(hop)
        return words and f"goes down {self.sink.depth:.3f} m first; {words}"
