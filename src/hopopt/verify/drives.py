"""Do drives obey their laws? The torques that gears ask of motors by NumPy, drives' own states integrated by SciPy."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Self

import numpy as np

from hopopt.design import Design
from hopopt.drivetrain.drives import Drive
from hopopt.drivetrain.dynamics import AddedStates, added_states
from hopopt.drivetrain.gear import (
    ENTRIES,
    LOSSLESS,
    Gear,
    any_lossy,
    driven_joints,
    gears_of,
    motor_torque,
    response_to,
)
from hopopt.drivetrain.operating_region.half_planes import OperatingRegion, torque_lines, within
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.drivetrain.supply import WINDING, power_drawn, power_used, sag, share_at, winding_heat
from hopopt.drivetrain.transmission import Turning
from hopopt.leg.robot import BASE, Robot
from hopopt.record import Strict, if_any, stated
from hopopt.sim.machine import Machine
from hopopt.verify.check import BALANCE, EXACT, STATE, Check
from hopopt.verify.replay import missed
from hopopt.verify.springs.at_drives import at_drives, rotors
from hopopt.verify.table import LANDING, NORMALISED_TIMES, POWERS, STANCE, TO_POWERS, Table, cut, dense, over_time

Clamp = Callable[[np.ndarray, np.ndarray], np.ndarray]  # drives' speeds and torques asked to torques given
LOOKED_AT = np.linspace(0, 1, 65)  # normalised times of an interval, between which a change of sign is looked for


@dataclass(frozen=True)
class Drives:
    """The drives of a leg in the rollout.

    clamp: brings motor torques into the operating regions
    gear: its losses; None where none are planned
    rotor: reflected inertias of what spins in front of the gears (n) [kg m^2]
    states: what the drives add of their own
    turning: how the joints turn them; None where they turn together
    """

    clamp: Clamp
    gear: Gear | None
    rotor: np.ndarray
    states: AddedStates
    turning: Turning | None = None

    @classmethod
    def of(cls, robot: Robot) -> Self:
        """The drives of a leg as its problem plans with them."""
        regions = [operating_region(robot.leg, joint, robot.parameters) for joint in robot.joints]
        clamp = joint_clamp(regions)
        if robot.leg.supply is not None or any(region.power is not None for region in regions):
            clamp = Drive.of(robot.leg, robot.parameters, robot.rotors, Gear()).clamp
        states = added_states(robot.leg, robot.parameters)
        gear = gears_of(robot.leg, robot.parameters) if any_lossy(robot.leg) else None
        if gear is not None and states.sprung:  # their gears are in the law of their states
            behind = np.isin(np.arange(len(robot.joints)), list(states.sprung))
            own: dict[str, Any] = {
                name: np.where(behind, ideal, getattr(gear, name))
                for name, ideal in zip(ENTRIES, LOSSLESS, strict=True)
            }
            for name in ("bends", "factor"):
                own[name] = tuple(np.where(behind, 0.0, each) for each in getattr(gear, name))
            gear = replace(gear, **own)
        return cls(clamp, gear, robot.rotors, states, robot.turning)

    def at_joints(self, machine: Machine, q: np.ndarray, v: np.ndarray, motor: np.ndarray, contact: bool) -> np.ndarray:
        """Torques (n) [N m] at the joints of the motors' torques, for q, v (BASE + n) of the leg."""
        if self.turning is None:
            if self.gear is None:
                return motor
            return self._passed(motor, v[BASE:], lambda tau: machine.acceleration(q, v, tau, contact)[BASE:])
        J, S = self.turning.jacobian(q[BASE:]), self.turning.spin(q[BASE:])
        if self.gear is None:
            return J.T @ motor
        drift = self.turning.drift(q[BASE:], v[BASE:])
        turned = lambda tau: S @ machine.acceleration(q, v, J.T @ tau, contact)[BASE:] + drift  # noqa: E731
        return J.T @ self._passed(motor, J @ v[BASE:], turned)

    def _passed(self, motor: np.ndarray, w: np.ndarray, accelerate: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """What gears make of the motors' torques at speeds w (n) of the drives, which their torques accelerate."""
        assert self.gear is not None
        return driven_joints(self.gear, motor, w, *response_to(accelerate, len(motor)), self.rotor)

    def at_springs(self, x: np.ndarray, motor: np.ndarray, v: np.ndarray) -> np.ndarray:
        """The motors' torques (n) [N m], that of a series spring where there is one, at states x and joint speeds v (n)."""
        if not self.states.sprung:
            return motor
        found = motor.copy()
        found[self.states.at] = self.states.torques(x, motor, v)
        return found

    def angles(self, q: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Joint angles q (..., n) [rad], of the drive behind a series spring, at states x (..., m): its deflection is the state
        before its speed."""
        found = q + 0.0
        for k, place in self.states.sprung.items():
            found[..., k] += x[..., place - 1]
        return found

    def asked(self, q: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Torques of the drives (n) [N m] that come to tau (n) at the joints, gears' losses aside, at joint angles q (n)."""
        return tau if self.turning is None else self.turning.drive_torques(q, tau)

    def speeds(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Of the drives (n) [rad/s] at joint angles and speeds (n)."""
        return v if self.turning is None else self.turning.speeds(q, v)


def joint_clamp(regions: Sequence[OperatingRegion]) -> Clamp:
    """``OperatingRegion.clamp`` of all joints at once, for torques and speeds that are single numbers."""
    upper, lower = (lines.tolist() for lines in torque_lines(regions))
    return lambda speed, asked: np.array(list(map(within, speed.tolist(), asked.tolist(), upper, lower)))


def drive_checks(robot: Robot, phase: str, table: Table) -> Iterator[Check]:
    """That motors are asked for what joints and gears take; that the drives' states follow from their commands, and the
    joints' torques from these states. Nothing where drives have neither."""
    states = added_states(robot.leg, robot.parameters)
    if any_lossy(robot.leg) or not robot.leg.direct or states.sprung:
        yield _gears(robot, phase, table)
        yield balance(robot, Machine(robot), phase, table)
    if not states.size:
        return
    if table.drive is None or table.command is None:
        yield Check(f"{phase} drives", np.inf, EXACT, "relative", "the plan has no states of its drives")
        return
    scales = np.array([scale for d in states.of.values() for scale in d.scales])
    if len(states.limited) < len(states.of):
        missed = [_missed(states, table, k) / scales for k in range(len(table.t))]
        worst = int(np.argmax(np.abs(missed).max(axis=1)))
        where = f"interval from {table.t[worst, 0]:.4f} s"
        yield Check(f"{phase} drives", float(np.abs(missed).max()), STATE, "of their scales", where)
    jumps = (table.drive[1:, 0] - table.drive[:-1, -1]) / scales
    yield Check(f"{phase} drives' continuity", float(np.abs(jumps).max(initial=0.0)), EXACT, "of their scales")
    rows = zip(*table.flat("drive", "command", "v", "tau"), strict=True)
    wrong = [
        [*(np.array(states.torques(x, u, v[BASE:])) - tau[states.at]), *(np.array(states.asked(x, u)) - u)]
        for x, u, v, tau in rows
    ]
    size = max(1.0, float(np.abs(table.tau).max()))
    yield Check(f"{phase} drive torque", float(np.abs(wrong).max()) / size, EXACT, "relative")


def drives_go_on(machine: Machine, design: Design, tables: Mapping[str, Table]) -> Iterator[Check]:
    """That the drives' states go on from phase to phase, round a cycle too, and begin a hop from rest as they hold the leg there."""
    states, first = added_states(design.leg, machine.robot.parameters), tables[STANCE]
    if not states.size or any(table.drive is None for table in tables.values()):
        return
    scales = np.array([scale for d in states.of.values() for scale in d.scales])
    ends = [
        (table.drive[0, 0] / scales, table.drive[-1, -1] / scales)
        for table in tables.values()
        if table.drive is not None
    ]
    jumps = [after[0] - before[1] for before, after in pairwise([*ends, *ends[: design.hop.periodic]])]
    yield Check("drives from phase to phase", float(np.abs(jumps).max()), EXACT, "of their scales")
    if not design.hop.periodic:
        held = states.at_rest(machine.stance_terms(first.q[0, 0, BASE:], first.v[0, 0, BASE:]).joint_bias) / scales
        yield Check("drives at the start", float(np.abs(held - ends[0][0]).max()), EXACT, "of their scales")
        if LANDING in tables and states.sprung:
            yield Check("drives at rest", float(np.abs(held - ends[-1][1]).max()), EXACT, "of their scales")


@dataclass(frozen=True)
class JointLosses(Strict):
    """What the drive of a joint turns into heat over the hop [J], of one leg."""

    gear: float = stated("by the gear's efficiency [J]")
    friction: float = stated("by the gear's Coulomb and viscous friction [J]")
    winding: float | None = stated("in the motor's winding [J]; null where nothing tells its resistance")


@dataclass(frozen=True)
class SupplyFigures(Strict):
    """What the supply gives over the hop."""

    lowest_voltage_V: float = stated("of the bus at its terminals [V]")
    peak_current_A: float = stated("of each supply [A]")
    energy_J: float = stated("drawn at its terminals, by all legs [J]")
    burnt_J: float | None = if_any(
        "of what the motors feed back, burnt [J], by all legs; left out where the supply takes it back"
    )


def losses(robot: Robot, tables: Mapping[str, Table]) -> dict[str, JointLosses]:
    """What becomes heat in each joint's drive [J], from the plan's torques and speeds."""
    return _losses(robot, [without_bends(robot, table) for table in tables.values()])


def _losses(robot: Robot, closely: Sequence[Table]) -> dict[str, JointLosses]:
    """``losses`` of tables without bends."""
    leg, p, found = robot.leg, robot.parameters, dict[str, JointLosses]()
    for k, joint in enumerate(robot.joints):
        gear = Gear.of(leg, joint, p)
        known = leg.supply is not None or all(leg.drive(joint, "motor", entry)[1] is not None for entry in WINDING)
        heat, total = winding_heat(leg, joint, p), np.zeros(3)
        for table in closely:
            w, rate, tau = (each[..., k] for each in at_drives(robot, table))
            motor = table.asked[..., k]
            out, rubbing = tau - rotors(robot)[k] * rate, gear.of_one(1.0)
            friction = (rubbing.needed(out, w) - out) * w
            rates = ((motor - tau) * w - friction, friction, heat * motor**2)
            total += [over_time(table, rate) for rate in rates]
        found[joint] = JointLosses(float(total[0]), float(total[1]), float(total[2]) if known else None)
    return found


def supply_figures(robot: Robot, tables: Mapping[str, Table]) -> SupplyFigures | None:
    """Lowest voltage [V], greatest current [A] and energies [J] of the supply; None without one."""
    leg, p = robot.leg, robot.parameters
    if leg.supply is None:
        return None
    lowest, peak, energy, used = np.inf, 0.0, 0.0, 0.0
    for table in (without_bends(robot, table) for table in tables.values()):
        drives = _powers(robot, table)
        power = power_drawn(leg, p, *drives)
        voltage = leg.supply.voltage * share_at(sag(leg, p), power)
        lowest = min(lowest, float(voltage.min()))
        peak = max(peak, float((power / voltage).max()) * leg.supply.legs / leg.supply.count)
        energy += leg.supply.legs * over_time(table, power)
        used += leg.supply.legs * over_time(table, power_used(leg, p, *drives))
    burnt = None if leg.supply.recuperation else energy - used
    return SupplyFigures(lowest, peak, energy, burnt_J=burnt)


def without_bends(robot: Robot, table: Table) -> Table:
    """The table with its intervals cut where a drive turns back, where what passes a gear's teeth changes sides, and where a supply
    that takes nothing back gives no more: there powers have a bend, which the polynomial of an interval does not follow."""
    if not any_lossy(robot.leg) and (robot.leg.supply is None or robot.leg.supply.recuperation):
        return table
    w, rate, tau = at_drives(robot, table)
    turning = np.concatenate([w, tau - rotors(robot) * rate], -1)
    if robot.leg.supply is not None:
        turning = np.concatenate(
            [turning, power_used(robot.leg, robot.parameters, *_powers(robot, table))[..., None]], -1
        )
    closely = cut(table, [_changes(x) for x in dense(NORMALISED_TIMES, turning, LOOKED_AT)])
    if closely is table or table.command is None or added_states(robot.leg, robot.parameters).sprung:
        return closely  # the torque of a motor in front of a spring is a polynomial
    w, rate, tau = at_drives(robot, closely)
    return replace(closely, command=motor_torque(gears_of(robot.leg, robot.parameters), tau, w, rate, rotors(robot)))


def _changes(values: np.ndarray) -> np.ndarray:
    """Normalised times at which columns of values at LOOKED_AT change their signs, by straight lines between them."""
    at, column = np.nonzero(values[:-1] * values[1:] < 0)
    before, after = values[at, column], values[at + 1, column]
    return np.unique(LOOKED_AT[at] + np.diff(LOOKED_AT)[at] * before / (before - after))


def _powers(robot: Robot, table: Table) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """What the drives' powers are of: their motors' torques [N m] and their speeds [rad/s], one (N, K) for each joint."""
    torques, speeds = table.asked, robot.drive_speeds(table.q, table.v, table.drive)
    return list(np.moveaxis(torques, -1, 0)), list(np.moveaxis(speeds, -1, 0))


def balance(robot: Robot, machine: Machine, phase: str, table: Table) -> Check:
    """Work that the motors give = energy gained, that of springs and rotors too + what gears and springs' damping turn into
    heat, relative to the work done."""
    table = without_bends(robot, table)
    lost = _losses(robot, [table])
    columns = [np.moveaxis(each, -1, 0) for each in (table.asked, at_drives(robot, table)[0])]
    drawn = sum(over_time(table, tau * w) for tau, w in zip(*columns, strict=True))
    gained = machine.energy(table.q[-1, -1], table.v[-1, -1]) - machine.energy(table.q[0, 0], table.v[0, 0])
    heat = sum(x.gear + x.friction for x in lost.values())
    if table.drive is not None:
        states, (own, v) = (
            added_states(robot.leg, robot.parameters),
            (np.moveaxis(x, -1, 0) for x in (table.drive, table.v)),
        )
        gained += states.stored(table.drive[-1, -1]) - states.stored(table.drive[0, 0])
        heat += over_time(table, states.lost(own, v[BASE:]) + np.zeros(table.t.shape))
    size = sum(over_time(table, np.abs(tau * w)) for tau, w in zip(*columns, strict=True))
    return Check(f"{phase} energy of the drives", abs(drawn - gained - heat) / max(size, 1e-3), BALANCE, "relative")


def _gears(robot: Robot, phase: str, table: Table) -> Check:
    """The law of the gears between the table's torques, relative to the largest."""
    name = f"{phase} gears"
    if table.command is None:
        return Check(name, np.inf, EXACT, "relative", "the plan has no torques of its motors")
    w, rate, tau = at_drives(robot, table)
    needed = motor_torque(gears_of(robot.leg, robot.parameters), tau, w, rate, rotors(robot))
    wrong = np.abs(needed - table.command).max(axis=(1, 2))
    where = f"interval from {table.t[int(np.argmax(wrong)), 0]:.4f} s"
    return Check(name, float(wrong.max()) / float(np.abs(table.command).max()), EXACT, "relative", where)


def _missed(states: AddedStates, table: Table, k: int) -> np.ndarray:
    """What the states at the end of an interval differ by from those that their rates lead to."""
    assert table.drive is not None
    assert table.command is not None
    command, speed, h = TO_POWERS @ table.command[k], TO_POWERS @ table.v[k][:, BASE:], table.t[k, -1] - table.t[k, 0]

    slope = TO_POWERS @ table.asked_rate[k]

    def rates(place: float, x: np.ndarray) -> np.ndarray:
        powers = (2 * place - 1) ** POWERS
        u = powers @ command
        u[list(states.limited)] = (powers @ slope)[list(states.limited)]
        return h * np.array(states.rates(x, u, powers @ speed))

    return missed(rates, table.drive[k, 0], table.drive[k, -1])
