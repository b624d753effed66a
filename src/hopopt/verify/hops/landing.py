"""Where one phase of a plan becomes the next: lift-off, the apex of a hop that lands, its touchdown, and a landing to rest.

By Pinocchio's C++, as in ``verify``. ``lift_off`` and ``landing`` return the parts of a check: values that must all be zero.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from hopopt.design import Design
from hopopt.leg.robot import BASE
from hopopt.sim.machine import Machine
from hopopt.verify.check import EXACT, Check
from hopopt.verify.hops.periodic import CLOSED, energy_check, impact_checks, touchdown_checks, touchdown_of
from hopopt.verify.table import DESCENT, LANDING, STANCE, Table, jumps

Parts = list[np.ndarray | float]


def lift_off(machine: Machine, stance: Table, flight: Table) -> Parts:
    """Flight begins where and when stance ends, the centre of mass not falling."""
    return [*jumps(stance, flight), np.minimum(machine.com_velocity(flight.q[0, 0], flight.v[0, 0])[1], 0.0)]


def landing(machine: Machine, flight: Table, descent: Table) -> Iterator[tuple[str, Parts]]:
    """The descent begins at the apex of the centre of mass, where and when flight ends; at its end the foot is on the
    ground, not moving up, and the body no lower than flight began."""
    rising = machine.com_velocity(flight.q[-1, -1], flight.v[-1, -1])[1]
    yield "apex", [*jumps(flight, descent), rising]
    place, speed = machine.foot_motion(descent.q[-1, -1], descent.v[-1, -1])
    lower = flight.q[0, 0, 1] - descent.q[-1, -1, 1]
    yield "touchdown", [place[1], max(float(speed[1]), 0.0), max(float(lower), 0.0)]


def landed_checks(machine: Machine, design: Design, tables: Mapping[str, Table]) -> Iterator[Check]:
    """That the foot touches down, that the landing begins as the impact leaves the leg and ends at rest in the pose of the
    start, and that the energy of the hop balances."""
    found, end = touchdown_of(machine, tables), tables[LANDING]
    late = end.t[0, 0] - tables[DESCENT].t[-1, -1]
    yield from touchdown_checks(found, tables, late, found.place[1:])
    yield Check("landing begins as the impact leaves the leg", found.closure, CLOSED, "SI")
    pose = end.q[-1, -1, BASE:] - tables[STANCE].q[0, 0, BASE:]
    yield Check("rest", float(np.abs([*pose, *end.v[-1, -1]]).max()), EXACT, "SI")
    yield energy_check("energy of the hop", machine, found, tables)
    yield from impact_checks(machine, design, found)
