"""Every figure of a summary that follows from the motion alone."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hopopt.leg.geometry.above import above_ground
from hopopt.leg.kinematics import reach
from hopopt.leg.limit_id import Kind, LimitId, motor_power, place_limit
from hopopt.leg.robot import BASE
from hopopt.leg.scales import Scale, descent_range, force_range, friction_needed
from hopopt.ocp.phases import FLIGHT, STANCE
from hopopt.ocp.rules import steepness
from hopopt.planner.answer.limit_use import LOADED_SHARE, IdleLimit, idle_limits
from hopopt.planner.answer.touchdown import ClearedBox, Landing, Orbit, landing, obstacle, orbit
from hopopt.planner.motion import Motion, Samples
from hopopt.record import Real, Strict, if_any, stated
from hopopt.verify.check import LIMIT
from hopopt.verify.drives import JointLosses, SupplyFigures, losses, supply_figures
from hopopt.verify.hops.collision import Collision, collision
from hopopt.verify.hops.heat import JointHeat, heat_figures
from hopopt.verify.springs.energy import SeriesSpringEnergy, SpringEnergy, series_spring_energies, spring_energies
from hopopt.verify.upper_bound import UpperBound, upper_bound

ACTIVE = 1e-3  # share of its range by which a limit may be missed and still count as active
SAMPLES_OF_INTERVAL = np.linspace(0.0, 1.0, 9)
UNLOADED = 1.0  # [N] on the paper's leg: a foot that carries less carries nothing
NO_FRICTION = 10.0  # coefficient that no ground has, and no problem may ask for more


@dataclass(frozen=True)
class Parts(Strict):
    """The three signed parts that sum to the clearance."""

    com_height_at_lift_off_m: float = stated("height of the centre of mass at lift-off [m]")
    ballistic_rise_m: float = stated("rise of the centre of mass in flight [m]")
    com_height_over_lowest_point_m: float = stated("lowest point minus centre of mass when flight ends [m]")

    @property
    def sum(self) -> float:
        """The clearance [m]."""
        return self.com_height_at_lift_off_m + self.ballistic_rise_m + self.com_height_over_lowest_point_m


@dataclass(frozen=True)
class PhaseFigures(Strict):
    """Duration, mesh and extremes of one phase."""

    duration_s: float = stated("how long it lasts [s]")
    intervals: int = stated("of its last mesh")
    peak_torque_Nm: Mapping[str, float] = stated("largest torque, by joint [N m]")
    peak_speed_rad_s: Mapping[str, float] = stated("largest speed, by joint [rad/s]")


@dataclass(frozen=True)
class LiftOff(Strict):
    """Lift-off: when, and the velocity of the centre of mass."""

    time_s: float = stated("since stance began [s]")
    speed_m_s: float = stated("of the centre of mass [m/s]")
    vertical_m_s: float = stated("its upward part [m/s]")
    horizontal_m_s: float = stated("its forward part [m/s]")


@dataclass(frozen=True)
class LeansOn(Strict):
    """What the hop needs of the ground, and of the time that it is allowed."""

    friction_needed: Real = stated(
        "coefficient that keeps the foot from slipping; null: none does, as it is held without load"
    )
    load_free_share: float = stated("share of stance in which the foot carries no load")
    stance_at_its_limit: str | None = stated("longest or shortest, if stance lasts as long as it may")


class Sampled:
    """A plan with its samples at the normalised times SAMPLES_OF_INTERVAL of every interval: ``fine`` by phase, and those of stance."""

    def __init__(self, plan: Motion):
        self.plan = plan
        self.fine = {phase: plan.everywhere(phase, SAMPLES_OF_INTERVAL) for phase in plan.phases}
        self.stance = self.fine[STANCE]


def _time_mean(samples: Samples, values: np.ndarray, per_interval: int = len(SAMPLES_OF_INTERVAL)) -> float:
    """Mean over time [values' unit] of values at the SAMPLES_OF_INTERVAL normalised times of every interval (trapezoids)."""
    t, y = samples.t.reshape(-1, per_interval), values.reshape(-1, per_interval)
    return float(np.trapezoid(y, t, axis=1).sum() / (t[-1, -1] - t[0, 0]))


def parts(plan: Motion) -> Parts:
    """The three exact, signed parts [m] that sum to the clearance (COM is the whole leg's centre of mass)."""
    start, end = plan.sample_phase(FLIGHT, np.array([0.0])), plan.apex
    low, high = float(start.points["com"][0, 1]), float(end.points["com"][0, 1])
    return Parts(low, high - low, plan.claims()["clearance_m"] - high)


def lowest_point(plan: Motion) -> str:
    """The foot or joint that is lowest when flight ends; of a leg with shapes also the trunk, or a link by its name."""
    end = plan.apex
    heights = {
        name: round(float(end.points[name][0, 1]), 9) for name in dict.fromkeys(("foot", *plan.robot.point_names))
    }
    return min(heights, key=lambda name: heights[name]).partition(" ")[0]


def phase_figures(plan: Motion, phase: str, samples: Samples) -> PhaseFigures:
    """Duration, mesh and the extremes of one phase."""
    joints = plan.robot.joints
    return PhaseFigures(
        duration_s=plan.phases[phase].duration,
        intervals=len(plan.phases[phase].x_start),
        peak_torque_Nm={j: float(np.abs(samples.tau[:, k]).max()) for k, j in enumerate(joints)},
        peak_speed_rad_s={j: float(np.abs(samples.v[:, BASE + k]).max()) for k, j in enumerate(joints)},
    )


def lift_off(plan: Motion) -> LiftOff:
    """Time [s], speed of the centre of mass [m/s] and its direction at lift-off."""
    s = plan.sample_phase(FLIGHT, np.array([0.0]))
    vx, vz = (float(x) for x in s.com_v[0])
    return LiftOff(plan.lift_off, float(np.hypot(vx, vz)), vertical_m_s=vz, horizontal_m_s=vx)


def saturation_mean(plan: Motion, stance: Samples) -> dict[str, float]:
    """C_avg of every joint in stance (the paper's eq. 18), capped at 1 between the nodes."""
    means, voltage = {}, plan.voltage(stance)
    for k, joint in enumerate(plan.robot.joints):
        ratio = plan.region(joint).at(voltage).saturation(stance.w[:, k], stance.command[:, k])
        means[joint] = _time_mean(stance, np.minimum(ratio, 1.0))
    return means


def energy(plan: Motion, fine: Mapping[str, Samples]) -> dict[str, float]:
    """Mechanical work of the joints [J]: net and positive, in every phase."""
    figures = {}
    for name, s in fine.items():
        power, T = s.tau * s.v[:, BASE:], plan.phases[name].duration
        figures[f"{name}_net_J"] = _time_mean(s, power.sum(axis=1)) * T
        figures[f"{name}_positive_J"] = sum(_time_mean(s, np.maximum(column, 0.0)) * T for column in power.T)
    return figures


def active_limits(plan: Motion, stance: Samples) -> dict[str, float]:
    """Share of stance in which each limit is active, largest first; a limit of its duration is active in all of it."""
    shares: dict[str, np.ndarray | bool] = {}
    leg, size, voltage = plan.design.leg, reach(plan.design.leg), plan.voltage(stance)
    for k, joint in enumerate(plan.robot.joints):
        region, angle = plan.region(joint), stance.q[:, BASE + k]
        use = np.array(region.use(stance.w[:, k], stance.command[:, k], voltage, stance.command_rate[:, k]))
        shares[str(LimitId(Kind.REGION, joint))] = use.max(axis=0) > 1 - ACTIVE
        if region.power is not None:
            drawn = np.abs(stance.w[:, k] * stance.command[:, k])
            shares[str(motor_power(leg, joint))] = drawn > (1 - ACTIVE) * region.power
        margin = ACTIVE * (leg.joint[joint].upper - leg.joint[joint].lower)
        near = np.minimum(angle - leg.joint[joint].lower, leg.joint[joint].upper - angle)
        shares[str(place_limit(leg, joint))] = near < margin
    shares |= _active_at_the_ground(plan, stance)
    for name, points in above_ground(plan.design).items():
        if name != "foot":
            shares[f"{name} on the ground"] = stance.lowest_of(points) < ACTIVE * size
    shares |= {f"{end} stance": True for end in _ends_of_stance_time(plan)}
    means = {name: _time_mean(stance, np.broadcast_to(active, stance.t.shape) + 0.0) for name, active in shares.items()}
    return most_first({name: share for name, share in means.items() if share > 1e-3})


def most_first(amounts: Mapping[str, float]) -> dict[str, float]:
    """Sorted, the largest first."""
    return dict(sorted(amounts.items(), key=lambda pair: -pair[1]))


def _active_at_the_ground(plan: Motion, stance: Samples) -> dict[str, np.ndarray]:
    """Where the ground's limits are active: it cannot pull, a loaded foot may not slip, the body may not descend."""
    margin, friction = ACTIVE * force_range(plan.robot.model), plan.design.contact.friction
    along, up = np.abs(stance.f[:, :-1]).max(axis=1) / steepness(stance.f.shape[1]), stance.f[:, -1]
    active = {"ground cannot pull": up < margin}
    if friction is not None:
        active["friction cone"] = (along > friction * up - margin) & (up >= margin)
    if not plan.design.hop.counter_movement:
        active["body never descends"] = stance.v[:, 1] < ACTIVE * descent_range(plan.design.leg)
    return active


def unloaded(plan: Motion, stance: Samples) -> float:
    """Largest horizontal force [N] on a foot that carries hardly anything."""
    carries = UNLOADED * Scale.of(plan.design.leg).force
    return float(np.abs(stance.f[stance.f[:, -1] < carries, :-1]).max(initial=0.0))


def leans_on(plan: Motion, stance: Samples) -> LeansOn:
    """What the hop needs of the ground and of the time that it is allowed."""
    size, friction = force_range(plan.robot.model), plan.design.contact.friction
    up, along = stance.f[:, -1], np.linalg.norm(stance.f[:, :-1], axis=1)
    loaded = up >= LOADED_SHARE * size
    held = along[~loaded].max(initial=0.0) > NO_FRICTION * LOADED_SHARE * size
    needed = np.inf if held else friction_needed(along[loaded], up[loaded], friction, LIMIT * size)
    share = _time_mean(stance, ~loaded + 0.0)
    return LeansOn(needed, share, next(iter(_ends_of_stance_time(plan)), None))


def _ends_of_stance_time(plan: Motion) -> list[str]:
    """Which ends of the time that stance may take are reached: both where it is given."""
    (shortest, longest), lasted = plan.design.hop.stance_duration, plan.phases[STANCE].duration
    ends = {"longest": lasted >= (1 - ACTIVE) * longest, "shortest": lasted <= (1 + ACTIVE) * shortest}
    return [name for name, reached in ends.items() if reached]


@dataclass(frozen=True, kw_only=True)
class MotionFigures:
    """What a summary says of the motion; computed from a ``Sampled`` plan."""

    upper_bound: UpperBound = stated(
        "what no hop within the drives' limits and the longest stance can pass", lambda m: upper_bound(m.plan.design)
    )
    parts: Parts = stated("what the clearance is the sum of", lambda m: parts(m.plan))
    lowest_point: str = stated(
        "foot or joint that the clearance is of; of a leg with shapes also the trunk or a link",
        lambda m: lowest_point(m.plan),
    )
    phases: Mapping[str, PhaseFigures] = stated(
        "each phase", lambda m: {name: phase_figures(m.plan, name, s) for name, s in m.fine.items()}
    )
    lift_off: LiftOff = stated("lift-off", lambda m: lift_off(m.plan))
    vertical_at_end_of_flight_m_s: float = stated(
        "upward velocity of the centre of mass [m/s]", lambda m: float(m.plan.apex.com_v[0, 1])
    )
    peak_ground_force_N: float = stated(
        "largest ground force [N]", lambda m: float(np.linalg.norm(m.stance.f, axis=1).max())
    )
    peak_vertical_force_N: float = stated("its largest vertical part [N]", lambda m: float(m.stance.f[:, -1].max()))
    friction: float | None = stated("coefficient; null: the foot never slips", lambda m: m.plan.design.contact.friction)
    grip_without_load_N: float = stated(
        "largest horizontal force on an unloaded foot [N]", lambda m: unloaded(m.plan, m.stance)
    )
    leans_on: LeansOn = stated(
        "what the hop needs of the ground and of the time that it is allowed", lambda m: leans_on(m.plan, m.stance)
    )
    saturation_mean: Mapping[str, float] = stated(
        "mean use of the operating region in stance, by joint", lambda m: saturation_mean(m.plan, m.stance)
    )
    energy: Mapping[str, float] = stated(
        "work of the joints, by phase, net and positive [J]", lambda m: energy(m.plan, m.fine)
    )
    losses: Mapping[str, JointLosses] | None = if_any(
        "what each joint's drive turns into heat [J]", lambda m: losses(m.plan.robot, m.plan.tables)
    )
    springs: Mapping[str, SpringEnergy] | None = if_any(
        "what each spring beside the drives stores and gives back, if the leg has any",
        lambda m: spring_energies(m.plan.robot, m.plan.tables) or None,
    )
    series_springs: Mapping[str, SeriesSpringEnergy] | None = if_any(
        "what the series spring of each joint stores and gives back, if there is any",
        lambda m: series_spring_energies(m.plan.robot, m.plan.tables) or None,
    )
    supply: SupplyFigures | None = if_any(
        "what the supply gives, if the problem has one", lambda m: supply_figures(m.plan.robot, m.plan.tables)
    )
    heat: Mapping[str, JointHeat] | None = if_any(
        "how hot each joint's motor gets, and its torque in the mean, where the problem has thermal entries",
        lambda m: heat_figures(m.plan.design, m.plan.robot, m.plan.tables),
    )
    collision: Collision | None = if_any(
        "how near the leg comes to the body or to itself, where the problem says what shape they have",
        lambda m: collision(m.plan.design, m.plan.tables),
    )
    idle_limits: Mapping[str, IdleLimit] = stated("limits that never act", lambda m: idle_limits(m.plan, m.fine))
    orbit: Orbit | None = if_any("the cycle of a periodic hop", lambda m: orbit(m.plan))
    obstacle: ClearedBox | None = if_any("the box that the leg clears, if it was made to", lambda m: obstacle(m.plan))
    landing: Landing | None = if_any(
        "the touchdown of a hop that is landed, and how it comes to rest", lambda m: landing(m.plan)
    )
