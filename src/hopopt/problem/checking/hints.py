"""Values that a problem may have but that are probably slips: a unit, a decimal point, a zero for "none".

Nothing here refuses a problem. Each hint is a sentence; it is shown before a solve, and beside whatever came of it.
"""

from collections.abc import Iterable, Iterator
from math import hypot

import numpy as np

from hopopt.design import Design, Leg
from hopopt.design.fields import LOOKALIKES
from hopopt.drivetrain.motor import DATASHEET, rated, states
from hopopt.leg.kinematics import reach
from hopopt.leg.scales import Scale
from hopopt.problem.checking.doubts import doubts

FASTEST, SLOWEST = 2700.0, 0.5  # rad/s: no-load speed of small motors at 26 000 rpm, of a joint
FURTHEST = 1.1 * np.pi  # rad: a joint turned by more than half a turn either way
HEAVY = 3.0  # masses of the body in one link
DIFFERENT = 0.1  # share by which a stated torque differs from what a datasheet implies
FAR = (
    0.25  # lengths of the leg from a joint to its link's centre of mass, if it is twice the link's too; soles have 0.1
)
DENSE = 500.0  # kg / m^3, mass of body and leg over the cube of the leg's reach; robots and animals have 10 to 100
SLIPPERY = 0.05  # less than ice
SHORT_STANCE = 0.01  # [s] on the paper's leg, of the longest stance
PUSH_DURATIONS = (0.05, 0.5)  # [s] on the paper's leg: how long push-offs take


def hints(design: Design) -> list[str]:
    """A sentence for each value that is probably not meant as it stands."""
    leg = design.leg
    found = [*_motors(leg), *_ranges(leg), *_links(leg), *_whole(design)]
    if not found and (outside := doubts(design)):  # a slip that is named already is their cause
        found.append(f"far outside what legs have: {'; '.join(outside)}")
    return list(dict.fromkeys(f"hint: {words}" for words in found))


def _motors(leg: Leg) -> Iterator[str]:
    most = _mass(leg) * reach(leg) ** 2
    for joint, (path, stated, ratio) in _drives(leg, "max_speed"):
        speed = stated or rated(leg, joint)[1]
        if speed > FASTEST:
            yield f"{path} = {speed:g} rad/s is {speed * 30 / np.pi:.0f} rpm{_meant(speed, 'rad/s', 'rpm')}"
        if speed / ratio < SLOWEST:
            yield (
                f"{path} = {speed:g} rad/s behind a gear of {ratio:g} turns the {joint} at {speed / ratio:.2g} rad/s at most: "
                "the motor's own speed is needed, in rad/s"
            )
    yield from _stated_over(leg)
    for joint, (path, rotor, ratio) in _drives(leg, "rotor_inertia"):
        if ratio**2 * rotor > most:
            yield (
                f"{path} = {rotor:g} kg m^2 is {ratio**2 * rotor:.3g} kg m^2 at the {joint} behind its gear of {ratio:g}, "
                f"more than the whole machine on the end of the leg has ({most:.3g} kg m^2): 1 g cm^2 is 1e-7 kg m^2"
            )


def _stated_over(leg: Leg) -> Iterator[str]:
    """Torques that are stated beside a datasheet that implies others."""
    for joint in leg.joints:
        path, torque = leg.drive(joint, "motor", "max_torque")
        V, R, k = (leg.drive(joint, "motor", entry)[1] for entry in DATASHEET)
        known = None not in (torque, V, R, k) and states(leg, joint, "max_torque")
        if known and not leg.drive(joint, "motor", "catalogue")[1] and abs(torque / (k * V / R) - 1) > DIFFERENT:
            yield (
                f"{path} = {torque:g} N m counts over the {k * V / R:.4g} N m that the motor's voltage, resistance and torque "
                "constant imply: leave it out if these are meant"
            )


def _drives(leg: Leg, entry: str) -> Iterable[tuple[str, tuple[str, float, float]]]:
    """(joint, (path of the motor's entry, its value, gear ratio)), each path once."""
    found = {}
    for joint in (name for name in leg.joints if name not in leg.sliding):
        (path, value), (_, ratio) = leg.drive(joint, "motor", entry), leg.drive(joint, "gear", "ratio")
        found.setdefault(path, (joint, (path, value or 0.0, ratio)))
    return found.values()


def _ranges(leg: Leg) -> Iterator[str]:
    spatial = any(leg.link[name].inertia_tensor is not None for name in leg.links)
    furthest = 2 * np.pi if spatial else FURTHEST  # joints of a robot's file go so far, and are in radians
    for name in (name for name in leg.joints if name not in leg.sliding):
        for side in ("lower", "upper"):
            value = getattr(leg.joint[name], side)
            if abs(value) > furthest:
                words = f"is {np.degrees(value):.0f} degrees{_meant(value, 'rad', 'degrees')}"
                yield f"leg.{name}.{side} = {value:g} rad {words}"


def _links(leg: Leg) -> Iterator[str]:
    for name in leg.links:
        link = leg.link[name]
        if link.mass > HEAVY * leg.body.mass:
            times = link.mass / leg.body.mass
            yield (
                f"leg.{name}.mass = {link.mass:g} kg is {times:.3g} times leg.body.mass = {leg.body.mass:g} kg"
                f"{_meant(link.mass, 'kg', 'grams')}"
            )
        away = hypot(*(link.com_position or (0.0,)))
        if away > max(2 * link.length, FAR * leg.length):
            yield (
                f"leg.{name}.com_position is {away:.3g} m from the joint, {away / link.length:.3g} times leg.{name}.length "
                f"= {link.length:.3g} m: is it in m, from the joint, all joint angles zero?"
            )
        if link.inertia is not None and link.inertia > link.mass * link.length**2:
            yield (
                f"leg.{name}.inertia = {link.inertia:g} kg m^2 is more than all its mass has at the length of the link "
                f"({link.mass * link.length**2:.3g} kg m^2){_meant(link.inertia, 'kg m^2', 'kg cm^2')}"
            )


def _whole(design: Design) -> Iterator[str]:
    leg, friction, (_, longest) = design.leg, design.contact.friction, design.hop.stance_duration
    mass, size = _mass(leg), reach(leg)
    if mass > DENSE * size**3:
        yield (
            f"leg.body.mass = {leg.body.mass:g} kg on a leg that reaches {size:.3g} m: is it in kg, and are the lengths in m?"
        )
    if friction is not None and friction < SLIPPERY:
        yield (
            f"contact.friction = {friction:g} is slipperier than ice (0.05): leave the line out for a foot that never slips, "
            "or give 0.5 to 1 for rubber on a floor"
        )
    time = Scale.of(leg).time
    if longest < SHORT_STANCE * time:
        least, most = (time * lasts for lasts in PUSH_DURATIONS)
        yield f"hop.stance_duration allows {longest:g} s at most: a push-off takes {least:.2g} to {most:.2g} s"


def _mass(leg: Leg) -> float:
    return leg.body.mass + sum(leg.link[name].mass for name in leg.links)


def _meant(value: float, unit: str, other: str) -> str:
    si = dict(LOOKALIKES[unit])[other]
    return f"; if {other} were meant, write {value * si:.4g}"
