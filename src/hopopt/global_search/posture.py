"""The posture of flight: how far the centre of mass is above the leg's lowest point when the leg is tucked best.

At the apex the clearance is the height of the centre of mass less this, so that no flight has to be searched.
"""

import numpy as np
from scipy.optimize import minimize

from hopopt.global_search.constants import StanceConstants, room_at, to_link_angles

POSES_OF_JOINT = 61  # of each joint, among which the tucked posture is looked for
REFINED = 3  # of the best of them that are refined
WINDOW_PENALTY = 1e3  # height [m] that a pose is thought worse for each metre beyond the foot window


def tuck_height(c: StanceConstants, window: float) -> float:
    """Least height of the centre of mass above the leg's lowest point [m], within joint limits and foot window [m], where no link
    is nearer to what it passes than it may."""
    return best_tuck(c, window)[0]


def best_tuck(c: StanceConstants, window: float) -> tuple[float, np.ndarray]:
    """That height, and the joint angles (2,) [rad] of it: the best poses of a grid, refined by sequential quadratic
    programming."""
    first, second = np.linspace(c.lower1, c.upper1, POSES_OF_JOINT), np.linspace(c.lower2, c.upper2, POSES_OF_JOINT)
    poses = np.stack(np.meshgrid(first, second, indexing="ij"), axis=-1).reshape(-1, 2)
    heights, offset = _above_points(c, poses)
    score = heights.max(axis=-1) + WINDOW_PENALTY * np.maximum(np.abs(offset) - window, 0.0)
    score += WINDOW_PENALTY * np.maximum(-room_at(c, poses), 0.0)
    best = poses[np.argsort(score, kind="stable")[:REFINED]]
    found = [(float(score.min()), best[0]), *(_refined(c, window, q) for q in best)]
    return min(found, key=lambda height_and_pose: height_and_pose[0])


def _refined(c: StanceConstants, window: float, pose: np.ndarray) -> tuple[float, np.ndarray]:
    """The nearest optimum: its height [m], inf if none is found, and its pose; unknowns are joint angles and height."""

    def room(x: np.ndarray) -> np.ndarray:
        heights, offset = _above_points(c, x[:2])
        return np.concatenate([x[2] - heights, [window + offset, window - offset], room_at(c, x[None, :2])])

    begin = np.append(pose, _above_points(c, pose)[0].max())
    bounds = [(c.lower1, c.upper1), (c.lower2, c.upper2), (None, None)]
    result = minimize(
        lambda x: x[2], begin, method="SLSQP", bounds=bounds, constraints={"type": "ineq", "fun": room},
        options={"ftol": 1e-9},
    )  # fmt: skip
    return float(result.x[2]) if room(result.x).min() > -1e-7 else np.inf, result.x[:2]


def _above_points(c: StanceConstants, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far the centre of mass is above foot, knee, hip, trunk and the thigh's corners (..., 4 + k) [m], and the foot in front
    of the hip [m].

    q: joint angles (..., 2) [rad]
    """
    turned = np.exp(1j * to_link_angles(c, q))
    knee = -complex(c.shank_x, c.shank_z) * turned[..., 1]
    hip = knee - complex(c.thigh_x, c.thigh_z) * turned[..., 0]
    moment = complex(c.first, c.first_across) * turned[..., 0] + complex(c.second, c.second_across) * turned[..., 1]
    com = moment.imag / c.mass
    corners = np.imag(turned[..., :1] * (c.corners[:, 0] + 1j * c.corners[:, 1]))
    points = np.stack([com, com - knee.imag, com - hip.imag, com - hip.imag - c.trunk], axis=-1)
    return np.concatenate([points, (com - hip.imag)[..., None] - corners], axis=-1), -hip.real
