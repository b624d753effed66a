"""The figures of one simulated hop: clearance and its parts, effort, energy, and the limits that were not kept."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hopopt.design import Design
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.drivetrain.supply import voltage_share
from hopopt.leg.geometry.above import above_ground
from hopopt.leg.robot import BASE
from hopopt.leg.scales import Scale, friction_needed, weight
from hopopt.sim.state import BOUNCE
from hopopt.sim.trace import Trace

LOADED_WEIGHT = 0.1  # of the weight: a foot that carries less slips unseen, and for a moment only
PULL = 1.0  # [N] on the paper's leg, by which the ground may have to pull: a foot is kept that its own sideways grip presses down
IDEAL_GRIP = " (without contact.friction its sideways grip has no limit, and keeps a foot that real ground lets go)"
SIMULATED_SLACK = 1e-3  # rad or share by which a limit may be missed in a simulation, and m, s, m/s on the paper's leg


def past_limits(design: Design, q_j: np.ndarray) -> np.ndarray:
    """By how much each joint is beyond its limits at joint angles q_j (..., n) [rad], negative within them, (..., n)."""
    joints = [design.leg.joint[name] for name in design.leg.joints]
    lower, upper = (np.array([getattr(j, side) for j in joints]) for side in ("lower", "upper"))
    return np.maximum(lower - q_j, q_j - upper)


def beyond_limits(design: Design, q_j: np.ndarray) -> np.ndarray:
    """Whether any joint is beyond its limits at joint angles q_j (k, n) [rad], (k,)."""
    return np.any(past_limits(design, q_j) > SIMULATED_SLACK, axis=1)


@dataclass(frozen=True)
class HopFigures:
    """What the first hop of a run amounts to, by the same definitions as the optimum's.

    design: the problem, with the true leg
    trace: the run
    bounce: a foot off the ground for less than this has not hopped [s, on the paper's leg]
    torque_gain: each motor's true torque constant over the believed one, a number or (n,)
    """

    design: Design
    trace: Trace
    bounce: float = BOUNCE
    torque_gain: Any = 1.0

    @cached_property
    def scale(self) -> Scale:
        """The leg's units over those of the paper's leg."""
        return Scale.of(self.design.leg)

    @cached_property
    def flight(self) -> slice:
        """Samples of the first flight, from lift-off to touchdown; bounces do not count."""
        least = self.bounce * self.scale.time
        t, edges = self.trace.t, np.flatnonzero(np.diff(np.concatenate([[1], self.trace.contact, [1]])))
        for begin, end in edges.reshape(-1, 2):
            if t[min(end, len(t) - 1)] - t[begin] >= least:
                down = [at for at in self.trace.times_of("touchdown") if at >= t[begin] + least]
                return slice(int(begin), min(int(end), *(int(np.searchsorted(t, at)) + 1 for at in down[:1]), len(t)))
        return slice(len(t), len(t))

    @property
    def stance(self) -> slice:
        """Samples before the first flight; the first one at least, should the foot be gone at once."""
        return slice(0, max(self.flight.start, 1))

    @property
    def flies(self) -> bool:
        """Whether the foot left the ground at all."""
        return self.flight.stop > self.flight.start

    @cached_property
    def highest(self) -> int | None:
        """The sample in flight whose lowest point is highest, the foot within its window, before a joint has come to
        its end stop; None if there is none."""
        allowed = self._in_window & ~self._stopped
        if not allowed.any():
            return None
        return self.flight.start + int(np.argmax(np.where(allowed, self.trace.lowest[self.flight], -np.inf)))

    @cached_property
    def _in_window(self) -> np.ndarray:
        """Whether the foot is within its window at the samples of flight."""
        points = self.trace.points
        offset = points["foot"][self.flight, 0] - points[self.trace.robot.joints[0]][self.flight, 0]
        return np.abs(offset) <= self.design.hop.foot_window

    @cached_property
    def _stopped(self) -> np.ndarray:
        """Whether a joint has come to its end stop by the samples of flight."""
        return np.logical_or.accumulate(beyond_limits(self.design, self.trace.q[self.flight, BASE:]))

    @property
    def cut_short(self) -> str:
        """When which joint came to its end stop, if the leg went higher after it, which does not count; else empty."""
        height = float(self.trace.lowest[self.flight][self._in_window & self._stopped].max(initial=0.0))
        if height <= self.clearance + SIMULATED_SLACK * self.scale.length:
            return ""
        k = self.flight.start + int(np.argmax(self._stopped))
        joint = self.design.leg.joints[int(np.argmax(past_limits(self.design, self.trace.q[k, BASE:])))]
        return (
            f"the {joint} came to its end stop at {self.trace.t[k]:.3f} s: the clearance of {self.clearance:.3f} m is of the time before, and "
            f"the {height:.3f} m that the leg reaches afterwards do not count"
        )

    @property
    def no_hop(self) -> str:
        """Why the run is no hop, in a clause; empty if the foot leaves the ground while the centre of mass rises, and
        clears it."""
        lift = self.lift_off
        if not self.flies:
            return f"the foot never leaves the ground ({self.trace.outcome})"
        if lift["vertical_m_s"] <= SIMULATED_SLACK * self.scale.speed:
            return f"the leg folds at {lift['time_s']:.3f} s without a push"
        if not self._in_window.any():
            return f"the foot is never within {self.design.hop.foot_window:g} m of the hip's plumb line in flight"
        if self.highest is None:
            return "a joint is at its end stop before the foot is in its window"
        return (
            "" if self.clearance > SIMULATED_SLACK * self.scale.length else "the leg's lowest point stays on the ground"
        )

    @property
    def clearance(self) -> float:
        """Height of the leg's lowest point [m], greatest in flight with the foot in its window; 0 if it never is."""
        return 0.0 if self.highest is None else float(self.trace.lowest[self.highest])

    @property
    def foot_height(self) -> float:
        """Greatest height of the foot [m], wherever it is: what the paper measures."""
        return float(self.trace.points["foot"][self.flight, 1].max(initial=0.0))

    @property
    def parts(self) -> dict[str, float]:
        """The exact, signed parts that sum to the clearance [m]."""
        if self.highest is None:
            return {"com_height_at_lift_off_m": 0.0, "ballistic_rise_m": 0.0, "com_height_over_lowest_point_m": 0.0}
        com = self.trace.points["com"][:, 1]
        low, high = com[self.flight.start], com[self.highest]
        return {
            "com_height_at_lift_off_m": float(low),
            "ballistic_rise_m": float(high - low),
            "com_height_over_lowest_point_m": float(self.clearance - high),
        }

    @property
    def budget(self) -> dict[str, float]:
        """The clearance [m] as push (COM height its ballistic apex would have), less what timing and posture take."""
        if self.highest is None:
            return {"push_m": 0.0, "timing_m": 0.0, "retraction_m": 0.0}
        p, rise = self.parts, max(self.lift_off["vertical_m_s"], 0.0) ** 2 / (2 * self._gravity)
        return {
            "push_m": p["com_height_at_lift_off_m"] + rise,
            "timing_m": p["ballistic_rise_m"] - rise,
            "retraction_m": p["com_height_over_lowest_point_m"],
        }

    @property
    def _gravity(self) -> float:
        return float(-self.trace.robot.model.gravity.linear[2])

    @property
    def lift_off(self) -> dict[str, float]:
        """Time [s], body height [m] and speed of the centre of mass [m/s] when the foot leaves."""
        if not self.flies:
            return {"time_s": 0.0, "body_height_m": 0.0, "vertical_m_s": 0.0, "horizontal_m_s": 0.0}
        k = self.flight.start
        vx, vz = (float(x) for x in self.trace.com_v[k])
        height = float(self.trace.q[k, 1])
        return {"time_s": float(self.trace.t[k]), "body_height_m": height, "vertical_m_s": vz, "horizontal_m_s": vx}

    def saturation(self, joint: int) -> np.ndarray:
        """Saturation ratio C of a joint at every sample of stance (the paper's eq. 17), at most 1."""
        trace, span, leg = self.trace, self.stance, self.design.leg
        region, p = operating_region(leg, trace.robot.joints[joint], trace.robot.parameters), trace.robot.parameters
        motor, speed = trace.motor[span] / self.torque_gain, trace.w[span] * self.torque_gain  # as if believed
        voltage = voltage_share(leg, p, list(motor.T), list(speed.T)) if leg.supply else None
        ratio = region.at(voltage).saturation(speed[:, joint], motor[:, joint])
        return np.minimum(ratio, 1.0)

    @property
    def saturation_mean(self) -> dict[str, float]:
        """C_avg of every joint in stance (the paper's eq. 18)."""
        t = self.trace.t[self.stance]
        span = max(float(t[-1] - t[0]), 1e-12)
        return {
            joint: float(np.trapezoid(self.saturation(k), t) / span) for k, joint in enumerate(self.trace.robot.joints)
        }

    @property
    def energy(self) -> dict[str, float]:
        """Up to the clearance [J]: the motors' net work, what gears and end stops took, what the leg gained."""
        trace = self.trace
        k = self.highest if self.highest is not None else self.stance.stop - 1
        motors, gears, stops, ground = (float(x) for x in trace.work[k])
        gained = float(trace.energy[k] - trace.energy[0])
        push = float(trace.work[self.stance.stop - 1, 0])
        lost = {"gears_J": gears, "stops_J": stops, "ground_friction_J": ground}
        return {"stance_net_J": push, "motors_J": motors, **lost, "gained_J": gained}

    @property
    def peaks(self) -> dict[str, dict[str, float] | float]:
        """Largest torque [N m] and speed [rad/s] of every joint's drive, behind its gear, up to the clearance, and ground force [N]."""
        trace, joints = self.trace, self.trace.robot.joints
        span = slice(0, (self.highest if self.highest is not None else self.stance.stop - 1) + 1)
        return {
            "torque_Nm": {j: float(np.abs(trace.motor[span, k]).max()) for k, j in enumerate(joints)},
            "speed_rad_s": {j: float(np.abs(trace.w[span, k]).max()) for k, j in enumerate(joints)},
            "ground_force_N": float(np.hypot(*trace.f[self.stance].T).max()),
        }

    @property
    def slip_ratio(self) -> float:
        """Largest |f_x| / f_z in stance where at least LOADED_WEIGHT of the weight presses on the foot: the friction
        coefficient that the hop needs there; 0 if there is none."""
        f, heavy = self.trace.f[self.stance], weight(self.trace.robot.model)
        along, up = np.abs(f[:, 0]), f[:, 1]
        pressed = up > LOADED_WEIGHT * heavy
        allowed = SIMULATED_SLACK * np.maximum(heavy, up[pressed])
        return friction_needed(along[pressed], up[pressed], self.design.contact.friction, allowed)

    @property
    def slip_distance(self) -> float:
        """How far the foot slips along the ground in stance, forth and back [m]."""
        on_ground = self.trace.contact[self.stance]
        path = np.abs(np.diff(self.trace.points["foot"][self.stance, 0]))
        return float(path[on_ground[1:] & on_ground[:-1]].sum())

    @property
    def limits_exceeded(self) -> list[str]:
        """Limits of the problem that the hop did not keep, in words; the bound does not hold for such a hop."""
        trace, hop, scale, found = self.trace, self.design.hop, self.scale, []
        span = slice(0, (self.highest if self.highest is not None else len(trace.t) - 1) + 1)
        past = past_limits(self.design, trace.q[span, BASE:]).max(axis=0)
        for k, (joint, excess) in enumerate(zip(trace.robot.joints, past, strict=True)):
            if excess > SIMULATED_SLACK:
                found.append(f"{joint} {excess:.3f} rad into its end stop")
            region, w = operating_region(self.design.leg, joint, trace.robot.parameters), trace.w[span, k]
            use = np.max(region.use(w, region.clamp(w, trace.motor[span, k])), axis=0)  # above 1 by speed alone
            if use.max() > 1 + SIMULATED_SLACK:
                found.append(f"{joint} at {np.abs(w[use.argmax()]):.1f} rad/s, faster than its drive may turn")
        found += self._wrong_durations()
        friction = self.design.contact.friction
        if friction is not None and self.slip_ratio > friction:
            found.append(f"needs friction {self.slip_ratio:.4g}, the ground has {friction:g}")
        if self.slip_distance > SIMULATED_SLACK * scale.length:
            found.append(f"the foot slips {1e3 * self.slip_distance:.0f} mm in stance")
        if (pull := -float(trace.f[self.stance, 1].min())) > PULL * scale.force:
            found.append(f"the ground would have to pull with {pull:.0f} N{IDEAL_GRIP if friction is None else ''}")
        least, lowest = self.design.contact.least_force, float(self.trace.f[self.stance, 1][:-1].min(initial=np.inf))
        if least and least - lowest > PULL * scale.force:
            found.append(f"{least - lowest:.0f} N less than the least ground force")
        deepest = hop.least_height - SIMULATED_SLACK * scale.length
        for name, points in above_ground(self.design).items() if hop.least_height else ():
            z = min(float(trace.points[point][span, 1].min()) for point in points)
            if name != "foot" and z < deepest:
                found.append(f"{name} down to {z:.3f} m")
        if not hop.counter_movement and float(trace.v[self.stance, 1].min()) < -SIMULATED_SLACK * scale.speed:
            found.append("the body descends in stance")
        return found

    def _wrong_durations(self) -> list[str]:
        """Phases that last shorter or longer than they may; flight counts up to the clearance."""
        left = self.lift_off["time_s"]
        lasted, slack = {"stance": left}, SIMULATED_SLACK * self.scale.time
        if self.highest is not None:
            lasted["flight"] = float(self.trace.t[self.highest]) - left
        ranges = {phase: getattr(self.design.hop, f"{phase}_duration") for phase in lasted}
        return [
            f"{phase} of {lasted[phase]:.3f} s"
            for phase, (shortest, longest) in ranges.items()
            if not shortest - slack <= lasted[phase] <= longest + slack
        ]

    def as_dict(self) -> dict[str, object]:
        """Everything above, for tables and ``--json``."""
        return {
            "clearance_m": self.clearance,
            "foot_height_m": self.foot_height,
            "parts": self.parts,
            "budget": self.budget,
            "lift_off": self.lift_off,
            "saturation_mean": self.saturation_mean,
            "energy": self.energy,
            "peaks": self.peaks,
            "slip_ratio": self.slip_ratio,
            "slip_distance_m": self.slip_distance,
            "limits_exceeded": self.limits_exceeded,
            "no_hop": self.no_hop,
            "cut_short": self.cut_short,
            "energy_error": self.trace.energy_error,
            "outcome": self.trace.outcome,
        }
