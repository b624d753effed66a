"""Parts of an answer's summary: what a hop reaches, and how far it is to be believed."""

from collections.abc import Mapping
from dataclasses import dataclass

from hopopt.planner.answer.summary_entry import Real, Strict, if_any, stated


@dataclass(frozen=True)
class Measures(Strict):
    """Figures that a hop can be made for; those that nobody asked for are None."""

    apex_m: float | None = if_any("height of the body when flight ends [m]")
    energy_J: float | None = if_any("positive mechanical work of the joints [J]")
    absolute_work_J: float | None = if_any("absolute mechanical work of the joints [J]")
    electrical_energy_J: float | None = if_any("electrical energy of the motors [J]")
    time_s: float | None = if_any("duration of the hop [s]")
    saturation: float | None = if_any("largest share of a drive's operating region that is used")
    peak_torque_Nm: float | None = if_any("largest torque of any joint [N m]")
    peak_force_N: float | None = if_any("largest ground force [N]")
    impact_J: float | None = if_any("kinetic energy lost at touchdown [J]")
    obstacle_m: float | None = if_any("height of the highest obstacle that the leg clears [m]")
    user_objective: float | None = if_any("a user-defined objective [its unit]")


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


@dataclass(frozen=True)
class UpperBound(Strict):
    """What no hop within the drives' limits and the longest stance can pass; None for what nothing bounds."""

    clearance_m: float | None = stated("clearance [m]")
    by_energy_m: float | None = stated("height of the centre of mass by energy [m]")
    by_speed_m: float | None = stated("height of the centre of mass by the drives' speeds [m]")
    power_W: float | None = stated("what all drives together can give at most [W]")
    lift_off_speed_m_s: float | None = stated("of the centre of mass at most [m/s]")


@dataclass(frozen=True)
class Impact(Strict):
    """The touchdown of a hop that goes on."""

    closure: float = stated("difference of the state after the impact from that in which stance begins [rad, rad/s]")
    step_m: float = stated("how far ahead of where it stood the foot lands [m]")
    work_J: float = stated("net work of the joints over the hop, which the impact takes [J]")
    impulse_Ns: float = stated("of the ground on the foot at touchdown [N s]")
    impact_loss_J: float = stated("kinetic energy that the impact takes [J]")
    foot_speed_m_s: float = stated("of the foot just before touchdown [m/s]")
    gear_impulse_Nms: float = stated("largest that a gear passes on to its rotor, joint side [N m s]")
    gear_impact_torque_Nm: float = stated(
        "the same over hop.touchdown_time: the gear's mean torque in the impact [N m]"
    )


@dataclass(frozen=True)
class Orbit(Impact):
    """A cycle of a periodic hop, and the impact that ends it."""

    period_s: float = stated("duration of a cycle [s]")


@dataclass(frozen=True)
class Obstacle(Strict):
    """The box that the leg clears, as the plan's table has it."""

    width_m: float = stated("of the box, along x [m]")
    height_m: float = stated("of the box [m]")
    begins_m: float = stated("its near side, ahead of where the foot stands [m]")


@dataclass(frozen=True)
class Landing(Impact):
    """A touchdown, and the way to rest."""

    touchdown_s: float = stated("time of touchdown since stance began [s]")
    rest_s: float = stated("time of rest since stance began [s]")
    peak_ground_force_N: float = stated("largest ground force while the leg comes to rest [N]")
    deepest_m: float = stated("lowest height of the body on the way to rest [m]")


@dataclass(frozen=True)
class IdleLimit(Strict):
    """A limit that never acts."""

    used: float = stated("largest share of its range that the plan uses")
    entry: str = stated("its entry of the problem file; empty for a limit that no entry sets")
    limit: float = stated("its value [the entry's unit]")
    enough: float = stated("a value that would do [the entry's unit]")


# ---- how far it is to be believed -----------------------------------------------------------------------------


@dataclass(frozen=True)
class Condition(Strict):
    """What was measured against what is allowed."""

    residual: Real = stated("what was measured [unit]")
    tolerance: float = stated("what is allowed [unit]")
    unit: str = stated("of both")
    where: str = stated("where the worst was found")
    left_out: str = stated("why nothing can be measured; empty if it was")
    passed: bool = stated("whether it holds, or is left out")


@dataclass(frozen=True)
class NamedCheck(Strict):
    """One check of the verification."""

    name: str = stated("what is checked")
    residual: Real = stated("what was measured [unit]")
    tolerance: float = stated("what is allowed [unit]")
    unit: str = stated("of both")
    where: str = stated("where the worst was found")
    left_out: str = stated("why nothing can be measured; empty if it was")
    passed: bool = stated("whether it holds, or is left out")


@dataclass(frozen=True)
class Estimate(Strict):
    """What each fault of the trajectories may have gained [the objective's unit]."""

    too_high_by: Real = stated("their sum")
    dynamics: Real = stated("dynamics between the nodes")
    controls: Real = stated("controls beyond their limits between the nodes")
    limits: Real = stated("limits of the states that are passed")
    program: Real = stated("residuals of the nonlinear program")
    second_order: Real = stated("faults that no multiplier shows")
    size: Real = stated("what the error is relative to")


@dataclass(frozen=True)
class Simulated(Measures):
    """The whole hop simulated in one piece, torques clamped to the drives' limits."""

    clearance_m: float | None = if_any("height of the lowest point when flight ends [m]")
    followed: bool | None = if_any("whether it stayed on the plan")
    short_by: Real | None = if_any("by how much the rollout value is less than the claim [the objective's unit]")
    strayed: Real | None = if_any("largest distance from the plan [SI]")
    passed: Real | None = if_any("largest share of its range by which a limit was passed")
    limit: str | None = if_any("that limit")
    note: str | None = if_any("why it says nothing about the plan")


@dataclass(frozen=True)
class Relaxed(Strict):
    """A hop that keeps its limits at the nodes alone."""

    gains: Real = stated("what it may gain, by the multipliers [the objective's unit]")


@dataclass(frozen=True)
class Error(Strict):
    """How far the objective may be off [the objective's unit, unless stated otherwise]."""

    too_high_by: Real = stated("by how much the claim may be better than the optimum")
    relative: Real = stated("the same, relative to the objective")
    estimate: Estimate = stated("from the trajectories and multipliers")
    simulated: Simulated = stated("from the hop simulated in one piece")
    relaxed: Relaxed = stated("what enforcing limits between the nodes costs")
    could_be_beaten_by: float | None = stated("neighbouring hops may be better by this; null if not certified")

    @property
    def either_way(self) -> float:
        """What the objective may be too good by, and neighbouring hops better by, together [its unit]."""
        return self.too_high_by + (self.could_be_beaten_by or 0.0)


@dataclass(frozen=True)
class Mesh(Strict):
    """One solve of the refinement."""

    intervals: Mapping[str, int] = stated("by phase")
    held: int = stated("intervals in which limits are enforced between the nodes")
    objective: Real = stated("[its unit]")
    local_error: Real = stated("largest of any interval, scaled")
    excess: Real = stated("largest share of its range by which a limit is passed between the nodes")
    iterations: int = stated("of Ipopt")
    build_seconds: float = stated("to build the program [s]")
    solve_seconds: float = stated("to solve it [s]")
    seconds: float = stated("in all [s]")
    drawn_in: int = stated("how often limits were tightened on this mesh before")


@dataclass(frozen=True)
class Optimum(Strict):
    """One local optimum on the first mesh."""

    objective: Real = stated("[its unit]")
    count: int = stated("starts that ended there")
    starts: tuple[str, ...] = stated("their names")


@dataclass(frozen=True)
class StartEnded(Strict):
    """One start on the first mesh."""

    name: str = stated("of the start")
    status: str = stated("Ipopt's word")
    objective: Real = stated("[its unit]")
    iterations: int = stated("of Ipopt")
    seconds: float = stated("[s]")
    near: str | None = if_any("the start whose hop it was stopped near, and whose objective this is")


@dataclass(frozen=True)
class Starts(Strict):
    """Where the starts ended on the first mesh."""

    count: int = stated("how many were tried: they ended at a hop, were stopped near one, or failed")
    agreeing: int = stated("those that ended where the chosen one did, or were stopped near it")
    failed: tuple[str, ...] = stated("names of those without a hop")
    chosen: str = stated("the one whose hop this is")
    optima: tuple[Optimum, ...] = stated("the local optima, best first")
    each: tuple[StartEnded, ...] = stated("every start")
    asked: int | None = if_any("starting points among them; the others are relaxed problems, motions and known hops")
    ended: int | None = if_any("how many ended at a hop")
    stopped: tuple[str, ...] | None = if_any("names of those that were stopped near a hop that was known")
    apart: Real | None = if_any("two objectives closer than this count as one hop [its unit]")
