"""Objectives of an economical hop: the least work, time, share of the drives, torque or ground force for a clearance.

All reach the clearance that the problem asks for (``hop.clearance``) and make something as small as possible until then.
Positive parts and peaks are not smooth: a power gets a control of its own that is at least the power and at least zero,
a peak a parameter that no value passes.
"""

from collections.abc import Callable, Mapping
from typing import Any

import casadi as ca

from hopopt.design import Design
from hopopt.drivetrain.motor import stall_torque
from hopopt.drivetrain.operating_region.limits import BACKWARD, FORWARD
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.drivetrain.supply import WINDING, winding_heat
from hopopt.leg.limit_id import JointWay, Kind, LimitId
from hopopt.leg.robot import BASE
from hopopt.ocp.drives import asked, bus_voltage, motor_torques
from hopopt.ocp.guesses.motion import MotionAt, MovingLeg
from hopopt.ocp.objectives.objective import AT_CLEARANCE, HopObjective, no_required_clearance, required_clearance
from hopopt.ocp.phases import LegPhase
from hopopt.ocp.problem import Control, Ends, Instant, Parameter, PathConstraint

TIE_BREAK_FACTOR = (
    5e4  # times the usual tie-break, in the leg's own time: work without heat hardly depends on when it is done
)
PUSH_SPEED = 10.0  # [rad/s] on the paper's leg: joint speed of a push, for the scale of power
SHARP = 0.1  # a peak may be passed by a smaller share of its range than a limit: it is the answer
KINK_FACTOR = (
    3.0  # a power may be passed by a larger one where work is flat: what that gains is in the estimate of its error
)


def _economical(name: str, meaning: str, unit: str, figure: str, value: Any, **more: Any) -> HopObjective:
    """An objective to be made small at the clearance that the problem asks for."""
    own, fault = more.pop("parameters", lambda hop: ()), more.pop("fault", lambda design: None)
    more = AT_CLEARANCE | more
    more["parameters"] = lambda hop: (required_clearance(hop), *own(hop))
    more["fault"] = lambda design: no_required_clearance(design) or fault(design)
    return HopObjective(name, meaning, unit, value, figure, maximize=False, **more)


def total(e: Ends, what: str) -> ca.SX:
    """An integral over all phases."""
    return sum((integrals[what] for integrals in e.integral.values()), ca.SX(0))


# ---- work ---------------------------------------------------------------------------------------------------


def _power(hop: MovingLeg, motion: MotionAt, s: Instant) -> ca.SX:
    """tau w of every joint [W], (n,); of the drive behind a series spring."""
    m, sprung = motion(s), hop.drive_states.sprung
    if not sprung:
        return m.tau * m.v[BASE:]
    of_drive, of_joint = m.drives.tau * m.drives.w, m.tau * m.v[BASE:]
    return ca.vertcat(*[(of_drive if k in sprung else of_joint)[k] for k in range(hop.n)])


def _of_motors(hop: MovingLeg, motion: MotionAt, s: Instant) -> ca.SX:
    """Mechanical power of every motor [W], (n,)."""
    return motor_torques(hop, motion)(s) * motion(s).drives.w


def _losses(hop: MovingLeg, motion: MotionAt, s: Instant) -> ca.SX:
    """Joule heat in every motor's winding [W], (n,): resistance times (motor torque / torque constant)^2."""
    torques = motor_torques(hop, motion)(s)
    return ca.vertcat(*[winding_heat(hop.leg, joint, s.p) * torques[k] ** 2 for k, joint in enumerate(hop.leg.joints)])


def largest_power(hop: MovingLeg) -> float:
    """The power of a push [W]: the leg's weight at its length and a push's joint speed."""
    return hop.weight * hop.reach * PUSH_SPEED / hop.scale.time


def _drawn(power: Callable[[MovingLeg, MotionAt, Instant], ca.SX], share: float = SHARP) -> dict[str, Any]:
    """A control for every joint that is at least its power and at least zero: at the optimum the positive part.

    Work is scaled by what it takes to lift the leg by its length [J], power by the leg's weight at that length and a push's
    joint speed [W]; ``share`` of it is what the power's range is taken to be.
    """

    def controls(hop: MovingLeg) -> tuple[Control, ...]:
        size = largest_power(hop)
        return (Control("drawn", hop.n, 0.0, scale=size, unit="W", labels=hop.leg.joints, only_bounds=True),)

    def path(hop: MovingLeg, phase: LegPhase) -> tuple[PathConstraint, ...]:
        def short(s: Instant) -> ca.SX:
            return s.drawn - power(hop, phase.motion, s)

        size, limit = share * largest_power(hop), LimitId(Kind.POWER, unit="W")
        return (PathConstraint(limit, short, 0.0, scale=size, unit="W", labels=hop.leg.joints),)

    return {"controls": controls, "path": path, "scale": lambda hop: hop.weight * hop.reach}


def _mechanical() -> dict[str, Any]:
    """What work without heat needs: a tie-break that counts, and to be solved with a larger one first."""
    return {
        **_drawn(_power, KINK_FACTOR),
        "tie_break": lambda hop: TIE_BREAK_FACTOR / hop.time_scale,
        "calm_first": True,
    }


def _drawn_work(hop: MovingLeg, motion: MotionAt) -> Mapping[str, Callable[[Instant], ca.SX]]:
    return {"work": lambda s: ca.sum1(s.drawn)}


def _work_both_ways(hop: MovingLeg, motion: MotionAt) -> Mapping[str, Callable[[Instant], ca.SX]]:
    """|p| = 2 max(p, 0) - p."""
    return {"work": lambda s: 2 * ca.sum1(s.drawn) - ca.sum1(_power(hop, motion, s))}


def _slides(design: Design) -> str | None:
    """What to say if torques would be set beside forces."""
    sliding = design.leg.sliding
    return f"it needs joints that turn, and {sliding[0]} slides: choose another objective" if sliding else None


def _no_winding(design: Design) -> str | None:
    """What to say if a motor's electrical figures are missing."""
    for joint in design.leg.joints:
        for entry in WINDING:
            path, value = design.leg.drive(joint, "motor", entry)
            if value is None:
                return (
                    f"it needs {path} (of the {joint}'s motor): give winding_resistance [ohm], torque_constant [N m/A]"
                )
    return None


# ---- peaks --------------------------------------------------------------------------------------------------


def _peak(name: str, unit: str, scale: Callable[[MovingLeg], float], upper: float = 100.0) -> Any:
    """A free parameter that nothing may pass, up to ``upper`` times its scale."""
    return lambda hop: (
        Parameter(name, lower=0.0, upper=upper * scale(hop), scale=scale(hop), unit=unit, value=scale(hop), free=True),
    )


def _region_share(hop: MovingLeg, phase: LegPhase) -> tuple[PathConstraint, ...]:
    """-share <= a tau + b w <= share for every pair of half-planes of every joint, at the voltage that the bus has."""

    def value(joint: str, k: int) -> Callable[[Instant], ca.SX]:
        torque, voltage = asked(hop, joint, phase.motion), bus_voltage(hop, phase.motion)

        def both(s: Instant) -> ca.SX:
            w, share = phase.motion(s).drives.w[k], s.p["share"]
            used = ca.vertcat(
                *operating_region(hop.leg, joint, s.p).use(w, torque(s), voltage(s), hop.torque_rate(s, k))[::2]
            )
            return ca.vertcat(share - used, share + used)

        return both

    return tuple(
        PathConstraint(LimitId(Kind.SHARE, joint, unit="1"), value(joint, k), lower=0.0, scale=SHARP)
        for k, joint in enumerate(hop.leg.joints)
    )


def largest_stall(hop: MovingLeg) -> float:
    """The largest stall torque of any joint [N m]."""
    return max(stall_torque(hop.leg, joint, hop.robot.parameters) for joint in hop.leg.joints)


def _torque_peak(hop: MovingLeg, phase: LegPhase) -> tuple[PathConstraint, ...]:
    def both(s: Instant) -> ca.SX:
        tau = phase.motion(s).tau
        return ca.vertcat(s.p["peak torque"] - tau, s.p["peak torque"] + tau)

    labels = tuple(JointWay(j, way) for way in (FORWARD, BACKWARD) for j in hop.leg.joints)
    limit, size = LimitId(Kind.PEAK_TORQUE, unit="N m"), SHARP * largest_stall(hop)
    return (PathConstraint(limit, both, lower=0.0, scale=size, unit="N m", labels=labels),)


def _force_peak(hop: MovingLeg, phase: LegPhase) -> tuple[PathConstraint, ...]:
    """peak - f^2 / peak >= 0: the force's magnitude without its root, which is not smooth at zero."""
    if phase.kind != "stance":
        return ()

    def value(s: Instant) -> ca.SX:
        peak = s.p["peak force"]
        return peak - ca.sumsqr(phase.motion(s).f) / peak

    limit, size = LimitId(Kind.PEAK_FORCE, unit="N"), SHARP * hop.force_range
    return (PathConstraint(limit, value, lower=0.0, scale=size, unit="N"),)


EFFORTS = (
    _economical(
        "energy", "positive mechanical work of the joints over the hop, nothing recovered", "J", "energy_J",
        lambda hop, e: total(e, "work"), integrands=_drawn_work, **_mechanical(),
    ),
    _economical(
        "absolute_work", "mechanical work of the joints over the hop, braking counted like driving", "J",
        "absolute_work_J", lambda hop, e: total(e, "work"), integrands=_work_both_ways, **_mechanical(),
    ),
    _economical(
        "electrical_energy", "electrical energy drawn over the hop: Joule heat and mechanical power, nothing fed back",
        "J", "electrical_energy_J", lambda hop, e: total(e, "work"), integrands=_drawn_work, fault=_no_winding,
        **_drawn(lambda hop, motion, s: _of_motors(hop, motion, s) + _losses(hop, motion, s)),
    ),
    _economical(
        "time", "time from the start of stance to the end of the hop", "s", "time_s",
        lambda hop, e: sum(e.duration.values(), ca.SX(0)), scale=lambda hop: hop.scale.time,
    ),
    _economical(
        "saturation", "largest share of its operating region that any joint uses: by as much could torque and speed of "
        "all motors be smaller", "1", "saturation", lambda hop, e: e.p["share"],
        parameters=_peak("share", "1", lambda hop: 1.0), path=_region_share,
    ),
    _economical(
        "peak_torque", "largest torque of any joint", "N m", "peak_torque_Nm", lambda hop, e: e.p["peak torque"],
        parameters=_peak("peak torque", "N m", largest_stall), path=_torque_peak, scale=largest_stall, fault=_slides,
    ),
    _economical(
        "peak_force", "largest ground force, its magnitude", "N", "peak_force_N", lambda hop, e: e.p["peak force"],
        parameters=_peak("peak force", "N", lambda hop: hop.force_range), path=_force_peak,
        scale=lambda hop: hop.force_range,
    ),
)  # fmt: skip
