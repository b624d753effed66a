"""What the command line shows of a motion: where the clearance comes from, its phases, its cycle and its touchdown."""

import numpy as np

from hopopt.design import GRAVITY, Design, Environment, Leg
from hopopt.design.geometry.link_joint import SLIDING, TURNING
from hopopt.drivetrain.springs import slides
from hopopt.planner.answer.summary import Summary
from hopopt.planner.answer.touchdown import Impact
from hopopt.planner.motion import at_apex
from hopopt.verify.hops.collision import Collision
from hopopt.verify.hops.heat import JointHeat
from hopopt.verify.whole_hop import SHARPER

NO_HEAT = 1e-6  # J
TOLD_HEAT = 0.05  # J: what is printed as 0.1 J at least
NO_STEP = 1e-6  # of the clearance: a step that is none
SWUNG = 1.5  # clearances: a foot that lands as from a higher fall did not only fall


def hop_lines(s: Summary, design: Design) -> list[str]:
    """Where the clearance comes from; durations, speeds at lift-off and the greatest ground force."""
    p, stance, flight, lift = s.parts, s.phases["stance"], s.phases["flight"], s.lift_off
    lands = "".join(
        f", {name} {s.phases[name].duration_s:.3f} s" for name in ("descent", "landing") if name in s.phases
    )
    end, flown = s.vertical_at_end_of_flight_m_s, f"{flight.duration_s:.3f} s"
    way = "rising" if end > 0 else "falling"
    flown = f"to the apex {flown}" if at_apex(end, lift.vertical_m_s) else f"{flown} (then {way} at {abs(end):.2f} m/s)"
    box = (
        [f"clears a box {o.width_m:g} m wide and {o.height_m:.4f} m high, {o.begins_m:.3f} m ahead"]
        if (o := s.obstacle)
        else []
    )
    parts = (
        f"clearance = COM height at lift-off {p.com_height_at_lift_off_m:.4f} + ballistic rise "
        f"{p.ballistic_rise_m:.4f} - COM height over the {s.lowest_point} {-p.com_height_over_lowest_point_m:.4f} m"
    )
    return [
        *([parts] if s.verified else []),
        f"stance {stance.duration_s:.3f} s, flight {flown}{lands}, lift-off at "
        f"{lift.vertical_m_s:.2f} m/s up and {lift.horizontal_m_s:+.2f} m/s along, peak ground force "
        f"{s.peak_ground_force_N:.0f} N",
        *box,
        *drive_lines(s, 1.0 if design.leg.supply is None else design.leg.supply.legs),
        *spring_lines(s, design.leg),
        *heat_lines(s),
        *nearest_lines(s.collision),
        *orbit_lines(s, design.surroundings.gravity),
        *_where(design.surroundings),
    ]


def nearest_lines(c: Collision | None) -> list[str]:
    """How near the leg comes to the body or to itself; nothing of a leg without shapes."""
    if c is None:
        return []
    one, other = c.between
    gap = f"at {1000 * c.least_distance_m:.1f} mm"
    if c.least_distance_m < 0:
        gap = f"inside it by {-1000 * c.least_distance_m:.1f} mm"
    if c.margin_m is not None and c.error_m is not None and c.margin_m > 0:
        most = f": up to {1000 * (c.margin_m + 2 * c.error_m):.2g} mm may be" if c.error_m > c.margin_m else ""
        gap += f" ({1000 * c.margin_m:.1f} mm are kept, by a distance that errs by less than {1000 * c.error_m:.2g} mm{most})"
    beside = f" (not counted, as they touch at their joint: {', '.join(c.left_out)})" if c.left_out else ""
    unseen = f"; not looked at, as without solids: {', '.join(c.without_solids)}" if c.without_solids else ""
    return [f"nearest: {one} passes {other} {gap}, at {c.time_s:.3f} s{beside}{unseen}"]


def drive_lines(s: Summary, legs: float) -> list[str]:
    """What gears and windings turn into heat, and what that asks of the supply, which feeds so many legs."""
    lost = list((s.losses or {}).values())
    gears = {"gears": sum(x.gear for x in lost), "their friction": sum(x.friction for x in lost)}
    windings = [x.winding for x in lost if x.winding is not None]
    known = {name: heat for name, heat in gears.items() if heat > NO_HEAT} | (
        {"windings": sum(windings)} if windings else {}
    )
    if not known:
        return []
    one, all_of_them = (" in one leg", f" by all {legs:g} legs") if legs != 1 else ("", "")
    words = f"heat of {', '.join(f'{name} {heat:.1f} J' for name, heat in known.items())}{one}"
    if (sharper := s.objective_error.simulated.sharper_gears_m) is not None:
        words += f"; simulated with gears that change sides {SHARPER:g} times as sharply {sharper:.4f} m"
    if (supply := s.supply) is None:
        return [words]
    sags = f"voltage down to {supply.lowest_voltage_V:.1f} V, up to {supply.peak_current_A:.0f} A, {supply.energy_J:.1f} J drawn{all_of_them}"
    if (supply.burnt_J or 0.0) > TOLD_HEAT:
        sags += f", {supply.burnt_J:.1f} J fed back and burnt"
    return [f"{words}; supply: {sags}"]


def spring_lines(s: Summary, leg: Leg) -> list[str]:
    """What each spring stores and gives back in stance."""
    of_slides = {f"spring {name}" for name, spring in (leg.spring or {}).items() if slides(leg, name, spring)}
    of_slides |= {f"series spring of the {joint}" for joint in leg.sliding}
    return [
        f"{name}: {e.at_start_J:.1f} J stored at the start, {e.taken_J:.1f} J taken up and {e.given_J:.1f} J given in stance, "
        f"at most {e.peak_torque_Nm:.3g} {(SLIDING if name in of_slides else TURNING).tau}"
        for name, e in {
            **{f"spring {name}": e for name, e in (s.springs or {}).items()},
            **{f"series spring of the {joint}": e for joint, e in (s.series_springs or {}).items()},
        }.items()
    ]


def heat_lines(s: Summary) -> list[str]:
    """How hot each motor gets, and how much of what it can give for ever it gives."""
    return [f"{joint} motor: {_hot(h)}" for joint, h in (s.heat or {}).items()]


def _hot(h: JointHeat) -> str:
    words = [f"RMS torque {h.rms_torque_N_m:.3g} N m"]
    if h.share_of_continuous is not None:
        words.append(f"{h.share_of_continuous:.0%} of continuous")
    if h.winding_temperature_C is not None:
        hot = np.isfinite(h.winding_temperature_C)
        words.append(f"winding up to {h.winding_temperature_C:.1f} degC" if hot else "winding hotter without end")
    if h.hops_from_cold is not None:
        words.append(f"{h.hops_from_cold} such hops from cold")
    return ", ".join(words)


def _where(around: Environment) -> list[str]:
    """Where the leg hops, unless on level ground on earth."""
    gravity = f"gravity is {around.gravity:g} m/s^2" if around.gravity != GRAVITY else ""
    slope = (
        f"the ground rises by {around.slope:g} rad along +x; heights are perpendicular to it" if around.slope else ""
    )
    return [line] if (line := "; ".join(filter(None, (gravity, slope)))) else []


def orbit_lines(s: Summary, gravity: float) -> list[str]:
    """The cycle of a periodic hop, or how a hop comes to rest, and the impact; gravity [m/s^2]."""
    if (end := s.landing) is not None:
        return [
            f"at rest after {end.rest_s:.3f} s in the pose of the start, {end.step_m:+.3f} m along; the ground pushes with at "
            f"most {end.peak_ground_force_N:.0f} N meanwhile, and the body is no lower than {end.deepest_m:.3f} m",
            _impact_line(end),
            *hard(end, s.clearance_m, gravity),
        ]
    if (o := s.orbit) is None:
        return []
    way = "in place" if abs(o.step_m) < NO_STEP * s.clearance_m else f"{o.step_m:+.3f} m along in each"
    return [
        f"period {o.period_s:.3f} s, {way}; the orbit closes to {o.closure:.0e}",
        _impact_line(o),
        *hard(o, s.clearance_m, gravity),
    ]


def _impact_line(o: Impact) -> str:
    """What an impact takes."""
    return (
        f"touchdown: foot at {o.foot_speed_m_s:.2f} m/s, impulse {o.impulse_Ns:.2f} N s, {o.impact_loss_J:.2f} J lost, "
        f"gear impulse {o.gear_impulse_Nms:.3f} N m s ({o.gear_impact_torque_Nm:.0f} N m over hop.touchdown_time)"
    )


def hard(o: Impact, clearance: float, gravity: float) -> list[str]:
    """What a foot means that lands much faster than it would fall, and which entries limit that."""
    fall = o.foot_speed_m_s**2 / (2 * gravity)
    if fall < SWUNG * clearance:
        return []
    return [
        f"a hard landing: the foot is swung down as fast as by a fall from {fall:.2f} m; hop.touchdown_speed limits that, "
        "hop.touchdown_loss the energy, hop.touchdown_impulse the blow (docs/periodic.md)"
    ]
