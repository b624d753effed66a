"""The paper's strategies: force control up to motor saturation, and position control (arXiv 2107.13717, section III).

Both follow the two-mass reference y_des(t) (the paper's eq. 9) with the foot under the hip. What the paper leaves open:

- The hip in stance. With both joints saturated it throws the leg over, so in force control the knee is driven and
  clamped (the paper's eqs. 10 and 14), and the hip is given the torque that keeps the body on the plumb line.
- The servo in flight, the "swing motion (position control)". With the printed k_d the leg swings about y_f(t) without
  end, so it is damped critically. It still folds the leg further than y_f where the drives cannot brake in time; with
  flight = "braked" it approaches y_f only as fast as they can.
- The landing. The reference jumps at touchdown (docs/paper.md), then runs ahead of the leg and pulls the foot off the
  ground. So the leg brakes evenly down to the height at which it once started, and there the push begins anew.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from hopopt.control.flight.braking import BRAKING, Braking, SpeedsNow
from hopopt.control.flight.draw_up import MARGIN, Aim, DrawingUp, LiftOff
from hopopt.control.paper_options import PaperOptions
from hopopt.control.setting import Setting, chosen
from hopopt.control.two_mass import TwoMass
from hopopt.drivetrain.operating_region.half_planes import UNBOUNDED
from hopopt.errors import UsageError
from hopopt.leg.kinematics import TwoJoints, foot_offset, two_joints, unlike_two_joints
from hopopt.leg.robot import BASE
from hopopt.leg.scales import Scale
from hopopt.sim.controller import Measurement
from hopopt.sim.hop_metrics import HopFigures
from hopopt.sim.machine import StanceTerms
from hopopt.sim.state import BOUNCE

RATE_STEP = 1e-5  # [m] on the paper's leg: step of the reference's own derivative
SHORTEST_BRAKING = 1e-3  # [m] on the paper's leg, over which a landing brakes at least
STRETCHED = 0.999999  # share of the leg's reach to which it is stretched at most
STILL_MOVING = 0.1  # share of a drive's no-load speed, above which a joint has not come to rest
NEAR = 1.5  # margins from a joint limit, within which a pose is at it


def begin(model: TwoMass, height: float) -> float:
    """Time since mid-stance [s] at which the reference has this height [m] of the body, on its way up."""
    times = np.linspace(0.0, model.t_lo, 2001)
    return float(times[int(np.argmin(np.abs(model.stance_reference(times)[0] - height)))])


class PaperStrategy:
    """What both strategies share: the reference, the servo towards it in flight, and the landing.

    at_once: whether joint speeds are taken as they are now all the time, not only once a joint comes too fast towards its limit
    """

    at_once = False

    def __init__(self, setting: Setting, **gains: Any):
        """gains: options on the paper's leg in place of the printed ones."""
        self.leg = setting.design.leg
        if not two_joints(self.leg):
            number = len(self.leg.joints)
            has = f"this one has {number}" if number != 2 else f"not one {unlike_two_joints(self.leg)}"
            raise UsageError(
                f"{setting.design.name}: the paper's strategies need a leg of two joints, {has}: "
                "simulate track or a strategy of your own (compare --strategies track)"
            )
        self.geometry = TwoJoints.of(self.leg)
        self.longest = STRETCHED * sum(map(abs, self.geometry.ends))  # seen from the side
        self.options = replace(PaperOptions.of(setting.design, gains), **chosen(PaperOptions, setting.options))
        if self.options.k_p <= 0:
            raise UsageError(
                f"k_p = {self.options.k_p:g}: it must be greater than 0, or nothing holds the leg in flight"
            )
        self.two_mass = self.options.two_mass(setting)
        self.machine, self.drive = setting.machine(), setting.drive()
        self.side = np.sign(self.geometry.bend(setting.start[1])) or 1.0
        self.lower, self.upper = (
            np.array([getattr(self.leg.joint[j], side) for j in self.leg.joints]) for side in ("lower", "upper")
        )
        self.shortest, self.step = (length * Scale.of(self.leg).length for length in (SHORTEST_BRAKING, RATE_STEP))
        self.drawing_up, self.aim = self._drawing_up(setting), None
        self.stretched = self.angles(np.inf)
        self.braking = Braking(setting, self.stretched) if self.drawing_up or self.at_once else None
        self.speeds = SpeedsNow(setting, self.machine, self.drive)
        self.hasty = self.at_once  # whether speeds are those of now from here on
        self.ended = False  # whether the push is over with the foot on the ground
        self.bounce = BOUNCE * Scale.of(self.leg).time
        self.no_load = setting.no_load_speed
        self.quick = self.no_load / 2
        self.settled = (setting.design.simulation.speed_window + 1) * setting.period
        self.lowest = float(-foot_offset(self.leg, setting.start)[1])
        self.pushed: float | None = 0.0  # when the push began [s]; None in flight and while landing
        self.left = 0.0  # when the last push ended [s]; a bounce on landing is no lift-off
        self.begin = begin(self.two_mass, self.lowest)
        self.rise = 0.0  # [s] from lift-off to the apex, from the speed when the foot was last down

    def _drawing_up(self, setting: Setting) -> DrawingUp | None:
        if self.options.retraction != "tuck":
            return None
        window = setting.design.hop.foot_window
        return DrawingUp(setting.robot, self.drive, setting.regions(), setting.no_load_speed, window, self.options.k_p)

    def torque(self, now: Measurement) -> np.ndarray:
        """Torques (n) [N m] to ask for. Where the leg is drawn up, a push ends while joints can still be braked before their limits."""
        if self.braking is None:
            return self._asked(now)
        current = self.speeds.of(now)
        if self.pushed is not None:
            self.hasty = self.hasty or self.too_fast(current.q, current.v)
        tau = self._asked(current if self.hasty else now)
        self.speeds.after(current, tau)
        return tau

    def _asked(self, now: Measurement) -> np.ndarray:
        """Torques (n) [N m] of the servo in flight, the landing, the strategy's push, or after it."""
        if not now.contact:
            if self.pushed is not None:
                self.pushed, self.left = None, now.t - now.since
                self.aim = self._aim(now)
            return self.swing(now)
        s = self.machine.stance_terms(now.q, now.v)
        self.rise = self.machine.com_velocity(s.q, s.v)[1] / self.two_mass.g
        down = s.v[1] >= 0 or s.q[1] <= self.lowest + self.shortest  # as low as it will be
        if self.pushed is None and now.since > self.settled and down:
            self.pushed, self.begin = now.t, begin(self.two_mass, s.q[1])
            self.hasty, self.ended = self.at_once, False
        if self.pushed is None:
            return self.land(s)
        tau = self.push(now, s)
        if not self.ended and s.v[1] > 0 and self.over(now, s, tau):
            self.ended, self.aim = True, self._aim(now)
        return self._let_go(now, s) if self.ended else tau

    def over(self, now: Measurement, s: StanceTerms, tau: np.ndarray) -> bool:
        """Whether a push of a rising leg, which asks for torques tau (n) [N m], has to end."""
        return self.too_fast(now.q, now.v)

    def too_fast(self, q: np.ndarray, v: np.ndarray) -> bool:
        """Whether a joint could not be brought to rest before its limit any more; never where the leg is not drawn up."""
        return self.braking is not None and self.braking.too_fast(q, v)

    def _let_go(self, now: Measurement, s: StanceTerms) -> np.ndarray:
        """Torques (n) [N m] towards the pose that is aimed at; where there is none, or they press the foot down, those that fold the leg."""
        if self.drawing_up and self.aim:
            tau = self.drawing_up.torque(now.q, now.v, self.aim.pose, self.aim.fastest)
            if s.contact_force(self.drive.at(now.q).clamp(now.v, tau))[1] <= 0:
                return tau
        return self.upright(s, float(np.copysign(UNBOUNDED, (now.q - self.stretched)[1])))

    def push(self, now: Measurement, s: StanceTerms) -> np.ndarray:
        """Torques (n) [N m] in stance."""
        raise NotImplementedError

    def swing(self, now: Measurement) -> np.ndarray:
        """k_p (theta_des - theta) + d (theta_des' - theta'), critically damped at every joint's own inertia.

        Large errors are made good at half the no-load speed at most: from there the drive can still brake. A braked
        servo comes no faster than sqrt(2 a e), with the deceleration a that its drive has at this speed.
        """
        drawn, aim = self.drawing_up, self.aim
        if drawn and aim and now.t - self.left < max(self.rise, aim.at + drawn.held):
            return drawn.torque(now.q, now.v, aim.pose, aim.fastest)
        angles, rates = self.desired(now)
        error = angles - now.q
        inertia = np.diag(self.machine.mass_matrix(np.concatenate([np.zeros(BASE), now.q])))[BASE:]
        damping = 2 * np.sqrt(self.options.k_p * inertia)
        approach = within(self.options.k_p / damping * error, -self.quick, self.quick)
        if self.options.flight == "braked":
            strength = np.abs(self.drive.at(now.q).clamp(now.v, np.copysign(UNBOUNDED, -error)))
            quickest = np.sqrt(2 * BRAKING * strength / inertia * np.abs(error))
            approach = within(approach, -quickest, quickest)
        return damping * (approach + rates - now.v)

    def _aim(self, now: Measurement) -> Aim | None:
        """Where to draw the leg up to, from the lift-off on; None where the reference goes on."""
        if self.drawing_up is None or self.rise < self.bounce / 2:
            return None
        return self.drawing_up.aim(LiftOff(now.q, now.v, self.rise * self.two_mass.g))

    def land(self, s: StanceTerms) -> np.ndarray:
        """Torques (n) [N m] that brake the body evenly, to stand at the height of the start."""
        distance = max(s.q[1] - self.lowest, self.shortest)
        return self.lifted(s, min(s.v[1], 0.0) ** 2 / (2 * distance))

    def lifted(self, s: StanceTerms, rise: float) -> np.ndarray:
        """Torques (n) [N m] under which the body has this acceleration upwards [m/s^2], on the plumb line."""
        a_j = -np.linalg.solve(s.jacobian, np.array([self._plumb(s), rise]) + s.drift)
        return self.upright(s, (s.mass_matrix @ a_j + s.joint_bias)[1])

    def upright(self, s: StanceTerms, knee: float) -> np.ndarray:
        """The knee's torque [N m], clamped, and that of the hip under which the body keeps to the plumb line."""
        knee = self.drive.at(s.q[BASE:]).clamp(s.v[BASE:], np.array([0.0, knee]))[1]
        # x'' = row (tau - bias) / mass matrix - drift, linear in the hip's torque
        row = np.linalg.solve(s.mass_matrix, -s.jacobian[0])
        still = row @ (np.array([0.0, knee]) - s.joint_bias) - s.drift[0]
        return np.array([(self._plumb(s) - still) / row[0], knee])

    def _plumb(self, s: StanceTerms) -> float:
        """Wanted x'' = -plumb_k x - plumb_d x' of the body [m/s^2]."""
        return float(-self.options.plumb_k * s.q[0] - self.options.plumb_d * s.v[0])

    def length(self, now: Measurement) -> tuple[float, float]:
        """y_des [m] and its rate [m/s] now; the phase is reset at lift-off and where the push begins."""
        if not now.contact:
            if now.t - self.left > self.two_mass.t_f:  # the plant flies longer than the model
                return self.landing_length, 0.0
            y, rate = self.two_mass.flight_reference(now.t - self.left)
        elif self.options.stance == "step":
            y, rate = np.inf, 0.0
        else:
            y, rate = self.two_mass.stance_reference(self.begin + now.t - (self.pushed or 0.0))
        return float(y), float(rate)

    def overshoot(self, hop: HopFigures) -> float | None:
        """How much shorter the leg is than y_f at the clearance of a hop [m]; None where flight does not follow y_f."""
        if hop.highest is None or hop.no_hop or self.options.retraction != "reference":
            return None
        trace, k = hop.trace, hop.highest
        length = -float(foot_offset(self.leg, trace.q[k, BASE:])[1])
        return float(self.two_mass.flight_reference(trace.t[k] - hop.lift_off["time_s"])[0]) - length

    def limited_by(self, hop: HopFigures) -> str:
        """What held a hop down, in words: of its push, then of how far the leg is drawn up; empty where there is none."""
        if hop.highest is None or hop.no_hop:
            return ""
        mean, lasted = hop.saturation_mean, hop.lift_off["time_s"]
        busiest = max(mean, key=lambda joint: mean[joint])
        longest = hop.design.hop.stance_duration[1]
        push = f"{self._pushes(lasted)} of {longest:.3g} s, {busiest} at {mean[busiest]:.0%} of what its drive gives"
        return f"{push}; {self._drawn_up(hop, hop.highest)}"

    def _pushes(self, lasted: float) -> str:
        """What is done in a stance of so many seconds, in words."""
        return f"pushes {lasted:.3f} s"

    def _drawn_up(self, hop: HopFigures, k: int) -> str:
        """What ends the drawing up of the leg by sample k, in words."""
        q, v = hop.trace.q[k, BASE:], hop.trace.v[k, BASE:]
        if self.drawing_up is None:
            return "in flight it follows its reference"
        busy = np.abs(v) / self.no_load
        if busy.max() > STILL_MOVING:
            return f"{self.leg.joints[int(busy.argmax())]} still turns at the clearance: the flight is too short for its drive"
        near = np.minimum(q - self.lower, self.upper - q)
        if near.min() < NEAR * MARGIN:
            return f"drawn up until {self.leg.joints[int(near.argmin())]} is at its limit"
        return "drawn up to the pose that is highest on its way"

    @property
    def landing_length(self) -> float:
        """y_des [m] at touchdown."""
        return float(self.two_mass.touchdown_reference(0.0)[0])

    def desired(self, now: Measurement) -> tuple[np.ndarray, np.ndarray]:
        """Joint angles [rad] and speeds [rad/s] to strive for (paper's eq. 16); the landing's after a tuck."""
        if not now.contact and self.options.retraction == "tuck":
            return self.angles(self.landing_length), np.zeros(2)
        return self.with_rates(*self.length(now))

    def with_rates(self, y: float, rate: float) -> tuple[np.ndarray, np.ndarray]:
        """Joint angles [rad] and speeds [rad/s] with the foot y [m] under the hip, going away at rate [m/s]."""
        angles = self.angles(y)
        return angles, (self.angles(y + self.step) - angles) / self.step * rate

    def angles(self, y: float) -> np.ndarray:
        """Joint angles [rad] that put the foot y [m] under the hip, or as far as limits and reach allow."""
        y = min(y, self.longest)
        for q in self.geometry.angles(np.array([0.0, -y])):
            if self.geometry.bend(q[1]) * self.side > 0:
                return within(q, self.lower, self.upper)
        folded = np.inf * self.side * self.geometry.signs[1]
        return within(np.array([self.geometry.middle[0], folded]), self.lower, self.upper)


def within(x: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """np.clip, four times as fast for few numbers."""
    return np.minimum(np.maximum(x, lower), upper)


class Force(PaperStrategy):
    """Force control with motor saturation: a PD law on the joint angles, clamped to the operating region."""

    def push(self, now: Measurement, s: StanceTerms) -> np.ndarray:
        """tau_dyn = -k_p (theta - theta_des) - k_d theta' at the knee (the paper's eqs. 10 and 14)."""
        angles, _ = self.desired(now)
        return self.upright(s, (-self.options.k_p * (now.q - angles) - self.options.k_d * now.v)[1])


class Position(PaperStrategy):
    """Position control: a stiff servo of the knee on y_des(t) and its rate, and of the hip to the angle at which the
    foot is under it, whatever length the leg has: where the knee saturates, it must not throw the leg over."""

    def push(self, now: Measurement, s: StanceTerms) -> np.ndarray:
        """k_p (theta_des - theta) + k_d (theta_des' - theta')."""
        (here, rates_here), (wanted, rates) = self.with_rates(s.q[1], s.v[1]), self.desired(now)
        angles, rates = np.array([here[0], wanted[1]]), np.array([rates_here[0], rates[1]])
        return self.options.k_p * (angles - now.q) + self.options.k_d * (rates - now.v)
