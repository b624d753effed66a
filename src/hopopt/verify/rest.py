"""Is a landing to rest true? Its touchdown, its end, and the energy of the whole hop, by Pinocchio's C++."""

from collections.abc import Iterator, Mapping

import numpy as np

from hopopt.design import Design
from hopopt.leg.robot import BASE
from hopopt.sim.machine import Machine
from hopopt.verify.check import BALANCE, EXACT, LIMIT, Check
from hopopt.verify.landing import jumps
from hopopt.verify.measures import joint_work
from hopopt.verify.periodic import CLOSED, SMALL, impact_excess, touchdown_of
from hopopt.verify.table import DESCENT, FLIGHT, LANDING, STANCE, Table


def landed_checks(machine: Machine, design: Design, tables: Mapping[str, Table]) -> Iterator[Check]:
    """That the foot touches down, that the landing begins as the impact leaves the leg and ends at rest in the pose of the
    start, and that the energy of the hop balances."""
    found, landing = touchdown_of(machine, tables), tables[LANDING]
    begins = [*jumps(tables[FLIGHT], tables[DESCENT]), landing.t[0, 0] - tables[DESCENT].t[-1, -1]]
    foot = [found.place[1], max(float(found.speed[1]), 0.0)]
    yield Check("descent begins as flight ends", max(float(np.abs(part).max()) for part in begins), EXACT, "SI")
    yield Check("touchdown", float(np.abs(foot).max()), EXACT, "SI")
    yield Check("landing begins as the impact leaves the leg", found.closure, CLOSED, "SI")
    pose = landing.q[-1, -1, BASE:] - tables[STANCE].q[0, 0, BASE:]
    yield Check("rest", float(np.abs([*pose, *landing.v[-1, -1]]).max()), EXACT, "SI")
    work = {name: joint_work(table) for name, table in tables.items()}
    net, moved = (sum(part[k] for part in work.values()) for k in (0, 1))
    yield Check("energy of the hop", abs(net - found.loss) / max(moved, SMALL), BALANCE, "relative")
    for limit, passed in impact_excess(machine, design, found).items():
        yield Check(str(limit), max(passed, 0.0), LIMIT, "of its range")
