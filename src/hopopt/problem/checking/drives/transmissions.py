"""Rules of transmissions: laws that close and have no dead point, motors on links, drives that move all joints."""

from itertools import product

import numpy as np

from hopopt.design import Leg, physical_parameters
from hopopt.drivetrain.motor import INDUCTANCE
from hopopt.drivetrain.transmission import LAWS, couplings, five_bar_ratios, in_range, ratios
from hopopt.leg.kinematics import planar
from hopopt.problem.checking.faults import Report
from hopopt.problem.checking.wording import did_you_mean
from hopopt.problem.render import shown

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
