"""The tie-break: of optima that are equally good, the one with the gentlest torques."""

from collections.abc import Callable

import casadi as ca
import numpy as np

from hopopt.drivetrain.dynamics import added_states
from hopopt.drivetrain.motor import stall_torque
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.ocp.drives import motor_torques
from hopopt.ocp.guesses.motion import MotionAt, MovingLeg
from hopopt.ocp.problem import Instant

EFFORT = "effort"  # the name of its integral
LOOPED = 10.0  # times its weight, of a leg that closes a loop in stance: there torques can hold against each other
REVERSING = 10.0  # and, of a leg that loops or not, where gears turn from driving to braking: torques that hardly matter chatter there


def effort(leg: MovingLeg, motion: MotionAt) -> Callable[[Instant], ca.SX]:
    """Sum over the joints of (tau / stall torque)^2, to be integrated; tau is what the motors are asked for. Where the rate of
    tau is limited, (rate / limit)^2 too."""
    torques = motor_torques(leg, motion)

    def rate(s: Instant) -> ca.SX:
        found = ca.sumsqr(torques(s) / ca.vertcat(*[stall_torque(leg.leg, j, s.p) for j in leg.leg.joints]))
        limited = added_states(leg.leg, s.p).limited
        return found + sum((leg.commands(s)[k] / most) ** 2 for k, most in limited.items())

    return rate


def largest_effort(leg: MovingLeg) -> float:
    """The most that ``effort`` can be; a region that no half-plane closes is taken up to twice its stall torque."""
    total, p = float(len(leg.drive_states.limited)), leg.robot.parameters
    for joint in leg.leg.joints:
        stall = stall_torque(leg.leg, joint, p)
        total += float(np.max(np.abs(operating_region(leg.leg, joint, p).corners()[:, 1]))) ** 2 / stall**2
    return total
