"""The entries of a problem that a live page has sliders for: the most rewarding ones, each with a range about its value."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from hopopt.design import Design, Leg
from hopopt.errors import UsageError
from hopopt.problem.catalogue import catalogue
from hopopt.problem.catalogue_facts import KINDS
from hopopt.problem.load import changed
from hopopt.problem.render import place, rows, shown_path, unit_at, value_at, values_of
from hopopt.studies.choose.pairs import drives_mass
from hopopt.studies.sweep.definition import Axis, axis, check_entry, whole_number

COUNT = 10  # sliders, unless entries are named
LEAST, MOST = 0.5, 2.0  # share of an entry's value that its slider goes down to, and up to
STEPS = 300  # of a slider's way
BODY = "leg.body.mass"
SUPPLY = ("leg.supply.voltage", "leg.supply.internal_resistance")  # have a slider wherever the problem states them
WHOLE = 1.0  # step of whole numbers alone: no other slider has it


@dataclass(frozen=True)
class Slider:
    """One entry that can be dragged.

    entry: its path in the problem; meaning: in words; unit: of its value
    value, low, high: where it begins, and its range [unit]
    step: between two of its places [unit]; whole numbers have 1
    """

    entry: str
    meaning: str
    unit: str
    value: float
    low: float
    high: float
    step: float

    @property
    def axis(self) -> Axis:
        """The same as the axis of a study."""
        return Axis(self.entry, (), self.low, self.high)

    @property
    def whole(self) -> bool:
        """Whether it takes whole numbers only."""
        return self.step == WHOLE

    def about(self, value: float) -> "Slider":
        """The same entry where it has another value, which its range holds."""
        return replace(self, value=value, low=min(self.low, value), high=max(self.high, value))

    def places(self, wanted: int) -> list[float]:
        """So many of its values, evenly; of whole numbers each once."""
        found = np.linspace(self.low, self.high, wanted).tolist()
        return sorted({float(round(x)) for x in found}) if self.whole else found

    def as_dict(self) -> dict[str, Any]:
        """For the page."""
        return asdict(self)

    def checked(self, value: Any) -> float:
        """A value that it may have; UsageError for one that it may not."""
        a_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not (a_number and self.low <= value <= self.high):  # also of integers that no float can hold
            raise UsageError(f"{self.entry}: {value!r:.40} is not a number from {self.low:g} to {self.high:g}")
        return float(round(value)) if self.whole else float(value)


def named(design: Design, asked: Sequence[str]) -> list[Slider]:
    """Sliders of entries by name, each "leg.gear.ratio" or with its range, "leg.gear.ratio=60:160"; one that is not set
    begins at the upper end of its range. UsageError in a sentence for what is no such entry."""
    found = dict[str, Slider]()
    for text in asked:
        entry, _, given = (part.strip() for part in text.partition("="))
        if entry in found:
            raise UsageError(f"--entry {shown_path(entry)} is given twice")
        ends = axis(entry, given, sampled=True).range if given else None
        found[entry] = _slider(design, entry, ends)
    return list(found.values())


def per_percent(design: Design, per_unit: Mapping[str, float]) -> dict[str, float]:
    """What 1 % more of each number of a problem changes, by what it changes per unit."""
    values = values_of(design)
    return {e: 0.01 * slope * abs(x) for e, slope in per_unit.items() if isinstance(x := values.get(e), float)}


def most_rewarding(design: Design, per_unit: Mapping[str, float]) -> list[Slider]:
    """Sliders of the entries of which a change by the same share changes the objective most; ``per_unit``: its derivatives."""
    gains = per_percent(design, per_unit)
    ranked = sorted((entry for entry, gain in gains.items() if gain), key=lambda entry: -abs(gains[entry]))
    values = values_of(design)
    supply = [entry for entry in SUPPLY if values.get(entry) and entry not in ranked[:COUNT]]
    return [_slider(design, entry, None) for entry in (*ranked[:COUNT], *supply)]


def places_of_parts(leg: Leg) -> list[str]:
    """Where a motor or a gear stands in the problem: the leg's, and those of joints that have their own."""
    own = {part: [joint for joint in leg.joints if getattr(leg.joint[joint], part) is not None] for part in KINDS}
    common = [f"leg.{part}" for part in KINDS if len(own[part]) < len(leg.joints)]
    return common + [f"leg.{joint}.{part}" for part in KINDS for joint in own[part]]


def added_mass(design: Design, choices: Mapping[str, str]) -> float:
    """What the body weighs more with other motors and gears than the problem has [kg], as ``hopopt choose`` counts it."""
    if not choices:
        return 0.0
    leg, entries = design.leg, catalogue()
    now, then = (drives_mass(one, one.joints, entries)[0] for one in (leg, changed(design, choices).leg))
    more = (leg.body.legs or 1) * (then - now)
    if more <= -leg.body.mass:
        raise UsageError(
            f"the body weighs {leg.body.mass:.3g} kg, and the drives that the problem has are taken to weigh {-more:.3g} kg more than "
            "these: choose parts in the problem file, with its leg.body.mass"
        )
    return more


def _slider(design: Design, entry: str, ends: tuple[float, float] | None) -> Slider:
    row = {row.path: row for row in rows(design)}.get(place(entry)[0])
    value = value_at(design, entry)
    if ends is None:
        check_entry(design, Axis(entry, (float(value),) if isinstance(value, (int, float)) else (0.0,)))
        if not value:
            what = "is 0" if value == 0 else "is not set"
            raise UsageError(f"--entry {entry}: it {what}, so give its range, as --entry {entry}=LOWER:UPPER")
        low, high = sorted((LEAST * float(value), MOST * float(value)))
    else:
        low, high = ends
        check_entry(design, Axis(entry, (low, high)))
    whole = whole_number(design, entry)
    begin = min(max(float(value), low), high) if isinstance(value, (int, float)) else high
    made = Slider(entry, row.meaning if row else "", unit_at(design, entry), begin, low, high, WHOLE)
    if whole:
        return replace(made, value=float(round(begin)), low=float(math.ceil(low)), high=float(math.floor(high)))
    return replace(made, step=_round_step((high - low) / STEPS))


def _round_step(step: float) -> float:
    """A step of 1, 2 or 5 times a power of ten, no larger; never WHOLE."""
    power = 10.0 ** math.floor(math.log10(step))
    found = next(digit * power for digit in (5, 2, 1) if digit * power <= step * (1 + 1e-9))
    return found if found != WHOLE else 0.5
