"""Couplings: whether one can be met, and those that the catalogue's laws of mass make: a torque that is free costs kilograms.

The coupled mass changes by what the fitted motors or gears differ, so that at the problem's own torque nothing changes:
its masses count its own motors already.
"""

import re
from collections.abc import Mapping
from itertools import combinations
from typing import Literal, cast

import numpy as np

from hopopt.design import Leg, physical_parameters
from hopopt.errors import UsageError
from hopopt.ocp.free_parameters import Coupling, FreeParameters
from hopopt.problem.checking.mass_law import PART_TORQUES, MassLaw, mass_law
from hopopt.problem.checking.wording import did_you_mean
from hopopt.problem.render import place

ASKED = re.compile(r"\s*catalogue\s*:\s*([\w.-]+)\s+by\s+([\w.-]+(?:\s+and\s+[\w.-]+)*)\s*")
HOW_TO_COUPLE = 'write "catalogue: leg.body.mass by leg.motor.max_torque", further torques after "and"'


def asks_catalogue(text: str) -> bool:
    """Whether a coupling is one of the catalogue's."""
    return re.match(r"\s*catalogue\b\s*:?", text) is not None


def catalogue_coupling(text: str, leg: Leg, bounds: Mapping[str, tuple[float, float]]) -> Coupling:
    """The coupling "catalogue: leg.body.mass by leg.motor.max_torque", written out with the laws' numbers.

    The mass is the leg's own plus a change for every torque that is named. The change is the fitted mass at that torque
    less the fitted mass at the leg's own torque, times the number of joints that it drives. UsageError in a sentence
    for what cannot be.
    """
    mass, torques = _asked(text, leg)
    known = physical_parameters(leg)
    own, powers, ends = known[mass], {}, np.full(2, known[mass])
    driven = {entry: _driven(text, entry, leg) for entry in torques}
    _each_once(text, driven)
    for entry in torques:
        law, joints = mass_law(_part(text, entry)), len(driven[entry])
        own -= joints * law.mass(known[entry])
        powers[entry, law.exponent] = -joints * law.coefficient
        if entry not in bounds:
            raise UsageError(f"--couple {text}: {entry} is not free: add --free {entry}=lower:upper")
        ends += joints * (np.array([law.mass(x) for x in bounds[entry]]) - law.mass(known[entry]))
    if mass not in bounds:
        low, high = max(0.9 * ends[0], 0.01), 1.1 * ends[1]
        raise UsageError(f"--couple {text}: {mass} is not free: add --free {mass}={low:.2g}:{high:.2g}")
    return Coupling(" ".join(text.split()), {mass: 1.0}, own, own, powers)


def laws(free_parameters: FreeParameters) -> dict[str, MassLaw]:
    """{"motor" or "gear": its law} of what the catalogue's couplings use."""
    return {part: mass_law(part) for part in dict.fromkeys(entry.split(".")[-2] for entry in _torques(free_parameters))}


def beyond(free_parameters: FreeParameters) -> list[str]:
    """A sentence for every torque whose bounds lie outside what its law was fitted to."""
    reported = []
    for entry in _torques(free_parameters):
        part = entry.split(".")[-2]
        law, (low, high) = mass_law(part), free_parameters.bounds[entry]
        if low < law.lowest or high > law.highest:
            reported.append(
                f"the catalogue's masses of {part}s are fitted from {law.lowest:g} to {law.highest:g} N m; "
                f"{entry} may be {low:g} to {high:g}"
            )
    return reported


def _torques(free_parameters: FreeParameters) -> list[str]:
    """The torques in the catalogue's couplings."""
    return [entry for c in free_parameters.couplings if asks_catalogue(c.text) for entry, _ in c.powers]


def _asked(text: str, leg: Leg) -> tuple[str, list[str]]:
    """The mass and the torques that a coupling names, all of them set in the leg."""
    found, known = ASKED.fullmatch(text), physical_parameters(leg)
    if not found:
        raise UsageError(f"--couple {text}: {HOW_TO_COUPLE}")
    mass, torques = found[1], re.split(r"\s+and\s+", found[2])
    for entry in (mass, *torques):
        if entry not in known:
            raise UsageError(f"--couple {text}: there is no entry {entry} that is set{did_you_mean(entry, known)}")
    if not mass.endswith(".mass"):
        raise UsageError(
            f"--couple {text}: {mass} is not a mass: name leg.body.mass or a link's, such as leg.thigh.mass"
        )
    if repeated := [t for k, t in enumerate(torques) if t in torques[:k]]:
        raise UsageError(f"--couple {text}: {repeated[0]} is named twice: once is enough")
    return mass, torques


def _part(text: str, entry: str) -> Literal["motor", "gear"]:
    """Whether an entry is a motor's or a gear's torque."""
    *_, part, key = entry.split(".")
    if part not in PART_TORQUES or key not in PART_TORQUES[part]:
        raise UsageError(
            f"--couple {text}: the catalogue has no law of mass by {entry}: "
            "name a motor's max_torque or torque_cap, or a gear's torque_cap"
        )
    return cast(Literal["motor", "gear"], part)


def _each_once(text: str, driven: Mapping[str, list[str]]) -> None:
    """UsageError where two torques are of one motor or gear, which has one mass."""
    for (a, of_a), (b, of_b) in combinations(driven.items(), 2):
        shared = [joint for joint in of_a if joint in of_b and _part(text, a) == _part(text, b)]
        if shared:
            raise UsageError(
                f"--couple {text}: {a} and {b} are both of the {shared[0]}'s {_part(text, a)}, "
                "whose mass would count twice: name one of them"
            )


def _driven(text: str, entry: str, leg: Leg) -> list[str]:
    """The joints that have the motor or gear of this torque; UsageError where another number of it is what it gives."""
    part, key = _part(text, entry), entry.split(".")[-1]
    joints = [joint for joint in leg.joints if leg.drive(joint, part, key)[0] == entry]
    if not joints:
        raise UsageError(f"--couple {text}: no joint has {entry}: every joint has its own {part}")
    for joint in joints:
        for other in PART_TORQUES[part]:
            path, value = leg.drive(joint, part, other)
            if value is not None and value < leg.drive(joint, part, key)[1]:
                raise UsageError(
                    f"--couple {text}: {path} = {value:g} N m is less and what the {joint}'s {part} gives: name that"
                )
    return joints


def meets(c: Coupling, free: Mapping[str, tuple[float, float]], known: Mapping[str, float]) -> None:
    """That a coupling is one of entries that are set, at least one of them free, and can be met within the bounds; UsageError if
    not."""
    for entry in c.entries:
        if entry not in known:
            raise UsageError(f"--couple {c.text}: there is no entry {entry}{did_you_mean(entry, known)}")
    if not free.keys() & set(c.entries):
        raise UsageError(f"--couple {c.text}: none of its entries is free")
    for _, entry, exponent in c.terms:
        low = free[entry][0] if entry in free else known[entry]
        if exponent != 1 and low <= 0:
            raise UsageError(f"--couple {c.text}: {entry} can be {low:g}, and a power of it needs it above 0")
    if not _can_be_met(c, free, known):
        raise UsageError(f"--couple {c.text}: no values within the bounds of --free meet it")


def keeps_order(c: Coupling, free: Mapping[str, tuple[float, float]], known: Mapping[str, float]) -> None:
    """That two neighbours in a table, of which ``monotone`` makes a coupling, can keep their order; UsageError if not."""
    if _can_be_met(c, free, known):
        return
    more, less = c.entries
    way = "falling" if (place(more)[1] or 0) < (place(less)[1] or 0) else "rising"
    says = " and ".join(
        f"{entry} is {known[entry]:g}" if entry not in free else "{} is {:g} to {:g}".format(entry, *free[entry])
        for entry in sorted(c.entries)
    )
    raise UsageError(
        f"--free {more if more in free else less}: a table keeps {way}, and no values within the bounds do: {says}; "
        "give other bounds, or free both"
    )


def _can_be_met(c: Coupling, free: Mapping[str, tuple[float, float]], known: Mapping[str, float]) -> bool:
    """Whether values within the bounds meet a coupling."""
    ends = np.zeros(2)
    for factor, entry, exponent in c.terms:
        ends += sorted(factor * x**exponent for x in free.get(entry, (known[entry],) * 2))
    slack = 1e-9 * max(1.0, float(np.abs(ends).max()))
    return bool(ends[1] >= c.lower - slack and ends[0] <= c.upper + slack)
