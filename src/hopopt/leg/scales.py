"""What counts as the whole range of a limit that has no other end: the same for planner and verification."""

import numpy as np
import pinocchio as pin

FORCE_RANGE = 5.0  # [weights of the leg]: a push-off's peak
DESCENT_RANGE = 1.0  # [m/s]: speed at which a body sinks into a counter-movement


def weight(model: pin.Model) -> float:
    """Weight [N] of everything the model carries, in the model's own gravity."""
    return float(sum(i.mass for i in model.inertias) * np.linalg.norm(model.gravity.linear))


def force_range(model: pin.Model) -> float:
    """Ground force [N] by which excess is measured."""
    return FORCE_RANGE * weight(model)
