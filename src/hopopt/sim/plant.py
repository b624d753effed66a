"""The plant: the leg in Pinocchio's C++, its drives and encoders, the ground, and a controller at a fixed rate.

In stance the foot is pinned and the joints are the coordinates, so nothing drifts and nothing penetrates; in
flight the whole leg is free. The foot leaves when the ground would have to pull, and lands with a plastic impact.
Runge-Kutta steps of fourth order end at every control instant and at every event, which is located by shortening
the last step.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from hopopt.drivetrain.drives import Drive
from hopopt.errors import UsageError
from hopopt.leg.robot import BASE, Robot
from hopopt.leg.scales import Scale
from hopopt.sim.controller import Controller, Measurement
from hopopt.sim.encoder import Encoder
from hopopt.sim.ground.stops import Stops
from hopopt.sim.machine import Machine
from hopopt.sim.state import BOUNCE, SENSELESS, Command, State, Timing, Torque
from hopopt.sim.trace import Event, Trace, TraceWriter

LONGEST = 2.5e-4  # [s] of a step on the paper's leg, however slow the controller
EVENT = 1e-9  # [s] to which events are located
JUMP = 1e-8  # [s] before the end of a step within which the torque that follows may already hold
AHEAD = 1e-5  # [s] over which a foot let go must rise
RAN_AWAY = "the motion ran away"  # how a run ends whose figures mean nothing
PAST_APEX = "past the apex"  # how a run ends that was to end there
CHATTER = 40  # lift-offs within a bounce's time: more than every second control period has one
AT_STOPS = 8  # parts of a step where a joint touches its end stop: they are stiff


class Plant:
    """A leg that can be hopped, with its drives and the end stops of its joints."""

    def __init__(self, robot: Robot, drive: Drive, above_ground: Collection[str] | None = None, finer: int = 1):
        """above_ground: points of the leg that stop a run where they hit the ground; by default all joints. finer: parts into
        which every step is cut."""
        self.finer = finer
        self.above_ground = set(robot.leg.pivots if above_ground is None else above_ground) - {"foot"}
        self.robot, self.machine, self.drive, self.n = robot, Machine(robot), drive, len(robot.joints)
        self.stops = Stops.of(robot.leg)
        time = Scale.of(robot.leg).time
        self.bounce, self.fastest, self.longest = BOUNCE * time, SENSELESS / time, LONGEST * time

    # ---- equations of motion ---------------------------------------------------------------------------

    def stance_start(self, q_j: np.ndarray) -> State:
        """At rest with the foot on the ground at the origin, drives with states of their own holding the leg."""
        terms, states = self.machine.stance_terms(q_j, np.zeros(self.n)), self.drive.states
        own = np.array(states.at_rest(terms.joint_bias) if states else ())
        return State(terms.q, terms.v, contact=True, foot=0.0, drive=own)

    def _rates(self, s: State, y: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Time derivative of (q, v, work, the drives' states), with q and v of the joints only in stance."""
        m = self.n if s.contact else self.n + BASE
        q, v, own = y[:m], y[m : 2 * m], y[2 * m + len(s.work) :]
        w = v[m - self.n :]
        stop, accelerate = self.stops.torque(q[m - self.n :], w), self._accelerations(s, q, v)
        drive = self.drive.at(q[m - self.n :])
        motor, tau = drive.torque(w, command, own, lambda tau: accelerate(tau + stop)[m - self.n :])
        a = accelerate(tau + stop)
        rates = self.drive.rates(w, command, own, self.longest)
        at_drives = w if isinstance(drive, Drive) else drive.jacobian @ w
        given = motor @ at_drives
        lost = (motor - tau) @ w if isinstance(drive, Drive) else given - tau @ w
        return np.concatenate([v, a, [given, lost, -stop @ w, 0.0], rates])

    def _accelerations(self, s: State, q: np.ndarray, v: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """What joint torques make of the leg, q and v of the joints only in stance."""
        if s.contact:
            return self.machine.stance_terms(q, v).acceleration
        return lambda tau: self.machine.acceleration(q, v, tau, False)

    def step(self, s: State, torque: Torque, h: float) -> State:
        """A step of length h [s] without regard to events; in several parts where a joint meets its end stop, or gears rub hard."""
        parts = AT_STOPS if self.stops.near(s.q[BASE:], s.v[BASE:], h) else 1
        if not self.drive.lossless:
            command = torque(s.t, s.q[BASE:], s.v[BASE:])
            parts = max(parts, self.drive.at(s.q[BASE:]).parts(s.v[BASE:], command, h, s.drive))
        parts *= self.finer
        for _ in range(parts):
            s = self._runge_kutta(s, torque, h / parts)
        return s

    def _runge_kutta(self, s: State, torque: Torque, h: float) -> State:
        first = BASE if s.contact else 0
        m = len(s.q) - first
        y = np.concatenate([s.q[first:], s.v[first:], s.work, s.drive])

        def rates(t: float, y: np.ndarray) -> np.ndarray:
            return self._rates(s, y, torque(t, y[m - self.n : m], y[2 * m - self.n : 2 * m]))

        k1 = rates(s.t, y)
        k2 = rates(s.t + h / 2, y + h / 2 * k1)
        k3 = rates(s.t + h / 2, y + h / 2 * k2)
        k4 = rates(s.t + h, y + h * k3)
        return self._with(s, y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), s.t + h)

    def _with(self, s: State, y: np.ndarray, t: float) -> State:
        m = (len(y) - len(s.work) - len(s.drive)) // 2
        q, v, work, own = np.split(y, [m, 2 * m, 2 * m + len(s.work)])
        if s.contact:
            q, v = self.machine.on_guides(q, v, s.foot, s.q[0])
            terms = self.machine.stance_terms(q, v)
            q, v = terms.q + np.array([s.foot, *[0.0] * (self.n + 1)]), terms.v
        return replace(s, q=q, v=v, t=t, work=work, drive=own)

    def force(self, s: State, command: np.ndarray) -> np.ndarray:
        """Contact force (x, z) [N] on the foot under a command; nothing in flight."""
        return self.torques(s, command)[2]

    def torques(self, s: State, command: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What a command (n) leads to: torques (n) [N m] of the motors and of the joints, contact force (x, z) [N]."""
        q, v = s.q[BASE:], s.v[BASE:]
        stop, drive = self.stops.torque(q, v), self.drive.at(s.q[BASE:])
        if s.contact:
            terms = self.machine.stance_terms(q, v)
            motor, tau = drive.torque(v, command, s.drive, lambda tau: terms.acceleration(tau + stop))
            return motor, tau, terms.contact_force(tau + stop)
        accelerate = self._accelerations(s, s.q, s.v)
        return *drive.torque(v, command, s.drive, lambda tau: accelerate(tau + stop)[BASE:]), np.zeros(BASE)

    def rise(self, s: State) -> float:
        """Upward velocity [m/s] of the centre of mass."""
        return float(self.machine.com_velocity(s.q, s.v)[1])

    def _margin(self, s: State, torque: Torque) -> float:
        """Below zero where the contact must change: vertical force [N] in stance, height of a sinking foot [m].

        A foot that the ground would have to pull, but that would sink if it were let go (its own sideways grip
        presses it down), stays: it comes off where it would rise.
        """
        if s.contact:
            fx, fz = self.force(s, torque(s.t, s.q[BASE:], s.v[BASE:]))
            return fz if fz >= 0 else fz + max(0.0, self._pressed_by_grip(s) * fx)
        position, velocity = self.machine.foot_motion(s.q, s.v)
        return position[1] if velocity[1] < 0 else max(position[1], 0.0)

    def _pressed_by_grip(self, s: State) -> float:
        """Upward acceleration of a free foot by a sideways force, over that by the same force upwards."""
        free = [k for k in range(len(s.q)) if k not in self.machine.held]
        J = self.machine.foot_jacobian(s.q)[:, free]
        mobility = J @ np.linalg.solve(self.machine.mass_matrix(s.q)[np.ix_(free, free)], J.T)
        return mobility[1, 0] / mobility[1, 1]

    # ---- events ----------------------------------------------------------------------------------------

    def advance(self, s: State, torque: Torque, h: float) -> tuple[State, bool]:
        """A step of at most h, cut short where the contact has to ``change``; whether it has to.

        A foot that ``lets_go`` at once is the caller's to see to.
        """
        after = self.step(s, torque, h)
        if not after.sane(self.fastest) or self._margin(after, torque) >= 0:
            return after, False
        if (here := self._margin(s, torque)) < 0 and s.contact:
            return after, False
        begin = 0.0 if here > 0 else min(AHEAD, h)  # the foot may just have come off
        if not here > 0 and self._margin(self.step(s, torque, begin), torque) <= 0:
            return s, True
        part = brentq(lambda part: self._margin(self.step(s, torque, part), torque), begin, h, xtol=EVENT * 1e-4)
        cut = self.step(s, torque, float(part))  # type: ignore[arg-type]
        return (after, False) if s.contact and not self._comes_off(cut, torque) else (cut, True)

    def noted_step(self, s: State, torque: Torque, h: float, writer: TraceWriter) -> tuple[State, bool, bool]:
        """``advance`` from a state that is noted, unless the foot lets go there: whether the contact has to change, and whether the
        state was noted."""
        if self.lets_go(s, torque):
            return s, True, False
        self._note(writer, s, torque)
        return *self.advance(s, torque, h), True

    def lets_go(self, s: State, torque: Torque) -> bool:
        """Whether a foot on the ground leaves it at once under this torque."""
        return s.contact and self._margin(s, torque) < 0 and self._comes_off(s, torque)

    def _comes_off(self, s: State, torque: Torque) -> bool:
        free = self.step(replace(s, contact=False), torque, AHEAD)
        return bool(self.machine.foot_motion(free.q, free.v)[0][1] > 0)

    def change(self, s: State, torque: Torque) -> tuple[State, Event | None]:
        """Let go of the foot; or land it, with a plastic impact, and note the energy that takes; whatever the torque."""
        if s.contact:
            return replace(s, contact=False).lifted(), Event("lift-off", s.t, 0.0)
        v = self.machine.touch_down(s.q, s.v)
        lost = self.machine.energy(s.q, s.v) - self.machine.energy(s.q, v)
        x, z = self.machine.foot_motion(s.q, v)[0]
        q = s.q - np.array([0.0, z, *[0.0] * self.n])
        return replace(s, q=q, v=v, contact=True, foot=x).landed(self.bounce), Event("touchdown", s.t, lost)

    # ---- the run ---------------------------------------------------------------------------------------

    def run(
        self,
        start: np.ndarray | State,
        controller: Controller,
        duration: float,
        *,
        timing: Timing | None = None,
        encoder: Encoder | None = None,
        landings: int = 0,
        falling: float = np.inf,
        breaks: Sequence[float] = (),
    ) -> Trace:
        """Hop from rest at joint angles ``start`` (n) [rad], or from any state at time zero.

        The run ends after ``duration`` [s], after a number of landings, or when the leg falls in flight at the speed
        ``falling`` [m/s]. breaks [s] are instants at which a controller without hold jumps: steps end there.
        """
        timing = timing or Timing()
        encoder = encoder or Encoder(0, 1, timing.period)
        s = start if isinstance(start, State) else self.stance_start(start)
        writer, outcome, torque = TraceWriter(self.robot), "the time was up", None
        pending: list[tuple[float, Command]] = [(0.0, lambda s: lambda t, q, v: np.zeros(self.n))]
        for k in range(max(1, round(duration / timing.period))):
            begin, end = k * timing.period, (k + 1) * timing.period
            s = s if s.t == begin else replace(s, t=begin)
            pending.append((begin + timing.delay, self._command(controller, s, encoder, timing)))
            pending = pending[max(i for i, (at, _) in enumerate(pending) if at <= begin + EVENT) :]
            cuts = [t for t in (*(at for at, _ in pending), *breaks) if begin + EVENT < t < end - EVENT]
            for until in (*sorted(cuts), end):
                command = next(c for at, c in reversed(pending) if at <= s.t + EVENT)
                s, torque = self._until(s, command, torque, until, writer)
            outcome = self.fault(s) or outcome
            if landings and s.landings >= landings:
                outcome = f"landing {landings}"
            elif falling < np.inf and not s.contact and self.rise(s) < -falling:
                outcome = PAST_APEX
            if outcome != "the time was up":
                break
        assert torque is not None
        if s.sane(self.fastest):
            self._note(writer, s, torque)
        return writer.trace(outcome)

    def _command(self, controller: Controller, s: State, encoder: Encoder, timing: Timing) -> Command:
        """What the controller asks for from now on: a constant, or without hold its answer at every moment."""

        def measured(s: State, t: float, q: np.ndarray, v: np.ndarray) -> Measurement:
            return Measurement(t, q, v, s.contact, t - s.since, s.landings)

        if not timing.hold:
            return lambda s: lambda t, q, v: controller.torque(measured(s, t, q, v))
        asked = np.asarray(controller.torque(measured(s, s.t, *encoder.read(s.q[BASE:], s.v[BASE:]))), dtype=float)
        if asked.shape != (self.n,) or not np.isfinite(asked).all():
            raise UsageError(f"the strategy asks for torques {asked} at {s.t:.4f} s: it takes {self.n} finite numbers")
        return lambda s: lambda t, q, v: asked

    def _until(
        self, s: State, command: Command, before: Torque | None, end: float, writer: TraceWriter
    ) -> tuple[State, Torque]:
        """Advance to ``end`` through whatever contact changes come; the state and the torque that led there.

        before is the torque that led here. Samples are taken where the contact has settled: a foot that comes off
        because the torque jumps leaves with the torque before.
        """

        def from_here(s: State) -> Torque:
            torque = command(s)
            return lambda t, q, v: torque(min(t, end - JUMP), q, v)

        torque = from_here(s)
        while end - s.t > EVENT and s.sane(self.fastest) and not s.halted:
            s, changes, noted = self.noted_step(s, torque, min(end - s.t, self.longest), writer)
            before = torque if noted else before
            if changes:
                if before:
                    self._note(writer, s, before)
                s, event = self.change(s, torque)
                if event:
                    writer.events.append(event)
                if chatters(writer.events, self.bounce):
                    s = replace(s, halted="the contact chatters")
                torque, before = from_here(s), None
        return s if s.halted or s.t == end else replace(s, t=end), torque

    def _note(self, writer: TraceWriter, s: State, torque: Torque) -> None:
        command = torque(s.t, s.q[BASE:], s.v[BASE:])
        writer.rows.append((s.t, s.q, s.v, command, *self.torques(s, command), s.contact, s.work))

    def fault(self, s: State) -> str:
        """Why the simulation cannot go on, or nothing."""
        if s.halted or not s.sane(self.fastest):
            return s.halted or RAN_AWAY
        lowest, height = self.lowest_watched(s)
        return f"the {lowest} hit the ground" if height < 0 else ""

    def lowest_watched(self, s: State) -> tuple[str, float]:
        """What is lowest of all that must not come to the ground, and its height [m]; infinite if there is none."""
        heights = [(z, name) for name, (_, z) in self.machine.points(s.q).items() if name in self.above_ground]
        height, name = min(heights, default=(np.inf, ""))
        return name.partition(" ")[0], float(height)


def chatters(events: Sequence[Event], within: float) -> bool:
    """Whether the foot has left the ground CHATTER times within the last so many seconds."""
    recent = [e for e in events[-4 * CHATTER :] if e.kind == "lift-off" and e.t >= events[-1].t - within]
    return len(recent) >= CHATTER
