"""A hop as a live page draws it: numbers, rounded, for its script."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from hopopt.planner.motion import Motion
from hopopt.report.motion import bars, chain

INSTANTS = 100  # evenly over the hop
DIGITS = 5  # of a number that is drawn


@dataclass(frozen=True)
class Picture:
    """What a page shows of a hop.

    drawn: the hop at k instants: t [s], (k,); chain: x, z of every joint and the foot [m], (k, 2 (n + 1)); bars: of each
        five-bar x, z of pivot, crank's end and rod's end [m], (k, 6 five-bars); v [rad/s],
        tau [N m], (n, k); lowest, com: heights [m], (k,); force: of the ground, upwards [N], (k,); voltage: of the bus
        over what it is without load, (k,), null without a supply that sags; regions: of each joint the corners of its
        operating region, [speeds, torques]
    figures: mass of the robot that this leg lifts [kg], the greatest power that its motors give together [W], and the
        lowest bus voltage over that without load
    """

    drawn: Mapping[str, Any]
    figures: Mapping[str, float | None]


def picture(motion: Motion) -> Picture:
    """A hop as it is drawn, with what a list of designs tells of it."""
    times = np.union1d(np.linspace(0.0, motion.end, INSTANTS), [motion.lift_off])
    s, robot = motion.sample(times), motion.robot
    v, voltage, legs = s.w, motion.voltage(s), chain(s.points, robot)
    drawn = {
        "t": _rounded(s.t), "joints": list(robot.joints), "chain": _rounded(legs.reshape(len(s.t), -1)),
        "bars": _rounded(bars(legs, s.q, robot.leg).reshape(len(s.t), -1)),
        "v": _rounded(v.T), "tau": _rounded(s.command.T), "lowest": _rounded(s.lowest),
        "com": _rounded(s.points["com"][:, 1]), "force": _rounded(s.f[:, -1]),
        "voltage": None if voltage is None else _rounded(voltage),
        "regions": [_rounded(motion.region(joint).outline().T) for joint in robot.joints],
    }  # fmt: skip
    return Picture(drawn, {
        "mass_kg": float(pin.computeTotalMass(robot.model)), "peak_power_W": float((s.command * v).sum(axis=1).max()),
        "lowest_voltage": None if voltage is None else float(voltage.min()),
    })  # fmt: skip


def _rounded(values: np.ndarray) -> list[Any]:
    return np.round(values, DIGITS).tolist()
