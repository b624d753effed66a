"""Do drives obey their laws? The torques that gears ask of motors by NumPy, drives' own states integrated by SciPy."""

from collections.abc import Iterator

import numpy as np

from hopopt.drivetrain.dynamics import AddedStates, added_states
from hopopt.drivetrain.gear import any_lossy, gears_of, motor_torque
from hopopt.leg.robot import BASE, Robot
from hopopt.verify.check import EXACT, STATE, Check
from hopopt.verify.replay import missed
from hopopt.verify.table import POWERS, TO_POWERS, Table


def drive_checks(robot: Robot, phase: str, table: Table) -> Iterator[Check]:
    """That motors are asked for what joints and gears take; that the drives' states follow from their commands, and the
    joints' torques from these states. Nothing where drives have neither."""
    if any_lossy(robot.leg):
        yield _gears(robot, phase, table)
    states = added_states(robot.leg, robot.parameters)
    if not states.size:
        return
    if table.drive is None or table.command is None:
        yield Check(f"{phase} drives", np.inf, EXACT, "relative", "the plan has no states of its drives")
        return
    scales = np.array([scale for d in states.of.values() for scale in d.scales])
    missed = [_missed(states, table, k) / scales for k in range(len(table.t))]
    worst = int(np.argmax(np.abs(missed).max(axis=1)))
    where = f"interval from {table.t[worst, 0]:.4f} s"
    yield Check(f"{phase} drives", float(np.abs(missed).max()), STATE, "of their scales", where)
    jumps = (table.drive[1:, 0] - table.drive[:-1, -1]) / scales
    yield Check(f"{phase} drives' continuity", float(np.abs(jumps).max(initial=0.0)), EXACT, "of their scales")
    rows = zip(*table.flat("drive", "command", "v", "tau"), strict=True)
    wrong = [np.array(states.torques(x, u, v[BASE:])) - tau[states.at] for x, u, v, tau in rows]
    size = max(1.0, float(np.abs(table.tau).max()))
    yield Check(f"{phase} drive torque", float(np.abs(wrong).max()) / size, EXACT, "relative")


def _gears(robot: Robot, phase: str, table: Table) -> Check:
    """The law of the gears between the table's torques, relative to the largest."""
    name = f"{phase} gears"
    if table.command is None:
        return Check(name, np.inf, EXACT, "relative", "the plan has no torques of its motors")
    gear, rotor = gears_of(robot.leg, robot.parameters), robot.model.armature[BASE:]
    needed = motor_torque(gear, table.tau, table.v[..., BASE:], table.a[..., BASE:], rotor)
    wrong = np.abs(needed - table.command).max(axis=(1, 2))
    where = f"interval from {table.t[int(np.argmax(wrong)), 0]:.4f} s"
    return Check(name, float(wrong.max()) / float(np.abs(table.command).max()), EXACT, "relative", where)


def _missed(states: AddedStates, table: Table, k: int) -> np.ndarray:
    """What the states at the end of an interval differ by from those that their rates lead to."""
    assert table.drive is not None
    assert table.command is not None
    command, speed, h = TO_POWERS @ table.command[k], TO_POWERS @ table.v[k][:, BASE:], table.t[k, -1] - table.t[k, 0]

    def rates(place: float, x: np.ndarray) -> np.ndarray:
        powers = (2 * place - 1) ** POWERS
        return h * np.array(states.rates(x, powers @ command, powers @ speed))

    return missed(rates, table.drive[k, 0], table.drive[k, -1])
