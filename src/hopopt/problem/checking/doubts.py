"""Numbers that follow from the entries and lie far outside what legs have, with the entry to look at.

All are dimensionless, so that a leg of any size is judged alike. The built-in legs lie well within.
"""

from hopopt.design import Design, Leg, physical_parameters
from hopopt.drivetrain.motor import behind
from hopopt.leg.derived import JointFigures, LegFigures, derived

STALL = 5.0  # stall torque over weight times reach, in any pose; legs have 1 to 3.4
USUAL_SPEEDS = (2.0, 25.0)  # no-load speed of a joint in sqrt(gravity / reach); legs have 3 to 16
ROTOR = 10.0  # reflected rotor inertia over that of the links about the joint; legs have 0.2 to 4
BEHIND = 1.5  # gear ratio from which a motor's values and the joint's are different things
OUTPUT = "torque and speed are needed in front of the gear, and a datasheet may state them behind it"


def doubts(design: Design) -> list[str]:
    """A sentence for each number far outside what legs have; none for a leg like others."""
    leg, found = design.leg, derived(design)
    outside = list(dict.fromkeys([*_torques(leg, found), *_speeds(leg, found), *_rotors(leg, found)]))
    geared = any(leg.drive(name, "gear", "ratio")[1] > BEHIND for name in leg.joints)
    return [*outside, OUTPUT] if outside and geared else outside


def _torques(leg: Leg, found: LegFigures) -> list[str]:
    """Of what the drives carry at standstill."""
    levers = [found.weight * (1.0 if j.name in leg.sliding else found.reach) for j in found.joints]
    strongest, lever = max(zip(found.joints, levers, strict=True), key=lambda each: each[0].stall_torque / each[1])
    unit, times = leg.units(strongest.name).tau, _lever(leg, strongest)
    entry = _entry(leg, strongest, "max_torque", unit if leg.linear(strongest.name) else "N m")
    if found.push is not None and found.push < 1:
        return [
            f"at the start the drives hold {found.push:.2g} weights on the foot, less than the leg's own: look at {entry}"
        ]
    if strongest.stall_torque > STALL * lever:
        return [
            f"the {strongest.name} has {strongest.stall_torque:.3g} {unit} at standstill, {strongest.stall_torque / lever:.2g} times "
            f"{times} (legs have less than {STALL:g}): look at {entry}"
        ]
    return []


def _lever(leg: Leg, joint: JointFigures) -> str:
    """By what a joint's torque or force is measured, in words."""
    return "the leg's weight" if joint.name in leg.sliding else "weight times leg length"


def _speeds(leg: Leg, found: LegFigures) -> list[str]:
    """Of how fast each joint turns without load, an entry that they share once."""
    least, most = USUAL_SPEEDS
    first = {behind(leg, j.name, "max_speed"): j for j in reversed(found.joints) if j.name not in leg.sliding}
    return [
        f"the {j.name} turns at {j.no_load_speed:.3g} rad/s without load, {j.no_load_speed * found.time:.2g} sqrt(gravity / "
        f"leg length) (legs have {least:g} to {most:g}): look at {_entry(leg, j, 'max_speed', 'rad/s')}"
        for j in first.values()
        if not least <= j.no_load_speed * found.time <= most
    ]


def _rotors(leg: Leg, found: LegFigures) -> list[str]:
    """Of rotors beside the links that they turn."""
    return [
        f"the rotor of the {j.name} has {j.rotor_inertia / j.link_inertia:.3g} times the inertia of its links "
        f"({j.rotor_inertia:.3g} and {j.link_inertia:.3g} {leg.units(j.name).inertia} at the joint): look at "
        f"{_entry(leg, j, 'rotor_inertia', leg.units(j.name).inertia if leg.linear(j.name) else 'kg m^2')}"
        for j in found.joints
        if j.rotor_inertia > ROTOR * j.link_inertia
    ]


def _entry(leg: Leg, joint: JointFigures, name: str, unit: str) -> str:
    """An entry of a joint's motor, and its gear."""
    p, (at, ratio) = physical_parameters(leg), leg.drive(joint.name, "gear", "ratio")
    paths = behind(leg, joint.name, name)
    of_motor = ", ".join(f"{path} = {p[path]:g}" for path in paths)
    return f"{of_motor}{f' {unit}' if len(paths) == 1 else ''} and {at} = {ratio:g}"
