"""The equations of a leg's motion over short windows of a log: what a least-squares fit of its parameters makes small.

Nothing is differentiated twice. Let T be the kinetic energy and V the potential energy of the leg in the joints alone:
in stance with the foot held; in flight relative to the centre of mass, which falls freely, so that V does not act. With
p = dT/dv and F = d(T - V)/dq, Lagrange's equations are dp/dt = F + tau_net, where

    tau_net = g tau - (1 - eta) g |tau| sign(v) - c sign(v) - d v.

tau is the logged torque, g the true torque constant over the believed one, eta the gear's efficiency, c and d its Coulomb
and viscous friction. Against a smooth window phi that is zero at both ends, and integrated by parts (the method of
modulating functions: Shinbrot, Trans. ASME 79, 1957), a row for each window and joint is

    int phi (tau - (1 - eta) |tau| sign(v)) = (-int phi' p - int phi F + c int phi sign(v) + d int phi v) / g

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
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from scipy import sparse

from hopopt.design import Design
from hopopt.drivetrain.region import operating_region
from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.robot import BASE, build_robot, link_bodies
from hopopt.robot_data.log_windows import WINDOW, Samples, samples_of, windows
from hopopt.robot_data.robot_log import RobotLog

FREE = 0.01  # [rad] from an end stop that no window touches
SHORT = 0.03  # of the stall torque by which a drive gives less than asked where it is on its line
NEAR_LINE = 0.85  # of the believed line's torque above which a drive without commands may be at its line
BELOW = 0.03  # of a cap on torque by which a drive stays below it where it is on its line


# ---- the leg ------------------------------------------------------------------------------------------------------


class LegMomenta:
    """p (n), F (n) and P (2) of a leg at samples, its bodies' masses scaled and its rotors' inertia at the joints free."""

    def __init__(self, design: Design):
        self.robot = build_robot(design.leg)
        self.n = len(self.robot.joints)
        self.masses = np.array([body.mass for body in link_bodies(design.leg, self.robot.parameters)[1:]])
        self.gravity = np.array(self.robot.model.gravity.linear[[0, 2]])
        self._functions = {contact: self._functions_in(contact) for contact in (True, False)}

    def _functions_in(self, contact: bool) -> tuple[ca.Function, ca.Function]:
        """(y, dy/dscales) and (dy/dq, dy/dv) of y = (p, F, P), from q, v and scales (2 n + 1)."""
        n, leg = self.n, LegDynamics(self.robot, self.robot.parameters)
        q, v, scales = ca.SX.sym("q", n), ca.SX.sym("v", n), ca.SX.sym("s", 2 * n + 1)
        leg.bodies = [leg.bodies[0]] + [
            replace(
                body,
                mass=scales[k] * body.mass,
                inertia=tuple(scales[k] * x for x in body.inertia),
                armature=scales[n + k] if k else 0.0,
            )
            for k, body in enumerate(leg.bodies[1:])
        ]
        still = ca.SX.zeros(n + BASE)
        whole, speed, _ = leg.stance_pose(q, v) if contact else leg.flight_pose(still[:BASE], still[:BASE], q, v)
        momentum = leg.inverse_dynamics(whole, still, speed) - leg.inverse_dynamics(whole, still, still)
        energy = 0.5 * ca.dot(speed, momentum)
        if contact:
            energy += sum(body.mass for body in leg.bodies) * ca.dot(leg.gravity, leg.points(whole)["com"])
        y = ca.vertcat(ca.gradient(energy, v), ca.gradient(energy, q), momentum[:BASE])
        values = ca.Function("y", [q, v, scales], [y, ca.densify(ca.jacobian(y, scales))])
        motion = ca.Function("dy", [q, v, scales], [ca.densify(ca.jacobian(y, x)) for x in (q, v)])
        return values, motion

    def at(self, s: Samples, scales: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """y (k, 2 n + 2), and its derivatives by the scales (k, 2 n + 2, 2 n + 1), for scales (2 n + 1) of the body's and the
        links' masses [1] and rotor inertia at the joints [kg m^2]."""
        y, by_scales = self._mapped(0, s, scales, (1, 2 * self.n + 1))
        return y[:, :, 0], by_scales

    def by_motion(self, s: Samples, scales: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of y by q and by v, (k, 2 n + 2, n) each."""
        by_q, by_v = self._mapped(1, s, scales, (self.n, self.n))
        return by_q, by_v

    def _mapped(self, which: int, s: Samples, scales: np.ndarray, widths: tuple[int, int]) -> list[np.ndarray]:
        k, height = len(s.t), 2 * self.n + BASE
        found = [np.zeros((k, height, width)) for width in widths]
        for contact, functions in self._functions.items():
            here = np.flatnonzero(s.contact == contact)
            values: Any = functions[which].map(len(here))(s.q[here].T, s.v[here].T, scales) if len(here) else ()
            for array, value, width in zip(found, values, widths, strict=False):
                array[here] = np.asarray(value).reshape(height, len(here), width).transpose(1, 0, 2)
        return found


# ---- rows ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Values:
    """What the rows depend on: scales (2 n + 1) as in ``LegMomenta.at``; g, eta, c [N m], d [N m s/rad] and W [rad/s] of every
    joint, (n) each; lags of torque and force, and how much greater they are where a drive is at its line [s]."""

    scales: np.ndarray
    gain: np.ndarray
    kept: np.ndarray
    friction: np.ndarray
    damping: np.ndarray
    speed: np.ndarray
    lag: float
    force_lag: float
    ramp_lag: float
    force_ramp_lag: float

    @staticmethod
    def of(x: np.ndarray, n: int) -> "Values":
        """From one vector in this order."""
        scales, gain, kept, friction, damping, speed, lags = np.split(x, 2 * n + 1 + n * np.arange(6))
        return Values(scales, gain, kept, friction, damping, speed, *lags.tolist())


def places(n: int) -> dict[str, int]:
    """Where in the vector of ``Values`` each kind begins, for n joints; "end" is its length."""
    names = ("gain", "kept", "friction", "damping", "speed", "lag")
    found = {name: 2 * n + 1 + n * k for k, name in enumerate(names)}
    late = ("lag", "force_lag", "ramp_lag", "force_ramp_lag", "end")
    return {"mass": 0, "rotor": n + 1, **found, **{name: found["lag"] + k for k, name in enumerate(late)}}


@dataclass(frozen=True)
class Block:
    """Rows of one kind, such as "tau0": residuals e (rows,), what the log alone gives of them (rows,), and their derivatives
    by the vector of ``Values`` (rows, values)."""

    kind: str
    e: np.ndarray
    logged: np.ndarray
    J: np.ndarray


Noise = dict[str, sparse.csr_array]  # a sensor, such as "q0" -> derivatives of rows by its noise (rows, samples)


class LogRows:
    """The rows of one log."""

    def __init__(self, design: Design, momenta: LegMomenta, log: RobotLog):
        self.momenta, self.s, self.n, leg = momenta, samples_of(log), momenta.n, design.leg
        self.at, self.coarse = places(self.n), coarseness(self.s)
        self.ratio = np.array([leg.drive(j, "gear", "ratio")[1] for j in leg.joints])
        self.stall = self.ratio * np.array([leg.drive(j, "motor", "max_torque")[1] for j in leg.joints])
        self.joints = [windows(self.s.t, self._moving(design, k)) for k in range(self.n)]
        self.saturated = [windows(self.s.t, self._saturated(design, k)) for k in range(self.n)]
        self.axes = [a for a in (0, 1) if np.any(log.force[:, a])]
        self.standing = windows(self.s.t, np.where(log.contact, self.s.phase, -1))
        self.ramps = np.stack([self._at_line(design, k) for k in range(self.n)], axis=1)

    def _moving(self, design: Design, k: int) -> np.ndarray:
        """A number for each stretch in which a joint turns one way, clear of its end stops; -1 elsewhere."""
        limits, s = design.leg.joint[design.leg.joints[k]], self.s
        free = (s.q[:, k] > limits.lower + FREE) & (s.q[:, k] < limits.upper - FREE)
        return self._numbered(k, (s.sign[:, k] != 0) & free)

    def _numbered(self, k: int, usable: np.ndarray) -> np.ndarray:
        return np.where(usable & (self.s.phase >= 0), 3 * self.s.phase + self.s.sign[:, k].astype(int) + 1, -1)

    def _at_line(self, design: Design, k: int) -> np.ndarray:
        """Whether a drive is at its torque-speed line, where its torque changes between two commands (k,): by its commands, or
        if there are none by the believed line."""
        tau, v, command = np.abs(self.s.tau[:, k]), self.s.v[:, k], self.s.command[:, k]
        if np.isfinite(command).any():
            return np.abs(np.nan_to_num(command)) > tau + SHORT * self.stall[k]
        region = operating_region(design.leg, design.leg.joints[k], self.momenta.robot.parameters)
        return (tau > NEAR_LINE * np.maximum(region.torque_bounds(v)[1], 0)) & (tau > NEAR_LINE * self.stall[k] / 4)

    def _saturated(self, design: Design, k: int) -> np.ndarray:
        """A number for each stretch in which a drive is on its torque-speed line as it drives its joint; -1 elsewhere."""
        leg, joint, tau = design.leg, design.leg.joints[k], self.s.tau[:, k]
        drive_cap, gear_cap = leg.drive(joint, "motor", "torque_cap")[1], leg.drive(joint, "gear", "torque_cap")[1]
        cap = min(np.inf if drive_cap is None else drive_cap * self.ratio[k], np.inf if gear_cap is None else gear_cap)
        asked = np.nan_to_num(self.s.command[:, k]) * np.sign(tau)
        on = (asked > np.abs(tau) + SHORT * self.stall[k]) & (tau * self.s.sign[:, k] > SHORT * self.stall[k])
        has_line = bool(leg.drive(joint, "motor", "laws")[1])
        return self._numbered(k, on & (np.abs(tau) < (1 - BELOW) * cap) & has_line)

    @property
    def count(self) -> int:
        """How many rows there are."""
        return sum(w.count for w in (*self.joints, *self.saturated, *([self.standing] * len(self.axes))))

    def blocks(self, x: np.ndarray) -> list[Block]:
        """All rows at the vector x of ``Values``."""
        values = Values.of(x, self.n)
        y, by_scales = self.momenta.at(self.s, values.scales)
        found = [self._joint_rows(k, y, by_scales, values) for k in range(self.n) if self.joints[k].count]
        found += [self._force_rows(a, y, by_scales, values) for a in self.axes if self.standing.count]
        return found + [self._line_rows(k, values) for k in range(self.n) if self.saturated[k].count]

    def _joint_rows(self, k: int, y: np.ndarray, by_scales: np.ndarray, values: Values) -> Block:
        n, w, s, at = self.n, self.joints[k], self.s, self.at
        g, sign = values.gain[k], s.sign[:, k]
        rubbed = np.abs(s.tau[:, k]) * sign
        passed, delayed = s.tau[:, k] - (1 - values.kept[k]) * rubbed, w.shifted(values.lag)
        signs, speeds = w.phi @ sign, w.phi @ s.v[:, k]
        load = values.friction[k] * signs + values.damping[k] * speeds - w.rate @ y[:, k] - w.phi @ y[:, n + k]
        slope = self.ramps[:, k] * (s.D @ s.tau[:, k])
        changing = w.phi @ (slope * self._passing(k, values))
        J = np.zeros((w.count, at["end"]))
        J[:, : at["gain"]] = (w.rate @ by_scales[:, k] + w.phi @ by_scales[:, n + k]) / g
        J[:, at["gain"] + k], J[:, at["kept"] + k] = load / g**2, delayed @ rubbed
        J[:, at["friction"] + k], J[:, at["damping"] + k] = -signs / g, -speeds / g
        J[:, at["lag"]], J[:, at["ramp_lag"]] = w.by_lag(values.lag) @ passed, changing
        J[:, at["kept"] + k] += values.ramp_lag * (w.phi @ (slope * np.sign(s.tau[:, k]) * sign))
        logged = delayed @ passed + values.ramp_lag * changing
        return Block(f"tau{k}", logged - load / g, logged, J)

    def _passing(self, k: int, values: Values) -> np.ndarray:
        """The share of one more logged torque that the gear passes on (k,)."""
        return 1 - (1 - values.kept[k]) * np.sign(self.s.tau[:, k]) * self.s.sign[:, k]

    def _force_rows(self, a: int, y: np.ndarray, by_scales: np.ndarray, values: Values) -> Block:
        n, w, f, at = self.n, self.standing, self.s.force[:, a], self.at
        weights, area = self.momenta.masses * self.momenta.gravity[a], w.phi.sum(axis=1)
        changing = w.phi @ (self.ramps.any(axis=1) * (self.s.D @ f))
        measured = w.shifted(values.force_lag) @ f + values.force_ramp_lag * changing
        e = measured + w.rate @ y[:, 2 * n + a] + area * (weights @ values.scales[: n + 1])
        J = np.zeros((w.count, at["end"]))
        J[:, : at["gain"]] = w.rate @ by_scales[:, 2 * n + a]
        J[:, : n + 1] += area[:, None] * weights
        J[:, at["force_lag"]], J[:, at["force_ramp_lag"]] = w.by_lag(values.force_lag) @ f, changing
        return Block(f"force{a}", e, measured, J)

    def _line_rows(self, k: int, values: Values) -> Block:
        w, s, at = self.saturated[k], self.s, self.at
        share, R, W = np.abs(s.tau[:, k]) / self.stall[k], self.ratio[k], values.speed[k]
        changing, speed = w.phi @ (s.D @ share), w.phi @ np.abs(s.v[:, k])
        missing = w.phi.sum(axis=1) - w.shifted(values.lag) @ share - values.ramp_lag * changing
        J = np.zeros((w.count, at["end"]))
        J[:, at["speed"] + k], J[:, at["lag"]] = R / W**2 * speed, -(w.by_lag(values.lag) @ share)
        J[:, at["ramp_lag"]] = -changing
        return Block(f"line{k}", missing - R / W * speed, missing, J)

    # ---- noise ----------------------------------------------------------------------------------------------------

    def noise(self, x: np.ndarray) -> Noise:
        """What the noise of each sensor does to all rows, in their order."""
        values, k = Values.of(x, self.n), len(self.s.t)
        motion = self.momenta.by_motion(self.s, values.scales)
        blocks = [self._joint_noise(j, motion, values) for j in range(self.n) if self.joints[j].count]
        blocks += [self._force_noise(a, motion, values) for a in self.axes if self.standing.count]
        blocks += [self._line_noise(j, values) for j in range(self.n) if self.saturated[j].count]
        names = sorted({name for block in blocks for name in block})
        heights = [next(iter(block.values())).shape[0] for block in blocks]
        nothing = [sparse.csr_array((height, k)) for height in heights]
        found = {}
        for name in names:
            B = sparse.vstack([b.get(name, zero) for b, zero in zip(blocks, nothing, strict=True)])
            found[name] = sparse.csr_array(B * self.coarse[:, int(name[1:])] if name[0] == "q" else B)
        return found

    def _of_angles(
        self, motion: tuple[np.ndarray, np.ndarray], rate: tuple[Any, int], phi: tuple[Any, int], factor: float
    ) -> dict[str, Any]:
        """Derivatives of factor (int phi' y_a + int phi y_b) by every angle, through its speed too; (weights, a), (weights, b)."""
        found = {}
        for j in range(self.n):
            by_q, by_v = (rate[0] * m[:, rate[1], j] + phi[0] * m[:, phi[1], j] for m in motion)
            found[f"q{j}"] = factor * (by_v @ self.s.D + by_q)
        return found

    def _joint_noise(self, k: int, motion: tuple[np.ndarray, np.ndarray], values: Values) -> Mapping[str, Any]:
        w, s, g = self.joints[k], self.s, values.gain[k]
        found = self._of_angles(motion, (w.rate, k), (w.phi, self.n + k), 1 / g)
        found[f"q{k}"] = found[f"q{k}"] - (values.damping[k] / g) * (w.phi @ s.D)
        late = (w.phi * (values.ramp_lag * self.ramps[:, k])) @ s.D
        return found | {f"tau{k}": (w.shifted(values.lag) + late) * self._passing(k, values)}

    def _force_noise(self, a: int, motion: tuple[np.ndarray, np.ndarray], values: Values) -> Mapping[str, Any]:
        w, at = self.standing, 2 * self.n + a
        found = self._of_angles(motion, (w.rate, at), (0.0 * w.phi, at), 1.0)
        late = (w.phi * (values.force_ramp_lag * self.ramps.any(axis=1))) @ self.s.D
        return found | {f"force{a}": w.shifted(values.force_lag) + late}

    def _line_noise(self, k: int, values: Values) -> Mapping[str, Any]:
        w, s = self.saturated[k], self.s
        late = values.ramp_lag * (w.phi @ s.D)
        torque = (w.shifted(values.lag) + late) * (-np.sign(s.tau[:, k]) / self.stall[k])
        return {f"tau{k}": torque, f"q{k}": -self.ratio[k] / values.speed[k] * ((w.phi * s.sign[:, k]) @ s.D)}

    def noise_levels(self) -> dict[str, float]:
        """A first guess of each sensor's noise, its standard deviation by third differences; of an encoder at least that of its
        steps."""
        s = self.s
        found = {f"q{k}": max(scatter(s.q[:, k]), step(s.q[:, k]) / np.sqrt(12)) for k in range(self.n)}
        found |= {f"tau{k}": scatter(s.tau[:, k]) for k in range(self.n)}
        return found | {f"force{a}": scatter(s.force[s.contact, a]) for a in self.axes}


def scatter(x: np.ndarray) -> float:
    """Standard deviation of white noise on a smooth signal x (k,), from the median of its third differences."""
    return float(1.4826 * np.median(np.abs(np.diff(x, 3))) / np.sqrt(20.0))


def coarseness(s: Samples) -> np.ndarray:
    """By how much more than white noise the steps of an encoder act on windows where a joint moves less than a step between two
    samples, (k, n): its error then stays alike for as many samples as a step takes."""
    period = float(np.median(np.diff(s.t)))
    steps = np.array([step(x) for x in s.q.T])
    alike = steps / np.maximum(np.abs(s.v) * period, 1e-12)
    return np.sqrt(np.clip(alike, 1.0, max(1.0, WINDOW / 2 / period)))


def step(x: np.ndarray) -> float:
    """The smallest step between two values of a signal."""
    apart = np.diff(np.unique(x))
    return float(apart.min()) if len(apart) else 0.0
