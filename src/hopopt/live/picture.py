"""A hop as a live page draws it: numbers, rounded, for its script."""

from typing import Any

import numpy as np
import pinocchio as pin

from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.planner.motion import Motion

INSTANTS = 100  # evenly over the hop
DIGITS = 5  # of a number that is drawn


def picture(motion: Motion) -> dict[str, Any]:
    """The hop at k instants.

    t [s], (k,); chain: x, z of every joint and the foot [m], (k, 2 (n + 1)); v [rad/s], tau [N m], (n, k)
    lowest, com: heights [m], (k,); force: of the ground, upwards [N], (k,)
    voltage: of the bus over what it is without load, (k,); null without a supply that sags
    regions: of each joint the corners of its operating region, [speeds, torques]
    """
    times = np.union1d(np.linspace(0.0, motion.end, INSTANTS), [motion.lift_off])
    s, n = motion.sample(times), len(motion.robot.joints)
    chain = np.stack([s.points[point] for point in (*motion.robot.joints, "foot")], axis=1)
    voltage, region = motion.voltage(s), motion.robot.parameters
    outlines = [operating_region(motion.design.leg, joint, region).outline() for joint in motion.robot.joints]
    return {
        "t": _rounded(s.t), "lift_off": float(motion.lift_off), "joints": list(motion.robot.joints),
        "chain": _rounded(chain.reshape(len(s.t), -1)), "v": _rounded(s.v[:, -n:].T),
        "tau": _rounded(s.command.T), "lowest": _rounded(s.lowest), "com": _rounded(s.points["com"][:, 1]),
        "force": _rounded(s.f[:, -1]), "voltage": None if voltage is None else _rounded(voltage),
        "regions": [_rounded(corners.T) for corners in outlines],
    }  # fmt: skip


def figures(motion: Motion) -> dict[str, float | None]:
    """What a list of designs tells of each: mass of the robot that this leg lifts [kg], the greatest power that its motors
    give together [W], and the lowest bus voltage over that without load."""
    s = motion.sample(np.linspace(0.0, motion.end, INSTANTS))
    power = (s.command * s.v[:, -s.command.shape[1] :]).sum(axis=1)
    voltage = motion.voltage(s)
    return {
        "mass_kg": float(pin.computeTotalMass(motion.robot.model)), "peak_power_W": float(power.max()),
        "lowest_voltage": None if voltage is None else float(voltage.min()),
    }  # fmt: skip


def _rounded(values: np.ndarray) -> list[Any]:
    return np.round(values, DIGITS).tolist()
