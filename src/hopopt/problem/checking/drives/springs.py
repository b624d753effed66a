"""Rules of springs, in series with drives and beside them."""

import re
from itertools import product

import numpy as np

from hopopt.design import Leg, physical_parameters
from hopopt.drivetrain.motor import INDUCTANCE, reflected_inertia
from hopopt.drivetrain.springs import joints_of, rounding
from hopopt.problem.checking.faults import Report
from hopopt.problem.checking.wording import did_you_mean
from hopopt.problem.render import shown

NAME = re.compile(r"[A-Za-z0-9_-]{1,64}")


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
