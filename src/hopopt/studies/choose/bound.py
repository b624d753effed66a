"""The most that drives could lift a leg by: a closed bound, so high that no hop passes it.

At the end every point of the leg is at the clearance or above, and so is its centre of mass (com). In flight the com is
ballistic, so it gets no higher than its energy at lift-off over m g. That is what it had at rest, and the work of the
motors in stance, which is at most the greatest power of all of them over the longest stance. Losses only take away.

    h <= z_com(start) + T max(P) / (m g),    P = sum of the joints' greatest powers within their operating regions

A supply bounds the sum further: what the motors give together is no more than what it lets through.
"""

import numpy as np
import pinocchio as pin

from hopopt.design import Design
from hopopt.drivetrain.supply import power_limits
from hopopt.leg.derived import derived
from hopopt.leg.kinematics import start_angles
from hopopt.leg.robot import BASE, build_robot


def highest(design: Design) -> float:
    """Clearance [m] that no hop from rest of the problem exceeds; infinite where the bound does not hold."""
    if any(
        (link.com is not None and not 0 <= link.com <= link.length) or link.com_position
        for link in design.leg.link.values()
    ):
        return np.inf  # a centre of mass may be below the lowest point
    robot, figures = build_robot(design.leg), derived(design)
    q = np.concatenate([np.zeros(BASE), start_angles(design)])
    model, data = robot.model, robot.model.createData()
    com = pin.centerOfMass(model, data, q)[2]
    pin.framesForwardKinematics(model, data, q)
    foot = data.oMf[model.getFrameId("point_foot")].translation[2]
    power = sum(j.peak_power for j in figures.joints)
    power = min([power, *(float(x) for x in power_limits(design.leg, robot.parameters).values())])
    stance = design.hop.stance_duration
    assert stance is not None
    return float(com - foot + stance[1] * power / figures.weight)
