"""Speeds and torques of a plan's drives behind their gears: as its joints turn them, or by themselves behind series springs."""

import numpy as np

from hopopt.drivetrain.dynamics import added_states
from hopopt.leg.robot import BASE, Robot
from hopopt.verify.table import Table


def at_drives(robot: Robot, table: Table) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Speeds [rad/s] and torques [N m] of the drives behind their gears, first and last, and between them the rates [rad/s^2] at
    which what spins in front of the gears speeds up, over their ratios, (N, K, n) each."""
    if robot.leg.elastic and table.drive is not None:
        return _sprung(robot, table, table.drive)
    if robot.turning is None:
        return table.v[..., BASE:], table.a[..., BASE:], table.tau
    rates = robot.turning.rates(*(each[..., BASE:] for each in (table.q, table.v, table.a)))
    return robot.drive_speeds(table.q, table.v), rates, robot.drive_torques(table.q, table.tau)


def _sprung(robot: Robot, table: Table, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same of a leg with series springs, at states x (N, K, m) of its drives."""
    states, rate, tau = added_states(robot.leg, robot.parameters), table.a[..., BASE:].copy(), table.tau.copy()
    columns = [np.moveaxis(each, -1, 0) for each in (x, table.asked, table.v[..., BASE:])]
    changes = states.rates(*columns)
    for k, place in states.sprung.items():
        rate[..., k] = changes[place]
        tau[..., k] += states.rotors[k] * changes[place]
    return robot.drive_speeds(table.q, table.v, x), rate, tau


def rotors(robot: Robot) -> np.ndarray:
    """Reflected inertias (n) [kg m^2] of what spins in front of all gears."""
    found = robot.rotors.copy()
    for k, rotor in added_states(robot.leg, robot.parameters).rotors.items():
        found[k] = rotor
    return found
