"""What drives with states of their own add to a phase: these states, and a command in place of the joint's acceleration."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise

import casadi as ca
import numpy as np

from hopopt.drivetrain.dynamics import added_states, refuse_series_springs
from hopopt.drivetrain.gear import Gear, gears_of, motor_torque
from hopopt.drivetrain.gear import lossy as lossy_gear
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.drivetrain.supply import power_drawn, sag, share_at
from hopopt.errors import UsageError
from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.robot import BASE, armatures
from hopopt.ocp.guesses.guess import Guess
from hopopt.ocp.guesses.motion import STANCE, MotionAt, MovingLeg
from hopopt.ocp.problem import BoundaryConstraint, Control, Ends, Instant, Phase, State, linkage

DRIVE, COMMAND = "drive", "command"  # the state and the control that are added: a torque, or the rate of one


def motor_torques(leg: MovingLeg, motion: MotionAt) -> Callable[[Instant], ca.SX]:
    """What the motors are asked for at an instant (n) [N m]: the drives' torques, with what their gears lose; or the commands
    to drives that have states of their own."""
    prompt = [k for k in range(leg.n) if k not in leg.drive_states.at]
    lossy = [k for k in prompt if lossy_gear(leg.leg, leg.leg.joints[k])]

    def torques(s: Instant) -> ca.SX:
        m, p = motion(s).drives, s.p
        tau = ca.vertsplit(m.tau)
        if leg.drive_states.size:
            asked = leg.asked_torques(s)
            tau = [asked[k] if k in leg.drive_states.at else tau[k] for k in range(leg.n)]
        for k in lossy:
            gear, rotor = Gear.of(leg.leg, leg.leg.joints[k], p), armatures(leg.dynamics(s).bodies)[BASE + k]
            tau[k] = motor_torque(gear, m.tau[k], m.w[k], m.rate[k], rotor)
        return ca.vertcat(*tau)

    return lambda s: s.once("motor torques", lambda: torques(s))


def reversing_speeds(leg: MovingLeg) -> np.ndarray:
    """Joint speeds (n) [rad/s] over which gears go from driving to braking; 0 where they lose nothing by that."""
    gears = gears_of(leg.leg, leg.robot.parameters)
    return np.where(gears.one_sided, gears.slow, 0.0)


def asked(leg: MovingLeg, joint: str, motion: MotionAt) -> Callable[[Instant], ca.SX]:
    """The torque that a joint's motor is asked for at an instant [N m]: its row of ``motor_torques``."""
    torques, k = motor_torques(leg, motion), leg.leg.joints.index(joint)
    return lambda s: torques(s)[k]


def bus_power(leg: MovingLeg, motion: MotionAt) -> Callable[[Instant], ca.SX]:
    """What the leg's motors draw together at an instant [W]."""
    torques = motor_torques(leg, motion)

    def power(s: Instant) -> ca.SX:
        return power_drawn(leg.leg, s.p, ca.vertsplit(torques(s)), ca.vertsplit(motion(s).drives.w))

    return lambda s: s.once("bus power", lambda: power(s))


def bus_voltage(leg: MovingLeg, motion: MotionAt) -> Callable[[Instant], ca.SX | None]:
    """The bus voltage at an instant, over what it is without load; None without a supply that sags."""
    if leg.leg.supply is None:
        return lambda s: None
    power = bus_power(leg, motion)
    return lambda s: s.once("bus voltage", lambda: share_at(sag(leg.leg, s.p), power(s)))


def with_drives(leg: MovingLeg, phase: Phase) -> Phase:
    """The phase with the states of its drives and the commands that move them; as it is where they have none."""
    states = leg.drive_states
    if not states.size:
        return phase
    regions = [operating_region(leg.leg, joint, leg.robot.parameters) for joint in states.of]
    sizes = [float(region.torque_bounds(0.0)[1]) for region in regions]
    sizes = [size if d.rate is None else float(d.rate) for size, d in zip(sizes, states.of.values(), strict=True)]
    scales = [scale for d in states.of.values() for scale in d.scales]
    units = " or ".join(dict.fromkeys(unit for d in states.of.values() for unit in d.units))
    own = State(DRIVE, states.size, scale=scales, unit=units, labels=states.labels())
    of_controls = " or ".join(dict.fromkeys("N m" if d.rate is None else "N m/s" for d in states.of.values()))
    command = Control(COMMAND, len(states.of), scale=sizes, unit=of_controls, labels=tuple(states.of))

    def rates(s: Instant) -> Mapping[str, ca.SX]:
        return {**phase.dynamics(s), DRIVE: _drive_rates(leg, s)}

    return replace(phase, states=(*phase.states, own), controls=(*phase.controls, command), dynamics=rates)


def changing(leg: MovingLeg, s: Instant, value: ca.SX) -> ca.SX:
    """How fast an expression of the states of an instant changes as the leg moves [its unit/s]. Without torques that jump, places,
    speeds, accelerations and forces are such expressions."""
    moves = {"q": s.v, "v": leg.acceleration(s), DRIVE: _drive_rates(leg, s)}
    if hasattr(s, "com"):
        moves |= {"com": s.com_v, "com_v": leg.dynamics(s).fall[leg.falling]}
    return ca.jtimes(value, ca.vertcat(*[getattr(s, name) for name in moves]), ca.vertcat(*moves.values()))


def _drive_rates(leg: MovingLeg, s: Instant) -> ca.SX:
    return ca.vertcat(*added_states(leg.leg, s.p).rates(getattr(s, DRIVE), leg.commands(s), s.v))


def holding(leg: MovingLeg, landing: str | None = None) -> tuple[BoundaryConstraint, ...]:
    """A hop from rest begins with the drives as they hold the leg there; one that comes to rest in the phase ``landing`` ends so
    where a series spring would move it on."""
    if not leg.drive_states.size:
        return ()
    scales = [scale for d in leg.drive_states.of.values() for scale in d.scales]

    def miss(s: Instant) -> ca.SX:
        held = leg.dynamics(s).stance(s.q, s.v, ca.SX.zeros(leg.n)).tau
        return getattr(s, DRIVE) - ca.vertcat(*added_states(leg.leg, s.p).at_rest(ca.vertsplit(held)))

    def at(name: str, value: Callable[[Ends], ca.SX]) -> BoundaryConstraint:
        return linkage(name, value, scales, labels=leg.drive_states.labels())

    begins = at("drives at the start", lambda e: miss(e.initial[STANCE]))
    if landing is None or not leg.drive_states.sprung:
        return (begins,)
    return begins, at("drives at rest", lambda e: miss(e.final[landing]))


def carried_on(leg: MovingLeg, *phases: str) -> tuple[BoundaryConstraint, ...]:
    """The drives' states go on from each phase to the next, whatever happens to the leg between them."""
    if not leg.drive_states.size:
        return ()
    scales = [scale for d in leg.drive_states.of.values() for scale in d.scales]

    def between(before: str, after: str) -> BoundaryConstraint:
        def miss(e: Ends) -> ca.SX:
            return getattr(e.initial[after], DRIVE) - getattr(e.final[before], DRIVE)

        return linkage(f"drives, {before} to {after}", miss, scales, labels=leg.drive_states.labels())

    return tuple(between(*pair) for pair in pairwise(phases))


def torques_of(leg: MovingLeg, x: np.ndarray, a: np.ndarray, on_ground: bool) -> np.ndarray:
    """Torques (m, n) [N m] of a guessed motion: angles and speeds x (m, 2 n) of the joints, accelerations a (m, n)."""
    q, v, rate = (ca.SX.sym(name, leg.n) for name in "qva")
    dynamics, still = LegDynamics(leg.robot, leg.robot.parameters), ca.SX.zeros(BASE)
    motion = dynamics.stance(q, v, rate) if on_ground else dynamics.flight(still, still, q, v, rate)
    torque = ca.Function("torque", [ca.vertcat(q, v), rate], [motion.tau])
    return np.array(torque.map(len(x))(x.T, a.T)).T


def refuse_drive_states(leg: MovingLeg, what: str) -> None:
    """UsageError where drives have states of their own, for a program that does not hand them on from phase to phase."""
    refuse_series_springs(leg.leg, what)
    if leg.drive_states.size:
        raise UsageError(f"{what} does not know drives with states of their own: leave out motor.torque_rate")


def with_drive_states(leg: MovingLeg, guess: Guess, on_ground: bool) -> Guess:
    """The guess with the states of the drives and their commands, as if the motion were slow; one that has them as it is."""
    states, of_leg = leg.drive_states, 2 * leg.n + (0 if on_ground else 2 * len(leg.falling))
    if not states.size or guess.x.shape[1] > of_leg:
        return guess
    tau = torques_of(leg, guess.x[:, -2 * leg.n :], guess.u, on_ground)
    held, controls = np.array([states.at_rest(row) for row in tau]), tau.copy()
    t, v = guess.fraction * guess.duration, guess.x[:, -leg.n :]
    for k, most in states.limited.items():
        controls[:, k] = np.clip(np.gradient(tau[:, k], t), -most, most)
    for k, speed in states.sprung.items():  # the drive turns with its joint, and bears its rotor
        held[:, speed] = v[:, k]
        controls[:, k] += states.rotors[k] * np.gradient(v[:, k], t)
    return replace(
        guess,
        x=np.hstack([guess.x, held]),
        u=np.hstack([np.delete(guess.u, states.at, axis=1), controls[:, states.at]]),
    )
