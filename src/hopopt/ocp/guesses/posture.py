"""The posture in which a leg clears most at the apex, whatever its push: its lowest point as high over the centre of mass
as joint limits and foot window allow.

The global method has this posture by code of its own (global_search/posture.py), as its answers are evidence about the
planner's.
"""

import casadi as ca
import numpy as np
from scipy.optimize import minimize

from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.kinematics import WINDOW_PENALTY, best_pose
from hopopt.leg.robot import BASE
from hopopt.ocp.guesses.motion import MovingLeg
from hopopt.ocp.hops.collision import slack


class Posture:
    """How high poses of a leg have its lowest point over the centre of mass, the leg clear of the body and of itself."""

    def __init__(self, leg: MovingLeg):
        self.limits, self.window = leg.limits, leg.design.hop.foot_window
        q = ca.SX.sym("q", leg.n)
        dynamics = LegDynamics(leg.robot, leg.robot.parameters)
        points = dynamics.points(ca.vertcat(ca.SX.zeros(BASE), q))
        over = ca.vertcat(*[points[name][1] - points["com"][1] for name in leg.point_names])
        beside = points["foot"][0] - points[leg.leg.joints[0]][0]
        clear = slack(leg, q)
        self._places = ca.Function("places", [q], [over, beside, clear])
        self._slopes = ca.Function("slopes", [q], [ca.jacobian(part, q) for part in (over, beside, clear)])

    def height(self, q: np.ndarray) -> np.ndarray:
        """Lowest point over the centre of mass (k,) [m] in poses q (k, n) [rad], less where the foot is beyond its window."""
        over, beside, clear = (np.array(part) for part in self._places.map(len(q))(q.T))
        inside = np.maximum(-clear, 0.0).max(axis=0) if len(clear) else 0.0
        return over.min(axis=0) - WINDOW_PENALTY * (np.maximum(np.abs(beside[0]) - self.window, 0.0) + inside)

    def best(self) -> np.ndarray:
        """The pose (n,) [rad] in which that is highest."""
        return best_pose(*self.limits, self.height, self._refined)

    def _refined(self, q: np.ndarray) -> np.ndarray:
        """The nearest optimum; unknowns are the pose and a height that no point is below."""

        def room(x: np.ndarray) -> np.ndarray:
            over, beside, clear = (np.array(part).ravel() for part in self._places(x[:-1]))
            return np.concatenate([over - x[-1], self.window - beside, self.window + beside, clear])

        def slope(x: np.ndarray) -> np.ndarray:
            over, beside, clear = (np.array(part) for part in self._slopes(x[:-1]))
            lifts = np.zeros(len(over) + 2 + len(clear))
            lifts[: len(over)] = -1.0
            return np.hstack([np.vstack([over, -beside, beside, clear]), lifts[:, None]])

        result = minimize(
            lambda x: -x[-1], np.append(q, self.height(q[None])[0]), jac=lambda x: np.append(np.zeros(len(q)), -1.0),
            method="SLSQP", bounds=[*zip(*self.limits, strict=True), (None, None)],
            constraints={"type": "ineq", "fun": room, "jac": slope},
        )  # fmt: skip
        return result.x[:-1]
