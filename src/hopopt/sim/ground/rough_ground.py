"""The plant on ground with friction: the foot may slip, and nothing may strike the ground unseen."""

from collections.abc import Collection
from dataclasses import replace
from typing import Any

import numpy as np

from hopopt.compiled.kernel import argument
from hopopt.drivetrain.drives import Drive
from hopopt.errors import UsageError
from hopopt.leg.robot import Robot
from hopopt.sim.ground import contact
from hopopt.sim.ground.planar import lowest, planar_leg, watched_points
from hopopt.sim.plant import RAN_AWAY, Plant
from hopopt.sim.state import State, Torque
from hopopt.sim.trace import Event, TraceWriter

HAPPENINGS = {
    contact.LIFTS: "lift-off",
    contact.LANDS: "touchdown",
    contact.SLIPS: "slip",
    contact.STICKS: "stick",
    contact.JAMS: "jam",
}


class RoughGround(Plant):
    """A leg on x and z guides, in their plane, on ground with a friction coefficient (Coulomb).

    Torques are held over a step: a controller without hold is asked where each begins.
    """

    def __init__(
        self,
        robot: Robot,
        drive: Drive,
        friction: float,
        above_ground: Collection[str] | None = None,
        finer: int = 1,
    ):
        """friction: coefficient, infinite for ideal ground; the others as for ``Plant``. UsageError for other legs."""
        if drive.states:
            raise UsageError(
                "drives with states of their own are simulated on ideal ground only: leave out contact.friction"
            )
        super().__init__(robot, drive, above_ground, finer)
        self.friction = friction
        self.ideal = friction == np.inf
        self._legs = argument(planar_leg(robot, drive, self.stops, self.above_ground, friction, finer))
        self._watched = watched_points(robot, self.above_ground)

    @property
    def leg(self) -> Any:
        """The leg as compiled functions take it (``planar_leg``)."""
        return self._legs[0]

    def step(self, s: State, torque: Torque, h: float) -> State:
        """A step of length h [s] without regard to events."""
        q, v, work = contact.step(self.leg, _mode(s), s.foot, s.q, s.v, s.work, self._held(s, torque), h)
        return replace(s, q=q, v=v, work=work, t=s.t + h)

    def torques(self, s: State, command: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What a command (n) leads to: torques (n) [N m] of the motors and of the joints, contact force (x, z) [N]."""
        *_, motor, tau, force = contact.noted_step(self._legs, _mode(s), s.foot, s.q, s.v, s.work, command, 0.0)
        return motor, tau, force

    def noted_step(self, s: State, torque: Torque, h: float, writer: TraceWriter) -> tuple[State, bool, bool]:
        """As ``Plant.noted_step``, in one call of a compiled function."""
        command = self._held(s, torque)
        held, q, v, work, lasted, ended, *given = contact.noted_step(
            self._legs, _mode(s), s.foot, s.q, s.v, s.work, command, h
        )
        if not held:
            return s, True, False
        writer.rows.append((s.t, s.q, s.v, command, *given, s.contact, s.work))
        return replace(s, q=q, v=v, work=work, t=s.t + lasted), bool(ended), True

    def lets_go(self, s: State, torque: Torque) -> bool:
        """Whether the foot cannot stay as it is under this torque: stuck, or slipping in its direction."""
        return bool(contact.holds(self.leg, _mode(s), s.q, s.v, self._held(s, torque)) < 0)

    def advance(self, s: State, torque: Torque, h: float) -> tuple[State, bool]:
        """A step of at most h [s], cut short where the contact changes or what is watched strikes the ground; whether it is."""
        command = self._held(s, torque)
        q, v, work, lasted, ended = contact.advance(self.leg, _mode(s), s.foot, s.q, s.v, s.work, command, h)
        return replace(s, q=q, v=v, work=work, t=s.t + lasted), bool(ended)

    def change(self, s: State, torque: Torque) -> tuple[State, Event | None]:
        """The state after a mode has ended, and what happened, with the energy an impact took; what strikes the
        ground ends the run."""
        q, v, mode, what, lost = contact.changed(self.leg, _mode(s), s.q, s.v, self._held(s, torque))
        if what == contact.STRIKES:
            struck = self.lowest_watched(s)[0]
            return replace(s, halted=f"the {struck} hit the ground"), Event(f"{struck} strikes", s.t, 0.0)
        foot = float(self.machine.foot_motion(q, v)[0][0])
        after = replace(
            s, q=q, v=v, contact=mode != contact.FLIGHT, slip=0 if mode == contact.FLIGHT else mode, foot=foot
        )
        if what == contact.LIFTS:
            after = after.lifted()
        elif what == contact.LANDS:
            after = after.landed(self.bounce)
        return after, Event(HAPPENINGS[what], s.t, lost) if what in HAPPENINGS else None

    def fault(self, s: State) -> str:
        """Why the simulation cannot go on, or nothing; on rough ground what strikes has been noticed at its instant."""
        return super().fault(s) if self.ideal else s.halted or ("" if s.sane(self.fastest) else RAN_AWAY)

    def lowest_watched(self, s: State) -> tuple[str, float]:
        """As ``Plant.lowest_watched``, compiled."""
        height, which = lowest(self._legs, s.q)
        return self._watched[which].partition(" ")[0] if self._watched else "", float(height)

    def _held(self, s: State, torque: Torque) -> np.ndarray:
        return np.asarray(torque(s.t, s.q[-self.n :], s.v[-self.n :]), dtype=float)


def _mode(s: State) -> int:
    return s.slip if s.contact else contact.FLIGHT
