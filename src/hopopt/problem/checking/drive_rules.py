"""Rules between the entries of drives: torque and speed that something bounds, whole datasheets, heat, losses, inductance, and
of springs beside them."""

import re
from itertools import product

import numpy as np

from hopopt.design import EfficiencyTable, Leg, Simulation, physical_parameters
from hopopt.design.drives.motor import LINEAR
from hopopt.design.drives.supply import Supply
from hopopt.drivetrain.gear import TABLE, efficiency_table, factor_curve
from hopopt.drivetrain.heat import BODIES, LIMIT
from hopopt.drivetrain.motor import IMPLIES, INDUCTANCE, lacking, reflected_inertia
from hopopt.drivetrain.operating_region.limits import Entry
from hopopt.drivetrain.springs import joints_of, rounding
from hopopt.drivetrain.supply import WINDING
from hopopt.drivetrain.transmission import LAWS, SAMPLES, couplings, five_bar_ratios, in_range, ratios
from hopopt.leg.kinematics import planar
from hopopt.problem.checking.faults import Report
from hopopt.problem.checking.wording import did_you_mean
from hopopt.problem.render import shown

NAME = re.compile(r"[A-Za-z0-9_-]{1,64}")


def drive_rules(leg: Leg, report: Report) -> None:
    """Report drives whose torque or speed nothing would bound: without a law both need a cap; motors that neither say their torque
    and speed nor have a datasheet that implies them."""
    _linear_rules(leg, report)
    _datasheet_rules(leg, report)
    open_ended: dict[tuple[str, str], list[str]] = {}
    for joint in leg.joints:
        path, laws = leg.drive(joint, "motor", "laws")
        if not laws and (missing := _uncapped(leg, joint)):
            open_ended.setdefault((path, missing), []).append(joint)
    for (path, missing), joints in open_ended.items():
        words = f'give these caps, or "paper" or "four-quadrant" in {path}'
        report.add(path, f"= [] leaves nothing to bound {missing} of {', '.join(joints)}: {words}")


def _linear_rules(leg: Leg, report: Report) -> None:
    """Report entries of linear motors where none is, and beside those of motors that turn; transmissions of what slides."""
    for path, motor, slides in (
        ("leg.motor", leg.motor, False),
        *((f"leg.{joint}.motor", leg.joint[joint].motor, joint in leg.sliding) for joint in leg.joints),
    ):
        given = [name for name in LINEAR.values() if motor is not None and getattr(motor, name) is not None]
        turning = [name for name in (*LINEAR, "voltage") if motor is not None and getattr(motor, name) is not None]
        if given and not slides:
            report.add(
                f"{path}.{given[0]}",
                'is of a linear motor: it belongs to [leg.<joint>.motor] of a joint with type = "prismatic"',
            )
        elif given and motor is not None and motor.max_force is None:
            report.add(f"{path}.max_force", f"is missing beside {given[0]}: a linear motor has a force at standstill")
        elif given and turning:
            report.add(
                f"{path}.{turning[0]}",
                f"is of a motor that turns, beside {given[0]} of a linear one: leave out one of them",
            )
    for joint in leg.joints:
        between = leg.joint[joint].transmission
        if between is not None and (joint in leg.sliding or {*(between.coupling or ())} & {*leg.sliding}):
            report.add(
                f"leg.{joint}.transmission",
                "goes with joints that turn: a prismatic joint moves as its drive does, leave it out",
            )


def _datasheet_rules(leg: Leg, report: Report) -> None:
    """Report what a motor's datasheet lacks."""
    faults: dict[str, str] = {}
    for joint in leg.joints:
        for name in IMPLIES:
            if missing := lacking(leg, joint, name):
                needed = ", ".join(f"motor.{entry}" for entry in missing)
                datasheet = "" if leg.linear(joint) else f", or what the motor's datasheet still lacks: {needed}"
                words = f"is missing: give it{datasheet}"
                faults.setdefault(leg.drive(joint, "motor", name)[0], words)
        constant = leg.drive(joint, "motor", "torque_constant")[1]
        for name in ("no_load_current", "current_cap"):
            path, value = leg.drive(joint, "motor", name)
            if value is not None and constant is None:
                words = f"= {value:g} A is a current, whose torque nothing tells: give motor.torque_constant too"
                faults.setdefault(path, words)
        path, inductance = leg.drive(joint, "motor", INDUCTANCE)
        if inductance is not None and leg.drive(joint, "motor", "winding_resistance")[1] is None:
            faults.setdefault(
                path, f"= {inductance:g} H tells how fast current rises only with motor.winding_resistance too"
            )
        if inductance is not None and leg.supply is not None and _gives_way(leg.supply):
            words = f"= {inductance:g} H goes with a stiff supply alone: leave it out, or [supply] but for its voltage"
            faults.setdefault(path, words)
    for path, words in faults.items():
        report.add(path, words)


def _gives_way(supply: Supply) -> bool:
    """Whether what a supply gives depends on what is drawn from it."""
    caps = supply.least_voltage, supply.current_cap, supply.power_cap
    return supply.internal_resistance > 0 or any(cap is not None for cap in caps)


DEAD = 1e-3  # share of its largest that a ratio is at a dead point, or of the ratios' product a determinant
BEYOND = 0.05  # rad beyond a joint's range where a linkage still closes, for stops that yield


def transmission_rules(leg: Leg, report: Report) -> None:
    """Report transmissions with two laws, to joints that are not there, that cannot close, or with a dead point in the joints' range."""
    if leg.direct:
        return
    for joint, entry in product(leg.joints, ("torque_rate", INDUCTANCE)):
        path, value = leg.drive(joint, "motor", entry)
        if value is not None:
            report.add(path, f"= {value:g} does not go with the joints' transmissions: leave out the one or the other")
    for joint in leg.joints:
        between, path = leg.joint[joint].transmission, f"leg.{joint}.transmission"
        if between is None:
            continue
        given = [law for law in (*LAWS, "five_bar") if getattr(between, law) is not None]
        if len(given) > 1:
            report.add(path, f"has {' and '.join(given)}: one law says how a joint turns its drive, remove the others")
        elif between.table is not None and (words := between.table.fault()):
            report.add(f"{path}.table", words)
        elif between.five_bar is not None:
            _five_bar_rules(leg, joint, f"{path}.five_bar", report)
        elif given:
            _moving_rules(leg, joint, f"{path}.{given[0]}", report)
        _motor_on_rules(leg, joint, report)
        for other in between.coupling or ():
            if other not in leg.joints or other == joint:
                others = ", ".join(name for name in leg.joints if name != joint) or "none"
                report.add(f"{path}.coupling.{other}", f"names no other joint of the leg: allowed are {others}")
    if not report.faults:
        _apart_rules(leg, report)


def _motor_on_rules(leg: Leg, joint: str, report: Report) -> None:
    """Report a motor on what is no link, or whose rotor's axis is not that of all joints before it."""
    between = leg.joint[joint].transmission
    if between is not None and between.reversed and between.motor_on in (None, "body"):
        report.add(
            f"leg.{joint}.transmission.reversed", "is of a motor on a link, and this one is on the body: leave it out"
        )
    if between is None or between.motor_on is None:
        return
    path, places = f"leg.{joint}.transmission.motor_on", ("body", *leg.links)
    if between.motor_on not in places:
        words = f"= {shown(between.motor_on)} is no link{did_you_mean(between.motor_on, places)}"
        report.add(path, f"{words}: allowed are {', '.join(places)}")
    elif joint not in leg.riding:
        return
    elif joint in leg.sliding:
        report.add(path, f"needs a joint that turns, and the {joint} slides: leave it out")
    elif not planar(leg):
        report.add(
            path,
            "is of a rotor in the plane of x and z, which this leg leaves: leave it out, or give every joint an axis along y",
        )
    elif between.five_bar is not None:
        report.add(
            path,
            f"does not go with leg.{joint}.transmission.five_bar, whose motor is on what carries the crank: leave it out",
        )


def series_rules(leg: Leg, report: Report) -> None:
    """Report series springs beside what their drives cannot have, or with no rotor to hold against them."""
    for joint in leg.elastic:
        path, p = f"leg.{joint}.series_spring", physical_parameters(leg)
        if not reflected_inertia(leg, joint, p):
            rotor = leg.drive(joint, "motor", "rotor_inertia")[0]
            report.add(path, f"needs a drive with inertia: give {rotor}, which is 0")
        if not leg.direct:
            between = next(name for name in leg.joints if leg.joint[name].transmission is not None)
            report.add(path, f"does not go with leg.{between}.transmission: leave out the one or the other")
        for other, entry in product(leg.joints, ("torque_rate", INDUCTANCE)):
            at, value = leg.drive(other, "motor", entry)
            if value is not None:
                report.add(path, f"does not go with {at} = {value:g}: leave out the one or the other")
                break


def _moving_rules(leg: Leg, joint: str, path: str, report: Report) -> None:
    """Report a law that cannot be had, or has a dead point, within the joint's range."""
    low, high = leg.joint[joint].lower, leg.joint[joint].upper
    angles = in_range(leg, joint, beyond=BEYOND)
    found = ratios(leg, joint, physical_parameters(leg), angles)
    remedy = f"change its entries, or leg.{joint}.lower = {low:g} and upper = {high:g}"
    if not np.isfinite(found).all():
        open_at = angles[~np.isfinite(found)][0]
        report.add(path, f"cannot close at {open_at:.4g} rad of the {joint}: {remedy}")
    elif np.abs(found).min() <= DEAD * np.abs(found).max() or found.min() < 0 < found.max():
        dead = angles[int(np.argmin(np.abs(found)))]
        report.add(
            path, f"has a dead point near {dead:.4g} rad of the {joint}, where its drive moves nothing: {remedy}"
        )


def _five_bar_rules(leg: Leg, joint: str, path: str, report: Report) -> None:
    """Report a five-bar that is on no chain of two links in the leg's plane, or cannot close, or has a dead point."""
    between, k = leg.joint[joint].transmission, leg.joints.index(joint)
    if k == 0:
        report.add(
            path,
            f"needs a link before the {joint}, which is the first: give it to one of {', '.join(leg.joints[1:]) or 'none'}",
        )
    elif leg.follows:
        link = next(name for name in leg.links if leg.link[name].follows is not None)
        report.add(path, f"does not go with leg.{link}.follows: leave out the one or the other")
    elif leg.sliding:
        report.add(path, f"does not go with the prismatic joint {leg.sliding[0]}: leave out the one or the other")
    elif not planar(leg):
        report.add(path, "is a chain in the plane of x and z, which this leg leaves: give every joint an axis along y")
    elif between is not None and between.coupling:
        report.add(path, f"turns with the {leg.joints[k - 1]} already: leave out leg.{joint}.transmission.coupling")
    else:
        _closing_rules(leg, joint, path, report)


def _closing_rules(leg: Leg, joint: str, path: str, report: Report) -> None:
    """Report a five-bar that cannot close, or has a dead point, in the ranges of its joints."""
    before = leg.joints[leg.joints.index(joint) - 1]
    poses, found = five_bar_ratios(leg, joint, physical_parameters(leg), BEYOND)
    open_at, own = poses[~np.isfinite(found).all(axis=1)], found[:, 1]
    remedy = f"change its entries, or the limits of {before} and {joint}"
    if len(open_at):
        (a, c), (b, d) = open_at.min(axis=0), open_at.max(axis=0)
        where = f"with the {joint} between {c:.4g} and {d:.4g} rad and the {before} between {a:.4g} and {b:.4g} rad"
        report.add(path, f"cannot close in places {where}: {remedy}")
    elif np.abs(own).min() <= DEAD * np.abs(own).max() or own.min() < 0 < own.max():
        at = poses[int(np.argmin(np.abs(own)))]
        where = f"{at[0]:.4g} rad of the {before} and {at[1]:.4g} rad of the {joint}"
        report.add(path, f"has a dead point near {where}, where its drive moves no {joint}: {remedy}")


def _apart_rules(leg: Leg, report: Report) -> None:
    """Report drives that do not move all joints apart from each other: a determinant of ratios that is near zero or changes its sign.

    Couplings are constant, so the determinant is linear in every joint's own ratio: its extremes are at the ends of these.
    """
    p, joints = physical_parameters(leg), leg.joints
    own = [
        five_bar_ratios(leg, j, p)[1][:, 1] if j in leg.five_bars else ratios(leg, j, p, in_range(leg, j))
        for j in joints
    ]
    corners = [np.diag(each) for each in product(*((ratio.min(), ratio.max()) for ratio in own))]
    for joint in leg.five_bars:
        k, beside = joints.index(joint), five_bar_ratios(leg, joint, p)[1][:, 0]
        corners = [
            J + beside_at * np.eye(len(J), k=-1) * (np.arange(len(J)) == k)[:, None]
            for J in corners
            for beside_at in (beside.min(), beside.max())
        ]
    for k, other, ratio in couplings(leg, p):
        for J in corners:
            J[k, other] += ratio
    found = np.array([np.linalg.det(J) / np.linalg.norm(J, axis=1).prod() for J in corners])
    if np.abs(found).min() <= DEAD or found.min() < 0 < found.max():
        coupled = ", ".join(f"leg.{j}.transmission" for j in joints if leg.joint[j].transmission is not None)
        report.add("leg", f"has drives that do not move its joints apart in all of their ranges: change {coupled}")


def heat_rules(leg: Leg, ambient: float, report: Report) -> None:
    """Report thermal entries that lack others, and a limit that the winding is above before it moves."""
    faults: dict[str, str] = {}
    for joint in leg.joints:
        own = {name: leg.drive(joint, "motor", name) for name in (LIMIT, *BODIES)}
        given = next((name for name, (_, value) in own.items() if value is not None), None)
        missing = [name for name in (*BODIES, *WINDING) if leg.drive(joint, "motor", name)[1] is None]
        if given and missing:
            path, value = own[given]
            words = f"= {value:g} tells how hot a motor gets only with all of its heat: give motor.{', motor.'.join(missing)} too"
            faults.setdefault(path, words)
        path, limit = own[LIMIT]
        if limit is not None and limit <= ambient:
            words = f"= {limit:g} degC is not above environment.temperature = {ambient:g} degC, with which the winding begins"
            faults.setdefault(path, f"{words}: give the insulation's limit, often 100 to 155 degC")
    for path, words in faults.items():
        report.add(path, words)


def _uncapped(leg: Leg, joint: str) -> str:
    """What no cap bounds in a joint's drive, with the entries that would; empty if torque and speed have one."""
    caps: tuple[Entry, ...] = ("motor", "torque_cap"), ("motor", "current_cap"), ("gear", "torque_cap")
    torque = any(leg.drive(joint, *cap)[1] for cap in caps)
    found = [] if torque else ["the torque (motor.torque_cap or gear.torque_cap)"]
    return " and ".join(found if leg.drive(joint, "gear", "speed_cap")[1] else [*found, "the speed (gear.speed_cap)"])


def loss_rules(leg: Leg, simulation: Simulation, report: Report) -> None:
    """Report an efficiency that would hold for no gear, as each has its own."""
    _table_rules(leg, report)
    tabled = {joint for joint in leg.joints if efficiency_table(leg, joint) is not None}
    own = [leg.drive(joint, "gear", TABLE if joint in tabled else "efficiency") for joint in leg.joints]
    if simulation.gear_efficiency != 1 and all(value is not None for _, value in own):
        paths = ", ".join(dict.fromkeys(path for path, _ in own))
        words = f"holds for no gear, as each has its own: change {paths}, or set simulation.gear_efficiency to 1"
        report.add("simulation.gear_efficiency", f"= {simulation.gear_efficiency:g} {words}")


def spring_rules(leg: Leg, report: Report) -> None:
    """Report springs that are named as no entry can be, lack or repeat something, or act on joints that the leg does not have."""
    for name, spring in (leg.spring or {}).items():
        path, joints = f"leg.spring.{name}", joints_of(name, spring)
        unknown = [joint for joint in joints if joint not in leg.joints]
        if not NAME.fullmatch(name):
            report.add(path, "is no name of a spring: 1 to 64 letters, digits, _ or - are needed")
        elif words := spring.fault():
            report.add(path, words)
        elif spring.table is not None and (words := spring.table.fault()):
            report.add(f"{path}.table", words)
        elif unknown and spring.joints is None:
            words = f"is named by no joint{did_you_mean(name, leg.joints)}: name it by one of {', '.join(leg.joints)}"
            report.add(path, f"{words}, or give its joints")
        elif unknown:
            words = f"has {shown(unknown[0])}{did_you_mean(unknown[0], leg.joints)}: it takes {', '.join(leg.joints)}"
            report.add(f"{path}.joints", words)
        elif len(set(joints)) < len(joints):
            report.add(f"{path}.joints", f"= {shown(joints)} has a joint twice: once is enough")
        elif spring.table is not None and (width := rounding(leg, name, spring)) > min(np.diff(spring.table.angle)):
            words = f"has angles nearer to each other than the {width:.3g} rad over which its corners are rounded: leave some out"
            report.add(f"{path}.table", words)


def _table_rules(leg: Leg, report: Report) -> None:
    """Report tables of efficiency that are no function of the speed, turn back, or stand beside one number."""
    for path, gear in (("leg.gear", leg.gear), *((f"leg.{joint}.gear", leg.joint[joint].gear) for joint in leg.joints)):
        table = None if gear is None else gear.efficiency_table
        if gear is not None and table is not None and gear.efficiency is not None:
            report.add(f"{path}.{TABLE}", "stands beside efficiency: each says what the gear passes on, remove one")
        elif table is not None and (words := table.fault() or _factor_fault(table)):
            report.add(f"{path}.{TABLE}", words)


def _factor_fault(table: EfficiencyTable) -> str:
    """Where a larger torque at the joint would go with a smaller one at the teeth; empty if nowhere."""
    if (curve := factor_curve(table)) is None:
        return ""
    at = np.linspace(float(curve.x[0]), float(curve.x[-1]), SAMPLES)
    for steeper, words in ((curve(at) - at * curve(at, 1), "rise"), (curve(at) + at * curve(at, 1), "fall")):
        if (wrong := steeper <= 0).any():
            less = f"at {at[wrong][0]:.3g} N m, so that more at the joint would go with less at the motor"
            return f"has factors that {words} too fast {less}: set the torques further apart, or the factors nearer together"
    return ""
