"""What counts as the whole range of a limit that has no other end: the same for planner and verification."""

from typing import Any

import numpy as np
import pinocchio as pin

FORCE_RANGE = 5.0  # [weights of the leg]: a push-off's peak
DESCENT_RANGE = 1.0  # [m/s]: speed at which a body sinks into a counter-movement


def weight(model: pin.Model) -> float:
    """Weight [N] of everything the model carries, in the model's own gravity."""
    return float(sum(i.mass for i in model.inertias) * np.linalg.norm(model.gravity.linear))


def time_scale(model: pin.Model, length: float) -> float:
    """sqrt(length / gravity) [s]: times of legs that differ in size alone are as these."""
    return float(np.sqrt(length / np.linalg.norm(model.gravity.linear)))


def force_range(model: pin.Model) -> float:
    """Ground force [N] by which excess is measured."""
    return FORCE_RANGE * weight(model)


def friction_needed(along: np.ndarray, up: np.ndarray, given: float | None, allowed: Any) -> float:
    """The coefficient of the narrowest friction cone around contact forces, ``along`` and ``up`` (k,) [N].

    given: the ground's coefficient, None where it grips without limit. Where its cone holds all of them but for ``allowed``
    [N, one number or (k,)], no more than it is needed: the ratio of two forces that are nearly nothing says nothing.
    """
    steepest = float((along / up).max(initial=0.0))
    kept = given is not None and bool(np.all(along - given * up <= allowed))
    return min(steepest, given) if kept and given is not None else steepest


def joint_inertias(model: pin.Model, angles: np.ndarray) -> np.ndarray:
    """The inertia (n) [kg m^2] that each joint shows at these joint angles (n) [rad] while all others are free."""
    q = np.concatenate([np.zeros(model.nq - len(angles)), angles])
    M = pin.crba(model, model.createData(), q)
    return 1 / np.diag(np.linalg.inv(np.triu(M) + np.triu(M, 1).T))[-len(angles) :]
