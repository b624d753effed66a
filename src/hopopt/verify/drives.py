"""Do the drives' own states obey their laws? Their rates integrated along the plan's speeds and commands, by SciPy."""

from collections.abc import Iterator

import numpy as np

from hopopt.drivetrain.dynamics import AddedStates, added_states
from hopopt.leg.robot import BASE, Robot
from hopopt.verify.check import EXACT, STATE, Check
from hopopt.verify.replay import missed
from hopopt.verify.table import POWERS, TO_POWERS, Table


def drive_checks(robot: Robot, phase: str, table: Table) -> Iterator[Check]:
    """That the drives' states follow from their commands, and the joints' torques from these states; nothing where drives
    have none."""
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


def _missed(states: AddedStates, table: Table, k: int) -> np.ndarray:
    """What the states at the end of an interval differ by from those that their rates lead to."""
    assert table.drive is not None
    assert table.command is not None
    command, speed, h = TO_POWERS @ table.command[k], TO_POWERS @ table.v[k][:, BASE:], table.t[k, -1] - table.t[k, 0]

    def rates(place: float, x: np.ndarray) -> np.ndarray:
        powers = (2 * place - 1) ** POWERS
        return h * np.array(states.rates(x, powers @ command, powers @ speed))

    return missed(rates, table.drive[k, 0], table.drive[k, -1])
