"""Pairs of a motor and a gear of the catalogue, and the problem with each of them on its leg.

A module's gear goes with its own motor alone; a motor whose own mass is stated goes with every gear that is sold by itself.
The drives sit at the body, as the entry leg.body.mass counts them: it changes by what new and present drives differ.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

from hopopt.design import Design, Leg, physical_parameters
from hopopt.drivetrain.gear import NOTHING_LOST
from hopopt.drivetrain.heat import BODIES, LIMIT
from hopopt.drivetrain.motor import rated, torque_cap
from hopopt.errors import UsageError
from hopopt.problem.catalogue import Entry, catalogue, with_part
from hopopt.problem.catalogue_facts import KINDS, problem_entries
from hopopt.problem.checking.mass_law import mass_law
from hopopt.problem.checking.wording import did_you_mean

FAMILY = re.compile(r"(.+)-\d+")  # of a gear's name, whose last number is its ratio
HEAT = (*BODIES, LIMIT, "continuous_torque")
NEUTRAL = {
    **{path.partition(".")[2]: value for path, value in NOTHING_LOST.items()},
    "inertia": 0.0,
    "rotor_inertia": 0.0,
    "winding_to_housing": 1e-3,  # with the longest time constants a winding that hardly gets warm
    "housing_to_ambient": 1e-3,
}  # what does nothing


@dataclass(frozen=True)
class Pair:
    """A motor with a gear.

    motor, gear: their names; one name for a module
    mass: of both, for one joint [kg]; None where the catalogue does not state it
    price: of both [EUR]; None where it is not stated
    unverified: numbers that no source confirms, such as "motor.rotor_inertia"
    """

    motor: str
    gear: str
    mass: float | None
    price: float | None
    unverified: tuple[str, ...]

    @property
    def name(self) -> str:
        """What it is called."""
        return self.motor if self.module else f"{self.motor} with {self.gear}"

    @property
    def module(self) -> bool:
        """Whether motor and gear come in one housing."""
        return self.motor == self.gear

    @property
    def family(self) -> tuple[str, ...]:
        """Pairs with the same differ in the ratio of their gear alone."""
        found = FAMILY.fullmatch(self.gear)
        return self.motor, found[1] if found and not self.module else self.gear


@dataclass(frozen=True)
class Combination:
    """A pair for each joint.

    at: joints with their pairs
    """

    at: tuple[tuple[str, Pair], ...]

    @classmethod
    def of(cls, at: Mapping[str, Pair]) -> "Combination":
        """Of joints with their pairs."""
        return cls(tuple(at.items()))

    @property
    def name(self) -> str:
        """What it is called."""
        return ", ".join(f"{joint}: {pair.name}" for joint, pair in self.at)

    @property
    def mass(self) -> float | None:
        """Of a joint's motor and gear, on average [kg]; None where one is not stated."""
        return _mean([pair.mass for _, pair in self.at])

    @property
    def price(self) -> float | None:
        """The same [EUR]."""
        return _mean([pair.price for _, pair in self.at])

    @property
    def unverified(self) -> tuple[str, ...]:
        """Numbers of any of them that no source confirms."""
        return tuple(dict.fromkeys(key for _, pair in self.at for key in pair.unverified))

    @property
    def family(self) -> tuple[str, ...]:
        """Those with the same differ in the ratios of their gears alone."""
        return tuple(name for _, pair in self.at for name in pair.family)


Tried = Pair | Combination  # of which each may be a candidate


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if len(known) == len(values) else None


def pairs_in(tried: Tried) -> list[Pair]:
    """The pair, or those of the joints."""
    return [tried] if isinstance(tried, Pair) else [pair for _, pair in tried.at]


def pairs(entries: Mapping[str, Entry], only: Sequence[str] | None = None) -> list[Pair]:
    """Every motor with every gear that it can be bought with, or those whose names match patterns such as "csf-*".

    UsageError for a pattern that none matches.
    """
    for pattern in only or ():
        if not any(fnmatchcase(name, pattern) for name in entries):
            near = did_you_mean(pattern, entries)
            raise UsageError(f"--only {pattern}: no motor or gear is called so{near}: hopopt actuators lists them")
    if only is not None:
        entries = {name: e for name, e in entries.items() if any(fnmatchcase(name, pattern) for pattern in only)}
    motors, geared = with_part("motor", entries), with_part("gear", entries)
    gears = [e for name, e in geared.items() if name not in motors]
    if only is not None and not (motors and (gears or motors.keys() & geared.keys())):
        lacks = "gear" if motors else "motor"
        raise UsageError(f"--only {','.join(only)} names no {lacks}: give patterns for both, such as maxon-ec60*,csf-*")
    modules = [_pair(e, e) for name, e in motors.items() if name in geared]
    alone = (e for name, e in motors.items() if name not in geared or "motor" in e.masses)
    return [*modules, *(_pair(motor, gear) for motor in alone for gear in gears)]


def _pair(motor: Entry, gear: Entry) -> Pair:
    parts = (("motor", motor), ("gear", gear))
    masses = [entry.masses.get(part) for part, entry in parts]
    whole = motor.module_mass if motor is gear else None
    mass = whole if whole is not None else None if None in masses else sum(m for m in masses if m is not None)
    prices = [entry.stated[part].get("price") for part, entry in parts]
    known = [p for p in prices if isinstance(p, float)]
    price = sum(known) if known and (motor is gear or len(known) == 2) else None
    unsure = tuple(f"{part}.{key}" for part, entry in parts for key in entry.unverified(part))
    return Pair(motor.name, gear.name, mass, price, unsure)


@dataclass(frozen=True)
class Drives:
    """Which drives of a problem are chosen, and what they weigh now.

    joints: whose; all: whether these are all of the leg
    legs: legs of the robot whose body the leg carries
    present: mass of the present drives of one leg's chosen joints [kg]; assumed: where that is from, in words
    entries: motors and gears by their names
    """

    design: Design
    joints: tuple[str, ...]
    legs: int
    present: float
    assumed: str
    entries: Mapping[str, Entry]

    @property
    def all(self) -> bool:
        return len(self.joints) == len(self.design.leg.joints)

    def added(self, pair: Tried) -> float:
        """What the body weighs more with a pair than now [kg]."""
        assert pair.mass is not None
        return self.legs * (len(self.joints) * pair.mass - self.present)

    def named(self, pair: Tried) -> dict[str, Any]:
        """Entries of the problem with a pair: by the catalogue's names, or by the numbers of a user's own file."""
        drives = {
            key: value
            for path, own in self._places(pair).items()
            for part in KINDS
            for key, value in self._part(path, part, own).items()
        }
        return {**self._without_own(pair), **drives, "leg.body.mass": self.design.leg.body.mass + self.added(pair)}

    def _part(self, path: str, part: str, pair: Pair) -> dict[str, Any]:
        """Entries of the motor or the gear of a pair at a place of the problem."""
        name, kind = getattr(pair, part), KINDS[part]
        if name in catalogue():
            return {f"{path}.{part}": name}
        numbers, keys = self.entries[name].parts[part], problem_entries(part)
        none = {key: None for key in (*keys, "catalogue") if not kind.model_fields[key].is_required()}
        return {f"{path}.{part}.{key}": value for key, value in {**none, **numbers}.items()}

    def numbers(self, pair: Tried, entries: Mapping[str, Entry], keys: Mapping[str, Sequence[str]]) -> dict[str, float]:
        """The same as numbers alone, with the ``keys`` of motor and gear; those that the pair does not state do nothing."""
        found = {"leg.body.mass": self.design.leg.body.mass + self.added(pair)}
        for path, own in self._places(pair).items():
            for part in KINDS:
                stated = entries[getattr(own, part)].parts[part]
                values = {key: stated.get(key, _neutral(part, key, stated)) for key in keys[part]}
                found |= {f"{path}.{part}.{key}": float(value) for key, value in values.items()}
        return found

    def heat(self, pair: Tried, entries: Mapping[str, Entry], keys: Sequence[str]) -> dict[str, float]:
        """What motors of a pair that state a limit of their winding state of heat beside the ``keys`` of a motor."""
        stated = {path: entries[own.motor].parts["motor"] for path, own in self._places(pair).items()}
        beside = set(HEAT) - set(keys)
        limited = {path: numbers for path, numbers in stated.items() if LIMIT in numbers}
        return {f"{path}.motor.{k}": x for path, numbers in limited.items() for k, x in numbers.items() if k in beside}

    def base(self, pair: Tried, entries: Mapping[str, Entry], keys: Mapping[str, Sequence[str]]) -> dict[str, Any]:
        """Entries that the problem of all pairs has, with the numbers of one of them and no names."""
        nameless = {f"{path}.{part}.catalogue": None for path in self._places(pair) for part in KINDS}
        return {**self._without_own(pair), **nameless, **self.numbers(pair, entries, keys)}

    def _places(self, tried: Tried) -> dict[str, Pair]:
        """Where in the problem a pair goes, or those of the joints."""
        if isinstance(tried, Combination):
            return {f"leg.{joint}": pair for joint, pair in tried.at}
        return {path: tried for path in (["leg"] if self.all else [f"leg.{joint}" for joint in self.joints])}

    def _without_own(self, tried: Tried) -> dict[str, Any]:
        """Joints' own drives go where all joints get the same."""
        own = ((j, part) for j in self.joints for part in KINDS if getattr(self.design.leg.joint[j], part) is not None)
        return {f"leg.{j}.{part}": None for j, part in own} if "leg" in self._places(tried) else {}


def _neutral(part: str, key: str, stated: Mapping[str, float]) -> float:
    """A value of an entry that is not stated with which it does nothing: a cap so high that it never acts, a winding whose
    heat is that which the torque-speed line implies."""
    if key in NEUTRAL:
        return NEUTRAL[key]
    if key == "winding_resistance":
        return stated["max_speed"] / stated["max_torque"] * stated.get("torque_constant", 1.0) ** 2
    if key == "torque_constant":
        return (stated["max_torque"] / stated["max_speed"] * stated.get("winding_resistance", 1.0)) ** 0.5
    return float(next(m.le for m in KINDS[part].model_fields[key].metadata if hasattr(m, "le")))


def keys_of(chosen: Sequence[Tried], entries: Mapping[str, Entry], leg: Leg) -> dict[str, list[str]]:
    """Entries of motor and gear that any of the pairs states, or the leg has; of heat only what the leg has, for each limit of
    a winding adds states to the program of all pairs."""
    found = dict[str, list[str]]()
    for part in KINDS:
        stated = {
            key for tried in chosen for pair in pairs_in(tried) for key in entries[getattr(pair, part)].parts[part]
        }
        numbers = problem_entries(part)
        present = {key for key in numbers if getattr(getattr(leg, part), key) is not None}
        found[part] = [key for key in numbers if key in (stated - set(HEAT)) | present]
    return found


def drives(
    design: Design, joints: Sequence[str] | None, legs: int, present: float | None, entries: Mapping[str, Entry]
) -> Drives:
    """The drives that are chosen; ``present``: the mass of the present ones of one leg [kg], if it is told. UsageError in a
    sentence for joints that are none."""
    chosen = tuple(joints or design.leg.joints)
    for joint in chosen:
        if joint not in design.leg.joints:
            raise UsageError(f"--joints {joint}: the leg has no such joint{did_you_mean(joint, design.leg.joints)}")
        if design.leg.linear(joint):
            turning = ",".join(name for name in design.leg.joints if not design.leg.linear(name))
            remedy = f"name others, as --joints {turning}" if turning else "there is nothing to choose for this leg"
            raise UsageError(f"{joint} slides by a linear motor, and motors of the catalogue turn: {remedy}")
    if legs < 1 or (present is not None and not 0 <= present < 1000):
        raise UsageError("--legs must be at least 1, and --present-mass between 0 and 1000 kg")
    if present is not None:
        return Drives(design, chosen, legs, present, "as --present-mass says", entries)
    mass, stated = drives_mass(design.leg, chosen, entries)
    words = (
        "as the catalogue states"
        if stated
        else "by the catalogue's fit of mass to torque; --present-mass says otherwise"
    )
    return Drives(design, chosen, legs, mass, words, entries)


def drives_mass(leg: Leg, joints: Sequence[str], entries: Mapping[str, Entry]) -> tuple[float, bool]:
    """Mass of the present motors and gears of some joints [kg], and whether the catalogue states it; else by its fit."""
    found = [_present(leg, joint, entries) for joint in joints]
    return sum(mass for mass, _ in found), all(stated for _, stated in found)


def _present(leg: Leg, joint: str, entries: Mapping[str, Entry]) -> tuple[float, bool]:
    """Mass of a joint's present motor and gear [kg], and whether it is stated."""
    names = {part: leg.drive(joint, part, "catalogue")[1] for part in ("motor", "gear")}
    masses = [entries[n].masses.get(part) if n in entries else None for part, n in names.items()]
    if None not in masses:
        return sum(m for m in masses if m is not None), True
    if names["motor"] == names["gear"] and names["motor"] in entries:
        whole = entries[names["motor"]].module_mass
        if whole is not None:
            return whole, True
    torque, cap = rated(leg, joint)[0], torque_cap(leg, joint, physical_parameters(leg))
    ratio, most = leg.drive(joint, "gear", "ratio")[1], leg.drive(joint, "gear", "torque_cap")[1]
    motor = min(torque, cap or torque)
    return mass_law("motor").mass(motor) + mass_law("gear").mass(min(motor * ratio, most or motor * ratio)), False
