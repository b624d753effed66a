"""A counter-movement before the push: down along a smooth reference, then up to the stretched leg, both by PD, clamped.

The paper's strategies push from the start upwards. A leg with room below its start gains by going down first: the push is
longer, and so the same drives give more work. How deep is chosen on the believed leg, when the strategy is made: pushes from
several depths are computed along the plumb line, with the same law and the same clamp. Of the optimum nothing is known here.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from hopopt.control.flight.draw_up import MARGIN, LiftOff
from hopopt.control.paper_pd import Force
from hopopt.control.setting import Setting
from hopopt.errors import UsageError
from hopopt.leg.geometry.above import points_above_ground
from hopopt.leg.kinematics import foot_offset
from hopopt.leg.robot import BASE
from hopopt.leg.scales import Scale, weight
from hopopt.sim.controller import Measurement
from hopopt.sim.machine import StanceTerms

DEPTHS = 12  # that are tried, evenly from none to all the room there is
SINKING = (0.5, 0.8)  # shares of gravity at which the reference is accelerated downwards, and slowed down again
ENDS = (0.0, 0.5, 1.0, 2.0)  # shares of the weight below which the ground's force ends a push that is tried
DRAWN_UP = 3  # movements of each end that throw highest, of which flights are computed
STEP = 2e-3  # [s] on the paper's leg, of a computed push
IN_TIME = 0.95  # share of the longest stance, within which a computed push ends
LATEST = 0.98  # share of it after which any push ends: the plant is slower than what was computed
LIGHT = 2.0  # [N] on the paper's leg, below which the ground's force counts as gone: speeds are measured late
LAST = 1e-3  # share of the leg's reach that a computed push ends below the stretched leg
LOADED = 0.1  # share of the weight that stays on the foot on the way down
GRIP = 0.7  # share of the friction cone within which the ground's force is kept, on ideal ground of that of friction 1: speeds are coarse


@dataclass(frozen=True)
class Movement:
    """Down by ``depth`` [m] in ``duration`` [s], at rest at both ends, then up until the ground carries less than
    the share ``released`` of the weight."""

    depth: float
    duration: float
    released: float = 0.0

    def down(self, t: float) -> tuple[float, float, float]:
        """Height over the beginning [m], its rate [m/s] and its acceleration [m/s^2] at a time [s] from its beginning, before its end."""
        w = np.pi / self.duration
        return (
            -self.depth * float(1 - np.cos(w * t)) / 2,
            -self.depth * float(w * np.sin(w * t)) / 2,
            -self.depth * float(w**2 * np.cos(w * t)) / 2,
        )


@dataclass(frozen=True)
class Way:
    """A push as computed, at instants (k,): times t [s] from its beginning, height y [m] of the body and its rate [m/s], the ground's
    upward force ``load`` [N], and whether a joint is ``too_fast`` to be brought to rest before its limit."""

    t: np.ndarray
    y: np.ndarray
    rate: np.ndarray
    load: np.ndarray
    too_fast: np.ndarray


class CounterMovement(Force):
    """Down as ``movement`` says, then the paper's force control towards the stretched leg."""

    at_once = True

    def __init__(self, setting: Setting, **gains: Any):
        """gains: options on the paper's leg in place of the printed ones. UsageError where the problem allows no counter-movement."""
        super().__init__(setting, **gains)
        if not setting.design.hop.counter_movement:
            raise UsageError("hop.counter_movement is false: simulate force_tuck, or leave that entry out")
        self.design, self.pace = setting.design, STEP * Scale.of(self.leg).time
        self.watched = points_above_ground(setting.design)
        self.light, self.weight = LIGHT * Scale.of(self.leg).force, weight(setting.robot.model)
        self.grip = GRIP * (1.0 if self.design.contact.friction is None else self.design.contact.friction)
        self._ways: dict[float, Way] = {}
        self._heights: dict[bytes, float] = {}
        self.movement = self._best()

    def push(self, now: Measurement, s: StanceTerms) -> np.ndarray:
        """On the way down the body's height by PD on the reference; then -k_p (theta - theta_des) - k_d theta' at the knee."""
        since = now.t - (self.pushed or 0.0)
        if since >= self.movement.duration:
            return self._pushing(s, now.q, now.v)
        y, rate, rise = self.movement.down(since)
        k, d = self.options.plumb_k, self.options.plumb_d
        return self._held(s, now, self.lifted(s, rise + k * (self.lowest + y - s.q[1]) + d * (rate - s.v[1])))

    def over(self, now: Measurement, s: StanceTerms, tau: np.ndarray) -> bool:
        """Whether the ground carries too little, a joint could not be brought to rest before its limit any more, or time is up."""
        since = now.t - (self.pushed or 0.0)
        if since < self.movement.duration:
            return False
        late = since >= LATEST * self.design.hop.stance_duration[1]
        return late or self._over(s, self.drive.at(now.q).clamp(now.v, tau))

    def _held(self, s: StanceTerms, now: Measurement, tau: np.ndarray) -> np.ndarray:
        """Torques (n) [N m] as near tau as leaves the foot enough load, within its grip: a leg that sinks presses little."""
        tau = self.drive.at(now.q).clamp(now.v, tau)
        along, up = force = s.contact_force(tau)
        up = max(up, LOADED * self.weight)
        wanted = np.array([np.clip(along, -self.grip * up, self.grip * up), up])
        if (wanted == force).all():
            return tau
        by_each = np.array([s.contact_force(tau + joint) - force for joint in np.eye(2)]).T
        return tau + np.linalg.solve(by_each, wanted - force)

    def _pushing(self, s: StanceTerms, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Torques (n) [N m] towards the stretched leg, the body on the plumb line as far as the foot grips."""
        tau = self.upright(s, float((self.options.k_p * (self.stretched - q) - self.options.k_d * v)[1]))
        along, up = force = s.contact_force(self.drive.at(q).clamp(v, tau))
        if abs(along) <= self.grip * up or up <= 0:
            return tau
        edge = np.array([1.0, -np.sign(along) * self.grip])
        by_hip = s.contact_force(tau + np.array([1.0, 0.0])) - s.contact_force(tau)
        return self.drive.at(q).clamp(v, tau) - np.array([edge @ force / (edge @ by_hip), 0.0])

    def _over(self, s: StanceTerms, tau: np.ndarray) -> bool:
        """Whether a push with these torques (n) [N m] has to end; with a loaded foot only once the leg rises fast enough to hop."""
        least = max(self.light, self.movement.released * self.weight if self.rise > self.bounce / 2 else 0.0)
        return bool(s.contact_force(tau)[1] < least) or self.too_fast(s.q[BASE:], s.v[BASE:])

    def _best(self) -> Movement:
        """That from which the computed leg clears most in the time there is, of those that throw it highest. An end of the push counts
        by the least of these, for in the plant none is met exactly. Of equal movements the least deep."""
        shares = [(d, w) for d in np.linspace(0.0, self._room(), DEPTHS) for w in (SINKING if d else SINKING[:1])]
        sinks = [(float(d), float(np.pi * np.sqrt(d / (2 * w * self.two_mass.g)))) for d, w in shares]
        ends = []
        for released in ENDS:
            thrown = {movement: self._thrown(movement) for movement in (Movement(*sink, released) for sink in sinks)}
            highest = sorted(thrown, key=lambda movement: -self._rise(thrown[movement]))[:DRAWN_UP]
            ends.append({movement: self._cleared(thrown[movement]) for movement in highest})
        best = max(ends, key=lambda cleared: min(cleared.values()))
        return max(best, key=lambda movement: best[movement])

    def _rise(self, off: LiftOff) -> float:
        """How high the centre of mass comes [m]."""
        height = self.machine.points(self.machine.stance_terms(off.q, off.v).q)["com"][1]
        return float(height + max(off.rising, 0.0) ** 2 / (2 * self.two_mass.g))

    def _cleared(self, off: LiftOff) -> float:
        """How high the lowest point comes [m] as the leg is drawn up; the centre of mass, where it is not. Many pushes end alike."""
        if self.drawing_up is None:
            return self._rise(off)
        alike = off.q.tobytes() + off.v.tobytes()
        if alike not in self._heights:
            aim = self.drawing_up.aim(off)
            self._heights[alike] = aim.height if aim else 0.0
        return self._heights[alike]

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

    def _thrown(self, movement: Movement) -> LiftOff:
        """The leg after a push as computed from the bottom."""
        way = self._up_from(movement.depth)
        least = max(self.light, movement.released * self.weight)
        ends = (way.rate > 0) & ((way.load < least) | way.too_fast)
        ends |= way.t + movement.duration >= IN_TIME * self.design.hop.stance_duration[1]
        k = int(np.argmax(ends)) if ends.any() else -1
        s = self.machine.stance_terms(*self.with_rates(float(way.y[k]), float(way.rate[k])))
        return LiftOff(s.q[BASE:], s.v[BASE:], float(self.machine.com_velocity(s.q, s.v)[1]))

    def _up_from(self, depth: float) -> "Way":
        """The push from this depth [m] below the start, as computed: up to the stretched leg, as long as a stance may last at most, or until
        the ground would have to let go whatever the movement says."""
        if depth not in self._ways:
            self._ways[depth] = Way(*map(np.array, zip(*self._steps_up(depth), strict=True)))
        return self._ways[depth]

    def _steps_up(self, depth: float) -> Iterator[tuple[float, float, float, float, bool]]:
        """Instants of a push, as the fields of ``Way``."""
        stretched = float(-foot_offset(self.leg, self.stretched)[1])
        y, rate, t = self.lowest - depth, 0.0, 0.0
        while t < IN_TIME * self.design.hop.stance_duration[1] and y < (1 - LAST) * stretched:
            q, v = self.with_rates(y, rate)
            s = self.machine.stance_terms(q, v)
            tau = self.drive.at(q).clamp(v, self._pushing(s, q, v))
            a, load, too_fast = s.acceleration(tau), float(s.contact_force(tau)[1]), self.too_fast(q, v)
            yield t, y, rate, load, too_fast
            if rate > 0 and (load < self.light or too_fast):
                return
            rise = -float((s.jacobian @ a + s.drift)[1])
            y, rate, t = y + self.pace * (rate + self.pace * rise / 2), rate + self.pace * rise, t + self.pace
        yield t, y, rate, 0.0, True

    def _pushes(self, lasted: float) -> str:
        """What is done in a stance of so many seconds, in words."""
        m = self.movement
        return f"goes down {m.depth:.3f} m in {m.duration:.3f} s, then pushes {max(lasted - m.duration, 0.0):.3f} s: {lasted:.3f} s"
