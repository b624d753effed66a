"""A strategy on the simulated leg: the plant that the problem file describes, and what the run amounts to."""

from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from copy import deepcopy
from dataclasses import asdict, dataclass, field, is_dataclass, replace
from functools import cached_property
from itertools import count
from typing import Any

import numpy as np

from hopopt.control.paper_pd import PaperStrategy
from hopopt.control.reference import PlanReference
from hopopt.control.setting import Setting, gear_of
from hopopt.control.strategies import Strategy
from hopopt.control.tracking.track import Track
from hopopt.design import Design
from hopopt.drivetrain.drives import Drive
from hopopt.drivetrain.dynamics import added_states, refuse_series_springs
from hopopt.errors import HopoptError, UsageError
from hopopt.leg.geometry.above import points_above_ground
from hopopt.leg.kinematics import can_slip, planar, start_angles
from hopopt.leg.robot import BASE, build_robot
from hopopt.leg.scales import Scale, radians
from hopopt.sim import mujoco
from hopopt.sim.controller import Controller, Measurement
from hopopt.sim.encoder import Encoder
from hopopt.sim.ground.rough_ground import RoughGround
from hopopt.sim.hop_metrics import HopFigures, beyond_limits
from hopopt.sim.plant import RAN_AWAY, Plant
from hopopt.sim.state import BOUNCE, State, Timing
from hopopt.sim.trace import Trace

BALANCED = 1e-4  # of the energy turned over: a greater error is none of rounding, and 0.1 mm of a clearance of 1 m
FINER = (1, 4, 16)  # parts of every step, tried in turn until the energy balances
PARTS = 4  # of a control period, to which MuJoCo takes a delay
LONGEST = 1.0  # [s] on the paper's leg, of a hop beyond its longest stance
PAST_APEX = 1.0  # [m/s] of fall on the paper's leg, 5 cm below the apex: no leg rises as fast any more


@dataclass(frozen=True)
class Run:
    """One simulated run: the strategy, what happened, the controller that did it, and the figures of its first hop.

    strategy: what controlled it
    design: the true leg
    trace: states, torques, force and events over time
    controller: as it was when the run ended; None of a run that was read
    stated: of a run that was read, what its folder says of the controller: options, feedback_moves, overshoot_m, limited_by
    torque_gain: as in ``Drive``
    """

    strategy: Strategy
    design: Design
    trace: Trace
    controller: Controller | None
    stated: Mapping[str, Any] = field(default_factory=dict)
    torque_gain: np.ndarray | None = None

    def __repr__(self) -> str:
        return (
            f"<Run of {self.strategy.name} on {self.design.name}: {self.figures.clearance:.4f} m, {self.trace.outcome}>"
        )

    @property
    def gain(self) -> Any:
        """``torque_gain`` as a factor: 1 where it is as believed."""
        return 1.0 if self.torque_gain is None else np.asarray(self.torque_gain, dtype=float)

    @cached_property
    def figures(self) -> HopFigures:
        """Of the first hop: clearance [m] and all that is measured of it."""
        return HopFigures(self.design, self.trace, torque_gain=self.gain)

    @property
    def options(self) -> dict[str, Any]:
        """The settings it ran with, by name; those of a controller that keeps none are the strategy's."""
        if "options" in self.stated:
            return dict(self.stated["options"])
        own = getattr(self.controller, "options", None)
        return asdict(own) if is_dataclass(own) and not isinstance(own, type) else dict(self.strategy.options)

    @property
    def moves(self) -> float | None:
        """The most by which feedback moved a torque from one sample to the next, share of stall torque; None without a plan."""
        return self.controller.moves if isinstance(self.controller, Track) else self.stated.get("feedback_moves")

    @property
    def overshoot(self) -> float | None:
        """How much shorter the leg is at its clearance than the reference it follows in flight [m]; None without one."""
        if isinstance(self.controller, PaperStrategy):
            return self.controller.overshoot(self.figures)
        return self.stated.get("overshoot_m")

    @property
    def limited_by(self) -> str:
        """What held a hop of the paper's strategies down, in words; empty for others."""
        if isinstance(self.controller, PaperStrategy):
            return self.controller.limited_by(self.figures)
        return str(self.stated.get("limited_by", ""))


def make_plant(design: Design, torque_gain: np.ndarray | None = None, finer: int = 1) -> Plant:
    """The leg of a problem with its drives and gear losses, on ideal ground, or where the foot may slip.

    It may slip if the problem has contact.friction and ``can_slip``. torque_gain as in ``Drive``, finer as in ``Plant``.
    Compiled equations of motion move it where they can: not on a vertical slider, nor with drives that have states of their
    own. Raises UsageError for a leg that leaves the x-z plane, or has series springs.
    """
    refuse_series_springs(design.leg, "a simulation with a controller")
    if not planar(design.leg):
        raise UsageError(
            f"{design.name}: this leg leaves the x-z plane; hopopt solves and verifies its hop, but simulates only legs "
            "whose joints all turn about the y axis"
        )
    robot = build_robot(design.leg)
    drive = Drive.of(
        design.leg, robot.parameters, robot.rotors, gear_of(design), torque_gain=torque_gain,
        states=added_states(design.leg, robot.parameters), turning=robot.turning,
    )  # fmt: skip
    friction = design.contact.friction
    watched = points_above_ground(design)
    if not can_slip(design.leg) or (friction is None and drive.states):
        return Plant(robot, drive, watched, finer)
    return RoughGround(robot, drive, np.inf if friction is None else friction, watched, finer)


def make_controller(
    design: Design, strategy: Strategy, plan: PlanReference | None = None, options: Mapping[str, Any] | None = None
) -> Controller:
    """A fresh controller of a strategy for a problem."""
    return strategy.controller(Setting(design, 1 / design.simulation.control_rate, plan, options or {}))


def simulate(
    design: Design,
    strategy: Strategy,
    *,
    plan: PlanReference | None = None,
    plant: Design | None = None,
    torque_gain: np.ndarray | None = None,
    hops: int = 1,
    past_apex: bool = False,
    options: Mapping[str, Any] | None = None,
    controller: Controller | None = None,
    start: np.ndarray | State | None = None,
) -> Run:
    """Hop a leg with a strategy, ``hops`` times, at rest from the problem's start or joint angles ``start`` (n) [rad], or
    from any state.

    past_apex: end well past the first apex, where the clearance is decided, not at the landing. plan is what ``track`` follows; plant is the true leg, if it differs from the one the strategy believes in;
    options are settings of the strategy, unless a fresh controller is given. Raises UsageError if the strategy
    cannot be made. Where the energy does not balance it is simulated again in finer steps; HopoptError if it does not
    balance then either.
    """
    period, truth = 1 / design.simulation.control_rate, plant or design
    fresh, s = controller or make_controller(design, strategy, plan, options), truth.simulation
    spare, error = _copied(controller), np.inf
    for finer in FINER:
        if finer > FINER[0]:
            if controller is not None and spare is None:
                break
            fresh = _copied(spare) or make_controller(design, strategy, plan, options)
        trace = make_plant(truth, torque_gain, finer).run(
            start_angles(design) if start is None else start,
            fresh,
            hops * longest(design),
            timing=Timing(period, s.torque_delay),
            encoder=Encoder(s.encoder_bits, s.speed_window, period, s.speed_error, radians(design.leg)),
            landings=hops,
            falling=PAST_APEX * Scale.of(design.leg).time if past_apex else np.inf,
        )
        error = trace.energy_error
        if error <= BALANCED or trace.outcome == RAN_AWAY:
            return Run(strategy, truth, trace, fresh, torque_gain=torque_gain)
    raise HopoptError(
        f"{design.name}, strategy {strategy.name}: the simulation's energy balance is off by {error:.1e}, more than "
        f"{BALANCED:g} may be, in the finest steps that were tried: give less gear friction or softer gains"
    )


def longest(design: Design) -> float:
    """Time [s] after which a hop that has not landed is given up."""
    return design.hop.stance_duration[1] + LONGEST * Scale.of(design.leg).time


def _copied(controller: Controller | None) -> Controller | None:
    """As it is before a run, for another; None if it cannot be copied."""
    with suppress(TypeError, ValueError):
        return deepcopy(controller)
    return None


def clearance_in_mujoco(
    design: Design, strategy: Strategy, plan: PlanReference | None, options: Mapping[str, Any] | None = None
) -> float:
    """The clearance [m] of a strategy's first hop in MuJoCo: the same controller, rate, encoders, drives and friction on
    another party's dynamics, contact and integrator (its joints have no end stops). Raises MissingExtraError without MuJoCo."""
    start = make_plant(design).stance_start(start_angles(design))
    run = in_mujoco(design, make_controller(design, strategy, plan, options), start)
    stopped = np.logical_or.accumulate(~run.contact & beyond_limits(design, run.q[:, BASE:]))
    return highest_in(design, run, ~run.contact & ~stopped)


def in_mujoco(
    design: Design, controller: Controller, start: State, landings: int = 1, bounce: float = BOUNCE
) -> mujoco.MujocoTrace:
    """A controller's run in MuJoCo from a state to so many landings after flights of at least ``bounce`` [s, on the paper's leg]; its commands act
    later by the problem's delay, to a quarter of a control period."""
    plant, period, s = make_plant(design), 1 / design.simulation.control_rate, design.simulation
    if plant.drive.states:
        raise UsageError("drives with states of their own are not simulated in MuJoCo")
    encoder = Encoder(s.encoder_bits, s.speed_window, period, s.speed_error, radians(design.leg))
    late = s.torque_delay / period
    parts = next((n for n in range(1, PARTS) if abs(n * late - round(n * late)) < 1e-6), PARTS)
    now, asked = start, deque([np.zeros(plant.n)] * (1 + round(parts * late)), maxlen=1 + round(parts * late))
    instants, command, machine = count(), np.zeros(plant.n), plant.machine

    def torque(t: float, q: np.ndarray, v: np.ndarray, contact: bool) -> np.ndarray:
        nonlocal now, command
        if contact and not now.contact:  # a bounce is no hop: its stance goes on
            hopped = t - now.since >= plant.bounce
            now = replace(now, contact=True, since=t if hopped else now.before, landings=now.landings + hopped)
        elif now.contact and not contact:
            now = replace(now, contact=False, since=t, before=now.since)
        if next(instants) % parts == 0:
            measured = encoder.read(q[BASE:], v[BASE:])
            command = controller.torque(Measurement(t, *measured, contact, t - now.since, now.landings))
        asked.append(command)
        return plant.drive.at(q[BASE:]).torque(
            v[BASE:], asked[0], None, lambda tau: machine.acceleration(q, v, tau, contact)[BASE:]
        )[1]

    duration = landings * longest(design)
    return mujoco.simulate(
        plant.robot, start.q, start.v, torque, duration, control_period=period / parts, contact=start.contact,
        friction=design.contact.friction, landings=landings, bounce=bounce,
    )  # fmt: skip


def highest_in(design: Design, run: mujoco.MujocoTrace, allowed: np.ndarray) -> float:
    """Greatest height of the leg's lowest point [m] at the samples ``allowed`` (k,), the foot in its window; else 0."""
    allowed = allowed & (np.abs(run.foot[:, 0] - run.q[:, 0]) <= design.hop.foot_window)
    return float(run.lowest[allowed].max(initial=0.0))
