"""The equations of a leg's motion over short windows of a log: what a least-squares fit of its parameters makes small.

Nothing is differentiated twice. Let T be the kinetic energy and V the potential energy of the leg in the joints alone:
in stance with the foot held; in flight relative to the centre of mass, which falls freely, so that of V only springs act. With
p = dT/dv and F = d(T - V)/dq, Lagrange's equations are dp/dt = F + tau_net, where

    tau_net = A a + k (g tau - A a - c sign(v) - d v),    k = eta where the gear drives, 1 / eta where it brakes.

tau is the logged torque, g the true torque constant over the believed one, A the rotor's inertia, eta the gear's efficiency,
c and d its Coulomb and viscous friction (the law of drivetrain/gear.py). Against a smooth window phi that is zero at both ends, and integrated by parts (the method of
modulating functions: Shinbrot, Trans. ASME 79, 1957), a row for each window and joint is

    int phi tau = (-int phi' p - int phi F + int phi (c sign(v) + d v + (1 - k) (g tau - A a - c sign(v) - d v))) / g

with tau at t + lag, where lag is by how much the log's torques are later than its angles [s]: a mean over the period after a row is half a period early.
A measured ground force f gives rows of its own, with the leg's linear momentum P, its mass m and gravity a:

    int phi f = -int phi' P - int phi m a, with f at t + force_lag.

Where a drive gives less than it is asked for, it is on its torque-speed line (R the gear ratio, W the no-load speed):

    int phi (1 - |tau| / (R tau_max)) = (R / W) int phi |v|.

Sampled once a period, a torque that the controller holds is half a period early, but at a drive's line, where it changes on its
own, it is not: there the lag is greater by ramp_lag, which acts on the slope of the torque (and of the force).

Windows lie within one phase, clear of its ends, of end stops, and of times where the joint hardly moves: there the sign of
its friction is not known. Speeds are slopes of the angles, for logged speeds lag behind.

What follows: without a measured force no row has g but in a ratio. Masses, rotor inertia, friction and g times any factor fit
as well. eta and W are told all the same.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from hopopt.design import Design, physical_parameters
from hopopt.drivetrain.motor import torque_cap
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.leg.robot import BASE
from hopopt.leg.scales import Scale, stall_torques
from hopopt.robot_data.leg_momenta import LegMomenta
from hopopt.robot_data.log_windows import WINDOW_LENGTH, LogSamples, samples_of
from hopopt.robot_data.robot_log import RobotLog
from hopopt.sim.machine import Machine

CLEAR_OF_STOPS = 0.01  # [rad] from an end stop that no window touches
SHORT_OF_COMMAND = 0.03  # of the stall torque by which a drive gives less than asked where it is on its line
NEAR_LINE = 0.85  # of the believed line's torque above which a drive without commands may be at its line
SMOOTH = 12  # samples on either side, from which an acceleration tells whether a gear drives or brakes
HELD = 4  # samples on either side, over which the course of a torque is smoothed
BELOW_CAP = 0.03  # of a cap on torque by which a drive stays below it where it is on its line


def places(n: int) -> dict[str, int]:
    """Where in the vector x of unknown values each kind begins, for n joints; "end" is its length.

    mass: scales of the body's and the links' masses (n + 1) [1]
    rotor: rotor inertia at the joints (n) [kg m^2]
    gain, efficiency, friction, damping: g [1], eta [1], c [N m] and d [N m s/rad] of every joint, (n) each
    speed: W of every joint (n) [rad/s]
    lag, force_lag: of torque and force (1) [s]
    ramp_lag, force_ramp_lag: how much greater those are where a drive is at its line (1) [s]
    """
    begin = 0
    found = {}
    for name, size in (
        ("mass", n + 1), ("rotor", n), ("gain", n), ("efficiency", n), ("friction", n), ("damping", n), ("speed", n),
        ("lag", 1), ("force_lag", 1), ("ramp_lag", 1), ("force_ramp_lag", 1), ("end", 0),
    ):  # fmt: skip
        found[name], begin = begin, begin + size
    return found


@dataclass(frozen=True)
class RowBlock:
    """Rows of one kind, such as "tau0": residuals e (rows,), what the log alone gives of them (rows,), and their derivatives
    by the vector of unknown values (rows, values)."""

    kind: str
    e: np.ndarray
    logged: np.ndarray
    J: np.ndarray


Noise = dict[str, sparse.csr_array]  # a sensor, such as "q0" -> derivatives of rows by its noise (rows, samples)


class LogRows:
    """The rows of one log."""

    def __init__(self, design: Design, momenta: LegMomenta, log: RobotLog):
        self.momenta, self.s, self.n, leg = momenta, samples_of(log, Scale.of(design.leg).time), momenta.n, design.leg
        self.at, self.coarse = places(self.n), coarseness(self.s)
        self.ratio = np.array([leg.drive(j, "gear", "ratio")[1] for j in leg.joints])
        self.stall = stall_torques(leg)
        self.smooth = differences(self.s.t, SMOOTH)
        self.held = self._answer_to_held_torques()
        self.joints = [self.s.windows(self._moving(design, k)) for k in range(self.n)]
        self.saturated = [self.s.windows(self._saturated(design, k)) for k in range(self.n)]
        self.axes = [a for a in (0, 1) if np.any(log.force[:, a])]
        self.standing = self.s.windows(np.where(log.contact, self.s.phase, -1))
        self.ramps = np.stack([self._at_line(design, k) for k in range(self.n)], axis=1)

    def _moving(self, design: Design, k: int) -> np.ndarray:
        """A number for each stretch in which a joint turns one way, clear of its end stops; -1 elsewhere."""
        limits, s = design.leg.joint[design.leg.joints[k]], self.s
        free = (s.q[:, k] > limits.lower + CLEAR_OF_STOPS) & (s.q[:, k] < limits.upper - CLEAR_OF_STOPS)
        return self._numbered(k, (s.sign[:, k] != 0) & free)

    def _answer_to_held_torques(self) -> np.ndarray:
        """What torques that change from sample to sample make of the accelerations beyond their smoothed course, by the believed
        leg (k, n) [rad/s^2]: slopes of angles do not show it, and it decides whether a gear drives or brakes."""
        s, machine, window = self.s, Machine(self.momenta.robot), np.full(2 * HELD + 1, 1 / (2 * HELD + 1))
        beyond = s.tau - np.stack([np.convolve(tau, window, "same") for tau in s.tau.T], axis=1)
        found, still, nowhere = np.zeros_like(s.tau), np.zeros(self.n), np.zeros(BASE)
        for i, q in enumerate(s.q):
            if s.contact[i]:
                found[i] = np.linalg.solve(machine.stance_terms(q, still).mass_matrix, beyond[i])
            else:
                forces = np.concatenate([nowhere, beyond[i]])
                found[i] = np.linalg.solve(machine.mass_matrix(np.concatenate([nowhere, q])), forces)[BASE:]
        return found

    def _numbered(self, k: int, usable: np.ndarray) -> np.ndarray:
        return np.where(usable & (self.s.phase >= 0), 3 * self.s.phase + self.s.sign[:, k].astype(int) + 1, -1)

    def _at_line(self, design: Design, k: int) -> np.ndarray:
        """Whether a drive is at its torque-speed line, where its torque changes between two commands (k,): by its commands, or
        if there are none by the believed line."""
        tau, v, command = np.abs(self.s.tau[:, k]), self.s.v[:, k], self.s.command[:, k]
        if np.isfinite(command).any():
            return np.abs(np.nan_to_num(command)) > tau + SHORT_OF_COMMAND * self.stall[k]
        region = operating_region(design.leg, design.leg.joints[k], self.momenta.robot.parameters)
        return (tau > NEAR_LINE * np.maximum(region.torque_bounds(v)[1], 0)) & (tau > NEAR_LINE * self.stall[k] / 4)

    def _saturated(self, design: Design, k: int) -> np.ndarray:
        """A number for each stretch in which a drive is on its torque-speed line as it drives its joint; -1 elsewhere."""
        leg, joint, tau = design.leg, design.leg.joints[k], self.s.tau[:, k]
        drive_cap = torque_cap(leg, joint, physical_parameters(leg))
        gear_cap = leg.drive(joint, "gear", "torque_cap")[1]
        cap = min(np.inf if drive_cap is None else drive_cap * self.ratio[k], np.inf if gear_cap is None else gear_cap)
        asked = np.nan_to_num(self.s.command[:, k]) * np.sign(tau)
        on = (asked > np.abs(tau) + SHORT_OF_COMMAND * self.stall[k]) & (
            tau * self.s.sign[:, k] > SHORT_OF_COMMAND * self.stall[k]
        )
        has_line = bool(leg.drive(joint, "motor", "laws")[1])
        return self._numbered(k, on & (np.abs(tau) < (1 - BELOW_CAP) * cap) & has_line)

    @property
    def count(self) -> int:
        """How many rows there are."""
        return sum(w.count for w in (*self.joints, *self.saturated, *([self.standing] * len(self.axes))))

    def blocks(self, x: np.ndarray) -> list[RowBlock]:
        """All rows at the vector x of unknown values."""
        y, by_scales = self.momenta.at(self.s, x[: self.at["gain"]])
        found = [self._joint_rows(k, y, by_scales, x) for k in range(self.n) if self.joints[k].count]
        found += [self._force_rows(a, y, by_scales, x) for a in self.axes if self.standing.count]
        return found + [self._line_rows(k, x) for k in range(self.n) if self.saturated[k].count]

    def _of_joint(self, k: int, x: np.ndarray) -> list[float]:
        """g, eta, c and d of a joint."""
        return [float(x[self.at[name] + k]) for name in ("gain", "efficiency", "friction", "damping")]

    def _lags(self, x: np.ndarray, of: str = "") -> list[float]:
        """Of the torque, or ``of`` "force_": the lag, and how much greater it is at a drive's line [s]."""
        return [float(x[self.at[f"{of}{name}"]]) for name in ("lag", "ramp_lag")]

    def _joint_rows(self, k: int, y: np.ndarray, by_scales: np.ndarray, x: np.ndarray) -> RowBlock:
        n, w, s, at, sign = self.n, self.joints[k], self.s, self.at, self.s.sign[:, k]
        (g, eta, c, d), (lag, ramp_lag) = self._of_joint(k, x), self._lags(x)
        teeth, a = self._teeth(k, x)
        drives = teeth * sign >= 0
        kept = 1 - np.where(drives, eta, 1 / eta)  # of the torque at the teeth: it goes on where that changes its sign
        by_eta = np.where(drives, 1.0, -1 / eta**2)
        delayed, signs, speeds = w.shifted(lag), w.phi @ sign, w.phi @ s.v[:, k]
        load = c * signs + d * speeds + delayed @ (kept * teeth) - w.rate @ y[:, k] - w.phi @ y[:, n + k]
        slope = self.ramps[:, k] * (s.D @ s.tau[:, k])
        changing = w.phi @ (slope * (1 - kept))
        J = np.zeros((w.count, at["end"]))
        J[:, : at["gain"]] = (w.rate @ by_scales[:, k] + w.phi @ by_scales[:, n + k]) / g
        J[:, at["rotor"] + k] += delayed @ (kept * a) / g
        by_gain = s.tau[:, k] - float(x[at["rotor"] + k]) * self.held[:, k]
        J[:, at["gain"] + k] = load / g**2 - delayed @ (kept * by_gain) / g
        J[:, at["efficiency"] + k] = delayed @ (by_eta * teeth) / g + ramp_lag * (w.phi @ (slope * by_eta))
        J[:, at["friction"] + k] = delayed @ (kept * sign) / g - signs / g
        J[:, at["damping"] + k] = delayed @ (kept * s.v[:, k]) / g - speeds / g
        J[:, at["lag"]] = w.by_lag(lag) @ (s.tau[:, k] - kept * teeth / g)
        J[:, at["ramp_lag"]] = changing
        logged = delayed @ s.tau[:, k] + ramp_lag * changing
        return RowBlock(f"tau{k}", logged - load / g, logged, J)

    def _passed_on(self, k: int, x: np.ndarray) -> np.ndarray:
        """The share of one more logged torque that the gear passes on (k,): eta where it drives, else 1 / eta."""
        eta = self._of_joint(k, x)[1]
        return np.where(self._teeth(k, x)[0] * self.s.sign[:, k] >= 0, eta, 1 / eta)

    def _teeth(self, k: int, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Torque at a gear's teeth (k,) [N m], less rotor and friction, and the acceleration (k,) [rad/s^2] used for it."""
        g, _, c, d = self._of_joint(k, x)
        s, rotor = self.s, float(x[self.at["rotor"] + k])
        a = self.smooth @ s.v[:, k] + g * self.held[:, k]
        return g * s.tau[:, k] - rotor * a - c * s.sign[:, k] - d * s.v[:, k], a

    def _force_rows(self, a: int, y: np.ndarray, by_scales: np.ndarray, x: np.ndarray) -> RowBlock:
        n, w, f, at = self.n, self.standing, self.s.force[:, a], self.at
        lag, ramp_lag = self._lags(x, "force_")
        weights, area = self.momenta.masses * self.momenta.gravity[a], w.phi.sum(axis=1)
        changing = w.phi @ (self.ramps.any(axis=1) * (self.s.D @ f))
        measured = w.shifted(lag) @ f + ramp_lag * changing
        e = measured + w.rate @ y[:, 2 * n + a] + area * (weights @ x[: n + 1])
        J = np.zeros((w.count, at["end"]))
        J[:, : at["gain"]] = w.rate @ by_scales[:, 2 * n + a]
        J[:, : n + 1] += area[:, None] * weights
        J[:, at["force_lag"]], J[:, at["force_ramp_lag"]] = w.by_lag(lag) @ f, changing
        return RowBlock(f"force{a}", e, measured, J)

    def _line_rows(self, k: int, x: np.ndarray) -> RowBlock:
        w, s, at, (lag, ramp_lag) = self.saturated[k], self.s, self.at, self._lags(x)
        share, R, W = np.abs(s.tau[:, k]) / self.stall[k], self.ratio[k], x[self.at["speed"] + k]
        changing, speed = w.phi @ (s.D @ share), w.phi @ np.abs(s.v[:, k])
        missing = w.phi.sum(axis=1) - w.shifted(lag) @ share - ramp_lag * changing
        J = np.zeros((w.count, at["end"]))
        J[:, at["speed"] + k], J[:, at["lag"]] = R / W**2 * speed, -(w.by_lag(lag) @ share)
        J[:, at["ramp_lag"]] = -changing
        return RowBlock(f"line{k}", missing - R / W * speed, missing, J)

    # ---- noise ----------------------------------------------------------------------------------------------------

    def noise(self, x: np.ndarray) -> Noise:
        """What the noise of each sensor does to all rows, in their order."""
        motion = self.momenta.by_motion(self.s, x[: self.at["gain"]])
        blocks = [self._joint_noise(j, motion, x) for j in range(self.n) if self.joints[j].count]
        blocks += [self._force_noise(a, motion, x) for a in self.axes if self.standing.count]
        blocks += [self._line_noise(j, x) for j in range(self.n) if self.saturated[j].count]
        names = sorted({name for block in blocks for name in block})
        nothing = [sparse.csr_array(next(iter(block.values())).shape) for block in blocks]
        found = {}
        for name in names:
            B = sparse.vstack([b.get(name, zero) for b, zero in zip(blocks, nothing, strict=True)])
            found[name] = sparse.csr_array(B * self.coarse[:, int(name[1:])] if name[0] == "q" else B)
        return found

    def _by_angles(self, motion: tuple[np.ndarray, np.ndarray], *parts: tuple[Any, int]) -> dict[str, Any]:
        """Derivatives of a sum of weights times components of y by every angle, through its speed too; parts: (weights,
        component)."""
        found = {}
        for j in range(self.n):
            by_q, by_v = (sum(weights * m[:, component, j] for weights, component in parts) for m in motion)
            found[f"q{j}"] = by_v @ self.s.D + by_q
        return found

    def _joint_noise(self, k: int, motion: tuple[np.ndarray, np.ndarray], x: np.ndarray) -> Mapping[str, Any]:
        w, s, (g, _, _, d), (lag, ramp_lag) = self.joints[k], self.s, self._of_joint(k, x), self._lags(x)
        found = {name: (1 / g) * B for name, B in self._by_angles(motion, (w.rate, k), (w.phi, self.n + k)).items()}
        found[f"q{k}"] = found[f"q{k}"] - (d / g) * (w.phi @ s.D)
        kept, rotor = 1 - self._passed_on(k, x), float(x[self.at["rotor"] + k])
        found[f"q{k}"] += ((w.shifted(lag) * (kept / g)) @ (rotor * self.smooth + d * sparse.eye_array(len(s.t)))) @ s.D
        late = (w.phi * (ramp_lag * self.ramps[:, k])) @ s.D
        return found | {f"tau{k}": (w.shifted(lag) + late) * self._passed_on(k, x)}

    def _force_noise(self, a: int, motion: tuple[np.ndarray, np.ndarray], x: np.ndarray) -> Mapping[str, Any]:
        w, (lag, ramp_lag) = self.standing, self._lags(x, "force_")
        late = (w.phi * (ramp_lag * self.ramps.any(axis=1))) @ self.s.D
        return self._by_angles(motion, (w.rate, 2 * self.n + a)) | {f"force{a}": w.shifted(lag) + late}

    def _line_noise(self, k: int, x: np.ndarray) -> Mapping[str, Any]:
        w, s, (lag, ramp_lag) = self.saturated[k], self.s, self._lags(x)
        torque = (w.shifted(lag) + ramp_lag * (w.phi @ s.D)) * (-np.sign(s.tau[:, k]) / self.stall[k])
        speed = -self.ratio[k] / x[self.at["speed"] + k] * ((w.phi * s.sign[:, k]) @ s.D)
        return {f"tau{k}": torque, f"q{k}": speed}

    def noise_levels(self) -> dict[str, float]:
        """A first guess of each sensor's noise, its standard deviation by third differences; of an encoder at least that of its
        steps."""
        s = self.s
        found = {f"q{k}": max(scatter(s.q[:, k]), step(s.q[:, k]) / np.sqrt(12)) for k in range(self.n)}
        found |= {f"tau{k}": scatter(s.tau[:, k]) for k in range(self.n)}
        return found | {f"force{a}": scatter(s.force[s.contact, a]) for a in self.axes}


def differences(t: np.ndarray, reach: int) -> sparse.csr_array:
    """Central differences at times t (k,) [s] over so many samples on either side, (k, k) [1/s]; none at the ends."""
    at = np.arange(reach, len(t) - reach)
    weight = 1 / (t[at + reach] - t[at - reach])
    places = np.concatenate([at, at]), np.concatenate([at + reach, at - reach])
    return sparse.csr_array((np.concatenate([weight, -weight]), places), shape=(len(t), len(t)))


def scatter(x: np.ndarray) -> float:
    """Standard deviation of white noise on a smooth signal x (k,), from the median of its third differences."""
    return float(1.4826 * np.median(np.abs(np.diff(x, 3))) / np.sqrt(20.0))


def coarseness(s: LogSamples) -> np.ndarray:
    """By how much more than white noise the steps of an encoder act on windows where a joint moves less than a step between two
    samples, (k, n): its error then stays alike for as many samples as a step takes."""
    period = float(np.median(np.diff(s.t)))
    steps = np.array([step(x) for x in s.q.T])
    alike = steps / np.maximum(np.abs(s.v) * period, 1e-12)
    return np.sqrt(np.clip(alike, 1.0, max(1.0, s.time * WINDOW_LENGTH / 2 / period)))


def step(x: np.ndarray) -> float:
    """The smallest step between two values of a signal."""
    apart = np.diff(np.unique(x))
    return float(apart.min()) if len(apart) else 0.0
