"""How a leg is drawn up in flight: towards the pose that lifts its lowest point highest in the time there is.

From lift-off on the centre of mass is on its parabola, whatever the joints do, so poses alone are left to choose. At lift-off
flights towards many are computed side by side on the believed leg, with the same servo and the same clamp. A flight counts up
to the first limit that it does not keep. Of the optimum nothing is known here.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from hopopt.control.flight.braking import BRAKING, SPARED
from hopopt.drivetrain.drives import Drive
from hopopt.drivetrain.operating_region.half_planes import UNBOUNDED, OperatingRegion
from hopopt.drivetrain.transmission import turned
from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.kinematics import spread
from hopopt.leg.robot import BASE, Robot
from hopopt.leg.scales import Scale

STEP = 2e-3  # [s] on the paper's leg, between the computed instants of a flight
PARTS = 3  # steps from one of them to the next
HELD = 0.05  # [s] on the paper's leg, for which a leg is drawn up beyond the time that is aimed at: it need not turn back at once
PAST_APEX = 0.1  # [s] on the paper's leg, after the apex, for which it is computed
QUICKEST = 150.0  # [1/s] on the paper's leg: bandwidth of the servo at most, which the steps can follow
POSES = (64, 48)  # that are tried at first, and then about the best
NARROWER = 0.2  # share of the joints' ranges within which they are then tried
LEAST = 0.2  # share of what is asked for that is left where drives saturate: beyond a speed limit nothing would fit
FASTEST = (0.85, 0.97)  # shares of the no-load speed to which joints are driven: coupled joints may overrun the greater
KEPT = 0.99  # share of the no-load speed beyond which a computed flight counts no more
MARGIN = 0.03  # [rad] that poses keep from the joint limits
SUNK = 1e-3  # [m] on the paper's leg, by which a computed leg may be below the ground


@dataclass(frozen=True)
class LiftOff:
    """Joint angles and speeds (n) [rad, rad/s], and upward speed [m/s] of the centre of mass as the foot leaves."""

    q: np.ndarray
    v: np.ndarray
    rising: float


@dataclass(frozen=True)
class Aim:
    """The pose (n) [rad] to draw up to, the share of the no-load speed to which joints are driven there, the height [m] that the lowest
    point is expected to reach, and when [s] after lift-off."""

    pose: np.ndarray
    fastest: float
    height: float
    at: float


class DrawingUp:
    """The servo that draws a leg up, and what it makes of poses."""

    def __init__(
        self,
        robot: Robot,
        drive: Drive,
        regions: Sequence[OperatingRegion],
        no_load: np.ndarray,
        window: float,
        k_p: float,
    ):
        """no_load: speeds (n) [rad/s] at which drives have no torque left; window: of the foot beside the hip [m]; k_p: of the servo
        [N m/rad], as far as its bandwidth allows."""
        leg, scale = robot.leg, Scale.of(robot.leg)
        self.window, self.step, self.late = window, STEP * scale.time, PAST_APEX * scale.time
        self.held = HELD * scale.time
        self.lower, self.upper = (np.array([getattr(leg.joint[j], s) for j in leg.joints]) for s in ("lower", "upper"))
        self.sunk, self.gravity = SUNK * scale.length, float(np.linalg.norm(robot.model.gravity.linear))
        self.drive, self.no_load, self.k_p, self.quickest = drive, no_load, k_p, QUICKEST / scale.time
        self._places = _places(robot)
        self._servo, self._step = self._functions(robot, regions)

    def _functions(self, robot: Robot, regions: Sequence[OperatingRegion]) -> tuple[ca.Function, ca.Function]:
        """The servo's torques, and angles and speeds one step later, of angles, speeds and a pose (n) each, and a share of the no-load
        speed. Inertia within a step is that of its beginning: a quarter of the time less, the greatest height the same to 0.1 mm."""
        n = len(robot.joints)
        q, v, pose = (ca.SX.sym(name, n) for name in ("q", "v", "pose"))
        fastest = ca.SX.sym("fastest")
        M, bias = ca.SX.sym("M", n, n), ca.SX.sym("bias", n)
        J = ca.DM.eye(n) if robot.leg.direct else turned(robot.leg, robot.parameters, q, v, v).jacobian
        w, at_drives = J @ v, (lambda tau: tau) if robot.leg.direct else (lambda tau: ca.solve(J.T, tau))
        bounds = [[ca.vertcat(*side) for side in r.torques_at(w[k])] for k, r in enumerate(regions)]
        least, most = ca.vertcat(*[ca.mmax(x) for x, _ in bounds]), ca.vertcat(*[ca.mmin(x) for _, x in bounds])

        def clamped(wanted: ca.SX) -> ca.SX:
            return ca.if_else(least <= most, ca.fmax(ca.fmin(at_drives(wanted), most), least), 0.0)

        strength = ca.fabs(J.T @ clamped(-ca.sign(pose - q) * UNBOUNDED))
        asked = M @ self._wanted(pose - q, v, ca.diag(M), strength, fastest * self.no_load)
        driven = at_drives(asked)
        room = (ca.if_else(driven > 0, most, least) - at_drives(bias)) / ca.if_else(driven == 0, 1.0, driven)
        tau = bias + ca.fmin(ca.fmax(ca.mmin(room), LEAST), 1.0) * asked
        a, h, after = ca.solve(M, J.T @ self.drive.passed(w, clamped(tau)) - bias), self.step / PARTS, (q, v)
        given, motion = [q, v, pose, fastest], _motion(robot)(q, v)
        part = ca.Function("part", [*given, M, bias], [q + h * (v + h * a), v + h * a, tau])
        asked = part(*given, *motion)[2]
        for _ in range(PARTS):
            after = part(*after, pose, fastest, *motion)[:2]
        return ca.Function("servo", given, [asked]), ca.Function("step", given, list(after))

    def _wanted(self, error: ca.SX, v: ca.SX, inertia: ca.SX, strength: ca.SX, most: ca.SX) -> ca.SX:
        """Accelerations (n) [rad/s^2] of a critically damped servo that comes no faster than its drive can brake, nor than ``most`` (n)
        [rad/s]."""
        rate = ca.fmin(ca.sqrt(self.k_p / inertia), self.quickest)
        quick = ca.fmin(ca.sqrt(2 * BRAKING * strength / inertia * ca.fabs(error)), most)
        return 2 * rate * (ca.fmax(ca.fmin(rate / 2 * error, quick), -quick) - v)

    def torque(self, q: np.ndarray, v: np.ndarray, pose: np.ndarray, fastest: float) -> np.ndarray:
        """Torques (n) [N m] towards a pose (n) [rad], critically damped, no faster than the drives can brake, nor than this share of the
        no-load speed."""
        return np.array(self._servo(q, v, pose, fastest)).ravel()

    def aim(self, off: LiftOff) -> Aim | None:
        """The pose that is worth most from a lift-off on; None if no flight keeps the limits. A flight that comes within SPARED of a
        joint's limit is taken only where all others come closer."""
        return self._best(off, SPARED) or self._best(off, 0.0)

    def _best(self, off: LiftOff, spared: float) -> Aim | None:
        lower, upper = self.lower + MARGIN, self.upper - MARGIN
        poses, shares, best = lower + (upper - lower) * spread(POSES[0], len(lower)), FASTEST, None
        for count in (*POSES[1:], 0):
            for fastest in shares:
                heights, times = self.heights(off, poses, fastest, spared)
                if heights.max() > (best.height if best else 0.0):
                    k = int(np.argmax(heights))
                    best = Aim(poses[k], fastest, float(heights[k]), float(times[k]))
            if best is None:
                return None
            around = best.pose + NARROWER * (upper - lower) * (spread(count, len(lower)) - 0.5)
            poses, shares = np.clip(around, lower, upper), (best.fastest,)
        return best

    def heights(
        self, off: LiftOff, poses: np.ndarray, fastest: float, spared: float = 0.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """How high the lowest point comes on the way to poses (k, n) [rad], (k,) [m], and when after lift-off, (k,) [s].

        fastest: share of the no-load speed to which joints are driven. spared: share of the joints' ranges that is kept free at their
        limits, where they are not beyond it at lift-off.
        """
        t, q, v = self.flights(off, poses, fastest)
        rows = q.reshape(-1, q.shape[-1])
        over, beside, above = (np.array(x).reshape(len(t), -1) for x in self._places.map(len(rows))(rows.T))
        height = above[0] + (off.rising * t - self.gravity / 2 * t**2)[:, None] + over
        most = np.maximum(KEPT * self.no_load, np.abs(off.v))
        free = spared * (self.upper - self.lower)
        lower, upper = np.clip(off.q, self.lower, self.lower + free), np.clip(off.q, self.upper - free, self.upper)
        kept = ((q >= lower) & (q <= upper) & (np.abs(v) <= most)).all(axis=2) & (height >= -self.sunk)
        counts = np.logical_and.accumulate(kept) & (np.abs(beside) <= self.window)
        height = np.where(counts, height, -np.inf)
        return height.max(axis=0), t[height.argmax(axis=0)]

    def flights(self, off: LiftOff, poses: np.ndarray, fastest: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (m,) [s] from lift-off, angles and speeds of the joints (m, k, n) on the way to poses (k, n) [rad], at most at a share of
        the no-load speed."""
        t = np.arange(0.0, max(off.rising, 0.0) / self.gravity + self.late, self.step)
        step, towards = self._step.map(len(poses)), ca.DM(poses.T)
        states = [tuple(ca.DM(np.broadcast_to(x[:, None], poses.T.shape)) for x in (off.q, off.v))]
        for _ in t[1:]:
            states.append(step(*states[-1], towards, fastest))
        q, v = (np.array([np.array(x).T for x in part]) for part in zip(*states, strict=True))
        return t, q, v


def _motion(robot: Robot) -> ca.Function:
    """Inertia (n, n) [kg m^2] of the joints in flight, and the torques (n) [N m] that they take without acceleration, of q and v."""
    n, still = len(robot.joints), ca.SX.zeros(BASE)
    q, v, a = (ca.SX.sym(name, n) for name in "qva")
    tau = LegDynamics(robot, robot.parameters).flight(still, still, q, v, a).tau
    return ca.Function("motion", [q, v], [ca.jacobian(tau, a), ca.substitute(tau, a, ca.SX.zeros(n))])


def _places(robot: Robot) -> ca.Function:
    """How high the lowest point is over the centre of mass, the foot ahead of the hip, and the centre of mass over the foot [m], of q."""
    q = ca.SX.sym("q", len(robot.joints))
    points = LegDynamics(robot, robot.parameters).points(ca.vertcat(ca.SX.zeros(BASE), q))
    over = ca.vertcat(*[points[name][1] - points["com"][1] for name in robot.point_names])
    beside = points["foot"][0] - points[robot.joints[0]][0]
    return ca.Function("places", [q], [ca.mmin(over), beside, points["com"][1] - points["foot"][1]])
