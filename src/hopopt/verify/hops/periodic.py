"""A hop that ends as it began, by Pinocchio's C++: its impact, what the impact does to foot and gears, its energy."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from hopopt.design import Design
from hopopt.leg.limit_id import Kind, LimitId
from hopopt.leg.robot import BASE
from hopopt.leg.scales import Scale, weight
from hopopt.sim.machine import Machine
from hopopt.verify.check import BALANCE, EXACT, LIMIT, Check
from hopopt.verify.measures import joint_work
from hopopt.verify.table import DESCENT, FLIGHT, LANDING, STANCE, Table, jumps

CLOSED = 1e-8  # rad, rad/s: by which the state after the impact may differ from that in which stance begins
SMALL = 1e-3  # [J] on the paper's leg: work that is as good as none


@dataclass(frozen=True)
class Touchdown:
    """The impact at touchdown, of a hop that goes on.

    closure: largest difference of the state after it from that in which the next stance begins [rad, rad/s]
    place, speed: of the foot just before it, x and z (2,) [m, m/s]
    impulse: of the ground on the foot, x and z (2,) [N s]
    loss: kinetic energy that it takes [J]
    gear: what each gear passes on to its rotor, joint side (n,) [N m s]
    """

    closure: float
    place: np.ndarray
    speed: np.ndarray
    impulse: np.ndarray
    loss: float
    gear: np.ndarray


def joints_at(table: Table, place: int) -> np.ndarray:
    """Joint angles [rad] and speeds [rad/s] at the beginning (place 0) or the end (-1) of a phase, (2 n,)."""
    return np.r_[table.q[place, place, BASE:], table.v[place, place, BASE:]]


def closure(machine: Machine, begin: np.ndarray, q: np.ndarray, v: np.ndarray, rate: float = 1.0) -> float:
    """Largest difference of the joints after an impact at q, v from those with which stance is to begin (2 n) [rad, and
    ``rate`` rad/s]."""
    units = np.repeat([1.0, rate], len(begin) // 2)
    return float(np.abs((np.r_[q[BASE:], machine.touch_down(q, v)[BASE:]] - begin) / units).max())


def touchdown_of(machine: Machine, tables: Mapping[str, Table], begin: np.ndarray | None = None) -> Touchdown:
    """The impact of a plan; ``begin``: joint angles and speeds (2 n) with which the stance after it is to begin, by default
    those of the landing, or of the first stance again."""
    q, v = tables[DESCENT].q[-1, -1], tables[DESCENT].v[-1, -1]
    after, impulse = machine.impact(q, v)
    gear = machine.robot.rotors * machine.robot.rotor_speeds(q, after - v)
    lost = machine.energy(q, v) - machine.energy(q, after)
    begin = joints_at(tables.get(LANDING, tables[STANCE]), 0) if begin is None else begin
    return Touchdown(closure(machine, begin, q, v), *machine.foot_motion(q, v), impulse[:BASE], lost, gear)


def period(tables: Mapping[str, Table]) -> float:
    """Duration of a cycle [s]."""
    return float(tables[DESCENT].t[-1, -1] - tables[STANCE].t[0, 0])


def periodic_checks(machine: Machine, design: Design, tables: Mapping[str, Table]) -> Iterator[Check]:
    """That the hop ends as it began, its foot where it has to be, and that its energy balances over a cycle."""
    found = touchdown_of(machine, tables)
    ahead = found.place - [design.hop.speed * period(tables), 0.0]
    yield from touchdown_checks(found, tables, tables[STANCE].t[0, 0], ahead)
    yield Check("orbit closed after the impact", found.closure, CLOSED, "SI")
    yield energy_check("energy of a cycle", machine, found, tables)
    yield from impact_checks(machine, design, found)


def touchdown_checks(found: Touchdown, tables: Mapping[str, Table], late: float, astray: np.ndarray) -> Iterator[Check]:
    """That the descent begins as flight ends, and the foot comes down; late: by how much the first stance or the next
    begins at another time than it should [s]; astray: the foot from where it should be [m]."""
    begins = [*jumps(tables[FLIGHT], tables[DESCENT]), late]
    foot = [*astray, max(float(found.speed[1]), 0.0)]
    yield Check("descent begins as flight ends", max(float(np.abs(part).max()) for part in begins), EXACT, "SI")
    yield Check("touchdown", float(np.abs(foot).max()), EXACT, "SI")


def energy_check(name: str, machine: Machine, found: Touchdown, tables: Mapping[str, Table]) -> Check:
    """Net work of the joints over all phases against what the impact takes and what the step climbs, relative to the work
    done."""
    small = SMALL * Scale.of(machine.leg).unit("J")
    net, moved = np.sum([joint_work(table) for table in tables.values()], axis=0)
    climbed = -machine.mass * machine.gravity[0] * found.place[0]
    return Check(name, float(abs(net - found.loss - climbed) / max(moved, small)), BALANCE, "relative")


def impact_checks(machine: Machine, design: Design, found: Touchdown) -> Iterator[Check]:
    """That the impact keeps every limit."""
    for limit, passed in impact_excess(machine, design, found).items():
        yield Check(str(limit), max(passed, 0.0), LIMIT, "of its range")


def impact_excess(machine: Machine, design: Design, found: Touchdown) -> dict[LimitId, float]:
    """By how much an impact passes each limit, as a share of it, or of the weight's impulse in a second; negative: kept."""
    hop, (along, up), friction = design.hop, found.impulse, design.contact.friction
    passed, size = {Kind.IMPACT_PUSH: -up / weight(machine.model)}, float(np.linalg.norm(found.impulse))
    if friction is not None:
        passed[Kind.IMPACT_FRICTION] = (abs(along) - friction * up) / weight(machine.model)
    for kind, value, most in (
        (Kind.IMPULSE, size, hop.touchdown_impulse),
        (Kind.IMPACT_LOSS, found.loss, hop.touchdown_loss),
        (Kind.FOOT_SPEED, float(np.linalg.norm(found.speed)), hop.touchdown_speed),
        (Kind.GEAR_IMPACT, float(np.abs(found.gear).max()) / hop.touchdown_time, hop.touchdown_gear_torque),
    ):
        if most is not None:
            passed[kind] = value / most - 1.0
    return {LimitId(kind): float(share) for kind, share in passed.items()}
