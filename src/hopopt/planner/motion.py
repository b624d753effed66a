"""A hop as functions of time: states and controls of its phases as the motion of the whole leg."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from hopopt.design import Design
from hopopt.drivetrain.dynamics import added_states
from hopopt.drivetrain.gear import any_lossy
from hopopt.drivetrain.operating_region.half_planes import OperatingRegion
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.drivetrain.supply import voltage_share
from hopopt.errors import UsageError
from hopopt.leg.robot import Robot, build_robot
from hopopt.nlp.trajectory import PhaseTrajectory
from hopopt.ocp.custom import Custom
from hopopt.ocp.drives import DRIVE, motor_torques
from hopopt.ocp.guesses.motion import MovingLeg
from hopopt.ocp.objectives.objective import HopObjective
from hopopt.ocp.phases import DESCENT, FLIGHT, LANDING, STANCE, flight, stance
from hopopt.ocp.problem import Instant, split, stack, symbols
from hopopt.verify.measures import MEASURES
from hopopt.verify.table import NORMALISED_TIMES, Table

AT_APEX = 0.045  # of the speed at lift-off: what is left to rise then is 0.2 % of the whole
TIME_ROUNDING = 1e-9  # s: what rounding may put a time outside the hop


@dataclass(frozen=True)
class Samples:
    """The whole leg at k times.

    t: since stance began (k,) [s]
    phase: name of the phase (k,)
    q: place of the body x, z [m], then joint angles [rad], (k, 2 + n)
    v: velocity of the body [m/s], then joint speeds [rad/s], (k, 2 + n)
    w: speeds of the drives behind their gears (k, n) [rad/s]
    a: acceleration of the body [m/s^2] and of the joints [rad/s^2], (k, 2 + n)
    tau: joint torques (k, n) [N m]
    command: torques that the motors are asked for, behind their gears (k, n) [N m]
    command_rate: how fast ``command`` changes where that is limited, else 0, (k, n) [N m/s]
    f: contact force x, z (k, 2) [N]; with y between them where the leg leaves the plane, (k, 3)
    points: name -> x, z (k, 2) [m] of every joint, "foot" and "com"
    com_v: velocity of the centre of mass x, z (k, 2) [m/s]
    """

    t: np.ndarray
    phase: np.ndarray
    q: np.ndarray
    v: np.ndarray
    w: np.ndarray
    a: np.ndarray
    tau: np.ndarray
    command: np.ndarray
    command_rate: np.ndarray
    f: np.ndarray
    points: dict[str, np.ndarray]
    com_v: np.ndarray

    @property
    def lowest(self) -> np.ndarray:
        """Height of the leg's lowest point (k,) [m]."""
        return self.lowest_of([name for name in self.points if name != "com"])

    def lowest_of(self, points: Sequence[str]) -> np.ndarray:
        """Height of the lowest of these points (k,) [m]."""
        return np.min([self.points[name][:, 1] for name in points], axis=0)

    def __getitem__(self, rows: Any) -> "Samples":
        """The samples at some rows (an index array, mask or slice)."""
        points = {name: p[rows] for name, p in self.points.items()}
        arrays = {
            name: getattr(self, name)[rows]
            for name in ("t", "phase", "q", "v", "w", "a", "tau", "command", "command_rate", "f", "com_v")
        }
        return Samples(**arrays, points=points)


class PlanEvaluator:
    """Turns states and controls of the phases into the motion of the whole leg, by the planner's own dynamics.

    of_drives: places of the drives' own states among those of each phase.
    """

    def __init__(self, design: Design, robot: Robot):
        self.robot, self.names = robot, [*robot.point_names, "com"]
        leg, self.functions, self.of_drives = MovingLeg(design), {}, {}
        for part in (stance(leg), flight(leg)):
            x, u = symbols(part.phase.states), symbols(part.phase.controls)
            s = Instant(**x, **u, t=0.0, p=robot.parameters)
            m, points = part.motion(s), leg.dynamics(s).points(part.motion(s).q)
            com_speed = ca.jtimes(points["com"], s.q, s.v)
            if part.kind == FLIGHT:
                com_speed += ca.jtimes(points["com"], s.com, s.com_v)
            outputs = [
                m.q,
                m.v,
                m.drives.w,
                m.a,
                m.tau,
                motor_torques(leg, part.motion)(s),
                ca.vertcat(*[0.0 if (rate := leg.torque_rate(s, k)) is None else rate for k in range(leg.n)]),
                m.f,
                com_speed,
                *(points[name] for name in self.names),
            ]
            given = [stack(x, part.phase.states), stack(u, part.phase.controls)]
            self.functions[part.kind] = ca.Function(part.kind, given, [ca.densify(o) for o in outputs])
            places = np.arange(given[0].numel())
            self.of_drives[part.kind] = split(part.phase.states, places).get(DRIVE, places[:0])
        self.of_drives |= {DESCENT: self.of_drives[FLIGHT], LANDING: self.of_drives[STANCE]}
        self.functions |= {DESCENT: self.functions[FLIGHT], LANDING: self.functions[STANCE]}

    def __call__(self, phase: str, t: np.ndarray, x: np.ndarray, u: np.ndarray) -> Samples:
        """Samples from states x (k, nx) and controls u (k, n or more) of one phase at times t (k,)."""
        states, moving = (
            self.functions[phase].size1_in(k) for k in (0, 1)
        )  # what drives and objectives add comes after
        of_leg = (np.ascontiguousarray(x.T[:states]), np.ascontiguousarray(u.T[:moving]))
        results = self.functions[phase].map(len(t))(*of_leg)
        q, v, w, a, tau, command, command_rate, f, com_v, *points = (np.array(r).T for r in results)
        return Samples(
            t,
            np.full(len(t), phase),
            q,
            v,
            w,
            a,
            tau,
            command,
            command_rate,
            f,
            dict(zip(self.names, points, strict=True)),
            com_v,
        )


@dataclass(frozen=True, repr=False)
class Motion:
    """A hop as functions of time.

    design, objective: the problem, and the name of what it was solved for
    phases: trajectories, by phase
    stated: figures that no table of the plan tells, by name [the name's unit]
    own: the user's functions, which are not stored
    """

    design: Design
    objective: str
    phases: dict[str, PhaseTrajectory]
    stated: Mapping[str, float] = field(default_factory=dict, kw_only=True)
    own: tuple[HopObjective | None, tuple[Custom, ...]] = field(default=(None, ()), kw_only=True)

    @cached_property
    def robot(self) -> Robot:
        return build_robot(self.design.leg)

    @cached_property
    def _evaluate(self) -> PlanEvaluator:
        return PlanEvaluator(self.design, self.robot)

    @property
    def duration(self) -> float:
        """From the start of stance to the apex [s]."""
        return self.phases[STANCE].duration + self.phases[FLIGHT].duration

    @property
    def end(self) -> float:
        """When the last phase ends [s]: at the apex, at touchdown, or at rest."""
        return sum(p.duration for p in self.phases.values())

    def _begin(self, phase: str) -> float:
        names = list(self.phases)
        return sum(self.phases[name].duration for name in names[: names.index(phase)])

    @property
    def lift_off(self) -> float:
        """Time of lift-off [s]."""
        return self.phases[STANCE].duration

    def region(self, joint: str) -> OperatingRegion:
        """The admissible operating region of a joint, in numbers."""
        return operating_region(self.design.leg, joint, self.robot.parameters)

    def voltage(self, s: Samples) -> np.ndarray | None:
        """The bus voltage at samples, over what it is without load (k,); None without a supply that sags."""
        if self.design.leg.supply is None:
            return None
        return voltage_share(self.design.leg, self.robot.parameters, list(s.command.T), list(s.w.T))

    def sample(self, t: Any) -> Samples:
        """The whole leg at times t [s] since stance began; at lift-off and apex, flight; at touchdown, the descent.
        UsageError for times outside the hop."""
        t = np.atleast_1d(np.asarray(t, dtype=float))
        outside = ~((t >= -TIME_ROUNDING) & (t <= self.end + TIME_ROUNDING))  # not-a-number too
        if outside.any():
            words = "give times in seconds since stance began"
            raise UsageError(f"t = {t[outside][0]:g} s is outside the hop, 0 to {self.end:.6g} s: {words}")
        t = np.clip(t, 0.0, self.end)
        parts, order = [], []
        which = np.searchsorted([self._begin(phase) for phase in self.phases], t, "left") - 1
        which = np.where(t < self.lift_off, 0, np.maximum(which, 1))
        for k, phase in enumerate(self.phases):
            if (rows := which == k).any():
                parts.append(self.sample_phase(phase, t[rows] - self._begin(phase)))
                order.append(np.flatnonzero(rows))
        return _join(parts)[np.argsort(np.concatenate(order), kind="stable")]

    def sample_phase(self, phase: str, t: np.ndarray) -> Samples:
        """The whole leg at times t [s] since the phase began; both ends belong to the phase."""
        x, u = self.phases[phase].sample(t)
        return self._standing(phase, self._evaluate(phase, np.asarray(t) + self._begin(phase), x, u))

    def _standing(self, phase: str, s: Samples) -> Samples:
        """Samples of a landing as seen from where the hop began; they count x from the foot, as all dynamics does."""
        if phase != LANDING:
            return s
        end = self.sample_phase(DESCENT, np.array([self.phases[DESCENT].duration]))
        ahead, q = end.points["foot"][0, 0], s.q.copy()
        q[:, 0] += ahead
        return replace(s, q=q, points={name: p + np.array([ahead, 0.0]) for name, p in s.points.items()})

    def everywhere(self, phase: str, normalised_times: np.ndarray) -> Samples:
        """The whole leg at the same normalised times (0 to 1) of every interval of a phase, interval by interval."""
        return self._standing(phase, self._everywhere(phase, normalised_times))

    def _everywhere(self, phase: str, normalised_times: np.ndarray) -> Samples:
        """The same, a landing's x counted from its foot."""
        t, x, u = self.phases[phase].everywhere(normalised_times)
        return self._evaluate(phase, t.ravel() + self._begin(phase), x.reshape(t.size, -1), u.reshape(t.size, -1))

    @cached_property
    def tables(self) -> dict[str, Table]:
        """The plan at Chebyshev points of every interval: what is stored and verified."""
        return {phase: self.fresh_table(phase) for phase in self.phases}

    def fresh_table(self, phase: str) -> Table:
        """The table of one phase, computed from its trajectory; a landing's x is counted from its foot."""
        samples, N = self._everywhere(phase, NORMALISED_TIMES), len(self.phases[phase].x_start)
        added = added_states(self.design.leg, self.robot.parameters)
        leg = self.design.leg
        apart = ("command",) if added.size or any_lossy(leg) or not leg.direct else ()
        arrays = {
            s: getattr(samples, s).reshape(N, len(NORMALISED_TIMES), *getattr(samples, s).shape[1:])
            for s in ("t", "q", "v", "a", "tau", "f", *apart)
        }
        table = Table(**arrays)
        return self._with_drives(phase, table) if added.size else table

    def _with_drives(self, phase: str, table: Table) -> Table:
        """The table with the drives' states."""
        _, x, _ = self.phases[phase].everywhere(NORMALISED_TIMES)
        return replace(table, drive=x[..., self._evaluate.of_drives[phase]])

    @property
    def apex(self) -> Samples:
        """The whole leg at the end of flight (one sample)."""
        return self.sample_phase(FLIGHT, np.array([self.phases[FLIGHT].duration]))

    @property
    def end_of_flight(self) -> str:
        """What a figure calls that instant: "apex", or "end" where the centre of mass still rises or falls again."""
        begin, end = self.sample_phase(FLIGHT, np.array([0.0, self.phases[FLIGHT].duration])).com_v[:, 1].tolist()
        return "apex" if at_apex(end, begin) else "end"

    def claims(self) -> dict[str, float]:
        """What verification is to confirm: the height of the lowest point at the apex [m]; what else the hop was made
        for, the body's height there [m] or what is ``stated``."""
        end = self.apex
        claims = {"clearance_m": float(end.lowest[0])}
        if self.objective == "apex":
            claims["apex_m"] = float(end.q[0, 1])
        claims |= {name: self.stated[name] for name in MEASURES.keys() & self.stated.keys()}
        return claims


def at_apex(vertical: float, at_lift_off: float) -> bool:
    """Whether the centre of mass, at this vertical speed [m/s] after that at lift-off, is as good as at its highest."""
    return abs(vertical) < AT_APEX * abs(at_lift_off)


def _join(parts: list[Samples]) -> Samples:
    if len(parts) == 1:
        return parts[0]
    names = ("t", "phase", "q", "v", "w", "a", "tau", "command", "command_rate", "f", "com_v")
    arrays = {n: np.concatenate([getattr(p, n) for p in parts]) for n in names}
    points = {name: np.concatenate([p.points[name] for p in parts]) for name in parts[0].points}
    return Samples(**arrays, points=points)
