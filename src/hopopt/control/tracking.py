"""Following a planned hop: its torques fed forward, and feedback on the joints.

The phase follows the contact, not the clock: stance runs from rest, flight from the measured lift-off. If the foot
is still down when the planned stance is over, the torques with which flight begins are applied: they lift it off.
The feedback is either a plain PD on the encoders, or linear-quadratic-Gaussian along the plan (Anderson and Moore,
Optimal Control, chapters 3 and 8): a Riccati recursion backwards over the control periods gives the gains, one
forwards the Kalman filter that makes joint speeds from coarse encoders, both on the dynamics linearised there.
"""

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from scipy.linalg import expm

from hopopt.control.reference import PhaseReference
from hopopt.control.setting import Setting, chosen, one_of
from hopopt.control.similarity import Size, factors
from hopopt.errors import UsageError
from hopopt.leg.robot import BASE
from hopopt.leg.scales import Scale
from hopopt.sim.controller import Measurement
from hopopt.sim.machine import Machine

EARLY = 0.9  # of the planned stance: a foot that comes off before is taken to bounce
STEP = 1e-5  # of the central differences that linearise the dynamics


@dataclass(frozen=True)
class TrackingOptions:
    """feedback: "lqr", "pd" or "none"; the numbers are those of the paper's leg.

    For lqr: the errors that count alike, angle [rad], speed [rad/s], effort [N m]; how much more the end of stance
    counts than one period of it; disturbance [N m], the torque error the filter expects. For pd: k_p [N m/rad],
    k_d [N m s/rad].
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

    def costs(self, n: int) -> tuple[np.ndarray, np.ndarray]:
        """Q (2 n, 2 n) and R (n, n): what errors and added torques of one control period cost."""
        return np.diag([self.angle**-2] * n + [self.speed**-2] * n), np.eye(n) / self.effort**2


@dataclass(frozen=True)
class Gains:
    """Along one phase, for each control period: the error (q, v) moves by A and by held torque B, feedback K
    (periods, n, 2 n), filter L (periods, 2 n, n); x' P x is the cost of all that follows (periods + 1, 2 n, 2 n)."""

    A: np.ndarray
    B: np.ndarray
    K: np.ndarray
    L: np.ndarray
    P: np.ndarray

    def at(self, period: int) -> tuple[np.ndarray, ...]:
        """A, B, K, L of a period; beyond the last, the last."""
        k = min(period, len(self.K) - 1)
        return self.A[k], self.B[k], self.K[k], self.L[k]

    def cost_to_go(self, period: int) -> np.ndarray:
        """P where a period begins; beyond the last, at the end of the phase."""
        return self.P[min(period, len(self.P) - 1)]


class Track:
    """The strategy ``track``: q, v, tau of the plan with feedback; after the plan's end it holds its last pose."""

    options_of: ClassVar[type[TrackingOptions]] = TrackingOptions

    def __init__(self, setting: Setting):
        if setting.plan is None:
            raise UsageError("the strategy track needs a planned hop to follow: solve the problem first")
        self.options, self.period = self.options_of.of(setting), setting.period
        self.plan, self.rest, self.drive = setting.plan, setting.start, setting.drive()
        self.state: Estimate | None = None
        self.lost = self.early = False
        self.began = -np.inf  # when the last stance began [s]
        if self.options.feedback == "lqr":
            machine, noise = setting.machine(), setting.angle_noise
            known = noise / Scale.of(setting.design.leg).time  # [rad/s] of a leg at rest, or one that was tracked
            unsure = {False: known, True: self.options.speed if self.plan.repeats else known}  # an impact comes before
            self.gains = {
                contact: regulator(
                    machine, self.reference(contact), self.period, contact, self.options, noise, unsure[contact]
                )
                for contact in (True, False)
            }

    def stance_goes_on(self, now: Measurement) -> bool:
        """Whether to follow the planned stance: on the ground, or only bounced off it long before the lift-off."""
        if now.contact:
            self.lost, self.began = False, now.t - now.since
            return True
        lasted, planned = now.t - self.began, self.plan.stance.duration
        if not self.lost:  # just left the ground
            self.lost, self.early = True, lasted < EARLY * planned
        return self.early and lasted < planned

    def reference(self, contact: bool) -> PhaseReference:
        """The planned phase."""
        return self.plan.stance if contact else self.plan.flight

    def torque(self, now: Measurement) -> np.ndarray:
        """tau_plan - K (q - q_plan, v - v_plan)."""
        over = now.landings and not self.plan.repeats
        if now.contact and over:  # stand as at the start
            return self.options.k_p * (self.rest - now.q) - self.options.k_d * now.v
        if not over and self.stance_goes_on(now):
            now = replace(now, contact=True, since=now.t - self.began)
        if now.contact and now.since > self.plan.stance.duration - 1e-9:
            return self.plan.flight.at(0.0)[2]
        q, v, tau = self.planned(now)
        if self.options.feedback == "none":
            return tau
        if self.options.feedback == "pd":
            return tau - self.options.k_p * (now.q - q) - self.options.k_d * (now.v - v)
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
            error = np.concatenate([now.q - q, np.zeros_like(q)])
        elif before.contact == now.contact:
            A, B = self.gains[now.contact].at(max(k - 1, 0))[:2]  # of the period that led here
            error = A @ before.error + B @ before.extra
        else:  # another reference
            ahead = before.q + self.period * before.v
            error = np.concatenate([ahead - q, before.v - v])
        error = error + L @ (now.q - q - error[: len(q)])
        speeds = v + error[len(q) :]
        command = self.drive.clamp(speeds, tau + self.added(now.contact, k, error))
        self.state = Estimate(now.contact, error, command - tau, q + error[: len(q)], speeds)
        return command

    def added(self, contact: bool, k: int, error: np.ndarray) -> np.ndarray:
        """The torque (n) [N m] that feedback adds to the plan's in control period k, from the estimated error (2 n): by the
        plan's own feedback if it has one, else by the regulator's."""
        K = self.gains[contact].at(k)[2] if self.plan.feedback is None else self.plan.feedback
        return -K @ error


@dataclass(frozen=True)
class Estimate:
    """What the filter thinks: errors (q, v) from the plan, the torque added to it, and the joints' q and v."""

    contact: bool
    error: np.ndarray
    extra: np.ndarray
    q: np.ndarray
    v: np.ndarray


def regulator(
    machine: Machine,
    phase: PhaseReference,
    period: float,
    contact: bool,
    o: TrackingOptions,
    noise: float,
    unsure: float,
) -> Gains:
    """Feedback and filter gains along a phase; ``noise`` [rad] is the standard error of a measured angle, ``unsure``
    [rad/s] that of the speeds as the phase begins."""
    n, periods = machine.n, max(1, int(phase.duration / period))
    pairs = [linearised(machine, phase, k * period, period, contact) for k in range(periods)]
    A, B = (np.array(matrices) for matrices in zip(*pairs, strict=True))
    Q, R = o.costs(n)
    K, P = np.empty((periods, n, 2 * n)), np.empty((periods + 1, 2 * n, 2 * n))
    P[periods] = Q * (o.end if contact else 1.0)
    for k in reversed(range(periods)):  # SciPy solves the stationary equation only: here A and B change along the plan
        after = P[k + 1]
        K[k] = np.linalg.solve(R + B[k].T @ after @ B[k], B[k].T @ after @ A[k])
        cost = Q + A[k].T @ after @ (A[k] - B[k] @ K[k])
        P[k] = 0.5 * (cost + cost.T)
    L, S, V = np.empty((periods, 2 * n, n)), np.diag([noise**2] * n + [unsure**2] * n), np.eye(n) * noise**2
    for k in range(periods):
        L[k] = np.linalg.solve(S[:n, :n] + V, S[:n]).T
        S = A[k] @ (S - L[k] @ S[:n]) @ A[k].T + o.disturbance**2 * B[k] @ B[k].T
        S = 0.5 * (S + S.T)
    return Gains(A, B, K, L, P)


def linearised(
    machine: Machine, phase: PhaseReference, t: float, period: float, contact: bool
) -> tuple[np.ndarray, np.ndarray]:
    """A, B of joint errors over one period of held torque about the plan at t: x+ = A x + B u."""
    n, z = machine.n, np.concatenate(phase.at(t))
    columns = [
        (joint_acceleration(machine, z + step, contact) - joint_acceleration(machine, z - step, contact)) / (2 * STEP)
        for step in STEP * np.eye(3 * n)
    ]
    system = np.zeros((3 * n, 3 * n))
    system[:n, n : 2 * n] = period * np.eye(n)
    system[n : 2 * n] = period * np.array(columns).T
    moved = expm(system)
    return moved[: 2 * n, : 2 * n], moved[: 2 * n, 2 * n :]


def joint_acceleration(machine: Machine, z: np.ndarray, contact: bool) -> np.ndarray:
    """Joint accelerations (n) [rad/s^2] from z = (q, v, tau) of the joints; in flight whatever the body does."""
    q, v, tau = np.split(z, 3)
    if contact:
        return machine.stance_terms(q, v).acceleration(tau)
    base = np.zeros(BASE)
    q, v = (np.concatenate([base, x]) for x in (q, v))
    return machine.acceleration(q, v, tau, False)[BASE:]
