"""The plant: the leg in Pinocchio's C++, its drives and encoders, the ground, and a controller at a fixed rate.

In stance the foot is pinned and the joints are the coordinates, so nothing drifts and nothing penetrates; in
flight the whole leg is free. The foot leaves when the ground would have to pull, and lands with a plastic impact.
Fixed Runge-Kutta steps of fourth order end at every control instant and at every event, which is located by
shortening the last step.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin
from scipy.optimize import brentq

from hopopt.leg.robot import BASE, Robot
from hopopt.sim.drive import Drive, Encoder, Stops
from hopopt.sim.machine import Machine
from hopopt.sim.measurement import Controller, Measurement
from hopopt.sim.trace import Event, Trace

EVENT = 1e-9  # [s] to which events are located
BOUNCE = 0.02  # [s] a foot off the ground for less has not hopped: its stance goes on
AT_STOPS = 8  # parts of a step where a joint touches its end stop: they are stiff
SENSELESS = 1e3  # [rad/s] beyond this the simulation has broken down


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
    """Where the leg is: q, v (BASE + n); on the ground the foot rests at (foot, 0); in this phase since ``since``,
    in the one before it since ``before`` [s]."""

    q: np.ndarray
    v: np.ndarray
    contact: bool
    foot: float
    t: float = 0.0
    since: float = 0.0
    before: float = 0.0
    landings: int = 0
    work: np.ndarray = field(default_factory=lambda: np.zeros(3))  # of the motors, lost in gears, taken by stops [J]


Torque = Callable[[float, np.ndarray, np.ndarray], np.ndarray]  # (t, q_j, v_j) -> command


class Plant:
    """A leg that can be hopped, with its drives and the end stops of its joints."""

    def __init__(self, robot: Robot, drive: Drive):
        self.robot, self.machine, self.drive, self.n = robot, Machine(robot), drive, len(robot.joints)
        joints = [robot.leg.joint[name] for name in robot.joints]
        self.stops = Stops(np.array([j.lower for j in joints]), np.array([j.upper for j in joints]))

    # ---- equations of motion ---------------------------------------------------------------------------

    def stance_start(self, q_j: np.ndarray) -> State:
        """At rest with the foot on the ground at the origin."""
        terms = self.machine.stance_terms(q_j, np.zeros(self.n))
        return State(terms.q, terms.v, contact=True, foot=0.0)

    def _rates(self, s: State, y: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Time derivative of (q, v, work), with q and v of the joints only in stance."""
        m = self.n if s.contact else self.n + BASE
        q, v = y[:m], y[m : 2 * m]
        w = v[m - self.n :]
        motor, tau = self.drive.torque(w, command)
        stop = self.stops.torque(q[m - self.n :], w)
        if s.contact:
            a = self.machine.stance_terms(q, v).acceleration(tau + stop)
        else:
            a = pin.aba(self.machine.model, self.machine.data, q, v, np.concatenate([np.zeros(BASE), tau + stop]))
        return np.concatenate([v, a, [motor @ w, (motor - tau) @ w, -stop @ w]])

    def step(self, s: State, torque: Torque, h: float) -> State:
        """A step of length h [s] without regard to events; in several parts where a joint meets its end stop."""
        parts = AT_STOPS if self.stops.near(s.q[BASE:], s.v[BASE:], h) else 1
        for _ in range(parts):
            s = self._runge_kutta(s, torque, h / parts)
        return s

    def _runge_kutta(self, s: State, torque: Torque, h: float) -> State:
        first = BASE if s.contact else 0
        m = len(s.q) - first
        y = np.concatenate([s.q[first:], s.v[first:], s.work])

        def rates(t: float, y: np.ndarray) -> np.ndarray:
            return self._rates(s, y, torque(t, y[m - self.n : m], y[2 * m - self.n : 2 * m]))

        k1 = rates(s.t, y)
        k2 = rates(s.t + h / 2, y + h / 2 * k1)
        k3 = rates(s.t + h / 2, y + h / 2 * k2)
        k4 = rates(s.t + h, y + h * k3)
        return self._with(s, y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), s.t + h)

    def _with(self, s: State, y: np.ndarray, t: float) -> State:
        m = (len(y) - len(s.work)) // 2
        q, v, work = y[:m], y[m : 2 * m], y[2 * m :]
        if s.contact:
            terms = self.machine.stance_terms(q, v)
            q, v = terms.q + np.array([s.foot, *[0.0] * (self.n + 1)]), terms.v
        return replace(s, q=q, v=v, t=t, work=work)

    def force(self, s: State, command: np.ndarray) -> np.ndarray:
        """Contact force (x, z) [N] on the foot under a command; nothing in flight."""
        if not s.contact:
            return np.zeros(BASE)
        q, v = s.q[BASE:], s.v[BASE:]
        terms = self.machine.stance_terms(q, v)
        return terms.force(terms.acceleration(self.drive.torque(v, command)[1] + self.stops.torque(q, v)))

    def _margin(self, s: State, torque: Torque) -> float:
        """Below zero where the contact must change: vertical force [N] in stance, height of a sinking foot [m]."""
        if s.contact:
            return self.force(s, torque(s.t, s.q[BASE:], s.v[BASE:]))[1]
        position, velocity = self.machine.foot_motion(s.q, s.v)
        return position[1] if velocity[1] < 0 else max(position[1], 0.0)

    # ---- events ----------------------------------------------------------------------------------------

    def advance(self, s: State, torque: Torque, h: float) -> tuple[State, Event | None]:
        """A step of at most h, cut short where the contact changes; the event, if there was one.

        Where the ground would have to pull, but the foot let go would not be off the ground after the step (it
        is pressed down by its own sideways grip), it stays.
        """
        if s.contact and self._margin(s, torque) < 0:
            return (self.step(s, torque, h), None) if self._stays(s, torque, h) else self._let_go(s)
        after = self.step(s, torque, h)
        if self._margin(after, torque) >= 0:
            return after, None
        if self._margin(s, torque) > 0:
            part = brentq(lambda part: self._margin(self.step(s, torque, part), torque), 0.0, h, xtol=EVENT)
            s = self.step(s, torque, float(part))  # type: ignore[arg-type]
        if not s.contact:
            return self._land(s)
        return (after, None) if self._stays(s, torque, h) else self._let_go(s)

    def _stays(self, s: State, torque: Torque, h: float) -> bool:
        free = self.step(self._let_go(s)[0], torque, h)
        return bool(self.machine.foot_motion(free.q, free.v)[0][1] <= 0)

    def _let_go(self, s: State) -> tuple[State, Event]:
        return replace(s, contact=False, since=s.t, before=s.since), Event("lift-off", s.t, 0.0)

    def _land(self, s: State) -> tuple[State, Event]:
        """Plastic impact; the energy it takes is noted."""
        v = self.machine.touch_down(s.q, s.v)
        lost = self.machine.energy(s.q, s.v) - self.machine.energy(s.q, v)
        x, z = self.machine.foot_motion(s.q, v)[0]
        q = s.q - np.array([0.0, z, *[0.0] * self.n])
        landed = replace(s, q=q, v=v, contact=True, foot=x)
        if s.t - s.since < BOUNCE:
            return replace(landed, since=s.before), Event("touchdown", s.t, lost)
        return replace(landed, since=s.t, landings=s.landings + 1), Event("touchdown", s.t, lost)

    # ---- the run ---------------------------------------------------------------------------------------

    def run(
        self,
        start: np.ndarray,
        controller: Controller,
        duration: float,
        *,
        timing: Timing | None = None,
        encoder: Encoder | None = None,
        landings: int = 0,
        breaks: Sequence[float] = (),
    ) -> Trace:
        """Hop from rest at joint angles ``start`` (n) [rad], for ``duration`` [s] or up to a number of landings.

        breaks [s] are instants at which a controller without hold jumps: steps end there.
        """
        timing = timing or Timing()
        encoder = encoder or Encoder(0, 1, timing.period)
        s, writer, outcome = self.stance_start(start), TraceWriter(self), "the time was up"
        pending: list[tuple[float, Torque]] = [(0.0, lambda t, q, v: np.zeros(self.n))]
        for k in range(max(1, round(duration / timing.period))):
            begin, end = k * timing.period, (k + 1) * timing.period
            s = replace(s, t=begin)
            pending.append((begin + timing.delay, self._command(controller, s, encoder, timing)))
            pending = pending[max(i for i, (at, _) in enumerate(pending) if at <= begin + EVENT) :]
            cuts = [t for t in (*(at for at, _ in pending), *breaks) if begin + EVENT < t < end - EVENT]
            for until in (*sorted(cuts), end):
                torque = next(f for at, f in reversed(pending) if at <= s.t + EVENT)
                s = self._until(s, torque, until, writer)
            outcome = self._fault(s) or (f"landing {landings}" if landings and s.landings >= landings else outcome)
            if outcome != "the time was up":
                break
        writer.sample(s, torque)
        return writer.trace(outcome)

    def _command(self, controller: Controller, s: State, encoder: Encoder, timing: Timing) -> Torque:
        """What the controller asks for from now on: a constant, or without hold its answer at every moment."""

        def measured(q: np.ndarray, v: np.ndarray, t: float) -> Measurement:
            return Measurement(t, q, v, s.contact, t - s.since, s.landings)

        if not timing.hold:
            return lambda t, q, v: controller.torque(measured(q, v, t))
        asked = np.asarray(controller.torque(measured(*encoder.read(s.q[BASE:], s.v[BASE:]), s.t)), dtype=float)
        return lambda t, q, v: asked

    def _until(self, s: State, torque: Torque, end: float, writer: "TraceWriter") -> State:
        """Advance to ``end`` through whatever contact changes come."""
        writer.sample(s, torque)
        while end - s.t > EVENT:
            s, event = self.advance(s, torque, end - s.t)
            if event:
                writer.event(event)
                writer.sample(s, torque)
        return replace(s, t=end)

    def _fault(self, s: State) -> str:
        """Why the simulation cannot go on, or nothing."""
        if not np.abs(s.v).max() < SENSELESS:
            return "the motion ran away"
        heights = {name: z for name, (_, z) in self.machine.points(s.q).items() if name not in ("foot", "com")}
        lowest = min(heights, key=lambda name: heights[name])
        return f"the {lowest} hit the ground" if heights[lowest] < 0 else ""


class TraceWriter:
    """Collects what a run does."""

    def __init__(self, plant: Plant):
        self.plant, self.rows, self.events = plant, [], []  # type: ignore[var-annotated]

    def sample(self, s: State, torque: Torque) -> None:
        """Note one instant."""
        command = torque(s.t, s.q[BASE:], s.v[BASE:])
        motor, tau = self.plant.drive.torque(s.v[BASE:], command)
        self.rows.append((s.t, s.q, s.v, command, motor, tau, self.plant.force(s, command), s.contact, s.work))

    def event(self, event: Event) -> None:
        """Note a change of contact."""
        self.events.append(event)

    def trace(self, outcome: str) -> Trace:
        """Everything noted, as arrays."""
        columns = [np.array(column) for column in zip(*self.rows, strict=True)]
        return Trace(self.plant.robot, *columns, events=tuple(self.events), outcome=outcome)
