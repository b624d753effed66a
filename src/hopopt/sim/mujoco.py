"""The leg in MuJoCo: a third party's dynamics, contact and integrator, to check a plan or a controller against.

The ground is the planner's ideal one: in stance the foot is pinned (an equality constraint, as stiff as the time step
allows), and the ground can only push: the pin lets go for good once it would have to pull. With a friction coefficient it
is MuJoCo's own frictional contact instead, on which the foot may slip. Joint limits are not enforced here: a plan has to
keep them by itself.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Protocol

import numpy as np

from hopopt.drivetrain.drives import Drive
from hopopt.drivetrain.gear import gears_of
from hopopt.drivetrain.motor import voltage_line
from hopopt.errors import HopoptError, MissingExtraError, UsageError
from hopopt.leg.files.export import DRIVE, ROTOR, to_mjcf
from hopopt.leg.robot import BASE, Robot
from hopopt.leg.scales import Scale, radians
from hopopt.sim.machine import Machine
from hopopt.sim.state import BOUNCE, SENSELESS

Controller = Callable[[float, np.ndarray, np.ndarray, bool], np.ndarray]  # (t, q, v, contact) -> tau (n) [N m]
PIN_PULL = 0.02  # of the weight: what the pin may pull before it lets go; a plan without load is at zero give or take
SETTLING = 8  # time steps: time constant of the pin. MuJoCo's least, 2, disturbs the contact force by 5e-4, 8 by 2e-6
GRIPS = 100.0  # how much harder friction is than the contact's normal, so that a foot within the cone hardly creeps
TOUCHES = (
    1e-5  # [m] on the paper's leg: a foot on frictional ground that is lower is on it; MuJoCo's contact is soft by less
)
PLACED = 1e-6  # m: how far from the origin a foot may be that is to stand there
IMPEDANCE = (0.9999, 0.9999, 0.001, 0.5, 2.0)  # MuJoCo's hardest constraint
TIME_STEP, CONTROL_PERIOD = 5e-5, 1e-4  # [s] on the paper's leg
STIFFNESS, DAMPING = 2000.0, 40.0  # [N m/rad, N m s/rad] on the paper's leg, of the feedback in a replay
PLANE = [0, 2]  # x and z of a world vector


@dataclass(frozen=True)
class MujocoTrace:
    """A run at k control instants: t (k,) [s]; q, v (k, 2 + n); tau (k, n) [N m], held until the next instant; contact
    force f (k, 2) [N]; contact (k,); foot (k, 2) [m]; lowest (k,): height of the leg's lowest point [m]."""

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    tau: np.ndarray
    f: np.ndarray
    contact: np.ndarray
    foot: np.ndarray
    lowest: np.ndarray

    @property
    def lift_off(self) -> float | None:
        """First instant at which the foot is free [s]; None if it never is."""
        return None if self.contact.all() else float(self.t[np.argmin(self.contact)])


def simulate(
    robot: Robot,
    q0: np.ndarray,
    v0: np.ndarray,
    controller: Controller,
    duration: float,
    *,
    time_step: float | None = None,
    control_period: float | None = None,
    contact: bool = True,
    friction: float | None = None,
    landings: int = 1,
    bounce: float = BOUNCE,
    dc_motors: bool = False,
) -> MujocoTrace:
    """Run a controller on the leg in MuJoCo, from q0, v0 (2 + n), for ``duration`` [s].

    controller(t, q, v, contact) is called every ``control_period`` [s] and its torques (n) [N m] are held; they are
    not clamped here. A whole number of Runge-Kutta steps of about ``time_step`` [s] fits into each period. Both are by default
    those of the paper's leg (1e-4 s, 5e-5 s), scaled. With
    ``contact`` the run begins in stance, the foot at the origin; else in flight. It ends early where the foot has come down
    ``landings`` times after flights of at least ``bounce`` [s, on the paper's leg]; a pinned foot only once. friction: coefficient
    of the ground; by default the foot is pinned. dc_motors: torques come from MuJoCo's DC motors, at the voltage that gives
    them at the instant's speeds and is held; so gears must lose nothing.
    Raises MissingExtraError without MuJoCo, UsageError for a foot that is elsewhere, HopoptError if the motion runs away.
    """
    time = Scale.of(robot.leg).time
    control_period = CONTROL_PERIOD * time if control_period is None else control_period
    steps = max(1, round(control_period / (TIME_STEP * time if time_step is None else time_step)))
    if dc_motors and not gears_of(robot.leg, robot.parameters).ideal:
        raise UsageError(
            "MuJoCo's DC motor has no gear that loses something: leave out dc_motors, or the gears' losses"
        )
    scene = _Scene(robot, control_period / steps, friction, dc_motors)
    scene.begin(q0, v0, contact)
    least = bounce * time
    rows, left = [], -np.inf if contact else 0.0  # when the foot last left the ground
    for k in range(round(duration / control_period) + 1):
        if k > 0:
            scene.advance(steps)
        rows.append(scene.instant(k * control_period, controller))
        t, *_, on_ground, foot, _ = rows[-1]
        if contact and not on_ground:
            left = t
        landings -= on_ground and not contact and t - left > least
        if (scene.pinned and not on_ground and foot[1] < -scene.touches) or landings <= 0:
            break
        contact = on_ground
    return MujocoTrace(*(np.array(column) for column in zip(*rows, strict=True)))


class ReplayedPlan(Protocol):
    """What of a solution a replay needs; hopopt.Solution is one."""

    @property
    def duration(self) -> float: ...
    def sample(self, t: Any) -> Any:
        """q, v (k, 2 + n), command (k, n) at times t (k,) [s]."""
        ...


def replay(
    robot: Robot,
    plan: ReplayedPlan,
    *,
    stiffness: float | None = None,
    damping: float | None = None,
    time_step: float | None = None,
    control_period: float | None = None,
    dc_motors: bool = False,
) -> MujocoTrace:
    """Play a plan's torques on the leg in MuJoCo, from the plan's start to its apex: replay(s.robot, s).

    A hop is an inverted pendulum, on which open-loop errors grow, so tau = tau_plan + stiffness [N m/rad] (q_plan - q) +
    damping [N m s/rad] (v_plan - v) at the joints, clamped to their operating regions; tau_plan is the plan's mean over
    the period. What is not given is the paper's leg's (2000 N m/rad, 40 N m s/rad, 5e-5 s, 1e-4 s), scaled. The last instant is the apex to within a period, and
    ``lowest`` there the clearance, unless the foot came down before. dc_motors: as of ``simulate``.
    """
    scale = Scale.of(robot.leg)
    work, time = scale.unit("N m") / radians(robot.leg) ** 2, scale.time
    stiff = STIFFNESS * work if stiffness is None else stiffness
    damped = DAMPING * work * time if damping is None else damping
    control_period = CONTROL_PERIOD * time if control_period is None else control_period
    instants = np.arange(round(plan.duration / control_period) + 1) * control_period
    reference, feedforward = plan.sample(np.minimum(instants, plan.duration)), _means(plan, instants, control_period)
    leg, p, machine = robot.leg, robot.parameters, Machine(robot)
    drive, turning = Drive.of(leg, p, robot.rotors, gears_of(leg, p), turning=robot.turning), robot.turning

    def controller(t: float, q: np.ndarray, v: np.ndarray, contact: bool) -> np.ndarray:
        k = round(t / control_period)
        planned = feedforward[k] if turning is None else turning.jacobian(q[BASE:]).T @ feedforward[k]
        tau = planned + stiff * (reference.q[k] - q)[BASE:] + damped * (reference.v[k] - v)[BASE:]
        at = drive.at(q[BASE:])
        return at.torque(v[BASE:], tau, None, lambda tau: machine.acceleration(q, v, tau, contact)[BASE:])[1]

    q0, v0, duration = reference.q[0], reference.v[0], float(instants[-1])
    steps = {"time_step": time_step, "control_period": control_period}
    return simulate(robot, q0, v0, controller, duration, dc_motors=dc_motors, **steps)


def _means(plan: ReplayedPlan, instants: np.ndarray, period: float, places: int = 8) -> np.ndarray:
    """Mean torque of the plan over the period after each instant (k, n): switches lie anywhere."""
    times = instants[:, None] + (np.arange(places) + 0.5) / places * period
    return plan.sample(np.minimum(times.ravel(), plan.duration)).command.reshape(len(instants), places, -1).mean(axis=1)


class _Scene:
    """MuJoCo's model and data of the leg, from the exported file."""

    def __init__(self, robot: Robot, time_step: float, friction: float | None = None, dc_motors: bool = False):
        self.mj = library()
        limits = [robot.leg.joint[joint] for joint in robot.joints]
        self.turning, pose = robot.turning, np.array([(limit.lower + limit.upper) / 2 for limit in limits])
        self.model = self.mj.MjModel.from_xml_string(to_mjcf(robot, dc_motors, heat=False, pose=pose))
        drives = dict(enumerate(robot.joints)) if self.turning else {}
        self._ratios = self._ratios_of(DRIVE, drives)
        self._spins = self._ratios_of(ROTOR, {k: joint for k, joint in drives.items() if joint in robot.leg.riding})
        self.motors = [voltage_line(robot.leg, joint, robot.parameters) for joint in robot.joints * dc_motors]
        self.data = self.mj.MjData(self.model)
        option, disable = self.model.opt, self.mj.mjtDisableBit
        option.timestep, option.integrator = time_step, int(self.mj.mjtIntegrator.mjINT_RK4)
        option.tolerance = 1e-14  # of the constraint solver: rounding
        option.disableflags |= int(disable.mjDSBL_LIMIT) | int(disable.mjDSBL_AUTORESET)
        self.pinned = friction is None
        if friction is None:
            option.disableflags |= int(disable.mjDSBL_CONTACT)
        else:
            option.cone, option.impratio = int(self.mj.mjtCone.mjCONE_ELLIPTIC), GRIPS
            self.model.geom_friction[:, 0] = friction
            self.model.geom_solref[:], self.model.geom_solimp[:] = (SETTLING * time_step, 1.0), IMPEDANCE
        self.model.eq_solref[0] = SETTLING * time_step, 1.0  # critically damped
        self.model.eq_solimp[0] = IMPEDANCE
        self.fastest = SENSELESS / Scale.of(robot.leg).time
        self.touches = TOUCHES * Scale.of(robot.leg).length
        self.grip = PIN_PULL * float(np.linalg.norm(option.gravity)) * float(self.model.body_mass.sum())

    def _ratios_of(self, name: str, joints: dict[int, str]) -> dict[int, np.ndarray]:
        """Where the ratios of such a tendon are, by the number of its joint."""
        tendons = {k: self.model.tendon(name.format(joint)).id for k, joint in joints.items()}
        return {k: self.model.tendon_adr[at] + np.arange(self.model.tendon_num[at]) for k, at in tendons.items()}

    def begin(self, q: np.ndarray, v: np.ndarray, contact: bool) -> None:
        self.data.qpos[:], self.data.qvel[:], self.data.eq_active[0] = q, v, contact and self.pinned
        self.mj.mj_forward(self.model, self.data)
        if contact and np.abs(self._foot()).max() > PLACED:
            x, z = self._foot()
            raise UsageError(f"stance begins with the foot at the origin, not at x = {x:.6g} m, z = {z:.6g} m")

    def instant(self, t: float, controller: Controller) -> tuple[Any, ...]:
        """Ask the controller, let go of the foot if the ground would pull; a row of the trace."""
        q, v = self.data.qpos.copy(), self.data.qvel.copy()
        contact = bool(self.data.eq_active[0]) if self.pinned else bool(self._foot()[1] < self.touches)
        if not np.abs(v).max() < self.fastest:
            raise HopoptError(f"the motion ran away at {t:.4f} s: the controller is unstable, or its period too long")
        tau = np.array(controller(t, q, v, contact), dtype=float)
        if self.motors:
            self.data.ctrl[:] = [motor.at(*each) for motor, *each in zip(self.motors, tau, v[BASE:], strict=True)]
        else:
            self.data.qfrc_applied[BASE:] = tau - self._turned(q[BASE:], v[BASE:])
        self.mj.mj_forward(self.model, self.data)
        f = self._force()
        if self.pinned and f[1] < -self.grip:
            self.data.eq_active[0], contact, f = False, False, np.zeros(BASE)
        foot = self._foot()
        return t, q, v, tau, f, contact, foot, min(foot[1], self.data.xanchor[BASE:, 2].min())

    def _turned(self, q: np.ndarray, v: np.ndarray) -> Any:
        """Give tendons that are drives their ratios at joint angles q (n); what rotors that the ratios speed up ask, (n) [N m]."""
        if self.turning is None:
            return 0.0
        J, S = self.turning.jacobian(q), self.turning.spin(q)
        for matrix, tendons in ((J, self._ratios), (S, self._spins)):
            for k, places in tendons.items():
                self.model.wrap_prm[places] = matrix[k]
        return S.T @ (self.turning.rotors * self.turning.drift(q, v))

    def advance(self, steps: int) -> None:
        self.mj.mj_step(self.model, self.data, steps)

    def _force(self) -> np.ndarray:
        """Contact force (x, z) [N] on the foot at the last step: of the pin, the only constraint, or of the floor."""
        if self.pinned:
            return self.data.efc_force[PLANE].copy() if self.data.eq_active[0] else np.zeros(BASE)
        total, local = np.zeros(3), np.zeros(6)
        for k in range(self.data.ncon):
            self.mj.mj_contactForce(self.model, self.data, k, local)
            total += self.data.contact[k].frame.reshape(3, 3).T @ local[:3]
        return total[PLANE]

    def _foot(self) -> np.ndarray:
        return self.data.site("foot").xpos[PLANE].copy()


def library() -> Any:
    """MuJoCo, which is compiled and without type information; imported when needed, as it is optional."""
    try:
        return import_module("mujoco")
    except ModuleNotFoundError:
        raise MissingExtraError("MuJoCo", "mujoco") from None
