"""Are several hops true that follow each other? Their phases, impacts and both ends, by Pinocchio's C++."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from hopopt.design import Design
from hopopt.leg.robot import Robot
from hopopt.leg.scales import Scale
from hopopt.sim.machine import Machine
from hopopt.verify.check import EXACT, Check
from hopopt.verify.drives import Drives
from hopopt.verify.hops.landing import lift_off
from hopopt.verify.hops.one_piece import simulated_hop, state_of
from hopopt.verify.hops.periodic import (
    CLOSED,
    Touchdown,
    closure,
    impact_checks,
    joints_at,
    touchdown_checks,
    touchdown_of,
)
from hopopt.verify.plan import durations, largest, phase_checks
from hopopt.verify.table import FLIGHT, STANCE, Table

Tables = Mapping[str, Table]  # of one hop's phases; x and time count from where and when it began
MISSED = 1e-3  # rad, and rad/s on the paper's leg: by which hops simulated in one piece may miss the orbit


def several_hops_checks(
    robot: Robot, design: Design, hops: Sequence[Tables], begin: np.ndarray, end: np.ndarray
) -> Iterator[Check]:
    """That every hop obeys the equations of motion and the limits, that each begins as the impact before it leaves the leg, and
    that they lead from ``begin`` to ``end``: joint angles [rad] and speeds [rad/s] with which a stance begins, (2 n) each."""
    machine = Machine(robot)
    yield Check("start", largest([joints_at(hops[0][STANCE], 0) - begin]), EXACT, "SI")
    for k, tables in enumerate(hops, 1):
        last = k == len(hops)
        found = touchdown_of(machine, tables, end if last else joints_at(hops[k][STANCE], 0))
        for check in _one_hop(machine, robot, design, tables, found):
            yield replace(check, name=f"hop {k}: {check.name}")
        words = "the last impact leads to the orbit" if last else f"hop {k + 1} begins as the impact leaves the leg"
        yield Check(words, found.closure, CLOSED, "SI")
    yield Check("the orbit, simulated in one piece", missed(machine, robot, design, hops, end), MISSED, "SI")


def _one_hop(machine: Machine, robot: Robot, design: Design, tables: Tables, found: Touchdown) -> Iterator[Check]:
    """That one hop begins at time zero, its phases follow each other, and they and the impact keep every limit."""
    yield durations(design, tables)
    yield Check("lift-off", largest(lift_off(machine, tables[STANCE], tables[FLIGHT])), EXACT, "SI")
    yield from touchdown_checks(found, tables, tables[STANCE].t[0, 0], found.place[1:])
    yield from impact_checks(machine, design, found)
    for name, table in tables.items():
        yield from phase_checks(machine, robot, design, name, table)


def missed(machine: Machine, robot: Robot, design: Design, hops: Sequence[Tables], end: np.ndarray) -> float:
    """By how much the joints miss ``end`` (2 n) [rad, and rad/s on the paper's leg] where all hops are simulated in one piece,
    torques clamped to the drives; infinite if that cannot be."""
    first = hops[0][STANCE]
    drives = Drives.of(robot)
    last = state = state_of(first)
    try:
        for tables in hops:
            _, last = simulated_hop(machine, drives, tables, state)
            state = last[0], machine.touch_down(*last[:2]), last[2]
    except (ArithmeticError, ValueError, np.linalg.LinAlgError):
        return np.inf
    return closure(machine, end, *last[:2], rate=1 / Scale.of(design.leg).time)
