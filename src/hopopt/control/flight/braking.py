"""Whether joints can be brought to rest before their limits, and their speeds as they are now.

A push that drives a light leg's joints towards the stretched leg leaves them fast, close to their limits. Whether a drive stops
them in time depends on a few rad/s, and by so much measured speeds are late.
"""

from collections import deque
from dataclasses import replace

import numpy as np

from hopopt.control.setting import Setting
from hopopt.drivetrain.drives import Drive
from hopopt.drivetrain.operating_region.half_planes import UNBOUNDED
from hopopt.leg.robot import BASE
from hopopt.sim.controller import Measurement
from hopopt.sim.machine import Machine

BRAKING = 0.5  # share of the drives' braking torque that is counted on: links are coupled
SPARED = 0.01  # share of a joint's range before its limit, within which it is to have come to rest
STANDS = 0.02  # share of a drive's no-load speed, below which a joint stands still: encoders are coarse
SPEEDS = np.linspace(0.0, 0.99, 100)  # shares of the no-load speed at which ways to rest are computed


class Braking:
    """Ways in which the joints of a stretched leg come to rest in flight."""

    def __init__(self, setting: Setting, stretched: np.ndarray):
        """stretched: joint angles (n) [rad] at which drives and inertia are taken."""
        leg = setting.design.leg
        self.lower, self.upper = (np.array([getattr(leg.joint[j], s) for j in leg.joints]) for s in ("lower", "upper"))
        self.period, self.no_load = setting.period, setting.no_load_speed
        self._drive = setting.drive().at(stretched)
        inertia = np.diag(setting.machine().mass_matrix(np.concatenate([np.zeros(BASE), stretched])))[BASE:]
        self._ways = [self._way_to_rest(of, of_all) for of, of_all in zip(np.eye(len(inertia)), inertia, strict=True)]

    def too_fast(self, q: np.ndarray, v: np.ndarray) -> bool:
        """Whether a joint at angles q and speeds v (n) [rad, rad/s] would come to rest too late, braked from the next period on."""
        return bool((self.rests_at(q, v) < 0).any())

    def rests_at(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """How far (n) [rad] before its limit, less SPARED, each joint comes to rest; without end for one that stands still."""
        speed, free = np.abs(v), np.where(v > 0, self.upper - q, q - self.lower)
        way = [np.interp(w, *of_joint, right=np.inf) for w, of_joint in zip(speed, self._ways, strict=True)]
        left = free - SPARED * (self.upper - self.lower) - self.period * speed - np.array(way) / BRAKING
        return np.where(speed < STANDS * self.no_load, np.inf, left)

    def _way_to_rest(self, joint: np.ndarray, inertia: float) -> tuple[np.ndarray, np.ndarray]:
        """Speeds (k) [rad/s] and the ways (k) [rad] to rest from them, of the joint that is 1 in ``joint`` (n), up to a speed from which its
        whole range would not do."""

        def strength(speed: float) -> float:
            return abs(float(self._drive.clamp(speed * joint, -UNBOUNDED * joint) @ joint))

        whole = np.sqrt(2 * strength(0.0) * float((self.upper - self.lower) @ joint) / inertia)
        speeds = SPEEDS * min(float(whole), float(self.no_load[joint.argmax()]))
        slope = np.array([w * inertia / strength(w) if strength(w) else np.inf for w in speeds])
        return speeds, np.concatenate([[0.0], np.cumsum(np.diff(speeds) * (slope[1:] + slope[:-1]) / 2)])


class SpeedsNow:
    """Joint speeds as they are now: those measured are means of a few periods, and in these joints gained what the torques that were
    asked for have given them."""

    def __init__(self, setting: Setting, machine: Machine, drive: Drive):
        """machine, drive: as the leg is believed to be."""
        simulated = setting.design.simulation
        window = simulated.speed_window if simulated.encoder_bits else 0
        self.machine, self.drive = machine, drive
        self._weights = setting.period * (np.arange(window) + 0.5) / max(window, 1)
        still = np.zeros(len(setting.design.leg.joints))
        self._rates = deque([still] * window, maxlen=window)  # of the joints in the last periods [rad/s^2]
        self._down = True  # whether the foot was on the ground

    def of(self, now: Measurement) -> Measurement:
        """The same instant, with the speeds that joints have by then."""
        if now.contact and not self._down:  # no torque says what an impact leaves
            self._rates.extend([np.zeros_like(now.v)] * len(self._rates))
        self._down = now.contact
        return replace(now, v=now.v + self._weights @ np.array(self._rates)) if self._rates else now

    def after(self, now: Measurement, tau: np.ndarray) -> None:
        """Note the torques (n) [N m] that are asked for at an instant with speeds of ``of``."""
        drive = self.drive.at(now.q)
        given = drive.passed(now.v, drive.clamp(now.v, tau))
        q, v = np.concatenate([np.zeros(BASE), now.q]), np.concatenate([np.zeros(BASE), now.v])
        if now.contact:
            s = self.machine.stance_terms(now.q, now.v)
            q, v = s.q, s.v
        self._rates.append(self.machine.acceleration(q, v, given, now.contact)[BASE:])
