"""Where one phase of a plan becomes the next: lift-off, the apex of a hop that lands, and its touchdown.

By Pinocchio's C++, as in ``verify``; each function returns the parts of one check: values that must all be zero.
"""

from collections.abc import Iterator

import numpy as np

from hopopt.sim.machine import Machine
from hopopt.verify.table import Table

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


def jumps(before: Table, after: Table) -> Parts:
    """By how much time, place and speed differ where a phase follows another."""
    return [getattr(before, s)[-1, -1] - getattr(after, s)[0, 0] for s in ("t", "q", "v")]
