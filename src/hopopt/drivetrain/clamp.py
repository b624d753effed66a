"""The clamp of a drive: what is left of a commanded torque at a speed (paper's eq. 14). One function for all who ask.

It is plain Python on purpose: verification calls it as it is, the plants compile it (drivetrain/kernels.py).
"""

from collections.abc import Sequence
from math import inf
from typing import Any

import numpy as np

from hopopt.drivetrain.half_planes import OperatingRegion

UNBOUNDED = 1e12  # [N m] of a torque line that is not there
TOGETHER = 4  # lines that a compiled function reads: other shapes of arrays are compiled anew


def within(w: float, tau: float, upper: Any, lower: Any) -> float:
    """tau [N m] of one joint within torques c - d w of the lines (c, d) above and below, (k, 2) each; 0 where there are none."""
    high, low = inf, -inf
    for k in range(len(upper)):
        high = min(high, upper[k][0] - upper[k][1] * w)
    for k in range(len(lower)):
        low = max(low, lower[k][0] - lower[k][1] * w)
    return min(max(tau, low), high) if low <= high else 0.0


def torque_lines(regions: Sequence[OperatingRegion]) -> tuple[np.ndarray, np.ndarray]:
    """Lines c - d w of the greatest and of the least torque of every joint, as many for each, (n, k, 2) [N m, N m s/rad]."""
    bounding = [[(float(h.a), float(h.b)) for h in region.planes if h.a != 0] for region in regions]
    upper = _filled([[(1 / a, b / a) for a, b in planes if a > 0] for planes in bounding], UNBOUNDED)
    return upper, _filled([[(1 / a, b / a) for a, b in planes if a < 0] for planes in bounding], -UNBOUNDED)


def filled_up(lines: np.ndarray, none: float) -> np.ndarray:
    """Lines (n, k, 2) with as many that never bound as make k a multiple of TOGETHER; none: their torque [N m]."""
    more = np.broadcast_to([none, 0.0], (len(lines), -lines.shape[1] % TOGETHER, 2))
    return np.concatenate([lines, more], axis=1)


def _filled(of_joints: list[list[tuple[float, float]]], none: float) -> np.ndarray:
    most = max(len(each) for each in of_joints)
    full = [[*each, *[(none, 0.0)] * (most - len(each))] for each in of_joints]
    return np.array(full, dtype=float).reshape(len(of_joints), most, 2)
