"""A strategy on the simulated leg: the plant that the problem file describes, and what the run amounts to."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hopopt.control.reference import PlanReference
from hopopt.control.setting import Setting
from hopopt.control.strategies import Strategy
from hopopt.design import Design, refuse_periodic
from hopopt.errors import UsageError
from hopopt.leg.actuator import operating_region
from hopopt.leg.kinematics import loop_axes, start_angles
from hopopt.leg.robot import BASE, build_robot
from hopopt.sim import mujoco
from hopopt.sim.controller import Controller, Measurement
from hopopt.sim.drive import Drive, Encoder, Gear
from hopopt.sim.hop_metrics import HopFigures, beyond_limits
from hopopt.sim.plant import Plant
from hopopt.sim.state import Timing
from hopopt.sim.trace import Trace

LONGEST = 1.0  # [s] of a hop beyond its longest stance
PAST_APEX = 1.0  # [m/s] of fall, 5 cm below the apex: no leg rises as fast any more


@dataclass(frozen=True)
class Run:
    """One simulated run: the strategy, what happened, and the figures of its first hop."""

    strategy: Strategy
    design: Design
    trace: Trace

    @cached_property
    def figures(self) -> HopFigures:
        return HopFigures(self.design, self.trace)


def make_plant(design: Design, torque_gain: np.ndarray | None = None) -> Plant:
    """The leg of a problem with its drives, gear losses and encoders; torque_gain as in ``Drive``.

    Raises UsageError for a leg that closes a loop with its guides when the foot stands, and for a periodic hop.
    """
    refuse_periodic(design, "a simulation of controllers")
    if loop_axes(design.leg):
        why = "stands on a vertical slider" if "x" not in design.leg.guides else "leaves the x-z plane"
        raise UsageError(
            f"{design.name}: this leg {why}; hopopt solves and verifies its hop, but simulates only legs on x and z "
            'guides that move in the x-z plane: simulate it with leg.guides = ["x", "z"]'
        )
    robot, s = build_robot(design.leg), design.simulation
    regions = [operating_region(design.leg, joint, robot.parameters) for joint in robot.joints]
    own = [design.leg.drive(joint, "gear", "efficiency")[1] for joint in robot.joints]
    efficiency = np.array([s.gear_efficiency if e is None else e for e in own])
    return Plant(
        robot, Drive(regions, Gear(efficiency, s.gear_friction, s.gear_damping), torque_gain), design.hop.above_ground
    )


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
) -> Run:
    """Hop a leg with a strategy, ``hops`` times, from the problem's start.

    past_apex: end well past the first apex, where the clearance is decided, not at the landing. plan is what
    ``track`` follows; plant is the true leg, if it differs from the one the strategy believes in;
    options are settings of the strategy, unless a fresh controller is given. Raises UsageError if the strategy
    cannot be made.
    """
    period, truth = 1 / design.simulation.control_rate, plant or design
    controller, s = controller or make_controller(design, strategy, plan, options), truth.simulation
    trace = make_plant(truth, torque_gain).run(
        start_angles(design),
        controller,
        hops * (design.hop.stance_duration[1] + LONGEST),
        timing=Timing(period, s.torque_delay),
        encoder=Encoder(s.encoder_bits, s.speed_window, period),
        landings=hops,
        falling=PAST_APEX if past_apex else np.inf,
    )
    return Run(strategy, truth, trace)


def clearance_in_mujoco(
    design: Design, strategy: Strategy, plan: PlanReference | None, options: Mapping[str, Any] | None = None
) -> float:
    """The clearance [m] of a strategy's first hop in MuJoCo: the same controller, rate, encoders and drives on another
    party's dynamics, ground and integrator (its joints have no end stops). Raises MissingExtraError without MuJoCo."""
    plant, period, s = make_plant(design), 1 / design.simulation.control_rate, design.simulation
    controller = make_controller(design, strategy, plan, options)
    encoder, since = Encoder(s.encoder_bits, s.speed_window, period), [0.0, True]

    def torque(t: float, q: np.ndarray, v: np.ndarray, contact: bool) -> np.ndarray:
        if contact != since[1]:
            since[:] = [t, contact]
        measured = encoder.read(q[BASE:], v[BASE:])
        asked = controller.torque(Measurement(t, *measured, contact, t - since[0], 0))
        return plant.drive.torque(v[BASE:], asked)[1]

    start = plant.stance_start(start_angles(design))
    duration = design.hop.stance_duration[1] + LONGEST
    run = mujoco.simulate(plant.robot, start.q, start.v, torque, duration, control_period=period)
    stopped = np.logical_or.accumulate(~run.contact & beyond_limits(design, run.q[:, BASE:]))
    allowed = ~run.contact & ~stopped & (np.abs(run.foot[:, 0] - run.q[:, 0]) <= design.hop.foot_window)
    return float(run.lowest[allowed].max(initial=0.0))
