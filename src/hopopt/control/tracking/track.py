"""Following a planned hop: its torques fed forward, and feedback on the joints.

The phase follows the contact, not the clock: stance runs from rest, flight from the measured lift-off. If the foot is still
down at the control instant next to the end of the planned stance, the torques with which flight begins lift it off.
The feedback is either a plain PD on the encoders, or linear-quadratic-Gaussian along the plan (``regulator``).
"""

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from hopopt.control.reference import PhaseReference
from hopopt.control.setting import Setting, chosen, one_of
from hopopt.control.similarity import Size, factors
from hopopt.control.tracking.regulator import Gains, Noise, regulator
from hopopt.errors import UsageError
from hopopt.leg.scales import Scale, standstill_torques
from hopopt.sim.controller import Measurement

EARLY_LIFT_OFF = 0.9  # of the planned stance: a foot that comes off before is taken to bounce
USUAL = 2.5e-4  # [s] on the paper's leg: the control period whose errors and torques the options weigh
LET_GO = 0.05  # of stall torque: what the filter takes the torque to be off by as the ground lets go; at 0.25 weak legs lost 7 cm


@dataclass(frozen=True)
class TrackingOptions:
    """feedback: "lqr", "pd" or "none"; the numbers are those of the paper's leg.

    For lqr, all at 4 kHz, at other rates the same per time: the errors that count alike, angle [rad], speed [rad/s],
    effort [N m]; how much more the end of stance counts than one period of it; disturbance [N m], the torque error that
    the filter expects. For pd: k_p [N m/rad], k_d [N m s/rad].
    """

    feedback: str = one_of("lqr", "pd", "none")
    angle: float = 0.01
    speed: float = 0.3
    effort: float = 30.0
    end: float = 100.0
    disturbance: float = 5.0
    k_p: float = 1000.0
    k_d: float = 20.0

    @classmethod
    def of(cls, setting: Setting) -> Self:
        """For a leg: what is given as it is, the rest scaled to the leg. Raises UsageError for options that there are not."""
        scale, pd, own = Scale.of(setting.design.leg), factors(Size.of(setting.design)), cls()
        by = {"speed": 1 / scale.time, "effort": scale.stall, "disturbance": scale.stall}
        by |= {name: pd[name] for name in ("k_p", "k_d")}
        scaled = {name: getattr(own, name) * factor for name, factor in by.items()}
        return cls(**{**scaled, **chosen(cls, setting.options)})

    def __post_init__(self) -> None:
        for name in ("angle", "speed", "effort"):
            if getattr(self, name) <= 0:
                raise UsageError(f"{name} = {getattr(self, name):g}: it must be greater than 0")

    def costs(self, n: int, periods: float, contact: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What errors (2 n, 2 n) and added torques (n, n) cost over so many usual periods, and errors at the end of a phase."""
        errors = np.diag([self.angle**-2] * n + [self.speed**-2] * n)
        return periods * errors, periods * np.eye(n) / self.effort**2, errors * (self.end if contact else 1.0)


class Track:
    """The strategy ``track``: q, v, tau of the plan with feedback; after the plan's end it holds its last pose."""

    options_of: ClassVar[type[TrackingOptions]] = TrackingOptions

    def __init__(self, setting: Setting):
        if setting.plan is None:
            raise UsageError("the strategy track needs a planned hop to follow: solve the problem first")
        self.options, self.period = self.options_of.of(setting), setting.period
        self.plan, self.rest, self.drive = setting.plan, setting.start, setting.drive()
        self.state: Estimate | None = None
        self.given, self.stall = np.zeros_like(self.rest), standstill_torques(setting.design.leg)
        self.step = float(np.sqrt(12) * setting.angle_noise)  # of the encoders [rad]
        early = 1e-9 if self.options.feedback == "none" else self.period / 2
        self.ends = self.plan.stance.duration - early  # of stance: from the control instant next to it on [s]
        self.moves = (
            0.0  # the most by which feedback moved a torque between samples, share of what a drive gives at standstill
        )
        self.lost = self.early = False
        self.began = -np.inf  # when the last stance began [s]
        if self.options.feedback == "lqr":
            self.gains = {contact: self._gains(setting, contact) for contact in (True, False)}

    def _gains(self, setting: Setting, contact: bool) -> Gains:
        machine, o, time = setting.machine(), self.options, Scale.of(setting.design.leg).time
        periods = self.period / (USUAL * time)
        speed = setting.angle_noise / time  # of a leg at rest, or one that was tracked
        jump = 0.0 if contact else LET_GO * float(self.stall.mean())
        if contact and self.plan.repeats:  # an impact comes before
            speed = o.speed
        noise = Noise(setting.angle_noise, o.disturbance / periods**0.5, speed, jump)
        costs = o.costs(machine.n, periods, contact)
        gains = regulator(machine, self.reference(contact), self.period, contact, costs, noise)
        return gains if self.plan.feedback is None else gains.with_feedback(self.plan.feedback)

    def stance_goes_on(self, now: Measurement) -> bool:
        """Whether to follow the planned stance: on the ground, or only bounced off it long before the lift-off."""
        if now.contact:
            self.lost, self.began = False, now.t - now.since
            return True
        lasted, planned = now.t - self.began, self.plan.stance.duration
        if not self.lost:  # just left the ground
            self.lost, self.early = True, lasted < EARLY_LIFT_OFF * planned
        return self.early and lasted < planned

    def reference(self, contact: bool) -> PhaseReference:
        """The planned phase."""
        return self.plan.stance if contact else self.plan.flight

    def torque(self, now: Measurement) -> np.ndarray:
        """tau_plan - K (q - q_plan, v - v_plan), and what the gears take of it."""
        over = now.landings and not self.plan.repeats
        if now.contact and over:  # stand as at the start
            return self.options.k_p * (self.rest - now.q) - self.options.k_d * now.v
        if not over and self.stance_goes_on(now):
            now = replace(now, contact=True, since=now.t - self.began)
        if now.contact and now.since > self.ends:
            _, v, self.given = self.plan.flight.at(0.0)
            return self.drive.at(now.q).needed(v, self.given, self._accelerated(self.plan.flight, 0.0))
        q, v, tau = self.planned(now)
        if self.options.feedback == "none":
            return self.drive.at(q).needed(v, tau, self._accelerated(self.reference(now.contact), now.since))
        if self.options.feedback == "pd":
            needed = self.drive.at(q).needed(v, tau, self._accelerated(self.reference(now.contact), now.since))
            return needed - self.options.k_p * (now.q - q) - self.options.k_d * (now.v - v)
        return self._regulated(now, q, v, tau)

    def planned(self, now: Measurement) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, v now, and the torque whose impulse over the next period is the plan's."""
        phase = self.reference(now.contact)
        q, v, tau = phase.at(now.since)
        if now.since > phase.duration:
            return q, np.zeros_like(v), np.zeros_like(tau)
        if self.options.feedback != "none":
            tau = phase.mean_torque(now.since, now.since + self.period)
        return q, v, tau

    def _regulated(self, now: Measurement, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
        k = round(now.since / self.period)
        before, L = self.state, self.gains[now.contact].at(k)[3]
        if before is None or (now.contact and not before.contact):  # no filter knows what speeds an impact leaves
            error = np.concatenate([self.missed(now.q - q, v), np.zeros_like(q)])
        elif before.contact == now.contact:
            A, B = self.gains[now.contact].at(max(k - 1, 0))[:2]  # of the period that led here
            error = A @ before.error + B @ before.extra
        else:
            error = self._let_go(now, before, q, v)
        error = error + L @ self.missed(now.q - q - error[: len(q)], v)
        speeds = v + error[len(q) :]
        wanted = tau + self.added(now.contact, k, error)
        a = self._accelerated(self.reference(now.contact), now.since)
        drive = self.drive.at(q)
        command = drive.clamp(speeds, drive.needed(v, wanted, a))  # at planned speeds, whose sign is no noise
        self.given = drive.passed(v, command, a)
        self.state = Estimate(now.contact, error, self.given - tau, q + error[: len(q)], speeds, now.t)
        if before is not None and before.contact == now.contact and now.since <= self.reference(now.contact).duration:
            self.moves = max(self.moves, float((np.abs(self.state.extra - before.extra) / self.stall).max()))
        return command

    def _accelerated(self, phase: PhaseReference, since: float) -> np.ndarray | None:
        """Mean acceleration (n) [rad/s^2] that is planned for the next period; None where no gear's losses ask for it."""
        if self.drive.lossless:
            return None
        return (phase.at(since + self.period)[1] - phase.at(since)[1]) / self.period

    def missed(self, apart: np.ndarray, v: np.ndarray) -> np.ndarray:
        """What a reading tells (n) [rad] that is so far from what was expected: nothing within half a step of the encoder, which
        rounds alike as long as the joint rests; the more, the more of a step it turns in a period at planned speeds v (n)."""
        resting = 1 - np.minimum(1, np.abs(v) * self.period / self.step)
        return apart - resting * np.clip(apart, -self.step / 2, self.step / 2)

    def _let_go(self, now: Measurement, before: "Estimate", q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Errors (2 n) from the planned flight's q and v at the first instant off the ground: speeds differ as in stance, by an
        early lift-off, and by the torque that was held on beyond it; angles have gone on at the mean speed."""
        n, flight = len(q), self.plan.flight
        held = self.given - flight.mean_torque(0.0, now.since)
        missed = self.plan.stance.at(now.t - now.since - self.began)[1] - flight.at(0.0)[1]
        off = before.error[n:] + missed + self.gains[False].B[0, n:] @ (held * (now.since / self.period))
        ahead = before.q + (now.t - before.t) * (before.v + v + off) / 2
        return np.concatenate([ahead - q, off])

    def added(self, contact: bool, k: int, error: np.ndarray) -> np.ndarray:
        """The torque (n) [N m] that feedback adds to the plan's in control period k, from the estimated error (2 n): by the
        plan's own feedback if it has one, else by the regulator's."""
        return -self.gains[contact].at(k)[2] @ error


@dataclass(frozen=True)
class Estimate:
    """What the filter thinks at t [s]: errors (q, v) from the plan, the torque added to it, and the joints' q and v."""

    contact: bool
    error: np.ndarray
    extra: np.ndarray
    q: np.ndarray
    v: np.ndarray
    t: float
