"""A hop simulated in one piece: a plan's torques, kept to its motion by feedback and clamped to the drives' limits."""

from collections.abc import Callable, Mapping

import numpy as np
from scipy.integrate import solve_ivp

from hopopt.drivetrain.gear import motor_torque
from hopopt.leg.robot import BASE
from hopopt.leg.scales import Scale
from hopopt.sim.machine import Machine
from hopopt.verify.drives import Drives, at_drives
from hopopt.verify.table import LANDING, NORMALISED_TIMES, POWERS, STANDING, TO_POWERS, Table

FEEDBACK_RATE = 100.0  # [1/s] of the critically damped feedback, well above the leg's own motions; of the paper's leg
FOLLOWS = 1e-3  # [s] on the paper's leg: within which a torque of limited rate follows the feedback
RELATIVE, ABSOLUTE = 1e-7, 1e-8  # of the integration: far below what is told, for a clamp's kinks make it slow

LegState = tuple[np.ndarray, np.ndarray, np.ndarray]  # q, v (2 + n) of body and joints, states of the drives
Driven = tuple[np.ndarray, np.ndarray, np.ndarray]  # of ``at_drives``
Law = Callable[[float, np.ndarray, np.ndarray, np.ndarray], np.ndarray]  # motor torques [N m] from place, q, v, states


def state_of(table: Table) -> LegState:
    """In which a phase begins."""
    return table.q[0, 0], table.v[0, 0], np.zeros(0) if table.drive is None else table.drive[0, 0]


def simulated_hop(
    machine: Machine, drives: Drives, tables: Mapping[str, Table], state: LegState
) -> tuple[dict[str, Table], LegState]:
    """The phases of a hop one after the other from ``state``: their tables, and the state in which the last ends."""
    found = dict[str, Table]()
    for name, table in tables.items():
        if name == LANDING:
            state = state[0], machine.touch_down(*state[:2]), state[2]
        found[name], state = _simulated(machine, drives, table, state, name in STANDING)
    return found, state


def _simulated(machine: Machine, drives: Drives, plan: Table, state: LegState, contact: bool) -> tuple[Table, LegState]:
    """One phase from ``state``: its table, and the state in which it ends."""
    rows, unit = list[tuple[np.ndarray, ...]](), Scale.of(machine.leg).time
    driven = at_drives(machine.robot, plan) if drives.gear and not drives.states.size else None
    for k in range(len(plan.t)):
        torque = _law(machine, drives, plan, k, contact, unit, driven)
        rows.append(_interval(machine, drives, torque, plan.t[k], state, contact, plan.asked_rate[k], FOLLOWS * unit))
        state = rows[-1][0][-1], rows[-1][1][-1], rows[-1][-1][-1]
    q, v, a, tau, f, motor, own = (np.array(part) for part in zip(*rows, strict=True))
    apart = drives.gear or drives.turning or drives.states.sprung
    return Table(plan.t, q, v, a, tau, f, motor if apart else None, own if drives.states.size else None), state


def _law(
    machine: Machine, drives: Drives, plan: Table, k: int, contact: bool, unit: float, driven: Driven | None
) -> Law:  # fmt: skip
    """The plan's torque in its interval k, kept to its motion, of drives behind series springs theirs, by feedback and within
    the regions; ``unit`` of time [s]; driven: what the drives of the plan do, None where their torques are interpolated."""
    q, v = plan.q[k], plan.v[k]
    x = np.zeros((len(q), 0)) if plan.drive is None else plan.drive[k]
    inertia = machine.stance_terms(q[0, BASE:], v[0, BASE:]).mass_matrix if contact else _free(machine, q[0])
    rate = FEEDBACK_RATE / unit
    stiffness, damping = rate**2 * inertia, 2 * rate * inertia
    toward = drives.angles(q[:, BASE:], x) @ stiffness.T + drives.states.speeds(x, v[:, BASE:]) @ damping.T
    ahead, asked = (TO_POWERS @ toward).T, planned(drives, plan, k, driven)

    def torque(place: float, angle: np.ndarray, speed: np.ndarray, own: np.ndarray) -> np.ndarray:
        powers = (2 * place - 1) ** POWERS
        if drives.states.sprung:
            angle, speed = drives.angles(angle, own), drives.states.speeds(own, speed)
        back = ahead @ powers - stiffness @ angle - damping @ speed
        return drives.clamp(drives.speeds(angle, speed), asked(powers) + drives.asked(angle, back))

    return torque


def planned(drives: Drives, plan: Table, k: int, driven: Driven | None) -> Callable[[np.ndarray], np.ndarray]:
    """What a plan asks of the motors (n) [N m] in its interval k, by powers of the place: by the gears' law where they lose.

    A motor's torque has a corner where its gear goes from driving to braking, that of its joint has none.
    """
    gear, asked = drives.gear, (TO_POWERS @ plan.asked[k]).T
    if gear is None or driven is None:
        return lambda powers: asked @ powers
    w, rate, tau = ((TO_POWERS @ each[k]).T for each in driven)
    return lambda powers: motor_torque(gear, tau @ powers, w @ powers, rate @ powers, drives.rotor)


def _free(machine: Machine, q: np.ndarray) -> np.ndarray:
    """Inertia that acts on the joints while the body is free, (n, n)."""
    M = machine.mass_matrix(q)
    return M[BASE:, BASE:] - M[BASE:, :BASE] @ np.linalg.solve(M[:BASE, :BASE], M[:BASE, BASE:])


def _interval(
    machine: Machine,
    drives: Drives,
    torque: Law,
    t: np.ndarray,
    state: LegState,
    contact: bool,
    rate: np.ndarray,
    lag: float,
) -> tuple[np.ndarray, ...]:
    """q, v, a, tau, f, the motors' torques and the drives' states at NORMALISED_TIMES of one interval, integrated tightly;
    rate (K, n) [N m/s]: of the plan's torques; lag [s]: within which torques of limited rate follow them."""
    first, h, limited = (BASE if contact else 0), t[-1] - t[0], list(drives.states.limited)
    m, ahead = len(state[0]) - first, (TO_POWERS @ rate[:, limited]).T

    def motion(place: float, x: np.ndarray) -> tuple[np.ndarray, ...]:
        q, v, own = x[:m], x[m : 2 * m], x[2 * m :]
        tau = motor = torque(place, q[BASE - first :], v[BASE - first :], own)
        toward = motor[limited] - own if limited else motor
        if limited:
            motor[limited] = own
            tau = motor = drives.clamp(v[BASE - first :], motor)
        tau = drives.at_springs(own, motor, v[BASE - first :])
        if drives.gear or drives.turning:
            nowhere = np.zeros(first)
            tau = drives.at_joints(machine, np.concatenate([nowhere, q]), np.concatenate([nowhere, v]), tau, contact)
        if not contact:
            return q, v, machine.acceleration(q, v, tau, False), tau, np.zeros(BASE), motor, own, toward
        q, v, a, f = machine.pinned(q, v, tau)
        return q, v, a, tau, f, motor, own, toward

    def rates(place: float, x: np.ndarray) -> np.ndarray:
        _, v, a, *_, toward = motion(place, x)
        if not limited:
            own = drives.states.rates(x[2 * m :], toward, v[BASE:])
            return h * np.concatenate([v[first:], a[first:], own])
        changing = ahead @ (2 * place - 1) ** POWERS + toward / lag
        return h * np.concatenate(
            [v[first:], a[first:], np.clip(changing, *drives.states.bounds(x[2 * m :], v[BASE:]))]
        )

    x0 = np.concatenate([state[0][first:], state[1][first:], state[2]])
    with np.errstate(over="ignore", invalid="ignore"):  # what runs away has failed
        run = solve_ivp(
            rates, (0.0, 1.0), x0, "DOP853", t_eval=NORMALISED_TIMES, rtol=RELATIVE, atol=ABSOLUTE, first_step=1.0
        )
    if not run.success or not np.isfinite(run.y).all():
        raise ArithmeticError("the leg cannot be integrated")
    samples = [motion(place, x) for place, x in zip(run.t, run.y.T, strict=True)]
    return tuple(np.array(part) for part in zip(*samples, strict=True))[:-1]
