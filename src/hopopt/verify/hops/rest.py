"""Is a landing to rest true? Its touchdown, its end, and the energy of the whole hop, by Pinocchio's C++."""

from collections.abc import Iterator, Mapping

import numpy as np

from hopopt.design import Design
from hopopt.leg.robot import BASE
from hopopt.sim.machine import Machine
from hopopt.verify.check import EXACT, Check
from hopopt.verify.hops.periodic import CLOSED, energy_check, impact_checks, touchdown_checks, touchdown_of
from hopopt.verify.table import DESCENT, LANDING, STANCE, Table


def landed_checks(machine: Machine, design: Design, tables: Mapping[str, Table]) -> Iterator[Check]:
    """That the foot touches down, that the landing begins as the impact leaves the leg and ends at rest in the pose of the
    start, and that the energy of the hop balances."""
    found, landing = touchdown_of(machine, tables), tables[LANDING]
    late = landing.t[0, 0] - tables[DESCENT].t[-1, -1]
    yield from touchdown_checks(found, tables, late, found.place[1:])
    yield Check("landing begins as the impact leaves the leg", found.closure, CLOSED, "SI")
    pose = landing.q[-1, -1, BASE:] - tables[STANCE].q[0, 0, BASE:]
    yield Check("rest", float(np.abs([*pose, *landing.v[-1, -1]]).max()), EXACT, "SI")
    yield energy_check("energy of the hop", found, tables)
    yield from impact_checks(machine, design, found)
